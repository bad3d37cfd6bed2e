"""The position-level scheme of systems with any mass matrix, forces and constraints, in Python."""

from dataclasses import replace

import numpy as np
from scipy.linalg import cho_solve

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.result.bar_motion import Effort
from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Forced, Room, advanced
from impactfem.vibro.kicks import Kicks
from impactfem.vibro.position_kernels import note
from impactfem.vibro.position_start import start_positions
from impactfem.vibro.projection import project
from impactfem.vibro.vibro_rows import (
    empty_rows,
    pushed,
    row_levels,
    row_times,
    starting_episodes,
    trajectory,
    unfinished,
)

_MAX_FIXED_POINT = 100


def march_general(
    system: GeneralizedSystem, u: Floats, v: Floats, steps: int, h: float, every: int
) -> Trajectory:
    """March over equal steps h; see `position_level`."""
    first = start_positions(system, u, v, h, system.mass(u))
    u, s, gap, before = first.position.copy(), first.change, first.gap, first.before
    e, count = system.restitution, system.num_constraints
    rows = empty_rows(system, steps, every)
    episodes, total, worst = starting_episodes(system, u, v), np.zeros(2 * count), 0.0
    noted = np.zeros((count, 5))
    impacts: list[tuple[float, ...]] = list(map(tuple, first.impacts))
    room = Room.at(system, u)
    place = system.gap(0.0, advanced(system, u, -s))
    wall_old, wall = place - before, system.motion_at(0.0)
    wall_old = wall_old + wall
    linearisations = 0
    kicks = Kicks(system, steps, h)
    for m in range(steps + 1):
        t = m * h
        if system.constant_mass is None or system.bilateral is not None:
            room = Room.at(system, u, t)
        wall_new = system.motion_at(t + h)
        (shift_old,), (shift,) = kicks.shifts(m, m + 1)
        mean = (wall_new + e * (wall_old - shift_old)) / (1.0 + e)
        new, impulse, solved = _step(room, t, h, u, s, mean)
        linearisations = max(linearisations, solved)
        end = advanced(system, u, new)
        following = system.gap(t + h, end)
        both = pushed(impulse / h, episodes)
        if m % every == 0 or m == steps:
            row = -(-m // every)
            rows[0][row], rows[1][row] = u, room.full(room.own(0.5 * (s + new) / h))
            rows[2][row], rows[3][row] = gap, total + 0.5 * both
        total += both
        worst = min(worst, float(gap.min(initial=0.0)))
        written = 0
        for c in range(count):
            speed = (gap[c] - before[c] + shift[c] - shift_old[c]) / h
            after = (following[c] - gap[c]) / h
            when = t + (min(max(gap[c] / -speed, -h), h) if speed < 0.0 else 0.0)
            if impulse[c] == 0.0 and episodes[c, 4]:
                episodes[c, 3] = after
            written = note(c, impulse[c] / h, when, speed, after, episodes, noted, written)
        impacts.extend(map(tuple, noted[:written]))
        u, s, gap, before = end, new, following, gap
        wall_old, wall = wall, wall_new
    impacts.extend(unfinished(episodes))
    details = {
        "dt": h, "implicit": False, "max_penetration": max(0.0, -worst),
        "max_linearisations": linearisations,
    }  # fmt: skip
    effort = Effort(num_unknowns=system.dofs, details=details)
    return trajectory(system, row_times(row_levels(steps, every), h), rows, impacts, effort)


def _step(
    room: Room, t: float, h: float, u: Floats, s: Floats, wall: Floats
) -> tuple[Floats, Floats, int]:
    """U^{m+1} - U^m, P and the linearisations; velocities in f by fixed point."""

    def gained(v: Floats) -> Floats:
        # Means of half a step around; at the start, which has taken half of those at t = 0 off.
        system, around = room.system, (t, h) if t else (0.25 * h, 0.5 * h)
        forced = Forced.at(system, around[0], u, v, room, around[1])
        if not t:
            first = Forced.at(system, t, u, v, room)
            forced = replace(forced, load=0.5 * (forced.load + first.load))
        if not np.isfinite(forced.load).all():
            raise ConvergenceError(
                f"force at t = {t:.6g} s is {forced.load.tolist()}: the motion or the formula "
                "broke down; use a smaller dt"
            )
        return h * h * forced.full(np.asarray(cho_solve((room.factor, True), forced.load)))

    more = gained(s / h)
    for _ in range(_MAX_FIXED_POINT):
        free = s + more
        found = project(room, u, free, s, wall)
        new = free + found.change
        following = gained(0.5 * (s + new) / h)
        moved = float(np.abs(following - more).max())
        if moved <= 1e-13 * float(max(np.abs(new).max(), np.abs(more).max())) + 1e-300:
            return new, found.impulse, found.linearisations
        more = following
    raise ConvergenceError(
        f"the forces that depend on velocity did not settle in {_MAX_FIXED_POINT} iterations at "
        f"t = {t:.6g} s (last change {moved:.1e}); use a smaller dt"
    )
