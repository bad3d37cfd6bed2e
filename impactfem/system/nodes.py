"""Nodes of a body's displacements on this rank, in the numbering of its space."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError
from impactfem.fem import cell_nodes, dolfinx_fem, facet_nodes
from impactfem.mesh.body import BodyMesh

_SAME = 1e-9
"""Share of a body's size below which coordinates are equal."""


@dataclass(frozen=True)
class Nodes:
    """Nodes of the displacement space; degrees of freedom are node-blocked, dim * node + direction.

    Attributes:
        space: Vector-valued Lagrange space of the geometry's degree.
        owned: Number of nodes this rank owns; they come first, ghosts after them.
        positions: Undeformed places [m], shape (owned + ghosts, dim).
        numbers: Canonical numbers, the same for any number of ranks, shape (owned + ghosts,).
        size: Largest extent of the whole body [m].
        facet_nodes: Nodes of a cell on each of its facets, shape (facets, nodes per facet).
        groups: Local cells of each material, if the body has several.
    """

    space: Any
    owned: int
    positions: Floats
    numbers: Integers
    size: float
    facet_nodes: Integers
    groups: Mapping[str, NDArray[np.int32]] = field(default_factory=dict)

    @property
    def dim(self) -> int:
        """Number of directions."""
        return int(self.positions.shape[1])

    @property
    def comm(self) -> Any:
        """MPI communicator."""
        return self.space.mesh.comm

    @property
    def same(self) -> float:
        """Distance [m] below which coordinates are equal."""
        return _SAME * self.size

    def dofs(self, nodes: Integers, direction: int) -> Integers:
        """Local degrees of freedom of nodes in one direction."""
        return self.dim * nodes.astype(np.int64) + direction

    def of_facets(self, facets: NDArray[np.int32]) -> Integers:
        """Local nodes of each local facet, shape (facets, nodes per facet)."""
        cells, places = self.cells_of(facets)
        nodes = self.space.dofmap.list[cells[:, None], self.facet_nodes[places]]
        return np.asarray(nodes, dtype=np.int64)

    def cells_of(self, facets: NDArray[np.int32]) -> tuple[Integers, Integers]:
        """A local cell of each local facet and the facet's place in it, both (facets,)."""
        topology = self.space.mesh.topology
        dim = topology.dim
        topology.create_connectivity(dim - 1, dim)
        topology.create_connectivity(dim, dim - 1)
        links = topology.connectivity(dim - 1, dim)
        cells = links.array[links.offsets[facets]].astype(np.int64)
        sides = topology.connectivity(dim, dim - 1).array.reshape(-1, len(self.facet_nodes))
        return cells, np.argmax(sides[cells] == facets[:, None], axis=1).astype(np.int64)

    def on_facets(self, facets: NDArray[np.int32]) -> Integers:
        """Owned nodes on facets (local), also where the facets lie on other ranks (collective)."""
        mesh = self.space.mesh
        dim = mesh.topology.dim - 1
        mesh.topology.create_connectivity(dim, dim + 1)
        found = dolfinx_fem.locate_dofs_topological(self.space, dim, facets, remote=True)
        return np.asarray(found[found < self.owned], dtype=np.int64)


def body_nodes(body: BodyMesh) -> Nodes:
    """Make the displacement space of a mesh and name its nodes.

    Raises:
        MeshError: A coordinate is not finite.
    """
    mesh = body.mesh
    dim = mesh.geometry.dim
    degree = body.degree
    space = dolfinx_fem.functionspace(mesh, ("Lagrange", degree, (dim,)))
    index_map = space.dofmap.index_map
    # Geometry and displacements have the same element, hence the same nodes cell by cell.
    geometry_node = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=np.int64)
    geometry_node[np.ravel(space.dofmap.list)] = np.ravel(cell_nodes(mesh))
    positions = mesh.geometry.x[geometry_node, :dim].copy()
    low = np.min(positions, axis=0, initial=np.inf)
    high = np.max(positions, axis=0, initial=-np.inf)
    lows, highs = np.array(mesh.comm.allgather((low, high))).transpose(1, 0, 2)
    size = float(np.max(highs.max(axis=0) - lows.min(axis=0)))
    if not np.isfinite(size):
        raise MeshError("the mesh has coordinates that are not finite; make the mesh anew")
    on_facets = facet_nodes(body.cell, degree)
    return Nodes(
        space,
        index_map.size_local,
        positions,
        body.numbers[geometry_node],
        size,
        on_facets,
        body.groups,
    )
