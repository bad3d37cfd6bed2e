"""Whether two bodies lie in each other: points just below the faces of one, inside the other.

Near touch the gaps of a pair say so; where bodies lie deeply in each other, or cross, no faces are
opposite. A point is inside a closed surface if the surface surrounds it once: the angles in the
plane, or solid angles in space (Van Oosterom, Strackee, IEEE Trans. Biomed. Eng. 30 (1983)
125-126), that the faces cover as seen from there, signed by their outward normals, sum to a full
turn.
"""

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.boundary import Boundary
from impactfem.contact.self_pairs import WithinBody

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

HALF_FACE = 0.5
"""Depth below faces, share of their width, at which a body in contact with itself is wrong."""

_BELOW = 0.02  # of the width of a face: how far below it the points lie
_AT_ONCE = 2_000_000  # angles
_TRIANGLES = {3: [[0, 1, 2]], 4: [[0, 1, 2], [1, 3, 2]]}  # DOLFINx's order of corners


def overlap(
    one: Boundary, places: Floats, other: Boundary, other_places: Floats
) -> tuple[float, Floats] | None:
    """How deep one body lies in another, and where; None if it does not.

    Points are taken below the middles of the faces of both. The depth of a point is that below the
    nearest face's plane, right in convex bodies and too small in others.

    Args:
        one: Outside of one body.
        places: Places of its nodes [m], shape (nodes, dim).
        other: Of the other.
        other_places: Of its nodes.
    """
    found: list[tuple[float, Floats]] = []
    for (a, at), (b, there) in (
        ((one, places), (other, other_places)),
        ((other, other_places), (one, places)),
    ):
        low, high = there.min(axis=0), there.max(axis=0)
        middles, below = _below(a, at)
        near = np.flatnonzero(((below > low) & (below < high)).all(axis=1))
        held = near[inside(b, there, below[near])]
        normals = outward_normals(b, there) if len(held) else b.normals
        for face in held:
            # The middle of the face is deeper than the point below it, or on the other's surface.
            depth = max(_depth(b, there, normals, x[face]) for x in (below, middles))
            found.append((depth, middles[face]))
    return max(found, key=lambda entry: entry[0], default=None)


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
