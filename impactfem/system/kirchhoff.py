"""Stiffness of the discrete Kirchhoff triangle: w and both slopes at each vertex.

The slopes of an element are quadratic. At vertices they are degrees of freedom; in the middle of an
edge of length l along s, from vertex i to j, they follow from w as a cubic along the edge and from
the slopes of its ends, whose normal part is linear:

    s . b = 3 (w_j - w_i) / (2 l) - s . (b_i + b_j) / 4,   n . b = n . (b_i + b_j) / 2.

So K = T^T K_b T with the bending form K_b on quadratic slopes and a sparse T. Source: J.-L. Batoz,
K.-J. Bathe, L.-W. Ho, Int. J. Numer. Meth. Eng. 15 (1980) 1771-1812.
"""

from typing import Any

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


def kirchhoff_stiffness(
    points: Floats, cells: Integers, rigidity: float, poisson_ratio: float
) -> csr_matrix:
    """Stiffness of a plate that nothing holds, (3 vertices, 3 vertices) [N/m, N, N m].

    Degree of freedom 3 v is w of vertex v, 3 v + 1 and 3 v + 2 are its slopes.

    Args:
        points: Vertices [m], (vertices, 2).
        cells: Triangles, (cells, 3).
        rigidity: D = E t^3 / (12 (1 - nu^2)) [N m].
        poisson_ratio: nu.
    """
    mesh = fem.serial_mesh(points, cells)
    space = dolfinx_fem.functionspace(mesh, ("Lagrange", 2, (2,)))
    number = (dolfinx_fem.Constant(mesh, value) for value in (rigidity, poisson_ratio))
    matrix = fem.assemble_petsc(fem.compile_form(bending(space, *number)))
    starts, columns, values = matrix.getValuesCSR()
    plain = csr_matrix((values.copy(), columns.copy(), starts.copy()), shape=matrix.getSize())
    matrix.destroy()
    ours = fem.input_numbers(mesh)[fem.cell_nodes(mesh)]
    edge_map = _edge_map(points, np.asarray(ours), np.asarray(space.dofmap.list, dtype=np.int64))
    return csr_matrix(edge_map.T @ plain @ edge_map)


def _edge_map(points: Floats, cells: Integers, nodes: Integers) -> csr_matrix:
    """T: quadratic slopes, by their nodes (cells, 6), of the degrees of freedom of vertices."""
    rows: list[Any] = []
    columns: list[Any] = []
    values: list[Any] = []

    def put(row: Integers, column: Integers, value: Floats) -> None:
        rows.append(row)
        columns.append(column)
        values.append(np.broadcast_to(value, row.shape))

    at, first = np.unique(nodes[:, :3], return_index=True)
    vertex = cells.ravel()[first]
    for axis in range(2):
        put(2 * at + axis, DOFS * vertex + 1 + axis, np.ones(1))
    ends = np.concatenate([cells[:, pair] for pair in _EDGES])
    at, first = np.unique(nodes[:, 3:].T, return_index=True)
    one, two = ends[first].T
    way = points[two] - points[one]
    length = np.linalg.norm(way, axis=1)
    s = way / length[:, None]
    for axis in range(2):
        row = 2 * at + axis
        put(row, DOFS * two, 1.5 / length * s[:, axis])
        put(row, DOFS * one, -1.5 / length * s[:, axis])
        for other in range(2):
            share = 0.5 * float(axis == other) - 0.75 * s[:, axis] * s[:, other]
            for end in (one, two):
                put(row, DOFS * end + 1 + other, share)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    shape = 2 * (int(nodes.max()) + 1), DOFS * len(points)
    return csr_matrix(coo_matrix(entries, shape=shape))


def curvatures(points: Floats, cells: Integers) -> csr_matrix:
    """Curvatures w_xx, w_yy and 2 w_xy of vertices by degrees of freedom, 3 rows each [1/m].

    Those of the triangles at a vertex, weighted by their areas.

    Args:
        points: Vertices [m], (vertices, 2).
        cells: Triangles, (cells, 3).
    """
    count = len(cells)
    nodes = 6 * np.arange(count)[:, None] + np.arange(6)  # slopes of each triangle of its own
    corners = points[cells]
    edges = corners[:, 1:] - corners[:, :1]
    inverse = np.linalg.inv(edges)  # columns are gradients of barycentric coordinates 1 and 2
    rising = np.stack([-inverse.sum(axis=2), inverse[:, :, 0], inverse[:, :, 1]], axis=1)
    area = 0.5 * np.abs(np.linalg.det(edges))
    around = np.bincount(cells.ravel(), np.repeat(area, 3), len(points))
    rows: list[Any] = []
    columns: list[Any] = []
    values: list[Any] = []
    for corner in range(3):
        # Derivatives there of the quadratic functions of vertices, then of the edges' middles.
        slope = [(3.0 if k == corner else -1.0) * rising[:, k] for k in range(3)]
        for a, b in _EDGES:
            share = 4.0 * float(corner in (a, b))
            slope.append(share * rising[:, b if a == corner else a])
        weight = (area / around[cells[:, corner]])[:, None]
        for node in range(6):
            across = weight * slope[node]
            for row, axis, part in ((0, 0, 0), (1, 1, 1), (2, 0, 1), (2, 1, 0)):
                rows.append(3 * cells[:, corner] + row)
                columns.append(2 * nodes[:, node] + axis)
                values.append(across[:, part])
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    shape = 3 * len(points), 12 * count
    return csr_matrix(coo_matrix(entries, shape=shape)) @ _edge_map(points, cells, nodes)
