"""The loop of schemes whose steps are Python: rows, impacts, sums."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.result.bar_motion import Effort
from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem
from impactfem.vibro.kicks import Kicks
from impactfem.vibro.position_kernels import note
from impactfem.vibro.vibro_rows import (
    empty_rows,
    pushed,
    row_levels,
    row_times,
    starting_episodes,
    trajectory,
    unfinished,
)


@dataclass(frozen=True)
class Stepped:
    """What a step has done.

    Attributes:
        position: u at its end, shape (d,).
        velocity: u' at its end, shape (d,).
        impulse: Of the constraints [N s], shape (J,).
        before: Their normal velocities at its start, where they acted, shape (J,).
        after: The same at its end.
        work: Of friction [J].
    """

    position: Floats
    velocity: Floats
    impulse: Floats
    before: Floats
    after: Floats
    work: float = 0.0


Walls = tuple[Floats, Floats]
"""Velocities of the walls just after the start of a step and just before its end, (J,) each."""

Step = Callable[[float, Floats, Floats, Walls], Stepped]
"""A step from a time [s], u, u' and the walls."""


def march(
    system: GeneralizedSystem,
    start: tuple[Floats, Floats],
    grid: tuple[int, float, int],
    step: Step,
    details: Mapping[str, Any],
) -> Trajectory:
    """Take all steps.

    Args:
        system: The system.
        start: u and u' at t = 0, shape (d,) each.
        grid: Number of steps, their length [s], and steps between two rows.
        step: The scheme.
        details: What the effort tells of it besides the step.

    Raises:
        ConvergenceError: A step was not solved, or the motion is not finite.
    """
    (u, v), (steps, h, every), count = start, grid, system.num_constraints
    rows = empty_rows(system, steps, every)
    episodes, total, worst = starting_episodes(system, u, v), np.zeros(2 * count), 0.0
    room = np.zeros((count, 5))
    impacts: list[tuple[float, ...]] = []
    kicks, rubbed = Kicks(system, steps, h), 0.0
    for m in range(steps + 1):
        t = m * h
        gap = system.gap(t, u)
        worst = min(worst, float(gap.min(initial=0.0)))
        if m % every == 0 or m == steps:
            row = -(-m // every)
            rows[0][row], rows[1][row], rows[2][row], rows[3][row] = u, v, gap, total
        if m == steps and not count:
            break
        ends = np.stack([system.motion_rate(t), system.motion_rate(t + h)])
        (wall,), (wall_new,) = kicks.rates(ends, m)
        done = step(t, u, v, (wall, wall_new))
        rubbed += done.work
        total += pushed(done.impulse, episodes)
        written = 0
        for c in range(count):
            speed = done.before[c]
            when = t + (min(max(gap[c] / -speed, 0.0), h) if speed < 0.0 else 0.0)
            written = note(c, done.impulse[c], when, speed, done.after[c], episodes, room, written)
        impacts.extend(map(tuple, room[:written]))
        u, v = done.position, done.velocity
    impacts.extend(unfinished(episodes))
    told = {"dt": h, **details, "max_penetration": max(0.0, -worst)}
    if system.friction.any():
        told["friction_work"] = rubbed
    effort = Effort(num_unknowns=system.dofs, details=told)
    return trajectory(system, row_times(row_levels(steps, every), h), rows, impacts, effort)
