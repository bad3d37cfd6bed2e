"""Structured test bodies of every kind of cell, with node numbers that know no ranks."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.fem import dolfinx_fem, dolfinx_mesh

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class TestBody:
    """A mesh with surfaces, and the nodes that this rank owns as unknowns."""

    __test__ = False

    mesh: Any
    surfaces: dict[str, NDArray[np.int32]]
    numbers: Indices
    owned: Indices  # canonical numbers
    places: Floats  # of the owned nodes


def grid(
    comm: Any,
    counts: tuple[int, ...],
    low: tuple[float, ...],
    high: tuple[float, ...],
    *,
    simplex: bool = False,
    degree: int = 1,
    bend: Callable[[Floats], Floats] | None = None,
) -> TestBody:
    """A block of cells whose sides are named left, right, bottom, top, back, front; then bent."""
    dim = len(counts)
    if simplex:
        cell = "triangle" if dim == 2 else "tetrahedron"
        corners = np.array(
            [
                np.cumsum([np.zeros(dim), *np.eye(dim)[list(order)]], axis=0)
                for order in permutations(range(dim))
            ]
        )
        reference = fem.reference_nodes(cell, degree)
        weights = np.column_stack([1 - reference.sum(axis=1), reference])
        inside = np.einsum("nv,cvd->cnd", weights, corners)
    else:
        cell = "quadrilateral" if dim == 2 else "hexahedron"
        inside = fem.reference_nodes(cell, degree)[None]
    origins = np.array(list(product(*map(range, counts))), dtype=float)
    nodes = np.rint(2 * (origins[:, None, None] + inside)).astype(int)
    nodes = nodes.reshape(-1, *inside.shape[1:])
    points, cells = np.unique(nodes.reshape(-1, dim), axis=0, return_inverse=True)
    cells = cells.reshape(nodes.shape[:2]).astype(np.int64)
    shape = np.asarray(low) + points / (2 * np.asarray(counts)) * np.subtract(high, low)
    # Each node sees another number than its place in the grid says.
    shuffle = np.random.default_rng(7).permutation(len(points))
    shape, cells = shape[np.argsort(shuffle)], shuffle[cells]
    if comm.rank:
        shape, cells = np.empty((0, dim)), np.empty((0, cells.shape[1]), dtype=np.int64)
    mesh = fem.global_mesh(comm, shape, cells, cell, degree)
    names = ("left", "right"), ("bottom", "top"), ("back", "front")
    surfaces = {}
    for axis in range(dim):
        for name, value in zip(names[axis], (low[axis], high[axis]), strict=True):
            mesh.topology.create_connectivity(dim - 1, dim)
            surfaces[name] = dolfinx_mesh.locate_entities_boundary(
                mesh, dim - 1, lambda x, a=axis, v=value: np.isclose(x[a], v)
            )
    if bend is not None:
        mesh.geometry.x[:, :dim] = bend(mesh.geometry.x[:, :dim])
    numbers = fem.input_numbers(mesh)
    space = dolfinx_fem.functionspace(mesh, ("Lagrange", degree))
    local = np.empty(space.dofmap.index_map.size_local + space.dofmap.index_map.num_ghosts, int)
    local[space.dofmap.list] = fem.cell_nodes(mesh)
    own = local[: space.dofmap.index_map.size_local]
    return TestBody(mesh, surfaces, numbers, numbers[own], mesh.geometry.x[own, :dim].copy())


def round_off(center: tuple[float, ...], radius: float) -> Callable[[Floats], Floats]:
    """Bend the square or cube [-1, 1]^dim into a disc or ball."""

    def bend(x: Floats) -> Floats:
        squares = x**2
        out = np.empty_like(x)
        for i in range(x.shape[1]):
            others = [squares[:, j] for j in range(x.shape[1]) if j != i]
            factor = 1 - sum(others) / 2
            if len(others) == 2:
                factor = factor + others[0] * others[1] / 3
            out[:, i] = x[:, i] * np.sqrt(factor)
        return np.asarray(center) + radius * out

    return bend
