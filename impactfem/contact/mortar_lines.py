"""Overlaps of lines in the plane, seen along the carrier's continuous normals.

Each line of degree 2 is two straight parts for the matching; shape functions, places and lengths
are those of the curve. The carrier's part x(s) = x_1 + s (x_2 - x_1), 0 <= s <= 1, looks along
n(s) = n_1 + s (n_2 - n_1) with the normals of its ends, means of the lines that meet there: what
two neighbours see neither overlaps nor leaves gaps (Yang, Laursen, Meng, Int. J. Numer. Methods
Eng. 62 (2005) 1183-1225). An end y of the other part is seen at the root of the parabola

    cross(y - x(s), n(s)) = 0,

and a point x(s) of the overlap sees y_1 + e (y_2 - y_1) with a linear equation for e.
"""

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.broad_phase import FACING
from impactfem.contact.mortar_surface import Overlap, Surface, unit

_SMOOTH = float(np.cos(np.pi / 4))  # lines at a larger angle meet in an edge, with a normal each


def line_ways(side: Surface) -> Floats:
    """Directions in which the ends of the parts look, shape (lines, parts + 1, 2).

    An end shared by two lines looks along the mean of their normals, unless these are more than
    45 degrees apart.
    """
    at = np.linspace(0.0, 1.0, side.degree + 1)
    tangents = np.einsum("qk,fkd->fqd", _line(at, side.degree)[1], side.points[side.faces])
    own = unit(np.stack([tangents[..., 1], -tangents[..., 0]], axis=-1) * side.sides[:, None, None])
    total, count = np.zeros_like(side.points), np.zeros(len(side.points))
    for end, place in ((0, 0), (1, -1)):
        np.add.at(total, side.faces[:, end], own[:, place])
        np.add.at(count, side.faces[:, end], 1.0)
    smooth = (count == 2) & (np.einsum("nd,nd->n", total, total) > 2.0 + 2.0 * _SMOOTH)
    for end, place in ((0, 0), (1, -1)):
        node = side.faces[:, end]
        own[:, place] = np.where(smooth[node, None], unit(total[node]), own[:, place])
    return own


def line_overlaps(
    carrier: Surface,
    other: Surface,
    pairs: Integers,
    reach: float,
    depth: Floats,
    points: int,
    *,
    thickness: float,
    axisymmetric: bool,
    full: bool = False,
) -> Overlap:
    """Integrate over the overlaps of pairs of lines.

    Args:
        carrier: The surface whose functions test.
        other: The surface opposite.
        pairs: Lines of both, shape (pairs, 2).
        reach: Largest distance of overlaps [m].
        depth: Largest penetration [m], shape (carrier's lines,).
        points: Gauss points of each overlap of two parts.
        thickness: Factor of lengths [m].
        axisymmetric: Whether the factor is 2 pi times the first coordinate instead.
        full: See `impactfem.contact.mortar.mortar`.
    """
    ways = line_ways(carrier)
    nodes = carrier.faces.shape[1], other.faces.shape[1]
    corners, count = nodes[0] if full else carrier.corners.shape[1], len(pairs)
    found = Overlap(
        np.zeros((count, corners, nodes[0])),
        np.zeros((count, corners, nodes[1])),
        np.zeros((count, corners, 2)),
        np.zeros(count),
        np.zeros(count),
    )
    x, y = carrier.points[carrier.faces[pairs[:, 0]]], other.points[other.faces[pairs[:, 1]]]
    n, side = ways[pairs[:, 0]], carrier.sides[pairs[:, 0]]
    limits = reach, depth[pairs[:, 0]]
    backs = unit(other.vectors)[pairs[:, 1]]
    gauss, weights = np.polynomial.legendre.leggauss(points)
    gauss, weights = (gauss + 1.0) / 2.0, weights / 2.0
    for p, (a, b) in enumerate(carrier.parts):
        places = carrier.places[p, :, 0]
        for q, (c, d) in enumerate(other.parts):
            facing = np.einsum("pd,pd->p", unit(n[:, p] + n[:, p + 1]), backs[:, q]) < -FACING
            ends = x[:, a], x[:, b], n[:, p], n[:, p + 1]
            s = [np.clip(_seen(*ends, y[:, end]), 0.0, 1.0) for end in (c, d)]
            low, high = np.minimum(*s), np.maximum(*s)
            high = np.where(facing, high, low)
            at = low[:, None] + np.outer(high - low, gauss)
            e, _ = _opposite(ends, y[:, c], y[:, d], at)
            r = places[0] + (places[1] - places[0]) * at
            there = other.places[q, :, 0]
            phi, slope = _line(r, carrier.degree)
            phi_other = _line(there[0] + (there[1] - there[0]) * e, other.degree)[0]
            tangent = np.einsum("pgk,pkd->pgd", slope, x)
            way = np.einsum("pgk,pkd->pgd", phi_other, y) - np.einsum("pgk,pkd->pgd", phi, x)
            seen = unit(n[:, p, None] + at[..., None] * (n[:, p + 1] - n[:, p])[:, None])
            gap = np.einsum("pgd,pgd->pg", way, seen) @ weights
            kept = (high > low) & (gap <= limits[0]) & (gap >= -limits[1])
            radius = np.einsum("pgk,pk->pg", phi, x[:, :, 0])
            factor = 2.0 * np.pi * radius if axisymmetric else np.full_like(radius, thickness)
            share = np.where(kept, (high - low) / len(carrier.parts), 0.0)
            dr = share[:, None] * weights * factor
            ds = dr * np.linalg.norm(tangent, axis=2)
            hats = np.concatenate([np.stack([1.0 - r, r], -1), phi[..., 2:corners]], axis=-1)
            found.carrier[:] += np.einsum("pg,pgi,pgk->pik", ds, hats, phi)
            found.other[:] += np.einsum("pg,pgi,pgk->pik", ds, hats, phi_other)
            across = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1) * side[:, None, None]
            found.vectors[:] += np.einsum("pg,pgi,pgd->pid", dr, hats, across)
            found.cover[:] += share
            found.gap[:] += share * gap
    found.gap[:] /= np.where(found.cover > 0.0, found.cover, 1.0)
    return found


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _seen(first: Floats, last: Floats, n_first: Floats, n_last: Floats, y: Floats) -> Floats:
    """Where s on a part the points y are seen, shape (pairs,)."""
    t, turn, d = last - first, n_last - n_first, y - first
    a, b, c = -_cross(t, turn), _cross(d, turn) - _cross(t, n_first), _cross(d, n_first)
    # Of both roots the one that stays finite for parallel normals.
    root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
    below = b + np.where(b < 0.0, -root, root)
    return np.asarray(-2.0 * c / np.where(below == 0.0, np.inf, below))


def _opposite(
    ends: tuple[Floats, Floats, Floats, Floats], first: Floats, last: Floats, at: Floats
) -> tuple[Floats, Floats]:
    """Where e on the other part points of a part look, and from which places, (pairs, points)."""
    x = ends[0][:, None] + at[..., None] * (ends[1] - ends[0])[:, None]
    n = ends[2][:, None] + at[..., None] * (ends[3] - ends[2])[:, None]
    below = _cross((last - first)[:, None], n)
    e = -_cross(first[:, None] - x, n) / np.where(below == 0.0, np.inf, below)
    return np.clip(e, 0.0, 1.0), x


def _line(r: Floats, degree: int) -> tuple[Floats, Floats]:
    """Shape functions of a line on [0, 1] and their slopes, shape (*r.shape, nodes)."""
    if degree == 1:
        return np.stack([1.0 - r, r], -1), np.stack([-np.ones_like(r), np.ones_like(r)], -1)
    values = [(1.0 - r) * (1.0 - 2.0 * r), r * (2.0 * r - 1.0), 4.0 * r * (1.0 - r)]
    return np.stack(values, -1), np.stack([4.0 * r - 3.0, 4.0 * r - 1.0, 4.0 - 8.0 * r], -1)
