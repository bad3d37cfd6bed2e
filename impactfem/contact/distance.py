"""Signed distance of points from rigid obstacles, and its gradient."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import SceneError

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Field = tuple[Floats, Floats]

ROUNDING = 1e-9
"""Share of an obstacle's size below which a distance does not say a direction."""


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
    return _FIELDS[obstacle.kind](obstacle, places - translation(obstacle, time))


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


def _half_space(obstacle: Any, points: Floats) -> Field:
    normal = _unit(np.asarray(obstacle.normal, dtype=np.float64))
    gap = (points - np.asarray(obstacle.point, dtype=np.float64)) @ normal
    return gap, np.tile(normal, (len(points), 1))


def _sphere(obstacle: Any, points: Floats) -> Field:
    arms = points - np.asarray(obstacle.center, dtype=np.float64)
    return _round(arms, _up(points.shape[1]), obstacle)


def _cylinder(obstacle: Any, points: Floats) -> Field:
    """Endless cylinder; in the plane a circle."""
    dim = points.shape[1]
    arms = points - np.asarray(obstacle.point, dtype=np.float64)
    if dim == 2:
        return _round(arms, _up(dim), obstacle)
    axis = _unit(np.asarray(obstacle.axis, dtype=np.float64))
    arms -= np.outer(arms @ axis, axis)
    # On the axis: square to it and as near to y as can be, or to x if it runs along y.
    start = np.eye(dim)[0 if abs(axis[1]) > np.sqrt(0.5) else 1]
    return _round(arms, _unit(start - (start @ axis) * axis), obstacle)


def _round(arms: Floats, fallback: Floats, obstacle: Any) -> Field:
    """Field of a sphere or cylinder from the arms of its centre or axis to the points."""
    length = np.sqrt(np.einsum("ij,ij->i", arms, arms))
    centred = length <= ROUNDING * obstacle.radius
    normal = arms / np.where(centred, 1.0, length)[:, None]
    normal[centred] = fallback
    if obstacle.side == "inside":
        return obstacle.radius - length, -normal
    return length - obstacle.radius, normal


def _box(obstacle: Any, points: Floats) -> Field:
    """Box or rectangle, turned by ``angle`` about its centre (in space about z)."""
    dim = points.shape[1]
    turn = np.eye(dim)
    cosine, sine = np.cos(obstacle.angle), np.sin(obstacle.angle)
    turn[:2, :2] = [[cosine, -sine], [sine, cosine]]
    half = 0.5 * np.asarray(obstacle.size, dtype=np.float64)
    local = (points - np.asarray(obstacle.center, dtype=np.float64)) @ turn
    signs = np.where(local < 0.0, -1.0, 1.0)
    beyond = np.abs(local) - half
    outer = np.maximum(beyond, 0.0)
    distance = np.sqrt(np.einsum("ij,ij->i", outer, outer))
    deepest = beyond.max(axis=1)
    rounding = ROUNDING * float(half.max())
    outside = distance > rounding
    order = np.array([1, 0, 2][:dim])
    nearest = order[np.argmax(beyond[:, order] >= (deepest - rounding)[:, None], axis=1)]
    normal = np.where(
        outside[:, None], outer / np.where(outside, distance, 1.0)[:, None], np.eye(dim)[nearest]
    )
    return np.where(deepest > 0.0, distance, deepest), (signs * normal) @ turn.T


def _polyline(obstacle: Any, points: Floats) -> Field:
    """Chain of segments with the body on its left; in space extended along z.

    Inside is what lies right of the nearest segment. At a corner the sum of both normals tells the
    side (the pseudonormal of Baerentzen and Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005)
    243-253). Beyond the ends of an open chain there is no obstacle: the gap is the distance from
    the end, whichever side the point lies on. A chain that returns to its first point is closed.
    """
    chain = np.asarray(obstacle.points, dtype=np.float64)
    chain = chain[np.r_[True, np.any(np.diff(chain, axis=0) != 0.0, axis=1)]]
    edges = np.diff(chain, axis=0)
    lengths = np.sqrt(np.einsum("ij,ij->i", edges, edges))
    along = edges / lengths[:, None]
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    closed = bool((chain[0] == chain[-1]).all())
    size = float(np.ptp(chain, axis=0).max())
    # Faces are reached a little beyond the open ends, lest rounding decide there what is inside.
    low, high = np.zeros(len(edges)), lengths.copy()
    if not closed:
        low[0] -= ROUNDING * size
        high[-1] += ROUNDING * size

    plane = points[:, :2]
    segment, place = _nearest_segments(plane, chain, along, low, high)
    on_face = (place > low[segment]) & (place < high[segment])
    normal = np.zeros_like(points)
    normal[:, :2] = left[segment]
    gap = np.einsum("ij,ij->i", plane - chain[segment], left[segment])

    corner = np.flatnonzero(~on_face)
    vertex = segment[corner] + (place[corner] >= high[segment[corner]])
    sums = np.zeros_like(chain)
    sums[:-1] += left
    sums[1:] += left
    ends = np.zeros(len(chain), dtype=bool)
    if closed:
        sums[0] = sums[-1] = left[0] + left[-1]
    else:
        ends[[0, -1]] = True
    arms = plane[corner] - chain[vertex]
    distance = np.sqrt(np.einsum("ij,ij->i", arms, arms))
    folded = np.hypot(*sums.T) <= ROUNDING  # there and back: the body is all around
    always = (ends | folded)[vertex]
    sign = np.where(always | (np.einsum("ij,ij->i", arms, sums[vertex]) >= 0.0), 1.0, -1.0)
    gap[corner] = sign * distance
    clear = distance > ROUNDING * size
    normal[corner[clear], :2] = sign[clear, None] * arms[clear] / distance[clear, None]
    touching = ~clear & ~folded[vertex]
    middle = sums[vertex[touching]]
    normal[corner[touching], :2] = middle / np.hypot(*middle.T)[:, None]
    return gap, normal


def _nearest_segments(
    points: Floats, chain: Floats, along: Floats, low: Floats, high: Floats
) -> tuple[Indices, Floats]:
    """Nearest segment of each point and the point's place along its line [m], not clipped."""
    best = np.full(len(points), np.inf)
    segment = np.zeros(len(points), dtype=np.int64)
    place = np.zeros(len(points))
    x, y = np.ascontiguousarray(points.T)
    for k, (ax, ay) in enumerate(chain[:-1]):
        cos, sin = along[k]
        rx, ry = x - ax, y - ay
        s = rx * cos + ry * sin
        h = ry * cos - rx * sin
        excess = s - np.clip(s, low[k], high[k])
        distance = h * h + excess * excess
        closer = distance < best
        np.copyto(best, distance, where=closer)
        np.copyto(place, s, where=closer)
        segment[closer] = k
    return segment, place


def _up(dim: int) -> Floats:
    up = np.zeros(dim)
    up[1] = 1.0
    return up


def _unit(vector: Floats) -> Floats:
    scaled = vector / np.abs(vector).max()  # the square of a long vector may overflow
    return np.asarray(scaled / np.linalg.norm(scaled))


_FIELDS: dict[str, Callable[[Any, Floats], Field]] = {
    "half_space": _half_space,
    "sphere": _sphere,
    "cylinder": _cylinder,
    "box": _box,
    "polyline": _polyline,
}
