"""What schemes with a constant step share: their steps, their rows, the driver of their loops."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import solve_cones
from impactfem.contact.impact_law import Law, complementarity
from impactfem.errors import ConvergenceError, SceneError
from impactfem.result.bar_motion import Effort
from impactfem.result.trajectory import Impacts, Trajectory
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.position_kernels import ROUNDING, lasts

Arrays = tuple[Floats, Floats, Floats, Floats]
"""Positions, velocities (rows, d), gaps (rows, J), impulses so far, all and lasting (rows, 2 J)."""

Tables = Callable[[int, int], tuple[Floats, Floats]]
"""Loads and walls of the steps from a first one to one before a last one."""

_ROOM = 4096  # events between two visits of Python
_MOST_STEPS = 32768  # steps whose loads are tabulated at once
_WINDOW = 4.0  # steps over which a force is a mean
_RESTS = 1e-12  # share of the lengths and speeds that is no distance and no motion
_MAX_SYSTEMS = 5000  # linear ones of a step with friction
_MAX_SWEEPS = 200  # of the splitting for gyroscopic or follower forces


def count_steps(duration: float, dt: float, every: int, impact_law: Law) -> tuple[int, float]:
    """Number of equal steps that are not longer than dt, and their length.

    Raises:
        SceneError: A value is not allowed.
    """
    if not (math.isfinite(dt) and dt > 0.0):
        raise SceneError(f"dt = {dt:g}: give the time step as a number > 0 [s]")
    if not (math.isfinite(duration) and duration > 0.0):
        raise SceneError(f"duration = {duration:g}: give a number > 0 [s]")
    if every < 1:
        raise SceneError(f"every = {every}: give a number >= 1 of steps between two rows")
    if impact_law != "simultaneous":
        raise SceneError(
            f'impact_law = "{impact_law}": schemes with time steps solve all impacts of a step at '
            'once; use impact_law = "simultaneous", or the event-driven method'
        )
    steps = max(1, math.ceil(duration / dt * (1.0 - 1e-12)))
    return steps, duration / steps


def row_levels(steps: int, every: int) -> NDArray[np.int64]:
    """Levels of the rows: every ``every``-th from 0 on, and the last one."""
    levels = np.arange(0, steps + every, every)
    levels[-1] = min(levels[-1], steps)
    return levels


def row_times(levels: NDArray[np.int64], dt: float) -> Floats:
    """Times of levels [s]."""
    times: Floats = levels * np.float64(dt)
    return times


def empty_rows(system: GeneralizedSystem, steps: int, every: int) -> Arrays:
    """Room for the rows."""
    rows = len(row_levels(steps, every))
    d, constraints = system.dofs, system.num_constraints
    return (
        np.zeros((rows, system.coordinates)),
        np.zeros((rows, d)),
        np.zeros((rows, constraints)),
        np.zeros((rows, 2 * constraints)),
    )


def trajectory(
    system: GeneralizedSystem,
    times: Floats,
    rows: Arrays,
    impacts: list[tuple[float, ...]] | Floats,
    effort: Effort,
) -> Trajectory:
    """The motion that rows and impacts describe.

    Raises:
        ConvergenceError: It is not finite.
    """
    position, velocity, gap, impulses = rows
    bad = np.flatnonzero(~(np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1)))
    if len(bad):
        raise ConvergenceError(
            f"the motion is not finite from t = {times[bad[0]]:.6g} s on: the step is too large "
            "for the forces; use a smaller dt"
        )
    impulse, lasting = np.split(np.diff(impulses, axis=0, prepend=0.0), 2, axis=1)
    force = np.zeros_like(gap)
    force[1:] = lasting[1:] / np.diff(times)[:, None]
    peak, window = largest_force(times, lasting, effort.details["dt"])
    order = np.array(impacts, dtype=float).reshape(-1, 5)
    order = order[np.argsort(order[:, 0], kind="stable")]
    return Trajectory(
        times=times,
        position=position,
        velocity=velocity,
        gap=gap,
        contact_force=force,
        impulse=impulse,
        kinetic=_kinetic(system, position, velocity),
        potential=_potential(system, times, position),
        peak=peak,
        window=window,
        impacts=Impacts.of_rows(list(map(tuple, order[order[:, 0] <= times[-1]]))),
        effort=effort,
    )


def pushed(impulse: Floats, episodes: Floats) -> Floats:
    """The impulses of a step (J,), followed by those of lasting contact, shape (2 J,)."""
    stays = [bool(lasts(c, one, episodes)) for c, one in enumerate(impulse)]
    return np.concatenate([impulse, np.where(stays, impulse, 0.0)])


def largest_force(times: Floats, lasting: Floats, dt: float) -> tuple[float | None, float]:
    """Largest mean force of lasting contact over four steps [N], None if there is none; their time.

    Args:
        times: Of the rows [s], shape (rows,).
        lasting: Impulses of lasting contact of each row [N s], (rows, J).
        dt: Time step [s].
    """
    if not lasting.any():
        return None, 0.0
    row = float(times[1] - times[0])
    count = min(max(1, math.ceil(_WINDOW * dt / row - 1e-9)), len(times) - 1)
    so_far = np.cumsum(lasting.sum(axis=1))
    means = (so_far[count:] - so_far[:-count]) / (times[count:] - times[:-count])
    return float(means.max()), count * row


def _kinetic(system: GeneralizedSystem, position: Floats, velocity: Floats) -> Floats:
    mass = system.constant_mass
    if mass is not None:
        constant: Floats = 0.5 * np.einsum("mi,mi->m", velocity, velocity @ mass.T)
        return constant
    pairs = zip(position, velocity, strict=True)
    return np.array([system.kinetic_energy(u, v) for u, v in pairs])


def _potential(system: GeneralizedSystem, times: Floats, position: Floats) -> Floats:
    if system.potential is None:
        return np.zeros(len(times))
    if isinstance(system, LinearSystem) and system.potential == system._linear_potential:  # noqa: SLF001  # all rows at once
        constant = np.array([signal.constant for signal in system.load])
        whole: Floats = (
            0.5 * np.einsum("mi,mi->m", position, position @ system.stiffness.T)
            - position @ constant
        )
        return whole
    pairs = zip(times, position, strict=True)
    return np.array([system.potential(float(t), u) for t, u in pairs])


def starting_episodes(system: GeneralizedSystem, u: Floats, v: Floats) -> Floats:
    """Episodes (J, 6) at t = 0, as of the kernels: what rests in contact goes on to do so."""
    rate, flow = system.gap_rate(0.0, u, v), np.abs(system.jacobian(u)) @ np.abs(v)
    still = np.abs(rate) <= _RESTS * (flow + np.abs(system.motion_rate(0.0)))
    closed = system.gap(0.0, u) <= _RESTS * float(np.abs(u).max(initial=0.0))
    episodes = np.zeros((system.num_constraints, 6))
    episodes[still & closed, 4:] = 2.0, np.inf
    return episodes


def unfinished(episodes: Floats) -> list[tuple[float, ...]]:
    """Impacts of the constraints that still act at the end; ``episodes`` as of the kernels."""
    acting = np.flatnonzero((episodes[:, 4] > 0.0) & (episodes[:, 2] > 0.0))
    rows = [(int(c), *episodes[c, :4]) for c in acting]
    return [(since, c, before, after, impulse) for c, since, before, impulse, after in rows]


def solve_impulses(coupling: Floats, offset: Floats) -> Floats:
    """Solve 0 <= P _|_ offset + coupling P >= 0 for the constraints of finite offset, shape (J,).

    The coupling J A^-1 J^T need not be symmetric (gyroscopic or follower forces): its skew part
    then moves to the right-hand side, sweep by sweep.

    Raises:
        ConvergenceError: No impulses were found.
    """
    closed = np.flatnonzero(np.isfinite(offset))
    impulse = np.zeros(len(offset))
    matrix, right = coupling[np.ix_(closed, closed)], offset[closed]
    even = 0.5 * (matrix + matrix.T)
    odd = matrix - even
    if not np.abs(odd).max(initial=0.0) > 1e-13 * np.abs(even).max(initial=0.0):
        impulse[closed] = complementarity(even, right)
        return impulse
    found = complementarity(even, right)
    for _ in range(_MAX_SWEEPS):
        following = complementarity(even, right + odd @ found)
        if np.abs(following - found).max() <= 1e-15 * np.abs(following).max(initial=0.0):
            impulse[closed] = following
            return impulse
        found = following
    raise ConvergenceError(
        f"contact: the impulses of {len(closed)} constraints were not found in {_MAX_SWEEPS} "
        "sweeps, for forces without potential; use a smaller dt"
    )


def cone_impulses(coupling: Floats, offset: Floats, friction: Floats, tangents: int) -> Floats:
    """Impulses of the closed constraints, each followed by those along its tangents.

    Normal ones obey 0 <= P _|_ offset + coupling P >= 0, tangential ones Coulomb's cone.
    """
    if not tangents:
        return solve_impulses(coupling, offset)
    each = offset.reshape(-1, 1 + tangents)
    none = np.zeros(len(friction))
    problem = ConeProblem(0.5 * (coupling + coupling.T), each, friction, none)
    tolerance = ROUNDING * float(np.abs(offset).max(initial=0.0))
    return solve_cones(problem, np.zeros_like(each), tolerance, _MAX_SYSTEMS)[0].ravel()


@dataclass
class LinearMarch:
    """A linear system on its way through a compiled loop.

    Attributes:
        kernel: The loop (`position_kernels`).
        steps: Number of steps; one more is taken for the velocity of the last row.
        dt: Their length [s].
        every: Steps between two rows.
        tables: What depends on time.
        matrices: stiff, damp, response, coupling, normals, offsets, restitution.
        state: u, s (d,), gap, gap before (J,).
        rows: Where rows are written.
        episodes: Those at the start (J, 6), changed in place.
        extra: Further arguments of the loop.
    """

    kernel: Any
    steps: int
    dt: float
    every: int
    tables: Tables
    matrices: tuple[Floats, ...]
    state: Arrays
    rows: Arrays
    episodes: Floats
    extra: tuple[Any, ...] = ()
    handed_back: int = 0
    worst: Floats = field(default_factory=lambda: np.zeros(1))

    def run(self) -> Floats:
        """March to the end; returns the impacts, shape (impacts, 5)."""
        count = len(self.state[2])
        episodes, total = self.episodes, np.zeros(2 * count)
        given, offset = np.full(count, np.nan), np.zeros(count)
        room = np.zeros((_ROOM + count, 5))
        found: list[Floats] = []
        m, stop = 0, self.steps + 1
        while m < stop:
            begin, end = m, min(stop, m + _MOST_STEPS)
            loads, walls = self.tables(begin, end)
            while m < end:
                m, written, waits = self.kernel(
                    (m, begin, end, self.steps, self.every), self.dt, loads, walls,
                    *self.matrices, *self.state, episodes, total, self.worst, given, offset,
                    self.rows, room, *self.extra,
                )  # fmt: skip
                if written:
                    found.append(room[:written].copy())
                if waits:
                    if not np.isfinite(self.state[0]).all():
                        raise ConvergenceError(
                            f"the motion is not finite at t = {m * self.dt:.6g} s; use a smaller dt"
                        )
                    self.handed_back += 1
                    given[:] = solve_impulses(self.matrices[3], offset)
        found.append(np.array(unfinished(episodes)).reshape(-1, 5))
        return np.concatenate(found)
