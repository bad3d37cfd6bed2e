"""Whether two surfaces overlap: how deep, and where.

A node or the centre of a face is inside the other body if it lies behind the nearest point of its
surface, by the normals of the faces there weighted with their angles (Baerentzen, Aanaes, IEEE
Trans. Vis. Comput. Graph. 11 (2005) 243-253). Give whole outsides: of parts, only what lies in
their bounding box is judged, and not what lies nearest to their rim. Bodies that cross without such
a point of one in the other are not found.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from impactfem.contact.mortar_surface import Surface, unit

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_NEAREST = 12  # faces of each size looked at for each point
_SAME = 1e-9  # share of the size of the bodies that counts as nothing


def self_check(
    first: Surface, second: Surface, names: tuple[str, str], *, tolerance: float = _SAME
) -> str | None:
    """Say how deep and where two surfaces overlap, or None.

    Args:
        first: One surface.
        second: The other.
        names: Of the bodies, for the message.
        tolerance: Overlap that is allowed, as a share of the larger body's extent. (Faces of curved
            surfaces are chords: two that fit together overlap by their sagitta.)
    """
    extent = max(float(np.ptp(side.points, axis=0).max()) for side in (first, second))
    both = _deepest(first, second), _deepest(second, first)
    depth, place = both[0] if both[0][0] >= both[1][0] else both[1]
    if depth <= tolerance * extent:
        return None
    near = ", ".join(f"{x:.4g}" for x in place)
    return (
        f"bodies {names[0]!r} and {names[1]!r} overlap by {depth:.4g} m at t = 0 near ({near}); "
        "move one of them"
    )


def _deepest(side: Surface, body: Surface) -> tuple[float, Floats]:
    """Largest depth [m] of points of a surface in a body, 0 if none is inside, and the place."""
    used = np.unique(side.faces)
    centres = side.points[side.faces[:, side.parts]].mean(axis=2).reshape(-1, side.dim)
    points = np.concatenate([side.points[used], centres])
    there = body.points[np.unique(body.faces)]
    points = points[((points >= there.min(axis=0)) & (points <= there.max(axis=0))).all(axis=1)]
    if not len(points):
        return 0.0, np.zeros(side.dim)
    depth = -_signed(points, _pieces(body))
    worst = int(np.argmax(depth))
    return max(float(depth[worst]), 0.0), points[worst]


@dataclass(frozen=True)
class _Pieces:
    """Segments or triangles: corners, their angles, outward normals, whether corners are on rims.

    Attributes:
        x: Shape (pieces, corners, dim).
        normal: Shape (pieces, dim).
        angle: Shape (pieces, corners).
        rim: Shape (pieces, corners).
    """

    x: Floats
    normal: Floats
    angle: Floats
    rim: NDArray[np.bool_]


def _pieces(body: Surface) -> _Pieces:
    """Cut the flat parts of faces into triangles; segments stay."""
    parts, sides = body.faces[:, body.parts].reshape(-1, body.parts.shape[1]), body.sides
    sides = np.repeat(sides, len(body.parts))
    if body.kind == "quadrilateral":
        parts, sides = np.concatenate([parts[:, :3], parts[:, [0, 2, 3]]]), np.tile(sides, 2)
    x = body.points[parts]
    if body.dim == 2:
        t = x[:, 1] - x[:, 0]
        normal, angle = np.stack([t[:, 1], -t[:, 0]], axis=1), np.ones(parts.shape)
        rim = np.bincount(parts.ravel(), minlength=len(body.points))[parts] < 2
    else:
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        ahead, behind = (unit(np.roll(x, turn, axis=1) - x) for turn in (-1, 1))
        angle = np.arccos(np.clip(np.einsum("tcd,tcd->tc", ahead, behind), -1.0, 1.0))
        edges = np.sort(np.stack([parts, np.roll(parts, -1, axis=1)], axis=2), axis=2)
        lines, count = np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)
        rim = np.isin(parts, lines[count < 2])
    return _Pieces(x, unit(normal * sides[:, None]), angle, rim)


def _signed(points: Floats, pieces: _Pieces) -> Floats:
    """Distance of points from a surface, negative behind it; inf where the rim is nearest."""
    centre = pieces.x.mean(axis=1)
    radius = np.linalg.norm(pieces.x - centre[:, None], axis=2).max(axis=1)
    level = np.floor(np.log2(np.maximum(radius, np.finfo(np.float64).tiny)))
    near = []
    for size in np.unique(level):
        mine = np.flatnonzero(level == size)
        found = KDTree(centre[mine]).query(points, k=min(_NEAREST, len(mine)))[1]
        near.append(mine[found.reshape(len(points), -1)])
    candidates = np.concatenate(near, axis=1)
    weights = _nearest(points[:, None], pieces.x[candidates])
    way = points[:, None] - np.einsum("pkc,pkcd->pkd", weights, pieces.x[candidates])
    distance = np.linalg.norm(way, axis=2)
    first = np.arange(len(points)), distance.argmin(axis=1)
    least, nearest = distance[first], way[first]
    # Pieces that meet in the nearest point; others as near lie elsewhere.
    hit = np.linalg.norm(way - nearest[:, None], axis=2) <= _SAME * float(np.abs(pieces.x).max())
    # At a corner the angles weigh the normals; along an edge two faces count alike.
    corner = weights.argmax(axis=2)[..., None]
    at_corner = weights.max(axis=2) > 1.0 - _SAME
    angle = np.take_along_axis(pieces.angle[candidates], corner, axis=2)[..., 0]
    share = np.where(hit, np.where(at_corner, angle, np.pi), 0.0)
    normal = np.einsum("pk,pkd->pd", share, pieces.normal[candidates])
    side = np.einsum("pd,pd->p", nearest, normal)
    touched = weights > _SAME
    on_rim = np.where(touched, pieces.rim[candidates], True).all(axis=2)
    on_rim &= (touched.sum(axis=2) < pieces.x.shape[1]) & hit
    return np.where(on_rim.any(axis=1), np.inf, np.where(side < 0.0, -least, least))


def _nearest(points: Floats, x: Floats) -> Floats:
    """Weights of the corners (..., corners, dim) of segments or triangles in the nearest point."""
    if x.shape[-2] == 2:
        return _on_segment(points, x[..., 0, :], x[..., 1, :])
    a, b, way = x[..., 1, :] - x[..., 0, :], x[..., 2, :] - x[..., 0, :], points - x[..., 0, :]
    aa, ab, bb = (np.einsum("...d,...d->...", *pair) for pair in ((a, a), (a, b), (b, b)))
    aw, bw = (np.einsum("...d,...d->...", side, way) for side in (a, b))
    below = np.maximum(aa * bb - ab * ab, np.finfo(np.float64).tiny)
    s, t = (bb * aw - ab * bw) / below, (aa * bw - ab * aw) / below
    found = np.stack([1.0 - s - t, s, t], axis=-1)
    best = np.where((found >= 0.0).all(axis=-1), -1.0, np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        pair = _on_segment(points, x[..., i, :], x[..., j, :])
        edge = np.zeros_like(found)
        edge[..., i], edge[..., j] = pair[..., 0], pair[..., 1]
        way = points - np.einsum("...c,...cd->...d", edge, x)
        distance = np.einsum("...d,...d->...", way, way)
        better = distance < best
        found = np.where(better[..., None], edge, found)
        best = np.where(better, distance, best)
    return found


def _on_segment(points: Floats, first: Floats, last: Floats) -> Floats:
    t, way = last - first, points - first
    long = np.maximum(np.einsum("...d,...d->...", t, t), np.finfo(np.float64).tiny)
    s = np.clip(np.einsum("...d,...d->...", t, way) / long, 0.0, 1.0)
    return np.stack([1.0 - s, s], axis=-1)
