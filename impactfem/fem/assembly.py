"""Forms compiled and assembled by DOLFINx, and matrices of PETSc filled by hand."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.fem.loading import PETSc, dolfinx, dolfinx_fem, petsc_assembly


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
    from scipy.sparse import csr_array  # noqa: PLC0415  (slow to load; bars need no such matrix)

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
