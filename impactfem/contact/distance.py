"""Signed distance of points from rigid obstacles, and its gradient."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import SceneError

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
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
        SceneError: The motion of the obstacle has no finite value at that time.
    """
    places = np.asarray(points, dtype=np.float64)
    found: Field = obstacle.gap(places - translation(obstacle, time))
    return found


def nearest_obstacle(
    obstacles: Sequence[Any], points: ArrayLike, time: float
) -> tuple[Indices, Floats, Floats]:
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


def translation(obstacle: Any, time: float) -> Floats | float:
    """Displacement of an obstacle [m] at a time [s], shape (dim,); 0 for one at rest.

    Raises:
        SceneError: It is not finite.
    """
    if obstacle.motion is None:
        return 0.0
    moved = np.array([formula(t=time) for formula in obstacle.motion], dtype=np.float64)
    if not np.isfinite(moved).all():
        text = [formula.text for formula in obstacle.motion]
        raise SceneError(
            f"obstacle {obstacle.name!r}: motion = {text} is not finite at t = {time:g} s; "
            "change the formula or the duration"
        )
    return moved


def on_a_line(obstacle: Any, times: Floats) -> tuple[Floats, float]:
    """Places [m] of an obstacle of points on a line, (times,); the side of the body, -1 or 1."""
    gap, normal = obstacle.gap(np.zeros((1, 1)))
    side = float(normal[0, 0])
    moved = np.array([np.zeros(1) + translation(obstacle, float(t)) for t in times])
    return moved[:, 0] - side * float(gap[0]), side
