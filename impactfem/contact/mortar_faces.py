"""Overlaps of faces in space, in the mean plane of the carrier's face.

Faces of degree 2 are four flat parts for the matching. A part of the other surface is projected on
the plane of the carrier's part, along its normal, and clipped; the common polygon is cut into
triangles (Puso, Laursen, Comput. Methods Appl. Mech. Eng. 193 (2004) 601-629; quadratic faces:
Puso, Laursen, Solberg, 197 (2008) 555-566). Shape functions, places and areas are those of the
curved face above a point of the plane.

The rule is exact for products of shape functions of triangles with straight sides and of
parallelograms. On other quadrilaterals these are not polynomials in the plane.
"""

import numpy as np
from scipy.special import roots_jacobi

from impactfem.arrays import Floats, Integers
from impactfem.contact.broad_phase import FACING
from impactfem.contact.mortar_kernels import integrate
from impactfem.contact.mortar_surface import Overlap, Surface, unit


def face_ways(side: Surface) -> Floats:
    """Directions in which the parts of faces look, their normals, shape (faces, parts, 3)."""
    return unit(side.vectors)


def face_overlaps(
    carrier: Surface,
    other: Surface,
    pairs: Integers,
    reach: float,
    depth: Floats,
    points: int,
    *,
    full: bool = False,
) -> Overlap:
    """Integrate over the overlaps of pairs of faces.

    Args:
        carrier: The surface whose functions test.
        other: The surface opposite.
        pairs: Faces of both, shape (pairs, 2).
        reach: Largest distance of overlaps [m].
        depth: Largest penetration [m], shape (carrier's faces,).
        points: Gauss points in each direction of a triangle of an overlap.
        full: See `impactfem.contact.mortar.mortar`.
    """
    count, corners = len(pairs), (carrier.faces if full else carrier.corners).shape[1]
    found = Overlap(
        np.zeros((count, corners, carrier.faces.shape[1])),
        np.zeros((count, corners, other.faces.shape[1])),
        np.zeros((count, corners, 3)),
        np.zeros(count),
        np.zeros(count),
    )
    integrate(
        carrier.points, carrier.faces, carrier.sides, carrier.parts, carrier.places,
        carrier.vectors, other.points, other.faces, other.parts, other.places, other.vectors,
        np.ascontiguousarray(pairs), reach, depth, FACING, _triangle_rule(points),
        found.carrier, found.other, found.vectors, found.cover, found.gap,
    )  # fmt: skip
    return found


def _triangle_rule(points: int) -> Floats:
    """Gauss-Jacobi rule on the reference triangle, exact to degree 2 points - 1."""
    r, w = np.polynomial.legendre.leggauss(points)
    s, z = roots_jacobi(points, 1.0, 0.0)  # weight 1 - s: the square with one side drawn together
    r, w, s, z = (r + 1.0) / 2.0, w / 2.0, (s + 1.0) / 2.0, z / 4.0
    across, along = np.meshgrid(r, s)
    weights = np.outer(z, w)
    return np.stack([(across * (1.0 - along)).ravel(), along.ravel(), weights.ravel()], axis=1)
