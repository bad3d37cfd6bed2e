"""Which constraints stay closed, and what impacts that never end at one place come to."""

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.impact_law import Impact, delassus, resolve_impact, resting_forces
from impactfem.vibro.event_constrained import constrained
from impactfem.vibro.flight_kernels import by_turns

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_MAX_TURNS = 100_000


def accumulate(
    mass: Floats, factor: Floats, jacobian: Floats, v: Floats, rate: Floats, restitution: Floats
) -> Impact:
    """The outcome of infinitely many impacts by turns at one place.

    They come to an end, or all constraints that are hit for ever lose their normal speeds: then
    impulses p >= 0 only where the speed after is 0, which is the impact without restitution.
    """
    before = jacobian @ v - rate
    matrix, answers = delassus(factor, jacobian)
    impulse, ended = by_turns(matrix, before.copy(), restitution, _MAX_TURNS)
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
) -> tuple[list[tuple[float, int]], Floats]:
    """Constraints that stay closed, as (force, index), and the acceleration (d,)."""
    mass, factor, jacobian, load, applied, curvature = state
    if not len(rows):
        return [], applied
    normals, bend = jacobian[rows], curvature[rows]
    if rank(normals) == len(rows):
        # Mostly all stay closed: then this is exact, and good for any ratio of masses.
        together, pressed = constrained(mass, normals, load[:, None], bend[:, None])
        if (pressed > 0.0).all():
            return [(float(pressed[i, 0]), int(j)) for i, j in enumerate(rows)], together[:, 0]
    force = resting_forces(factor, normals, applied, bend)
    matrix, answers = delassus(factor, normals)
    acceleration = applied + answers @ force
    size = np.abs(normals) @ np.abs(applied) + np.abs(bend) + np.abs(matrix) @ force
    away = normals @ acceleration + bend
    stays = (force > 0.0) | (away <= 1e-12 * size)
    return [(float(force[i]), int(j)) for i, j in enumerate(rows) if stays[i]], acceleration


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
