"""Many motions of one linear system from different initial data, in one compiled loop."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_solve

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.system.generalized import LinearSystem
from impactfem.system.start_checks import check_start
from impactfem.vibro import position_level, velocity_level
from impactfem.vibro.kicks import Kicks
from impactfem.vibro.position_kernels import march_members, march_positions, march_velocities
from impactfem.vibro.position_level import PositionSettings, choose_implicit
from impactfem.vibro.position_start import start_positions
from impactfem.vibro.velocity_level import VelocitySettings
from impactfem.vibro.vibro_rows import count_steps, row_levels, row_times, solve_impulses

_MOST_STEPS = 32768  # steps whose loads are tabulated at once
_CLOSED = 1e-12  # share of the largest coordinate below which a gap counts as closed


@dataclass(frozen=True)
class EnsembleResult:
    """Motions of n members.

    Attributes:
        times: Levels that are kept [s], shape (rows,); 0 and the end are among them.
        position: Shape (n, rows, d); of rigid bodies in space those of `solve_ensemble`.
        velocity: As in `Trajectory`, shape (n, rows, d).
        gap: [m], shape (n, rows, J).
        impulse: Contact impulse up to each level [N s], shape (n, rows, J).
        max_penetration: Of each member [m], shape (n,).
        details: Figures of the method: dt, handed_back (steps whose forces were found elsewhere).
    """

    times: Floats
    position: Floats
    velocity: Floats
    gap: Floats
    impulse: Floats
    max_penetration: Floats
    details: Mapping[str, Any]


def integrate_ensemble(
    system: LinearSystem,
    positions: ArrayLike,
    velocities: ArrayLike,
    duration: float,
    settings: PositionSettings | VelocitySettings,
    *,
    every: int | None = None,
) -> EnsembleResult:
    """Integrate one system from n initial states; each member as a single run would go.

    Args:
        system: The system.
        positions: u0 of each, shape (n, d).
        velocities: v0 of each, shape (n, d).
        duration: [s].
        settings: Of the position-level or the velocity-level scheme; their ``every`` is not used.
        every: Steps between two kept levels; None for the start and the end alone.

    Raises:
        SceneError: Bad input; it names the member.
        ConvergenceError: Contact was not solved, or a motion is not finite.
    """
    u, v = (np.array(values, dtype=float, ndmin=2) for values in (positions, velocities))
    if u.shape != v.shape or u.shape[1:] != (system.dofs,) or not len(u):
        raise SceneError(
            f"positions has shape {u.shape}, velocities {v.shape}; give both as (n, {system.dofs})"
        )
    steps, h = count_steps(duration, settings.dt, every or 1, settings.impact_law)
    _check_members(system, u, v)
    kicks = Kicks(system, steps, h)
    if isinstance(settings, PositionSettings):
        kernel, loads, matrices, states, extra = _positions(system, kicks, u, v, h, settings)
    else:
        kernel, loads, matrices, states, extra = _velocities(system, kicks, u, v, h, settings)
    levels = row_levels(steps, every or steps)
    n, count = len(u), system.num_constraints
    rows = (
        *np.zeros((2, n, len(levels), system.dofs)),
        np.zeros((n, len(levels), count)),
        np.zeros((n, len(levels), 2 * count)),
    )
    logs = (np.zeros((n, count, 6)), np.zeros((n, 2 * count)), np.zeros((n, 1)))
    given, offset = np.full(count, np.nan), np.zeros(count)
    handed_back = 0
    for begin in range(0, steps + 1, _MOST_STEPS):
        end = min(steps + 1, begin + _MOST_STEPS)
        member, m = 0, begin
        while member < n:
            member, m = march_members(
                kernel, (member, m), (begin, end, steps, every or steps), h, loads(begin, end),
                matrices, states, logs, (given, offset), rows, extra,
            )  # fmt: skip
            if member < n:
                handed_back += 1
                given[:] = solve_impulses(matrices[3], offset)
    bad = np.flatnonzero(~np.isfinite(rows[1][:, -1]).all(axis=1))
    if len(bad):
        raise ConvergenceError(f"member {bad[0]}: the motion is not finite; use a smaller dt")
    details = {"dt": h, "handed_back": handed_back}
    deepest = np.maximum(0.0, -logs[2][:, 0])
    times = row_times(levels, h)
    return EnsembleResult(times, rows[0], rows[1], rows[2], rows[3][..., :count], deepest, details)


def _check_members(system: LinearSystem, u: Floats, v: Floats) -> None:
    bad = np.flatnonzero(~(np.isfinite(u) & np.isfinite(v)).all(axis=1))
    if not len(bad):
        gaps = u @ system.normals.T + system.offsets - system.motion_at(0.0)
        bad = np.flatnonzero((gaps < -_CLOSED * np.abs(u).max(axis=1, keepdims=True)).any(axis=1))
    for member in (int(bad[0]) if len(bad) else 0,):  # the first bad one says why
        try:
            check_start(system, u[member], v[member])
        except SceneError as error:
            raise SceneError(f"member {member}: {error}") from None


def _positions(
    system: LinearSystem, kicks: Kicks, u: Floats, v: Floats, h: float, settings: PositionSettings
) -> tuple[Any, ...]:
    implicit = choose_implicit(system, u[0], v[0], h, settings.implicit)
    loads, *matrices = position_level.step_matrices(system, h, implicit=implicit)
    weight = position_level.start_weight(system, h, implicit=implicit)
    gap = u @ system.normals.T + system.offsets - system.motion_at(0.0)
    # The start of single runs for all members at once, then again for those in contact.
    force = system.load_at(0.0) - u @ system.stiffness.T - v @ system.damping.T
    factor: Floats = np.linalg.cholesky(weight)
    change = h * v - 0.5 * h * h * cho_solve((factor, True), force.T).T
    first = start_positions(system, u[0], v[0], h, weight)
    wall = system.gap(0.0, u[0] - first.change) + system.motion_at(0.0) - first.before
    before = (u - change) @ system.normals.T + system.offsets - wall
    size = np.abs(u).max(axis=1, keepdims=True)
    for member in np.flatnonzero((gap <= _CLOSED * size + 1e-300).any(axis=1)):
        own = start_positions(system, u[member], v[member], h, weight)
        change[member], gap[member], before[member] = own.change, own.gap, own.before

    def tables(begin: int, end: int) -> tuple[Floats, Floats]:
        return position_level.tabulate(system, kicks, loads, h, begin, end)

    return march_positions, tables, tuple(matrices), (u, change, gap, before), ()


def _velocities(
    system: LinearSystem, kicks: Kicks, u: Floats, v: Floats, h: float, settings: VelocitySettings
) -> tuple[Any, ...]:
    theta = velocity_level.check_theta(settings.theta)
    loads, *matrices = velocity_level.step_matrices(system, h, theta)
    gap = u @ system.normals.T + system.offsets - system.motion_at(0.0)

    def tables(begin: int, end: int) -> tuple[Floats, Floats]:
        return velocity_level.tabulate(system, kicks, loads, h, begin, end)

    return march_velocities, tables, tuple(matrices), (u, v, gap, np.zeros_like(gap)), (theta,)
