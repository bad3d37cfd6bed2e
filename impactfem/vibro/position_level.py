"""Paoli's and Schatzman's scheme: impacts by one projection of positions a step.

    U^{m+1} = -e U^{m-1} + (1 + e) P_K[(2 U^m - (1 - e) U^{m-1} + h^2 F^m) / (1 + e)],

P_K the projection on K = {phi >= b} in the metric of M(U^m). In words: without contact the central
difference scheme, and Z = (U^{m+1} + e U^{m-1}) / (1 + e) is kept in K. Where walls move, b is
(b(t_{m+1}) + e b(t_{m-1})) / (1 + e): this is the scheme in the frame of a translating wall. Where
a wall changes its velocity at once, b(t_{m-1}) is that of its motion after it (`kicks`).

For a `LinearSystem` F contains the unknown: with velocities (U^{m+1} - U^{m-1}) / 2h and forces
K (beta U^{m+1} + (1 - 2 beta) U^m + beta U^{m-1}) of the stiffness the step reads

    A (U^{m+1} - 2 U^m + U^{m-1}) = h^2 (p^m - K U^m) - h C (U^m - U^{m-1}) + J^T P,
    A = M + h C / 2 + beta h^2 K,      0 <= P _|_ gap^{m+1} + e gap^{m-1} >= 0,

and P = h^2 lambda^m. p^m is the mean of p(t) half a step around t_m. Eliminating U^{m+1} leaves
J A^-1 J^T P: a projection in the metric of A. beta is 0 (the founding scheme, stable for
h omega_max < 2) or 1/4 (stable without contact for any h). The condition of contact is stated for
each constraint with its own e; for equal ones it is the projection, and always the law of
simultaneous impacts.

An impact takes two steps, leaves with the speed e v exactly, and 2 h late; positions thus have
order 1, and penetrate by no more than 2 e h v / (1 + e).

Source: Paoli and Schatzman, Ill-posedness in vibro-impact and its numerical consequences (2000),
equations (23) to (27).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from impactfem.arrays import Floats
from impactfem.contact.impact_law import Law
from impactfem.errors import SceneError
from impactfem.result.bar_motion import Effort
from impactfem.result.trajectory import Trajectory
from impactfem.system.frequency import highest_frequency
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.joined import closed as closed_rows
from impactfem.system.start_checks import check_start
from impactfem.vibro.kicks import Kicks
from impactfem.vibro.position_general import march_general
from impactfem.vibro.position_kernels import march_positions
from impactfem.vibro.position_start import start_positions
from impactfem.vibro.vibro_rows import (
    LinearMarch,
    count_steps,
    empty_rows,
    row_levels,
    row_times,
    starting_episodes,
    trajectory,
)

_IMPLICIT_FROM = 1.0  # h omega_max above which the stiffness is averaged
_LIMIT = 2.0


@dataclass(frozen=True)
class PositionSettings:
    """Settings of the position-level scheme.

    Attributes:
        dt: Longest time step h [s]; the one used divides the duration.
        implicit: Whether stiffness forces are averaged over three levels (linear systems); None
            to do so where h omega_max > 1.
        every: Steps between two rows of the trajectory.
        impact_law: Only "simultaneous", which the scheme realises by itself.
    """

    dt: float
    implicit: bool | None = None
    every: int = 1
    impact_law: Law = "simultaneous"

    def resolution(self, _: float) -> float:
        """Impacts closer in time than this are one [s]."""
        return 2.0 * self.dt


def integrate_positions(
    system: GeneralizedSystem,
    position: Sequence[float] | Floats,
    velocity: Sequence[float] | Floats,
    duration: float,
    settings: PositionSettings,
) -> Trajectory:
    """Integrate by the position-level scheme.

    Rows hold U^m, the velocity (U^{m+1} - U^{m-1}) / 2h, also at the start and the end (one step
    more is taken), and the mean contact force, for which momentum is balanced exactly. Gaps may
    be negative: it is Z that stays in K. Impacts are the intervals in which a constraint acts, from
    the crossing of the line of approach, for two steps at most: what goes on is lasting contact.
    Their speeds are one-sided differences.

    Args:
        system: The system.
        position: u0, shape (d,).
        velocity: v0, shape (d,).
        duration: [s].
        settings: Step and choices.

    Raises:
        SceneError: Bad input, or dt too large for the stiffness.
        ConvergenceError: Contact or forces that depend on velocity were not solved.
    """
    u = np.array(position, dtype=float).reshape(-1)
    v = np.array(velocity, dtype=float).reshape(-1)
    steps, h = count_steps(duration, settings.dt, settings.every, settings.impact_law)
    check_start(system, u, v)
    implicit = choose_implicit(system, u, v, h, settings.implicit)
    if isinstance(system, LinearSystem):
        return _linear(system, u, v, steps, h, settings.every, implicit=implicit)
    return march_general(system, *closed_rows(system, u, v), steps, h, settings.every)


def choose_implicit(
    system: GeneralizedSystem, u: Floats, v: Floats, h: float, wanted: bool | None
) -> bool:
    """Whether to average stiffness forces.

    Raises:
        SceneError: The step is too large for explicit stiffness forces, or averages are wanted
            for a system that is not linear.
    """
    linear = isinstance(system, LinearSystem)
    if wanted and not linear:
        raise SceneError(
            "implicit = true: only linear systems have averaged stiffness forces; leave implicit "
            "out and choose dt < 2 / omega_max"
        )
    number = h * highest_frequency(system, u, v)
    implicit = (linear and number > _IMPLICIT_FROM) if wanted is None else wanted
    if not implicit and number >= _LIMIT:
        remedy = "or implicit = true" if linear else "or the event-driven method"
        raise SceneError(
            f"dt = {h:.6g} s is too large for the stiffness: with explicit forces the scheme is "
            f"stable for dt < {_LIMIT * h / number:.6g} s = 2 / omega_max; use a smaller dt, "
            f"{remedy}"
        )
    return implicit


def step_matrices(system: LinearSystem, h: float, *, implicit: bool) -> tuple[Floats, ...]:
    """A^-1 h^2 (d, d), then stiff, damp, response, coupling, normals, offsets, restitution."""
    beta = 0.25 if implicit else 0.0
    whole = system.mass(np.zeros(system.dofs))
    whole = whole + 0.5 * h * system.damping + beta * h * h * system.stiffness
    inverse = lu_solve(lu_factor(whole), np.eye(system.dofs))
    response = inverse @ system.normals.T
    return (
        h * h * inverse,
        h * h * (inverse @ system.stiffness),
        h * (inverse @ system.damping),
        np.ascontiguousarray(response),
        system.normals @ response,
        system.normals,
        system.offsets,
        system.restitution,
    )


def start_weight(system: LinearSystem, h: float, *, implicit: bool) -> Floats:
    """Symmetric part of M + beta h^2 K, shape (d, d)."""
    weight = system.mass(np.zeros(system.dofs))
    if implicit:
        weight = weight + 0.125 * h * h * (system.stiffness + system.stiffness.T)
    return weight


def tabulate(
    system: LinearSystem, kicks: Kicks, loads: Floats, h: float, begin: int, end: int
) -> tuple[Floats, Floats]:
    """Tables of the steps begin to end: h^2 A^-1 p^m (steps, d), and walls (steps, 3 J).

    Of walls b(t_{m+1}) and both `Kicks.shifts`.
    """
    levels = np.arange(begin, end)
    means = system.load_at(h * np.maximum(levels - 0.5, 0.0), h * (levels + 0.5))
    if begin == 0:  # the start has taken half of p(0) off
        means[0] = 0.5 * (means[0] + system.load_at(0.0))
    forces = means @ loads.T
    ahead = h * (levels + 1.0)
    walls = np.stack([signal(ahead) + 0.0 * ahead for signal in system.motion], axis=1)
    return np.ascontiguousarray(forces), np.hstack([walls, *kicks.shifts(begin, end)])


def _linear(
    system: LinearSystem, u: Floats, v: Floats, steps: int, h: float, every: int, *, implicit: bool
) -> Trajectory:
    loads, *matrices = step_matrices(system, h, implicit=implicit)
    first = start_positions(system, u, v, h, start_weight(system, h, implicit=implicit))
    rows, episodes = empty_rows(system, steps, every), starting_episodes(system, u, v)
    kicks = Kicks(system, steps, h)
    march = LinearMarch(
        march_positions, steps, h, every,
        lambda begin, end: tabulate(system, kicks, loads, h, begin, end), tuple(matrices),
        (first.position, first.change, first.gap, first.before), rows, episodes,
    )  # fmt: skip
    impacts = np.concatenate([first.impacts, march.run()])
    details = {
        "dt": h, "implicit": implicit, "max_penetration": max(0.0, -float(march.worst[0])),
        "handed_back": march.handed_back,
    }  # fmt: skip
    times = row_times(row_levels(steps, every), h)
    effort = Effort(num_unknowns=system.dofs, details=details)
    return trajectory(system, times, rows, impacts, effort)
