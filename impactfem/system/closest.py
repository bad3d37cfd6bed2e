"""Closest points of lines and flat faces in space, all points against all of them."""

import numpy as np

from impactfem.arrays import Floats

_TINY = np.finfo(float).tiny


def closest_shares(points: Floats, simplices: Floats) -> Floats:
    """Weights of the corners that give the closest points, >= 0 with the sum 1.

    Source: Ericson, Real-time collision detection (2005), section 5.1.

    Args:
        points: Shape (points, dim).
        simplices: Points, lines or triangles by their corners, shape (simplices, 1 to 3, dim).

    Returns:
        Shape (points, simplices, corners).
    """
    corners = simplices.shape[1]
    if corners == 1:
        return np.ones((len(points), len(simplices), 1))
    if corners == 2:
        return _on_lines(points, simplices)
    return _on_triangles(points, simplices)


def shares_inside(point: Floats, simplices: Floats) -> Floats:
    """Weights of the corners that give a place, below 0 where it lies beyond their side.

    Args:
        point: Shape (dim,).
        simplices: Triangles in the plane or tetrahedra, flat ones too, (simplices, dim + 1, dim).

    Returns:
        Shape (simplices, corners).
    """
    edges = (simplices[:, 1:] - simplices[:, :1]).swapaxes(1, 2)
    others = (np.linalg.pinv(edges) @ (point - simplices[:, 0])[:, :, None])[:, :, 0]
    return np.hstack([1.0 - others.sum(axis=1, keepdims=True), others])


def _on_lines(points: Floats, lines: Floats) -> Floats:
    along = lines[:, 1] - lines[:, 0]
    square = np.maximum(np.einsum("sd,sd->s", along, along), _TINY)
    arm = points[:, None] - lines[None, :, 0]
    share = np.clip(np.einsum("psd,sd->ps", arm, along) / square, 0.0, 1.0)
    return np.stack([1.0 - share, share], axis=-1)


def _on_triangles(points: Floats, triangles: Floats) -> Floats:
    """The foot of the normal where it lies inside; else the closest point of the three sides."""
    one, two = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    arm = points[:, None] - triangles[None, :, 0]
    aa, ab, bb = (np.einsum("sd,sd->s", *pair) for pair in ((one, one), (one, two), (two, two)))
    pa, pb = (np.einsum("psd,sd->ps", arm, side) for side in (one, two))
    area = np.maximum(aa * bb - ab * ab, _TINY)
    v, w = (bb * pa - ab * pb) / area, (aa * pb - ab * pa) / area
    inside = np.stack([1.0 - v - w, v, w], axis=-1)
    best, least = inside, np.where((inside >= 0.0).all(axis=-1), -1.0, np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        sides = triangles[:, (a, b)]
        share = _on_lines(points, sides)
        away = points[:, None] - np.einsum("psc,scd->psd", share, sides)
        square = np.einsum("psd,psd->ps", away, away)
        whole = np.zeros_like(inside)
        whole[..., (a, b)] = share
        closer = square < least
        best = np.where(closer[..., None], whole, best)
        least = np.where(closer, square, least)
    return best


def distances(points: Floats, simplices: Floats, shares: Floats) -> tuple[Floats, Floats]:
    """Arms from closest points to the points, (points, simplices, dim), and their lengths."""
    arms = points[:, None] - np.einsum("psc,scd->psd", shares, simplices)
    return arms, np.asarray(np.sqrt(np.einsum("psd,psd->ps", arms, arms)))
