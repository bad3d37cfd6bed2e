"""What a body's mesh says about itself: heights of its cells, its boundary and the nodes on it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.mesh.body import BodyMesh

Floats = NDArray[np.float64]
Integers = NDArray[np.int32]

_CHUNK = 100_000  # cells whose Jacobians are held at a time


def smallest_heights(body: BodyMesh) -> Floats:
    """Smallest height of each local cell, for estimates of the largest stable time step.

    For simplices it is the least distance of a vertex from the opposite facet; for quadrilaterals
    and hexahedra that of opposite facets, from the Jacobian at the nodes and in the middle. Of
    curved cells it is the least over these places.

    Returns:
        Heights [m], ghosts included, shape (local cells,).
    """
    simplex = body.cell in {"triangle", "tetrahedron"}
    nodes = fem.reference_nodes(body.cell, body.degree)
    places = nodes.mean(axis=0, keepdims=True)
    if not (simplex and body.degree == 1):
        places = np.concatenate([nodes, places])
    _, gradients = fem.coordinate_basis(body.cell, body.degree, places)
    cells = fem.cell_nodes(body.mesh)
    x = body.mesh.geometry.x[:, : body.gdim]
    heights = np.empty(len(cells))
    for start in range(0, len(cells), _CHUNK):
        some = slice(start, start + _CHUNK)
        jacobians = np.einsum("cna,bpn->cpab", x[cells[some]], gradients)
        slopes = np.linalg.inv(jacobians)  # rows: gradients of the reference coordinates
        if simplex:
            last = -slopes.sum(axis=2, keepdims=True)
            slopes = np.concatenate([slopes, last], axis=2)
        heights[some] = 1.0 / np.linalg.norm(slopes, axis=3).max(axis=(1, 2))
    return heights


def boundary_facets(body: BodyMesh) -> Integers:
    """Facets of the boundary that this rank owns, with a name or without, shape (facets,)."""
    topology = body.mesh.topology
    topology.create_connectivity(topology.dim - 1, topology.dim)
    found: Integers = fem.dolfinx_mesh.exterior_facet_indices(topology)
    return np.sort(found)


def facet_nodes(body: BodyMesh, facets: Integers) -> Integers:
    """Local geometry nodes of some facets, vertices first, shape (facets, nodes per facet)."""
    topology = body.mesh.topology
    dim = topology.dim
    topology.create_connectivity(dim - 1, dim)
    topology.create_connectivity(dim, dim - 1)
    to_cells, to_facets = topology.connectivity(dim - 1, dim), topology.connectivity(dim, dim - 1)
    cells = to_cells.array[to_cells.offsets[facets]]
    table = fem.facet_nodes(body.cell, body.degree)
    sides = to_facets.array.reshape(-1, len(table))[cells] == np.asarray(facets)[:, None]
    nodes: Integers = np.take_along_axis(
        fem.cell_nodes(body.mesh)[cells], table[sides.argmax(axis=1)], axis=1
    )
    return nodes


def nodes_on(body: BodyMesh, facets: Integers) -> NDArray[np.bool_]:
    """Which local nodes lie on facets that any rank names (collective).

    A rank can own a node of the boundary without having a facet there.

    Args:
        body: The mesh.
        facets: Local facets that this rank contributes.

    Returns:
        Shape (local nodes,), the same for a node on every rank that has it.
    """
    marks: Any = fem.node_vector(body.mesh)
    marks.array[np.unique(facet_nodes(body, facets))] = 1.0
    marks.scatter_reverse(fem.ADD)
    marks.scatter_forward()
    return np.asarray(marks.array > 0.0)
