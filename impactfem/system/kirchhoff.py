"""Stiffness of the discrete Kirchhoff triangle: w and both slopes at each vertex.

The slopes of an element are quadratic. At vertices they are degrees of freedom; in the middle of an
edge of length l along s, from vertex i to j, they follow from w as a cubic along the edge and from
the slopes of its ends, whose normal part is linear:

    s . b = 3 (w_j - w_i) / (2 l) - s . (b_i + b_j) / 4,   n . b = n . (b_i + b_j) / 2.

So K = T^T K_b T with the bending form K_b on quadratic slopes and a sparse T. Source: J.-L. Batoz,
K.-J. Bathe, L.-W. Ho, Int. J. Numer. Meth. Eng. 15 (1980) 1771-1812.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from impactfem import fem
from impactfem.fem import dolfinx_fem
from impactfem.forms.plate import bending

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

DOFS = 3
"""Degrees of freedom of a vertex: w [m] and its slopes along x and y."""

_EDGES = ((1, 2), (0, 2), (0, 1))  # vertices of the edges of a triangle, as Basix numbers them


def triangle_stiffness(
    points: Floats, cells: Integers, rigidity: float, poisson_ratio: float, shear: float = 0.0
) -> csr_matrix:
    """Stiffness of a plate that nothing holds, (3 vertices, 3 vertices) [N/m, N, N m].

    Degree of freedom 3 v is w of vertex v, 3 v + 1 and 3 v + 2 are its slopes.

    Args:
        points: Vertices [m], (vertices, 2).
        cells: Triangles, (cells, 3).
        rigidity: D = E t^3 / (12 (1 - nu^2)) [N m].
        poisson_ratio: nu.
        shear: D over the stiffness to shear [m^2]; 0 of a plate without shear.
    """
    mesh = fem.serial_mesh(points, cells)
    space = dolfinx_fem.functionspace(mesh, ("Lagrange", 2, (2,)))
    number = (dolfinx_fem.Constant(mesh, value) for value in (rigidity, poisson_ratio))
    matrix = fem.assemble_petsc(fem.compile_form(bending(space, *number)))
    starts, columns, values = matrix.getValuesCSR()
    plain = csr_matrix((values.copy(), columns.copy(), starts.copy()), shape=matrix.getSize())
    matrix.destroy()
    ours = fem.input_numbers(mesh)[fem.cell_nodes(mesh)]
    nodes = np.asarray(space.dofmap.list, dtype=np.int64)
    edge_map = _edge_map(points, np.asarray(ours), nodes, shear)
    bent = csr_matrix(edge_map.T @ plain @ edge_map)
    return bent + _sheared(points, cells, rigidity, shear) if shear else bent


def _sheared(points: Floats, cells: Integers, rigidity: float, shear: float) -> csr_matrix:
    """Stiffness to shear: strains along edges, at corners by both edges there, linear between."""
    corners = points[cells]
    along, ways, lengths = _way_missed(corners)
    soft = _softness(lengths, shear)[:, :, None]
    strain = along / (1.0 + soft) * soft
    own = _freedoms(cells)
    at = np.empty((len(cells), 3, 2, 3 * DOFS))
    for corner in range(3):
        beside = [k for k, pair in enumerate(_EDGES) if corner in pair]
        at[:, corner] = np.linalg.solve(ways[:, beside], strain[:, beside])
    edges = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.abs(np.linalg.det(edges))
    linear = (np.ones((3, 3)) + np.eye(3)) / 12.0
    each = np.einsum("c,ij,ciad,cjae->cde", rigidity / shear * area, linear, at, at)
    size = DOFS * len(points)
    return _assembled(each, own, own, (size, size))


def _softness(lengths: Floats, shear: float) -> Floats:
    """Phi of edges: 12 D / (shear stiffness l^2), (cells, 3)."""
    return 12.0 * shear / lengths**2


def _way_missed(corners: Floats) -> tuple[Floats, Floats, Floats]:
    """(w_j - w_i) / l - s . (b_i + b_j) / 2 of edges by degrees of freedom, (cells, 3, 9).

    Also their directions, (cells, 3, 2), and lengths [m], (cells, 3).
    """
    found = np.zeros((len(corners), 3, 3 * DOFS))
    first, last = (corners[:, [pair[k] for pair in _EDGES]] for k in (0, 1))
    lengths = np.linalg.norm(last - first, axis=2)
    ways = (last - first) / lengths[:, :, None]
    for k, (one, two) in enumerate(_EDGES):
        found[:, k, DOFS * two] = 1.0 / lengths[:, k]
        found[:, k, DOFS * one] = -1.0 / lengths[:, k]
        for end in (one, two):
            found[:, k, DOFS * end + 1 : DOFS * end + 3] = -0.5 * ways[:, k]
    return found, ways, lengths


def curvatures(points: Floats, cells: Integers, shear: float = 0.0) -> csr_matrix:
    """Curvatures b_xx, b_yy and b_xy + b_yx of vertices by degrees of freedom, 3 rows each [1/m].

    Those of the triangles at a vertex, weighted by their areas.

    Args:
        points: Vertices [m], (vertices, 2).
        cells: Triangles, (cells, 3).
        shear: See `triangle_stiffness`.
    """
    corners = points[cells]
    edges = (corners[:, 1:] - corners[:, :1]).swapaxes(1, 2)
    inverse, area = np.linalg.inv(edges), 0.5 * np.abs(np.linalg.det(edges))
    # Gradients of the linear functions of the corners.
    rising = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
    around = np.bincount(cells.ravel(), np.repeat(area, 3), len(points))
    slopes, count = _slopes(corners, shear), len(cells)
    bent = np.empty((count, 3, 3, 3 * DOFS))  # of triangles at their corners
    for corner in range(3):
        # Derivatives there of the quadratic functions of vertices, then of the edges' middles.
        shapes = np.zeros((count, 6, 2))
        shapes[:, :3] = -rising
        shapes[:, corner] = 3.0 * rising[:, corner]
        for k, pair in enumerate(_EDGES):
            if corner in pair:
                shapes[:, 3 + k] = 4.0 * rising[:, sum(pair) - corner]
        each = np.einsum("cna,cnbd->cabd", shapes, slopes)
        each *= (area / around[cells[:, corner]])[:, None, None, None]
        bent[:, corner] = np.stack(
            [each[:, 0, 0], each[:, 1, 1], each[:, 0, 1] + each[:, 1, 0]], axis=1
        )
    own = _freedoms(cells)
    size = DOFS * len(points)
    return _assembled(bent.reshape(count, 9, -1), own, own, (size, size))


def _edge_map(points: Floats, cells: Integers, nodes: Integers, shear: float) -> csr_matrix:
    """T: quadratic slopes, by their nodes (cells, 6), of the degrees of freedom of vertices."""
    slopes = _slopes(points[cells], shear)
    _, first = np.unique(nodes, return_index=True)  # neighbours have the same ones
    chosen = np.zeros(nodes.size, dtype=bool)
    chosen[first] = True
    slopes *= chosen.reshape(*nodes.shape, 1, 1)
    rows = (2 * nodes[:, :, None] + np.arange(2)).reshape(len(cells), -1)
    shape = 2 * (int(nodes.max()) + 1), DOFS * len(points)
    return _assembled(slopes.reshape(len(cells), 12, -1), rows, _freedoms(cells), shape)


def _slopes(corners: Floats, shear: float) -> Floats:
    """Slopes at the nodes of elements by their degrees of freedom, (cells, 6, 2, 9).

    Args:
        corners: (cells, 3, 2).
        shear: See `triangle_stiffness`.
    """
    found = np.zeros((len(corners), 6, 2, 3 * DOFS))
    for corner in range(3):
        for axis in range(2):
            found[:, corner, axis, DOFS * corner + 1 + axis] = 1.0
    along, ways, lengths = _way_missed(corners)
    more = 1.5 / (1.0 + _softness(lengths, shear))[:, :, None] * along
    for k, (one, two) in enumerate(_EDGES):
        mean = 0.5 * (found[:, one] + found[:, two])
        found[:, 3 + k] = mean + ways[:, k, :, None] * more[:, k, None]
    return found


def _freedoms(cells: Integers) -> Integers:
    """Degrees of freedom of the corners of elements, (cells, 9)."""
    return (DOFS * cells[:, :, None] + np.arange(DOFS)).reshape(len(cells), -1)


def _assembled(
    values: Floats, rows: Integers, columns: Integers, shape: tuple[int, int]
) -> csr_matrix:
    """Sum of matrices of elements (cells, m, n), at rows (cells, m) and columns (cells, n)."""
    row, column = (
        np.broadcast_to(each, values.shape) for each in (rows[:, :, None], columns[:, None])
    )
    found = csr_matrix(coo_matrix((values.ravel(), (row.ravel(), column.ravel())), shape=shape))
    found.eliminate_zeros()
    return found
