"""Answers of gaps between bodies of few coordinates each: A = R R^T, of which R is kept."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.rooted_kernels import full_of, islands_among, own_of, squares_of
from impactfem.contact.sparse_kernels import scaled_rows
from impactfem.contact.sparse_rows import across, rows_of, times


@dataclass(frozen=True)
class Rooted:
    """A matrix A = R R^T that is asked for products, its diagonal and parts.

    A row of R has the coordinates of the bodies on both sides of a gap, a row of A those of all
    gaps on these bodies: of many bodies R is far smaller, and A is not made.

    Attributes:
        roots: R, (rows, coordinates).
    """

    roots: csr_matrix

    __array_ufunc__ = None  # a number of NumPy times this asks __rmul__

    @classmethod
    def none(cls, size: int) -> "Rooted":
        """0, of so many rows."""
        return cls(csr_matrix((size, 0)))

    def __len__(self) -> int:
        """Number of rows."""
        return int(self.roots.shape[0])

    def __matmul__(self, forces: Floats) -> Floats:
        """A times a vector."""
        return times(self.roots, across(self.roots, forces))

    def __rmul__(self, share: float) -> "Rooted":
        """A times a number >= 0."""
        return self if share == 1.0 else Rooted(csr_matrix(np.sqrt(share) * self.roots))

    def diagonal(self) -> Floats:
        """Of A, (rows,)."""
        return np.asarray(squares_of(self.roots.indptr, self.roots.data))

    def among(self, places: Integers) -> "Rooted":
        """The part of some rows and the same columns."""
        if len(places) == len(self):
            return self
        ends, *entries = scaled_rows(*rows_of(self.roots), places, np.ones(len(places)))
        shape = len(places), self.roots.shape[1]
        return Rooted(csr_matrix((*reversed(entries), ends), shape=shape))

    def islands(self, dim: int) -> list[Integers]:
        """Pairs of so many rows that move each other: what acts on a body moves all of it."""
        ends, columns, _ = rows_of(self.roots)
        island = islands_among(ends, columns, len(self) // dim, dim, self.roots.shape[1])
        order = np.argsort(island, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(island[order])) + 1)

    def sparse(self) -> csr_matrix:
        """A as a sparse matrix."""
        return csr_matrix(self.roots @ self.roots.T)

    def full(self) -> Floats:
        """A as an array."""
        return np.asarray(full_of(*rows_of(self.roots), self.roots.shape[1]))


type Matrix = Floats | Rooted


def full(matrix: Matrix) -> Floats:
    """A matrix as an array."""
    return matrix.full() if isinstance(matrix, Rooted) else matrix


def among(matrix: Matrix, places: Integers) -> Matrix:
    """The part of a matrix that some places have; all of them stand in their order."""
    if isinstance(matrix, Rooted):
        return matrix.among(places)
    return matrix if len(places) == len(matrix) else matrix[np.ix_(places, places)]


def own_blocks(matrix: Matrix, dim: int) -> Floats:
    """Answers of pairs to their own forces, (pairs, dim, dim)."""
    pairs = len(matrix) // dim
    if not isinstance(matrix, Rooted):
        each = np.arange(pairs)
        return np.asarray(matrix.reshape(pairs, dim, pairs, dim)[each, :, each])
    return np.asarray(own_of(*rows_of(matrix.roots), pairs, dim))
