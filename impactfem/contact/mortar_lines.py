"""Overlaps of lines in the plane, seen along the carrier's continuous normals.

Each line of degree 2 is two straight parts for the matching; shape functions, places and lengths
are those of the curve. The carrier's part x(s) = x_1 + s (x_2 - x_1), 0 <= s <= 1, looks along
n(s) = n_1 + s (n_2 - n_1) with the normals of its ends, means of the lines that meet there: what
two neighbours see neither overlaps nor leaves gaps (Yang, Laursen, Meng, Int. J. Numer. Methods
Eng. 62 (2005) 1183-1225). An end y of the other part is seen at the root of the parabola

    cross(y - x(s), n(s)) = 0,

and a point x(s) of the overlap sees y_1 + e (y_2 - y_1) with a linear equation for e.
"""

from functools import cache

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.broad_phase import FACING
from impactfem.contact.line_kernels import overlaps, ways_of
from impactfem.contact.mortar_surface import Overlap, Surface, unit

_SMOOTH = float(np.cos(np.pi / 4))  # lines at a larger angle meet in an edge, with a normal each


def line_ways(side: Surface) -> Floats:
    """Directions in which the ends of the parts look, shape (lines, parts + 1, 2).

    An end shared by two lines looks along the mean of their normals, unless these are more than
    45 degrees apart.
    """
    smooth = 2.0 + 2.0 * _SMOOTH
    return np.asarray(ways_of(side.points, side.faces, side.sides, smooth))


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
    sides = tuple(
        (side.points, side.faces, side.sides, side.parts, side.places[..., 0])
        for side in (carrier, other)
    )
    factor = 0.0 if axisymmetric else thickness
    limits = reach, depth, FACING
    backs, ways = unit(other.vectors), line_ways(carrier)
    tests = carrier.faces.shape[1] if full else 2
    law = limits, _rule(points), factor, tests
    return Overlap(*overlaps(*sides, ways, backs, pairs, *law))


@cache
def _rule(points: int) -> tuple[Floats, Floats]:
    """Gauss points on [0, 1], and weights."""
    gauss, weights = np.polynomial.legendre.leggauss(points)
    return (gauss + 1.0) / 2.0, weights / 2.0
