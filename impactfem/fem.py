"""DOLFINx in one place: its import, and every difference between versions 0.9 and 0.11.

Nothing else in impactfem asks for a version of DOLFINx.
"""

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ImpactError, MissingDependencyError

try:
    # mpi4py must load and initialise MPI before DOLFINx is loaded.
    from mpi4py import MPI  # isort: skip
    import basix.ufl
    import dolfinx
    import ufl
    from dolfinx import fem as dolfinx_fem
    from dolfinx import mesh as dolfinx_mesh
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

__all__ = [
    "MPI",
    "PETSc",
    "assemble_rows",
    "assemble_vector",
    "cell_nodes",
    "compile_form",
    "dolfinx_fem",
    "dolfinx_mesh",
    "facet_submesh",
    "gather",
    "mesh_from_gmsh",
    "on_root",
    "refine_edges",
    "serial_mesh",
    "set_entries",
    "sparse_matrix",
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


def assemble_vector(form: Any) -> NDArray[np.float64]:
    """Assemble a linear form; returns the entries this rank owns, shape (owned dofs,)."""
    vector = dolfinx_fem.assemble_vector(form)
    vector.scatter_reverse(dolfinx.la.InsertMode.add)
    owned = vector.index_map.size_local
    return np.array(vector.array[:owned], dtype=np.float64)


def sparse_matrix(comm: Any, local: int, size: int) -> Any:
    """Make a square PETSc matrix with ``local`` rows on this rank and ``size`` on all."""
    matrix = PETSc.Mat().create(comm)
    matrix.setSizes(((local, size), (local, size)))
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
