"""Moreau's and Jean's scheme: impacts and contact forces as impulses on velocities.

With f the forces without contact, as their means over the time of the step at one state, and
v_t = (1 - theta) v^m + theta v^{m+1} the step is

    M (v^{m+1} - v^m) = h f + J^T P,      u^{m+1} = u^m + h v_t,
    0 <= P _|_ w^{m+1} + e w^m >= 0   where the gap at t_m + h/2, u^m + h v^m / 2 is <= 0,

w = J v - b'. For a `LinearSystem` f = p - C v_t - K (u^m + theta h v_t), which with

    A = M + theta h C + theta^2 h^2 K,
    A (v^{m+1} - v^m) = h p - h K u^m - (h C + theta h^2 K) v^m + J^T P

is solved at once; stable for any h from theta = 1/2 on. Other systems, and those with friction,
take M, J and f at the midpoint, u^m + h v^m / 2. Impulses of friction obey Coulomb's exact cone
with the slip at the end of the step.

An impact takes one step and leaves with e w^m; positions have order 1 and penetrate O(h).
Source: Jean and Moreau, Unilaterality and dry friction in the dynamics of rigid body collections
(1992); Jean, Comput. Methods Appl. Mech. Engrg. 177 (1999) 235-257.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, lu_factor, lu_solve

from impactfem.arrays import Floats
from impactfem.contact.impact_law import Law, delassus
from impactfem.errors import ConvergenceError, SceneError
from impactfem.result.bar_motion import Effort
from impactfem.result.trajectory import Trajectory
from impactfem.system.frequency import highest_frequency
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.joined import Forced, Room, advanced
from impactfem.system.joined import closed as closed_rows
from impactfem.system.start_checks import check_start
from impactfem.vibro.kicks import Kicks
from impactfem.vibro.position_kernels import ROUNDING, march_velocities
from impactfem.vibro.stepping import Stepped, Walls, march
from impactfem.vibro.vibro_rows import (
    LinearMarch,
    cone_impulses,
    count_steps,
    empty_rows,
    row_levels,
    row_times,
    starting_episodes,
    trajectory,
)

_LIMIT = 2.0  # h omega_max up to which forces at the midpoint are stable
_MAX_FIXED_POINT = 100


@dataclass(frozen=True)
class VelocitySettings:
    """Settings of the velocity-level scheme.

    Attributes:
        dt: Longest time step h [s]; the one used divides the duration.
        theta: Weight of the end of the step, in [1/2, 1]; 1/2 keeps the energy of free motion.
        every: Steps between two rows of the trajectory.
        impact_law: Only "simultaneous".
    """

    dt: float
    theta: float = 0.5
    every: int = 1
    impact_law: Law = "simultaneous"

    def resolution(self, _: float) -> float:
        """Impacts closer in time than this are one [s]."""
        return 2.0 * self.dt


def integrate_velocities(
    system: GeneralizedSystem,
    position: Sequence[float] | Floats,
    velocity: Sequence[float] | Floats,
    duration: float,
    settings: VelocitySettings,
) -> Trajectory:
    """Integrate by the velocity-level scheme.

    Impacts are the intervals in which a constraint acts, dated by the line of approach, for two
    steps at most: what goes on is lasting contact.

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
    check_theta(settings.theta)
    check_start(system, u, v)
    if isinstance(system, LinearSystem) and not system.friction.any():
        return _linear(system, u, v, steps, h, settings)
    number = h * highest_frequency(system, u, v)
    if number >= _LIMIT:
        raise SceneError(
            f"dt = {h:.6g} s is too large for the stiffness: with forces at the midpoint the "
            f"scheme is stable for dt < {_LIMIT * h / number:.6g} s = 2 / omega_max; use a smaller "
            "dt, or the event-driven method"
        )
    theta = settings.theta
    return march(
        system, closed_rows(system, u, v), (steps, h, settings.every),
        lambda t, u, v, walls: _step(system, t, h, theta, u, v, walls), {"theta": theta},
    )  # fmt: skip


def check_theta(theta: float) -> float:
    """theta, if it is allowed.

    Raises:
        SceneError: It is not.
    """
    if not 0.5 <= theta <= 1.0:
        raise SceneError(f"theta = {theta:g}: give a number from 1/2 to 1")
    return theta


def step_matrices(system: LinearSystem, h: float, theta: float) -> tuple[Floats, ...]:
    """A^-1 h (d, d), then stiff, damp, response, coupling, normals, offsets, restitution."""
    c, k = system.damping, system.stiffness
    whole = system.mass(np.zeros(system.dofs)) + theta * h * c + (theta * h) ** 2 * k
    inverse = lu_solve(lu_factor(whole), np.eye(system.dofs))
    response = inverse @ system.normals.T
    return (
        h * inverse,
        h * (inverse @ k),
        inverse @ (h * c + theta * h * h * k),
        np.ascontiguousarray(response),
        system.normals @ response,
        system.normals,
        system.offsets,
        system.restitution,
    )


def tabulate(
    system: LinearSystem, kicks: Kicks, loads: Floats, h: float, begin: int, end: int
) -> tuple[Floats, Floats]:
    """Tables: h A^-1 p (steps, d) and b, b at the midpoint, b' before and after (steps, 4 J)."""
    times = h * np.arange(begin, end + 1)
    forces = system.load_at(times[:-1], times[1:]) @ loads.T
    at, middle = times[:-1], times[:-1] + 0.5 * h
    places = [signal(at) + 0.0 * at for signal in system.motion]
    halves = [signal(middle) + 0.0 * at for signal in system.motion]
    rates = np.stack([signal.rate(times) + 0.0 * times for signal in system.motion], axis=1)
    where = np.stack([*places, *halves], axis=1)
    walls = np.hstack([where, *kicks.rates(rates, begin)])
    return np.ascontiguousarray(forces), walls


def _linear(
    system: LinearSystem, u: Floats, v: Floats, steps: int, h: float, settings: VelocitySettings
) -> Trajectory:
    theta = settings.theta
    loads, *matrices = step_matrices(system, h, theta)
    rows, episodes = empty_rows(system, steps, settings.every), starting_episodes(system, u, v)
    kicks = Kicks(system, steps, h)
    march = LinearMarch(
        march_velocities, steps, h, settings.every,
        lambda begin, end: tabulate(system, kicks, loads, h, begin, end), tuple(matrices),
        (u, v, system.gap(0.0, u), np.zeros(system.num_constraints)), rows,
        episodes, (theta,),
    )  # fmt: skip
    impacts = march.run()
    details = {
        "dt": h, "theta": theta, "max_penetration": max(0.0, -float(march.worst[0])),
        "handed_back": march.handed_back,
    }  # fmt: skip
    effort = Effort(num_unknowns=system.dofs, details=details)
    return trajectory(
        system, row_times(row_levels(steps, settings.every), h), rows, impacts, effort
    )


def _step(
    system: GeneralizedSystem, t: float, h: float, theta: float, u: Floats, v: Floats, walls: Walls
) -> Stepped:
    """One step; velocities in f are found by fixed point."""
    middle = advanced(system, u, 0.5 * h * v)
    room = Room.at(system, middle, t)
    tolerance = ROUNDING * float(np.abs(middle).max())
    closed = np.flatnonzero(system.gap(t + 0.5 * h, middle) <= tolerance)
    count = system.num_constraints
    impulse, speed, after = np.zeros(count), np.zeros(count), np.zeros(count)
    jacobian, answers, coupling = np.zeros((0, len(v))), np.zeros((len(v), 0)), np.zeros((0, 0))
    tangents, friction = 0, system.friction[closed]
    if len(closed):
        jacobian = system.jacobian(middle)[closed]
        speed[closed] = jacobian @ v - walls[0][closed]
        if friction.any():
            rows = np.concatenate([jacobian[:, None], system.slip(middle)[closed]], axis=1)
            tangents = rows.shape[1] - 1
            jacobian = rows.reshape(-1, len(v))  # the normal of each, then its tangents
        coupling, answers = delassus(room.factor, room.rows(jacobian))
        answers = room.full(answers)
    normal = slice(None, None, 1 + tangents)
    rate, arriving = np.zeros((2, len(jacobian)))
    rate[normal], arriving[normal] = walls[1][closed], system.restitution[closed] * speed[closed]

    def accelerated(v: Floats) -> Floats:
        forced = Forced.at(system, t + 0.5 * h, middle, v, room, h)
        if not np.isfinite(forced.load).all():
            raise ConvergenceError(
                f"force at t = {t:.6g} s is {forced.load.tolist()}: the motion or the formula "
                "broke down; use a smaller dt"
            )
        return forced.full(np.asarray(cho_solve((room.factor, True), forced.load)))

    gained = h * accelerated(v)
    for _ in range(_MAX_FIXED_POINT):
        free = v + gained
        offset = jacobian @ free - rate + arriving
        pushing = cone_impulses(coupling, offset, friction, tangents)
        impulse[closed] = pushing[normal]
        new = free + answers @ pushing
        following = h * accelerated(0.5 * (v + new))
        moved = float(np.abs(following - gained).max())
        if moved <= 1e-13 * float(max(np.abs(new).max(), np.abs(gained).max())) + 1e-300:
            after[closed] = (jacobian @ new - rate)[normal]
            along = pushing * (0.5 * jacobian @ (v + new))
            work = float(along.sum() - along[normal].sum())
            end = advanced(system, u, h * (v + theta * (new - v)))
            return Stepped(*closed_rows(system, end, new), impulse, speed, after, work)
        gained = following
    raise ConvergenceError(
        f"the forces that depend on velocity did not settle in {_MAX_FIXED_POINT} iterations at "
        f"t = {t:.6g} s (last change {moved:.1e}); use a smaller dt"
    )
