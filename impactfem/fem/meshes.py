"""Meshes of DOLFINx: made, distributed, refined, and their cells and nodes asked for."""

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from impactfem.fem.loading import MPI, basix, dolfinx, dolfinx_gmsh, dolfinx_mesh, ufl


def mesh_from_gmsh(model: Any, comm: Any) -> tuple[Any, Any]:
    """Distribute the two-dimensional mesh of a Gmsh model.

    Args:
        model: ``gmsh.model`` on rank 0, ignored elsewhere.
        comm: MPI communicator of the mesh.

    Returns:
        The mesh and its facet tags (values are Gmsh's physical tags).
    """
    data = dolfinx_gmsh.model_to_mesh(model, comm, 0, gdim=2)
    if isinstance(data, tuple) and len(data) == 3:  # DOLFINx 0.9: (mesh, cell tags, facet tags)
        return data[0], data[2]
    return data.mesh, data.facet_tags


def serial_mesh(points: NDArray[np.float64], cells: NDArray[np.int64]) -> Any:
    """Make a mesh of triangles that this rank has for itself.

    Args:
        points: Shape (nodes, 2).
        cells: Nodes of each triangle, shape (cells, 3).
    """
    coordinates = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    return dolfinx_mesh.create_mesh(MPI.COMM_SELF, cells=cells, x=points, e=coordinates)


def num_vertices(cell: str) -> int:
    """Vertices of a cell such as "triangle"."""
    return len(basix.topology(basix.CellType[cell])[0])


def facet_vertices(cell: str) -> list[list[int]]:
    """Vertices of each facet of a cell, in DOLFINx's order."""
    return cast("list[list[int]]", basix.topology(basix.CellType[cell])[-2])


def _coordinate_element(cell: str, degree: int) -> Any:
    return basix.create_element(
        basix.ElementFamily.P,
        basix.CellType[cell],
        degree,
        basix.LagrangeVariant.equispaced,
    )


def reference_nodes(cell: str, degree: int) -> NDArray[np.float64]:
    """Nodes of the reference cell in DOLFINx's order, shape (nodes, dim)."""
    nodes: NDArray[np.float64] = _coordinate_element(cell, degree).points
    return nodes


def facet_nodes(cell: str, degree: int) -> NDArray[np.int64]:
    """Nodes on each facet of a cell, its edges and vertices included, shape (facets, nodes)."""
    return np.array(_coordinate_element(cell, degree).entity_closure_dofs[-2], dtype=np.int64)


def coordinate_basis(
    cell: str, degree: int, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shape functions of the geometry and their reference gradients.

    Args:
        cell: Kind of the cell.
        degree: Degree of the geometry.
        points: Places in the reference cell, shape (points, dim).

    Returns:
        Values, shape (points, nodes), and gradients, shape (dim, points, nodes).
    """
    table = _coordinate_element(cell, degree).tabulate(1, points)[:, :, :, 0]
    return table[0], table[1:]


def cell_quadrature(cell: str, degree: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Quadrature of the reference cell that is exact up to a degree: places and weights."""
    points, weights = basix.make_quadrature(basix.CellType[cell], degree)
    return points, weights


def point_space(mesh: Any, degree: int, shape: tuple[int, ...]) -> Any:
    """Space of functions that have values at the points of a quadrature only.

    Args:
        mesh: The mesh.
        degree: Of the quadrature; the points are those of `cell_quadrature`.
        shape: Of the values.
    """
    cell = mesh.topology.cell_type.name
    element = basix.ufl.quadrature_element(cell, value_shape=shape, degree=degree)
    return dolfinx.fem.functionspace(mesh, element)


def from_gmsh_order(cell: str, nodes: int) -> NDArray[np.int64]:
    """The order p with ``dolfinx_nodes[i] = gmsh_nodes[p[i]]`` for cells of so many nodes."""
    kind = dolfinx.cpp.mesh.to_type(cell)
    return np.array(dolfinx_gmsh.cell_perm_array(kind, nodes), dtype=np.int64)


def global_mesh(
    comm: Any, points: NDArray[np.float64], cells: NDArray[np.int64], cell: str, degree: int
) -> Any:
    """Distribute a mesh that rank 0 has; neighbouring ranks see the cells behind shared facets.

    Args:
        comm: MPI communicator.
        points: Nodes on rank 0, shape (nodes, dim); shape (0, dim) elsewhere.
        cells: Nodes of each cell, shape (cells, nodes per cell); shape (0, ...) elsewhere.
        cell: Kind of the cells.
        degree: Degree of the geometry.
    """
    dim = points.shape[1]
    coordinates = basix.ufl.element(
        "Lagrange", cell, degree, basix.LagrangeVariant.equispaced, shape=(dim,)
    )
    mode = dolfinx_mesh.GhostMode.shared_facet
    try:
        partitioner = dolfinx_mesh.create_cell_partitioner(mode, 2)
    except TypeError:  # DOLFINx 0.9
        partitioner = dolfinx_mesh.create_cell_partitioner(mode)
    return dolfinx_mesh.create_mesh(
        comm, cells=cells, x=points, e=ufl.Mesh(coordinates), partitioner=partitioner
    )


def moved_mesh(mesh: Any, points: NDArray[np.float64]) -> Any:
    """The same elements, on the same ranks, with nodes elsewhere.

    Args:
        mesh: A mesh of `global_mesh`.
        points: Of all local nodes, shape (nodes, dim).
    """
    own = mesh.geometry
    index, places = own.index_map(), np.ascontiguousarray(points)
    numbers = own.input_global_indices
    element = own.cmaps[0] if hasattr(own, "cmaps") else own.cmap  # DOLFINx 0.9
    # `dolfinx.mesh.create_geometry` of 0.9 hands over an element that its own C++ does not take.
    whole: Any = dolfinx.cpp.mesh.Geometry_float64
    geometry = whole(index, cell_nodes(mesh), element._cpp_object, places, numbers)  # noqa: SLF001
    kinds: Any = [mesh.topology._cpp_object, geometry]  # noqa: SLF001
    made = dolfinx.cpp.mesh.Mesh_float64(mesh.comm, *kinds)
    return dolfinx_mesh.Mesh(made, ufl.Mesh(mesh.ufl_domain().ufl_coordinate_element()))


def node_vector(mesh: Any) -> Any:
    """Make a vector of one number, at first 0, for each node of the geometry, ghosts included."""
    return dolfinx.la.vector(mesh.geometry.index_map(), 1, dtype=np.float64)


def input_numbers(mesh: Any) -> NDArray[np.int64]:
    """Number of each local node of a mesh in the ``points`` of `global_mesh`, shape (nodes,)."""
    return np.array(mesh.geometry.input_global_indices, dtype=np.int64)


def refine_edges(mesh: Any, edges: NDArray[np.int32]) -> Any:
    """Bisect some edges of a serial mesh of triangles, and more so that it stays conforming."""
    mesh.topology.create_entities(1)
    return dolfinx_mesh.refine(mesh, edges)[0]


def facet_submesh(mesh: Any, facets: NDArray[np.int32]) -> tuple[Any, Any]:
    """Make a mesh of some facets, with what `compile_form` needs to couple both.

    Args:
        mesh: Parent mesh.
        facets: Local indices of the facets, ghosts included.

    Returns:
        The submesh and its entity maps.
    """
    dim = mesh.topology.dim - 1
    submesh, to_parent = dolfinx_mesh.create_submesh(mesh, dim, facets)[:2]
    if hasattr(dolfinx_mesh, "EntityMap"):  # DOLFINx >= 0.10
        return submesh, [to_parent]
    index_map = mesh.topology.index_map(dim)
    to_child = np.full(index_map.size_local + index_map.num_ghosts, -1, dtype=np.int32)
    to_child[to_parent] = np.arange(len(to_parent), dtype=np.int32)
    return submesh, {submesh: to_child}


def cell_nodes(mesh: Any) -> NDArray[np.int32]:
    """Geometry nodes of each cell of this rank (ghosts included), shape (cells, nodes)."""
    geometry = mesh.geometry
    nodes: NDArray[np.int32] = (
        geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap  # DOLFINx 0.9
    )
    return nodes


def is_simplex(mesh: Any) -> bool:
    """Whether the cells of a mesh are intervals, triangles or tetrahedra."""
    return mesh.topology.cell_type.name in {"interval", "triangle", "tetrahedron"}


def tag_facets(mesh: Any, facets: NDArray[np.int32]) -> Any:
    """Tag facets (local, increasing) with 1, for the measure of a surface."""
    dim = mesh.topology.dim - 1
    mesh.topology.create_connectivity(dim, dim + 1)
    return dolfinx_mesh.meshtags(mesh, dim, facets, np.ones(len(facets), dtype=np.int32))
