"""DOLFINx in one place: its import, and every difference between versions 0.9 and 0.11.

Nothing else in impactfem asks for a version of DOLFINx.
"""

import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from impactfem.errors import ImpactError, MissingDependencyError
from impactfem.first_use import compiling

# h5py's own HDF5 library must load before that of DOLFINx, which it would take for its own.
import h5py  # isort: skip  # noqa: F401

try:
    # mpi4py must load and initialise MPI before DOLFINx is loaded.
    from mpi4py import MPI  # isort: skip
    import basix.ufl
    import dolfinx
    import dolfinx.jit
    import ffcx.compiler
    import ufl
    from dolfinx import fem as dolfinx_fem
    from dolfinx import mesh as dolfinx_mesh
    from dolfinx.fem import petsc as petsc_assembly
    from petsc4py import PETSc as _PETSc
except ImportError as error:
    raise MissingDependencyError(
        f"DOLFINx, PETSc or mpi4py cannot be imported ({error}). Remedy: "
        "`pip install impactfem[fem]`, or on Debian 13 `apt-get install python3-dolfinx`; "
        "`impactfem doctor` says what is missing."
    ) from error

try:  # DOLFINx >= 0.10
    from dolfinx.io import gmsh as dolfinx_gmsh
except ImportError:  # DOLFINx 0.9
    from dolfinx.io import gmshio as dolfinx_gmsh

# The type stubs of petsc4py, where there are any, refuse NumPy arrays and mpi4py communicators.
PETSc: Any = _PETSc


def form_cache() -> Path:
    """Folder in which FFCx keeps compiled forms."""
    return Path(dolfinx.jit.get_options()["cache_dir"])


def _announced(compile_objects: Callable[..., Any]) -> Callable[..., Any]:
    """FFCx's compiler, which is not called for forms that its cache holds, with an announcement."""

    @functools.wraps(compile_objects)
    def announcing(*arguments: Any, **settings: Any) -> Any:
        compiling("finite-element forms", form_cache())
        return compile_objects(*arguments, **settings)

    return announcing


# FFCx tells nobody when it compiles: its log can only be had together with all of its details.
ffcx.compiler.compile_ufl_objects = _announced(ffcx.compiler.compile_ufl_objects)

ADD = dolfinx.la.InsertMode.add
"""Adds in `scatter_reverse` what ghosts hold to their owners."""

__all__ = [
    "ADD",
    "MPI",
    "PETSc",
    "assemble_petsc",
    "assemble_rows",
    "assemble_vector",
    "cell_nodes",
    "cell_quadrature",
    "compile_form",
    "coordinate_basis",
    "dolfinx_fem",
    "dolfinx_mesh",
    "facet_nodes",
    "facet_submesh",
    "facet_vertices",
    "form_cache",
    "from_gmsh_order",
    "gather",
    "global_mesh",
    "input_numbers",
    "is_simplex",
    "mesh_from_gmsh",
    "node_vector",
    "num_vertices",
    "on_root",
    "products_in_order",
    "raise_together",
    "rectangular_matrix",
    "reference_nodes",
    "refine_edges",
    "serial_mesh",
    "set_entries",
    "sparse_matrix",
    "tag_facets",
    "ufl",
]


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


def compile_form(form: Any, entity_maps: Any = None) -> Any:
    """Compile a UFL form (cached on disk by FFCx after the first time)."""
    return dolfinx_fem.form(form, entity_maps=entity_maps)


def assemble_rows(form: Any) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Assemble a bilinear form into the entries of the rows this rank owns.

    Returns:
        Global rows, global columns and values, each of shape (entries,).
    """
    matrix = dolfinx_fem.assemble_matrix(form)
    matrix.scatter_reverse()
    rows_map, columns_map = matrix.index_map(0), matrix.index_map(1)
    starts = matrix.indptr[: rows_map.size_local + 1]
    stop = int(starts[-1])
    rows = rows_map.local_range[0] + np.repeat(np.arange(rows_map.size_local), np.diff(starts))
    columns = columns_map.local_to_global(matrix.indices[:stop].astype(np.int32))
    return rows.astype(np.int64), columns.astype(np.int64), matrix.data[:stop].copy()


def assemble_petsc(form: Any) -> Any:
    """Assemble a compiled bilinear form into a PETSc matrix (AIJ).

    PETSc itself adds what other ranks contribute in the order in which it comes; here it is that of
    the ranks, so that a run can be repeated bit by bit. (DOLFINx has no such matrices for two
    spaces of different block sizes. Those of this package couple nodes with cells: each entry comes
    from one cell, hence from one rank.)
    """
    sizes = {int(space.dofmap.bs) for space in form.function_spaces}
    if len(sizes) > 1:
        matrix = petsc_assembly.assemble_matrix(form)
        matrix.assemble()
        return matrix
    block = sizes.pop()
    matrix = dolfinx_fem.assemble_matrix(form)
    matrix.scatter_reverse()
    row_map, column_map = matrix.index_map(0), matrix.index_map(1)
    owned = row_map.size_local
    starts = matrix.indptr[: owned + 1].astype(PETSc.IntType)
    stop = int(starts[-1])
    columns = column_map.local_to_global(matrix.indices[:stop].astype(np.int32))
    values = matrix.data[: stop * block * block]
    shape = tuple(
        (part.size_local * block, part.size_global * block) for part in (row_map, column_map)
    )
    comm = row_map.comm
    del matrix
    if block > 1:
        csr = (starts, columns.astype(PETSc.IntType), values)
        blocked = PETSc.Mat().createBAIJ(shape, block, csr=csr, comm=comm)
        del csr, columns, values
        blocked.assemble()
        return blocked.convert("aij")
    rows = csr_array((values, columns, starts), shape=(owned, column_map.size_global))
    rows.sort_indices()
    csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
    found = PETSc.Mat().createAIJ(shape, csr=csr, comm=comm)
    found.assemble()
    return found


def assemble_vector(form: Any) -> NDArray[np.float64]:
    """Assemble a linear form; returns the entries this rank owns, shape (owned dofs,)."""
    vector = dolfinx_fem.assemble_vector(form)
    vector.scatter_reverse(dolfinx.la.InsertMode.add)
    owned = vector.index_map.size_local * vector.block_size
    return np.array(vector.array[:owned], dtype=np.float64)


@contextmanager
def products_in_order(comm: Any) -> Iterator[None]:
    """Have PETSc form P^T A P in an order that does not depend on when messages come.

    On three and more ranks only one of its ways does; multigrid takes it too, where it is set up in
    this context. So runs can be repeated bit by bit.

    Args:
        comm: Communicator of the matrices; on one rank nothing is changed.
    """
    options, name = PETSc.Options(), "matptap_via"
    if comm.size == 1 or options.hasName(name):
        yield
        return
    options[name] = "allatonce"
    try:
        yield
    finally:
        options.delValue(name)


def sparse_matrix(comm: Any, local: int, size: int) -> Any:
    """Make a square PETSc matrix with ``local`` rows on this rank and ``size`` on all."""
    return rectangular_matrix(comm, (local, size), (local, size))


def rectangular_matrix(comm: Any, rows: tuple[int, int], columns: tuple[int, int]) -> Any:
    """Make a PETSc matrix; rows and columns are counted on this rank and on all."""
    matrix = PETSc.Mat().create(comm)
    matrix.setSizes((rows, columns))
    matrix.setType(PETSc.Mat.Type.AIJ)
    matrix.setUp()  # entries are hashed until the first assembly: no preallocation is needed
    return matrix


def set_entries(
    matrix: Any,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    values: NDArray[np.float64],
    *,
    add: bool,
) -> None:
    """Add or insert entries, which may lie in rows of other ranks, and assemble (collective).

    Args:
        matrix: From `sparse_matrix`.
        rows: Global rows, shape (entries,); in any order.
        columns: Global columns.
        values: Values.
        add: Whether to add to what is there; otherwise to replace it.
    """
    order = np.argsort(rows, kind="stable")
    present, counts = np.unique(rows, return_counts=True)
    matrix.setValuesIJV(
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        columns[order].astype(np.int32),
        values[order],
        addv=PETSc.InsertMode.ADD_VALUES if add else PETSc.InsertMode.INSERT_VALUES,
        rowmap=present.astype(np.int32),
    )
    matrix.assemble()


def gather(comm: Any, values: Sequence[Any] | NDArray[Any]) -> NDArray[Any]:
    """Concatenate the arrays of all ranks, in rank order, on every rank."""
    return np.concatenate(comm.allgather(np.asarray(values)))


def raise_together(comm: Any, error: ImpactError | None) -> None:
    """Raise the error of the lowest rank that has one on all ranks (collective).

    Raises:
        ImpactError: That error, as it is.
    """
    if not comm.allreduce(error is not None, op=MPI.LOR):
        return
    raise next(found for found in comm.allgather(error) if found is not None)


def on_root[T](comm: Any, action: Callable[[], T]) -> T:
    """Run ``action`` on rank 0 and give every rank its answer, or its error.

    Raises:
        ImpactError: The error of rank 0, on all ranks, so that none waits for ever.
    """
    answer: T | None = None
    failure: ImpactError | None = None
    if comm.rank == 0:
        try:
            answer = action()
        except ImpactError as error:
            failure = error
    answer, failure = comm.bcast((answer, failure), root=0)
    if failure is not None:
        raise failure
    return cast("T", answer)
