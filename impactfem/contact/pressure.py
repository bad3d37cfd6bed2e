"""Contact pressure from the forces on contact nodes.

A nodal force is the integral of the pressure times the node's shape function. Over the integral of
the shape function (the area of the node) it gives the pressure there, but for two cases of degree
2, where that integral is zero and the forces say nothing of the pressure at the node:

- Corners of triangles. There the pressure is tested with the linear shape function of the corner,
  which is its own and half of those of the middles of its sides: force = lambda_corner + sum of
  lambda_middle / 2, over the integral of that function. It is a mean over the faces at the corner.
- Nodes on the axis of a body of revolution. They take the pressure in the middle of their face,
  from which it differs by the square of its size.

All pressures are >= 0, and zero in the middles that do not touch.
"""

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.boundary import Boundary

_SIDE, _TRIANGLE = 3, 6  # nodes of faces of degree 2: ends or corners first, then middles
_OPPOSITE = ((1, 2), (0, 2), (0, 1))  # corners beside the middles of a triangle's sides


def pressure_map(outside: Boundary, asked: Booleans, *, axisymmetric: bool) -> csr_matrix:
    """Matrix from the forces on the nodes of the outside [N] to the pressures there [Pa].

    Args:
        outside: The outside of the body.
        asked: Faces that may touch, shape (faces,); only their nodes have pressures.
        axisymmetric: Whether the first coordinate is the radius.
    """
    faces, dim = outside.faces[asked], outside.points.shape[1]
    if dim == 3 and faces.shape[1] == _TRIANGLE:
        return _of_triangles(faces, outside.areas[asked].sum(axis=1), len(outside.numbers))
    if axisymmetric and faces.shape[1] == _SIDE:
        return _of_turned_sides(faces, outside.areas[asked].sum(axis=1), outside.points[:, 0])
    return csr_matrix(diags_array(_inverse(outside.total(outside.areas, asked))))


def _of_triangles(faces: Integers, areas: Floats, count: int) -> csr_matrix:
    """The map for triangles of degree 2.

    A third of a triangle is the integral of the quadratic function of each middle and of the
    linear one of each corner.
    """
    thirds = np.bincount(faces.ravel(), np.repeat(areas / 3.0, _TRIANGLE), minlength=count)
    sides = np.concatenate(
        [faces[:, [3 + side, corner]] for side, pair in enumerate(_OPPOSITE) for corner in pair]
    )
    middle, corner = np.unique(sides, axis=0).T  # two faces share a side
    own = np.unique(faces)
    rows, columns = np.concatenate([corner, own]), np.concatenate([middle, own])
    weights = np.concatenate([np.full(len(corner), 0.5), np.ones(len(own))])
    tested = csr_matrix((weights, (rows, columns)), shape=(count, count))
    return csr_matrix(diags_array(_inverse(thirds)) @ tested)


def _of_turned_sides(faces: Integers, areas: Floats, radius: Floats) -> csr_matrix:
    """The map for sides of degree 2 that turn about the axis.

    Their functions times the radius have the integrals of Simpson's rule.
    """
    parts = radius[faces]
    parts[:, 2] = 2.0 * (parts[:, 0] + parts[:, 1])
    parts *= (areas / parts.sum(axis=1))[:, None]
    area = np.bincount(faces.ravel(), parts.ravel(), minlength=len(radius))
    taken = np.arange(len(radius))
    tolerance = 1e-9 * float(np.abs(radius).max(initial=0.0))
    for end in (0, 1):
        on = faces[np.abs(radius[faces[:, end]]) <= tolerance]
        taken[on[:, end]] = on[:, 2]
    return csr_matrix((_inverse(area)[taken], (np.arange(len(radius)), taken)))


def _inverse(area: Floats) -> Floats:
    """1 / area, 0 for nodes of no face."""
    found: Floats = np.divide(1.0, area, out=np.zeros(len(area)), where=area > 0.0)
    return found
