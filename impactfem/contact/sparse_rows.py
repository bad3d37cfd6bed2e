"""Products of sparse matrices that change in every layer, without what SciPy asks of each."""

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.sparse_kernels import across_rows, directed_rows, times_rows


def rows_of(matrix: csr_matrix) -> tuple[Integers, Integers, Floats]:
    """Ends of rows, columns and values, as kernels take them."""
    return matrix.indptr, matrix.indices, matrix.data


def times(matrix: Floats | csr_matrix, values: Floats) -> Floats:
    """A matrix (rows, columns) times values (columns,) or (columns, dim)."""
    if isinstance(matrix, np.ndarray):
        return np.asarray(matrix @ values)
    flat = np.ascontiguousarray(values if values.ndim > 1 else values[:, None])
    found = times_rows(*rows_of(matrix), flat)
    return np.asarray(found.reshape(matrix.shape[0], *values.shape[1:]))


def across(matrix: Floats | csr_matrix, values: Floats) -> Floats:
    """Its transpose times values (rows,) or (rows, dim)."""
    if isinstance(matrix, np.ndarray):
        return np.asarray(matrix.T @ values)
    flat = np.ascontiguousarray(values if values.ndim > 1 else values[:, None])
    found = across_rows(*rows_of(matrix), flat, matrix.shape[1])
    return np.asarray(found.reshape(matrix.shape[1], *values.shape[1:]))


def below(parts: list[csr_matrix], columns: int) -> csr_matrix:
    """Matrices one below the other."""
    before = np.cumsum([0, *(part.nnz for part in parts)])
    ends = [part.indptr[1:] + first for part, first in zip(parts, before, strict=False)]
    entries = [np.concatenate([getattr(part, n) for part in parts]) for n in ("data", "indices")]
    rows = sum(part.shape[0] for part in parts)
    return csr_matrix((*entries, np.concatenate([[0], *ends])), shape=(rows, columns))


def directed_roots(
    weights: csr_matrix, rows: Integers, frames: Floats, roots: csr_matrix
) -> csr_matrix:
    """Roots of the answers of some gaps, a row for each direction, columns in rising order.

    Args:
        weights: Of contact nodes in all gaps, (gaps, nodes).
        rows: The gaps.
        frames: Directions of each, (rows, ways, dim).
        roots: Of the nodes, (nodes dim, coordinates).
    """
    entries = directed_rows(*rows_of(weights), rows, np.ascontiguousarray(frames), *rows_of(roots))
    found = csr_matrix(entries, shape=(len(rows) * frames.shape[1], roots.shape[1]))
    found.has_sorted_indices = True
    return found
