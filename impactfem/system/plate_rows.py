"""What coordinates of a plate do to its vertices and contact nodes, row by row."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.spatial import cKDTree

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.system.kirchhoff import DOFS
from impactfem.system.plate_mesh import PlateMesh


def free_basis(still: Booleans, ways: list[list[Floats]]) -> tuple[csr_matrix, Booleans, Integers]:
    """Basis of free motions, which of them are deflections, and the vertex of each."""
    rows, columns, values = [], [], []
    deflected: list[bool] = []
    vertices: list[int] = []

    def add(vertex: int, entries: list[tuple[int, float]], *, moves: bool) -> None:
        for part, value in entries:
            rows.append(DOFS * vertex + part)
            columns.append(len(vertices))
            values.append(value)
        deflected.append(moves)
        vertices.append(vertex)

    for vertex, (held, along) in enumerate(zip(still.tolist(), ways, strict=True)):
        if not held:
            add(vertex, [(0, 1.0)], moves=True)
        if not along:
            add(vertex, [(1, 1.0)], moves=False)
            add(vertex, [(2, 1.0)], moves=False)
        elif np.linalg.matrix_rank(np.array(along), tol=1e-6) == 1:
            add(vertex, [(1, -along[0][1]), (2, along[0][0])], moves=False)
    shape = DOFS * len(still), len(vertices)
    basis = csr_matrix(coo_matrix((values, (rows, columns)), shape=shape))
    return basis, np.array(deflected, dtype=bool), np.array(vertices, dtype=np.int64)


def pinned(matrix: csr_matrix, led: Booleans) -> csr_matrix:
    """A matrix with ones on the diagonal, and nothing beside, where coordinates are led."""
    if not led.any():
        return matrix
    kept = diags((~led).astype(float))
    return csr_matrix(kept @ matrix @ kept + diags(led.astype(float)))


def patches(mesh: PlateMesh, touch: Integers, radius: float) -> csr_matrix:
    """Means around vertices by a Gaussian of some standard deviation [m], (touching, vertices)."""
    tree = cKDTree(mesh.points)
    near = tree.query_ball_point(mesh.points[touch], 4.0 * radius)
    counts = [len(each) for each in near]
    rows, columns = np.repeat(np.arange(len(touch)), counts), np.concatenate(near).astype(np.int64)
    away = np.linalg.norm(mesh.points[touch][rows] - mesh.points[columns], axis=1)
    weights = np.exp(-0.5 * (away / radius) ** 2) * mesh.lumped(np.ones(len(mesh.cells)))[columns]
    sums = np.bincount(rows, weights)
    shape = len(touch), len(mesh.points)
    return csr_matrix(coo_matrix((weights / sums[rows], (rows, columns)), shape=shape))
