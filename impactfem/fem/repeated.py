"""A matrix that is assembled again and again: its pattern is found once."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Integers
from impactfem.fem.loading import PETSc, dolfinx_fem
from impactfem.fem.ranks import gather


class RepeatedMatrix:
    """A form plus a multiple of a fixed matrix, as one PETSc matrix (AIJ) that keeps its pattern.

    What ranks contribute is added in their order, as in `impactfem.fem.assemble_petsc`.

    Attributes:
        matrix: The PETSc matrix; on one rank it shares the values that are written here.
    """

    def __init__(self, form: Any, fixed: Any, held: NDArray[np.bool_]) -> None:
        """Find the pattern (collective).

        Args:
            form: Compiled bilinear form on one space.
            fixed: PETSc matrix (AIJ) of the same rows and columns.
            held: Which of the owned rows, and of the same columns, are those of the unit matrix.
        """
        self._form = form
        self._cells = dolfinx_fem.create_matrix(form)
        first, last = fixed.getOwnershipRange()
        size = fixed.getSize()[0]
        own = _places(self._cells, int(form.function_spaces[0].dofmap.bs), size)
        starts, columns, values = fixed.getValuesCSR()
        rows = np.repeat(np.arange(last - first, dtype=np.int64), np.diff(starts))
        given = rows * size + columns
        every = np.union1d(own, given)
        self._at = np.searchsorted(every, own)
        self._fixed = np.zeros(len(every))
        self._fixed[np.searchsorted(every, given)] = values
        rows, columns = every // size, every % size
        whole = gather(fixed.comm.tompi4py(), held)
        self._held = np.flatnonzero(held[rows] | whole[columns])
        self._unit = np.flatnonzero(held[rows] & (rows + first == columns))
        starts = np.searchsorted(rows, np.arange(last - first + 1))
        self._values = np.zeros(len(every))
        self._csr = (starts.astype(PETSc.IntType), columns.astype(PETSc.IntType), self._values)
        self._shares = fixed.comm.size == 1
        make = PETSc.Mat().createAIJWithArrays if self._shares else PETSc.Mat().createAIJ
        sizes = ((last - first, size), (last - first, size))
        self.matrix = make(sizes, csr=self._csr, bsize=fixed.getBlockSize(), comm=fixed.comm)

    def assemble(self, factor: float) -> None:
        """Assemble the form as it is now and add a multiple of the fixed matrix (collective)."""
        cells, values = self._cells, self._values
        cells.data[:] = 0.0
        dolfinx_fem.assemble_matrix(cells, self._form)
        if not self._shares:  # a message of one rank to itself costs up to ms on a busy machine
            cells.scatter_reverse()
        np.multiply(self._fixed, factor, out=values)
        values[self._at] += cells.data[: len(self._at)]
        values[self._held] = 0.0
        values[self._unit] = 1.0
        if not self._shares:
            self.matrix.setValuesCSR(*self._csr)
        self.matrix.assemble()
        self.matrix.stateIncrease()

    def destroy(self) -> None:
        """Free the PETSc matrix."""
        self.matrix.destroy()


def _places(matrix: Any, block: int, size: int) -> Integers:
    """Owned row times ``size`` plus global column of the owned entries, in their order."""
    row_map, column_map = matrix.index_map(0), matrix.index_map(1)
    starts = matrix.indptr[: row_map.size_local + 1]
    stop = int(starts[-1])
    rows = np.repeat(np.arange(row_map.size_local, dtype=np.int64), np.diff(starts))
    columns = column_map.local_to_global(matrix.indices[:stop].astype(np.int32)).astype(np.int64)
    inside = np.arange(block, dtype=np.int64)
    rows = block * rows[:, None, None] + inside[None, :, None]
    columns = block * columns[:, None, None] + inside[None, None, :]
    found: Integers = (rows * size + columns).ravel()
    return found
