"""Which constraints stay closed, and what impacts that never end at one place come to.

The acceleration decides which constraints without normal speed stay closed: 0 <= force _|_ second
rate of the gap >= 0. Just after an impact it often decides nothing: a body that was not strained
has no acceleration yet, and the sign of its rounding would be drawn by lot. Then the first rate
that is not zero decides, of third order or higher: gap and contact force are power series of the
time to come, which must not be negative, lexicographically, and one of them vanishes. That is a
complementarity problem over an ordered field, with the same positive definite matrix, and has one
solution. Source: Heemels, Schumacher and Weiland, Linear complementarity systems (2000).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.impact_law import Impact, delassus, resolve_impact, resting_forces
from impactfem.vibro.event_constrained import constrained
from impactfem.vibro.flight_kernels import by_turns

_MAX_TURNS = 100_000
_MAX_FLIPS = 10  # changes of sides, for each constraint


@dataclass(frozen=True)
class Onset:
    """How gaps and contact forces begin with given closed constraints.

    Attributes:
        gaps: Coefficients of the gaps from the second order on, shape (orders, J).
        gap_doubts: Their rounding.
        forces: Coefficients of the forces of the closed constraints, shape (orders, S).
        force_doubts: Their rounding.
    """

    gaps: Floats
    gap_doubts: Floats
    forces: Floats
    force_doubts: Floats


def signs(series: Floats, doubts: Floats) -> tuple[Floats, Integers]:
    """Lexicographic signs of series (orders, n): -1, 0, +1 (n,), and the orders that decide (n,).

    Flights let go of a contact force that is below its full doubt: half of it here, so that what
    has just been let go of is not taken for zero.
    """
    sure = np.abs(series) > 0.5 * doubts
    first = np.argmax(sure, axis=0)
    columns = np.arange(series.shape[1])
    sign = np.where(sure[first, columns], np.sign(series[first, columns]), 0.0)
    return sign, first


def stay(
    onset: Callable[[tuple[int, ...]], Onset], jacobian: Floats, start: tuple[int, ...],
    rows: Integers,
) -> tuple[tuple[int, ...], tuple[int, ...], Integers]:  # fmt: skip
    """Constraints that stay closed, by the first of their rates that is not zero.

    By Murty's rule: of the constraints that are wrong the first one changes sides. What no rate
    decides stays closed.

    Args:
        onset: How gaps and forces begin with given closed constraints.
        jacobian: Shape (J, d).
        start: Constraints to begin with, linearly independent.
        rows: Constraints without gap and normal speed.

    Returns:
        Linearly independent closed constraints, those that stay closed because these do, and the
        order in time at which the gap of each of the others grows, shape (J,).
    """
    closed = set(start)
    for _ in range(_MAX_FLIPS * (1 + len(rows))):
        held = tuple(sorted(closed))
        begin = onset(held)
        opening, order = signs(begin.gaps, begin.gap_doubts)
        pressing = dict(zip(held, signs(begin.forces, begin.force_doubts)[0], strict=True))
        free = [j for j in rows.tolist() if j not in closed]
        shut = [j for j in free if opening[j] <= 0.0]
        lone = [j for j in shut if rank(jacobian[[*held, j]]) > len(held)]
        wrong = sorted([*lone, *(j for j in held if pressing[j] < 0.0)])
        if not wrong:
            return held, tuple(j for j in shut if j not in lone), 2 + order
        closed ^= {wrong[0]}
    return start, (), 2 + order


def accumulate(
    mass: Floats, factor: Floats, jacobian: Floats, v: Floats, rate: Floats, restitution: Floats,
    noise: Floats,
) -> Impact:  # fmt: skip
    """The outcome of infinitely many impacts by turns at one place.

    They come to an end, or all constraints that are hit for ever lose their normal speeds: then
    impulses p >= 0 only where the speed after is 0, which is the impact without restitution.
    """
    before = jacobian @ v - rate
    matrix, answers = delassus(factor, jacobian)
    impulse, ended = by_turns(matrix, before.copy(), restitution, noise.copy(), _MAX_TURNS)
    if not ended:
        if rank(jacobian) == len(rate):
            together, push = constrained(mass, jacobian, (mass @ v)[:, None], -rate[:, None])
            if (push >= 0.0).all():
                return Impact(together[:, 0], push[:, 0], before, np.zeros(len(rate)))
        return resolve_impact(factor, jacobian, v, rate, np.zeros(len(rate)))
    after = v + answers @ impulse
    return Impact(after, impulse, before, jacobian @ after - rate)


def lasting(
    state: tuple[Floats, Floats, Floats, Floats, Floats, Floats], rows: Integers
) -> list[tuple[float, int]]:
    """Constraints that stay closed by their accelerations, as (force, index)."""
    mass, factor, jacobian, load, applied, curvature = state
    if not len(rows):
        return []
    normals, bend = jacobian[rows], curvature[rows]
    if rank(normals) == len(rows):
        # Mostly all stay closed: then this is exact, and good for any ratio of masses.
        _, pressed = constrained(mass, normals, load[:, None], bend[:, None])
        if (pressed > 0.0).all():
            return [(float(pressed[i, 0]), int(j)) for i, j in enumerate(rows)]
    force = resting_forces(factor, normals, applied, bend)
    matrix, answers = delassus(factor, normals)
    acceleration = applied + answers @ force
    size = np.abs(normals) @ np.abs(applied) + np.abs(bend) + np.abs(matrix) @ force
    away = normals @ acceleration + bend
    stays = (force > 0.0) | (away <= 1e-12 * size)
    return [(float(force[i]), int(j)) for i, j in enumerate(rows) if stays[i]]


def independent(
    jacobian: Floats, staying: list[tuple[float, int]]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Linearly independent constraints, those with the largest forces first, and the others."""
    chosen: list[int] = []
    left: list[int] = []
    for _, j in sorted(staying, reverse=True):
        both = [*chosen, j]
        (chosen if rank(jacobian[both]) == len(both) else left).append(j)
    return tuple(sorted(chosen)), tuple(sorted(left))


def rank(normals: Floats) -> int:
    """Rank of rows, whatever their lengths."""
    if len(normals) == 1:
        return 1
    unit = normals / np.linalg.norm(normals, axis=1)[:, None]
    return int(np.linalg.matrix_rank(unit, tol=1e-9))
