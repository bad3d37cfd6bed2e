"""Signed distance of points from rigid obstacles, and its gradient."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats, Integers
from impactfem.scene.obstacles.rotation import gap_at, placement

Field = tuple[Floats, Floats]


def signed_distance(obstacle: Any, points: ArrayLike, time: float) -> Field:
    """Distance of points from an obstacle, negative inside, and its gradient.

    Outside, the normal comes from the nearest point of the obstacle; inside it shows the shortest
    way out. Where several are nearest (centres, edges met from inside) one of them is taken, the
    y direction before the others: a body that stands flush on a box is pushed up, not aside.

    Args:
        obstacle: One of the obstacles of a solid (`impactfem.scene.obstacles`).
        points: Places [m], shape (points, dim), dim 2 or 3.
        time: Time [s], for obstacles that move.

    Returns:
        Gap [m], shape (points,), >= 0 on the side of the body; unit normal towards the body, the
        gradient of the gap, shape (points, dim).

    Raises:
        SceneError: The place of the obstacle has no finite value at that time.
    """
    places = np.asarray(points, dtype=np.float64)
    return gap_at(obstacle, places, time)


def nearest_obstacle(
    obstacles: Sequence[Any], points: ArrayLike, time: float
) -> tuple[Integers, Floats, Floats]:
    """Find the obstacle with the smallest gap; the first one where several have it.

    Args:
        obstacles: At least one.
        points: Places [m], shape (points, dim).
        time: Time [s].

    Returns:
        Index of the obstacle, its gap [m], both (points,), and its normal, (points, dim).
    """
    gap, normal = signed_distance(obstacles[0], points, time)
    index = np.zeros(len(gap), dtype=np.int64)
    for k, obstacle in enumerate(obstacles[1:], start=1):
        other, direction = signed_distance(obstacle, points, time)
        closer = other < gap
        index[closer] = k
        gap = np.where(closer, other, gap)
        normal[closer] = direction[closer]
    return index, gap, normal


def on_a_line(obstacle: Any, times: Floats) -> tuple[Floats, float]:
    """Places [m] of an obstacle of points on a line, (times,); the side of the body, -1 or 1."""
    gap, normal = obstacle.gap(np.zeros((1, 1)))
    side = float(normal[0, 0])
    moved = np.array([placement(obstacle, float(t)).moved(np.zeros(1)) for t in times])
    return moved[:, 0] - side * float(gap[0]), side
