"""Whether two bodies lie in each other: points just below the faces of one, inside the other.

Near touch the gaps of a pair say so; where bodies lie deeply in each other, or cross, no faces are
opposite. A point is inside a closed surface if the surface surrounds it once: the angles in the
plane, or solid angles in space (Van Oosterom, Strackee, IEEE Trans. Biomed. Eng. 30 (1983)
125-126), that the faces cover as seen from there, signed by their outward normals, sum to a full
turn.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Booleans, Floats
from impactfem.contact.boundary import Boundary
from impactfem.contact.obstacle_places import edges
from impactfem.contact.self_pairs import WithinBody
from impactfem.scene.obstacles.rotation import Placement, placement
from impactfem.system.closest import closest_shares, distances

HALF_FACE = 0.5
"""Depth below faces, share of their width, at which a body in contact with itself is wrong."""

_BELOW = 0.02  # of the width of a face: how far below it the points lie
_DEEP = 0.25  # of the width of a face, or of what is small of an obstacle, between nodes
_HELD = 1e-6  # of the size of a body, by which its nodes are in an obstacle
_WALK = 64  # of the length of a line: the shortest steps along it
_MARKS = 256  # of an obstacle in a body, at most
_AT_ONCE = 2_000_000  # angles
_TRIANGLES = {3: [[0, 1, 2]], 4: [[0, 1, 2], [1, 3, 2]]}  # DOLFINx's order of corners


def _lattice(corners: int) -> Floats:
    """Shares of the corners of a face in places all over it, (places, corners)."""
    s = (np.arange(8) + 0.5) / 8.0
    if corners == 2:
        return np.stack([1.0 - s, s], axis=1)
    x, y = (each.ravel() for each in np.meshgrid(s[::2], s[::2]))
    if corners == 3:
        x, y = x[x + y < 1.0], y[x + y < 1.0]
        return np.stack([1.0 - x - y, x, y], axis=1)
    return np.stack([(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y], axis=1)


_SHARES = {corners: _lattice(corners) for corners in (2, 3, 4)}


def overlap(
    one: Boundary, places: Floats, other: Boundary, other_places: Floats, *, closely: bool = False
) -> tuple[float, Floats] | None:
    """How deep one body lies in another, and where; None if it does not.

    Points are taken below the middles of the faces of both. The depth of a point is that below the
    nearest face's plane, right in convex bodies and too small in others. Looked at closely, there
    are points all over the faces: then bodies thinner than these do not cross unseen.

    Args:
        one: Outside of one body.
        places: Places of its nodes [m], shape (nodes, dim).
        other: Of the other.
        other_places: Of its nodes.
        closely: Whether to take more points.
    """
    found: list[tuple[float, Floats]] = []
    for (a, at), (b, there) in (
        ((one, places), (other, other_places)),
        ((other, other_places), (one, places)),
    ):
        low, high = there.min(axis=0), there.max(axis=0)
        middles, below = _all_over(a, at) if closely else _below(a, at)
        near = np.flatnonzero(((below > low) & (below < high)).all(axis=1))
        held = near[inside(b, there, below[near])]
        if closely:  # below a sharp edge a point may be on the other side of it
            held = held[inside(a, at, below[held])]
        normals = outward_normals(b, there) if len(held) else b.normals
        for face in held:
            # The middle of the face is deeper than the point below it, or on the other's surface.
            depth = max(_depth(b, there, normals, x[face]) for x in (below, middles))
            found.append((depth, middles[face]))
    return max(found, key=lambda entry: entry[0], default=None)


def in_obstacle(
    obstacle: Any,
    time: float,
    body: Boundary,
    places: Floats,
    *,
    held: float = _HELD,
    least: float = _DEEP,
) -> tuple[float, Floats] | None:
    """How deep an obstacle and a body lie in each other between nodes, and where; None: not.

    Sides of the faces of the body are not in the obstacle, nor what marks the obstacle in
    the body. Where nodes are in the obstacle, which is refused of those that may touch, or told of
    them, nothing is said.

    Args:
        obstacle: `impactfem.scene.obstacles.RigidObstacle`.
        time: [s].
        body: Outside of the body.
        places: Of its nodes [m], shape (nodes, dim).
        held: Depth of nodes, share of the size of the body, from which nothing is said.
        least: Depth that counts, share of what faces of curved ones may miss: of their width, or of
            what is small of the obstacle.
    """
    placed = placement(obstacle, time)
    gap = obstacle.gap(placed.back(places))[0]
    if gap.min() < -held * float(np.ptp(places, axis=0).max(initial=0.0)):
        return None
    corners = _corners(body)
    width = np.linalg.norm(np.ptp(places[corners], axis=1), axis=1)
    sides = _sides(corners[gap[corners].min(axis=1) <= width])  # others are too far
    known = np.maximum(-gap[sides], 0.0).max(axis=1, initial=0.0)
    found = _within(obstacle, placed, places[sides], known, least)
    marks = placed.moved(_marks(obstacle, placed.back(places), 0.5 * float(np.median(width))))
    low, high = places.min(axis=0), places.max(axis=0)
    marks = marks[((marks > low) & (marks < high)).all(axis=1)]
    marks = marks[:: 1 + len(marks) // _MARKS]
    parts = places[_parts(body)]
    width = np.repeat(width, len(parts) // max(1, len(body.faces)))
    for mark in marks[inside(body, places, marks)]:
        away = distances(mark[None], parts, closest_shares(mark[None], parts))[1][0]
        if (away > least * width).all() and (found is None or away.min() > found[0]):
            found = float(away.min()), mark
    return found


def _within(
    obstacle: Any, placed: Placement, sides: Floats, known: Floats, least: float
) -> tuple[float, Floats] | None:
    """How deep lines (lines, 2, dim) run through an obstacle, and where, (dim,).

    Each is walked along by its distance from the obstacle, within which there is nothing. Depths
    are beyond those known of the ends of the lines (lines,), and, as a share, beyond the least.
    """
    begin, way = sides[:, 0], sides[:, 1] - sides[:, 0]
    length = np.linalg.norm(way, axis=1)
    small = np.minimum(obstacle.features, length)
    step, at = np.maximum(0.2 * small, length / _WALK), np.zeros(len(length))
    small = small if obstacle.is_convex else length
    deepest, found = 0.0, None
    left = np.flatnonzero(length > 0.0)
    while len(left):
        over = begin[left] + (at[left] / length[left])[:, None] * way[left]
        gap = obstacle.gap(placed.back(over))[0]
        depth = -gap - known[left]
        depth[depth <= least * small[left]] = 0.0
        if depth.max() > deepest:
            deepest, found = float(depth.max()), over[np.argmax(depth)]
        at[left] += np.maximum(gap, step[left])
        left = left[at[left] < length[left]]
    return None if found is None else (deepest, found)


def _marks(obstacle: Any, places: Floats, step: float) -> Floats:
    """Places at rest that an obstacle has in it [m], (marks, dim).

    Args:
        obstacle: It.
        places: Of the body's nodes where the obstacle is at rest [m], (nodes, dim).
        step: Between marks along what is long.
    """
    dim, core, found = places.shape[1], obstacle.core, [np.zeros((0, places.shape[1]))]
    if obstacle.corners is not None:
        found.append(edges(obstacle.corners, max(step, 1e-4 * float(np.ptp(obstacle.corners)))))
    if core is not None and core.side > 0.0:
        axis = np.zeros(dim) if core.axis is None else np.asarray(core.axis, dtype=float)
        along = (places - core.center) @ axis
        count = 1 + int((along.max() - along.min()) / step)
        found.append(core.center + np.outer(np.linspace(along.min(), along.max(), count), axis))
    if obstacle.ridges is not None:
        ridges = obstacle.ridges.places
        if dim == 3:  # all along z
            z = np.arange(places[:, 2].min(), places[:, 2].max(), step)
            ridges = np.column_stack([np.repeat(ridges, len(z), axis=0), np.tile(z, len(ridges))])
        found.append(ridges)
    if dim == 3 and len(rims := obstacle.rims):
        found.append(_along(rims, places.min(axis=0), places.max(axis=0), step))
    return np.concatenate(found)


def _along(lines: Floats, low: Floats, high: Floats, step: float) -> Floats:
    """Places along the parts of lines (lines, 2, dim) in a box, (places, dim)."""
    begin, way = lines[:, 0], lines[:, 1] - lines[:, 0]
    way = np.where(way == 0.0, np.finfo(float).tiny, way)
    with np.errstate(over="ignore"):
        ends = np.sort([(low - begin) / way, (high - begin) / way], axis=0)
    first, last = np.maximum(ends[0].max(axis=1), 0.0), np.minimum(ends[1].min(axis=1), 1.0)
    some = np.flatnonzero(first < last)
    first, last, begin, way = first[some], last[some], begin[some], way[some]
    count = 1 + ((last - first) * np.linalg.norm(way, axis=1) / step).astype(np.int64)
    line = np.repeat(np.arange(len(some)), count)
    place = np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count)
    share = first[line] + (last - first)[line] * (place + 0.5) / count[line]
    return np.asarray(begin[line] + share[:, None] * way[line])


def folded(
    body: Boundary, places: Floats, within: WithinBody, depth: float = _BELOW
) -> Floats | None:
    """Where a body lies in itself, a place (dim,); None if it does not.

    Points below its faces are in it once, unless another part of it lies there too. It is asked of
    faces to which others have come close that were far along the outside: all others lie in it as
    they did.

    Args:
        body: Its outside.
        places: Of its nodes [m], shape (nodes, dim).
        within: Which of its faces may meet.
        depth: How far below the faces the points are, share of their width.
    """
    middles, below = _below(body, places, depth)
    some = within.close(middles, _width(body))
    twice = some[_turns(body, places, below[some]) > 1.5]
    return middles[twice[0]] if len(twice) else None


def inside(body: Boundary, places: Floats, points: Floats) -> Booleans:
    """Which points (points, dim) are inside a body whose nodes are at some places."""
    return np.asarray(_turns(body, places, points) > 0.5)


def _below(body: Boundary, places: Floats, depth: float = _BELOW) -> tuple[Floats, Floats]:
    """Middles of the faces and points just below them, (faces, dim) each."""
    middles = places[_corners(body)].mean(axis=1)
    return middles, middles - (depth * _width(body))[:, None] * outward_normals(body, places)


def _all_over(body: Boundary, places: Floats) -> tuple[Floats, Floats]:
    """Points all over the faces and just below them, face by face, (points, dim) each."""
    corners, normals = places[_corners(body)], outward_normals(body, places)
    shares = _SHARES[corners.shape[1]]
    over = np.einsum("sc,fcd->fsd", shares, corners)
    below = over - (_BELOW * _width(body))[:, None, None] * normals[:, None]
    return over.reshape(-1, places.shape[1]), below.reshape(-1, places.shape[1])


def outward_normals(body: Boundary, places: Floats) -> Floats:
    """Unit outward normals of faces where the body is, however it has turned, (faces, dim)."""
    side = np.sign(np.einsum("fd,fd->f", _across(body, body.points), body.normals))
    across = side[:, None] * _across(body, places)
    return np.asarray(across / np.linalg.norm(across, axis=1)[:, None])


def _across(body: Boundary, places: Floats) -> Floats:
    """Normals of faces by the order of their corners, of any length, (faces, dim)."""
    corners = places[_corners(body)]
    along = corners[:, 1:3] - corners[:, :1]
    if places.shape[1] == 2:
        return np.stack([along[:, 0, 1], -along[:, 0, 0]], axis=1)
    return np.cross(along[:, 0], along[:, 1])


def _turns(body: Boundary, places: Floats, points: Floats) -> Floats:
    """How often the surface of a body surrounds points (points, dim), (points,)."""
    found = np.zeros(len(points))
    parts, normals = _parts(body), outward_normals(body, places)
    for first in range(0, len(points), max(1, _AT_ONCE // max(1, len(parts)))):
        some = slice(first, first + max(1, _AT_ONCE // max(1, len(parts))))
        ways = places[parts][None] - points[some, None, None]  # (points, parts, corners, dim)
        turns = _angles(ways) if places.shape[1] == 2 else _solid_angles(ways)
        faces = np.repeat(np.arange(len(body.faces)), len(parts) // max(1, len(body.faces)))
        outward = np.einsum("pfd,fd->pf", ways.mean(axis=2), normals[faces])
        found[some] = (np.sign(outward) * turns).sum(axis=1)
    return found


def _angles(ways: Floats) -> Floats:
    """Shares of a full turn that segments cover, (points, segments)."""
    a, b = ways[:, :, 0], ways[:, :, 1]
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return np.asarray(np.abs(np.arctan2(cross, (a * b).sum(axis=2))) / (2.0 * np.pi))


def _solid_angles(ways: Floats) -> Floats:
    """Shares of the full sphere that triangles cover, (points, triangles)."""
    a, b, c = (ways[:, :, k] for k in range(3))
    la, lb, lc = (np.linalg.norm(way, axis=2) for way in (a, b, c))
    volume = np.einsum("pfd,pfd->pf", a, np.cross(b, c))
    ab, bc, ca = ((x * y).sum(axis=2) for x, y in ((a, b), (b, c), (c, a)))
    around = la * lb * lc + ab * lc + bc * la + ca * lb
    return np.asarray(np.abs(np.arctan2(volume, around)) / (2.0 * np.pi))


def _depth(body: Boundary, places: Floats, normals: Floats, point: Floats) -> float:
    """Distance to the nearest plane of a face [m]."""
    middles = places[_corners(body)].mean(axis=1)
    return float(np.abs(np.einsum("fd,fd->f", middles - point, normals)).min())


def _corners(body: Boundary) -> NDArray[np.int64]:
    """Corners of the faces, without nodes between them."""
    if body.points.shape[1] == 2:
        return body.faces[:, :2]
    return body.faces[:, : {3: 3, 6: 3, 4: 4, 9: 4}[body.faces.shape[1]]]


def _sides(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Ends of the straight sides of faces by their corners, (sides, 2)."""
    around = corners[:, [0, 1, 3, 2]] if corners.shape[1] == 4 else corners
    if around.shape[1] == 2:
        return around
    return np.unique(
        np.sort(np.stack([around, np.roll(around, 1, axis=1)], axis=2).reshape(-1, 2)), axis=0
    )


def _parts(body: Boundary) -> NDArray[np.int64]:
    """Segments, or triangles of the faces one after the other, by their corners."""
    corners = _corners(body)
    if body.points.shape[1] == 2:
        return corners
    return corners[:, _TRIANGLES[corners.shape[1]]].reshape(-1, 3)


def _width(body: Boundary) -> Floats:
    """Width of the faces [m], (faces,)."""
    corners = body.points[_corners(body)]
    return np.asarray(np.linalg.norm(np.ptp(corners, axis=1), axis=1))
