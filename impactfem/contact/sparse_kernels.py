"""Compiled products of sparse matrices: ends of rows, columns and values, as SciPy has them."""

import numpy as np

from impactfem.compiled import compiled


@compiled
def rows_among(matrix):
    """Ends of rows, columns and values of an array."""
    count, size = matrix.shape
    ends, last = np.zeros(count + 1, dtype=np.int32), 0
    columns, values = np.empty(count * size, dtype=np.int32), np.empty(count * size)
    for i in range(count):
        for k in range(size):
            if matrix[i, k] != 0.0:
                columns[last], values[last] = k, matrix[i, k]
                last += 1
        ends[i + 1] = last
    return ends, columns[:last], values[:last]


@compiled
def times_rows(ends, columns, values, given):
    """A sparse matrix times values (columns, dim)."""
    dim = given.shape[1]
    found = np.zeros((len(ends) - 1, dim))
    for i in range(len(ends) - 1):
        for k in range(ends[i], ends[i + 1]):
            for c in range(dim):
                found[i, c] += values[k] * given[columns[k], c]
    return found


@compiled
def across_rows(ends, columns, values, given, size):
    """Its transpose, of so many rows, times values (rows, dim)."""
    dim = given.shape[1]
    found = np.zeros((size, dim))
    for i in range(len(ends) - 1):
        for k in range(ends[i], ends[i + 1]):
            for c in range(dim):
                found[columns[k], c] += values[k] * given[i, c]
    return found


@compiled
def directed_rows(ends, columns, values, rows, frames, root_ends, root_columns, roots):
    """Values, columns and ends of rows; see `impactfem.contact.sparse_rows.directed_roots`."""
    ways, dim = frames.shape[1:]
    most = 0
    for i in range(len(rows)):
        for k in range(ends[rows[i]], ends[rows[i] + 1]):
            first = columns[k] * dim
            most += root_ends[first + dim] - root_ends[first]
    found = np.zeros(ways * most)
    places = np.empty(ways * most, dtype=np.int32)
    stops = np.zeros(ways * len(rows) + 1, dtype=np.int32)
    place = np.empty(most, dtype=np.int32)  # columns of a gap
    last = 0
    for i in range(len(rows)):
        count = 0
        for k in range(ends[rows[i]], ends[rows[i] + 1]):
            first = columns[k] * dim
            for m in range(root_ends[first], root_ends[first + dim]):
                known = False
                for j in range(count):
                    known = known or place[j] == root_columns[m]
                if not known:
                    place[count] = root_columns[m]
                    count += 1
        place[:count].sort()
        for w in range(ways):
            for k in range(ends[rows[i]], ends[rows[i] + 1]):
                for c in range(dim):
                    share, row = values[k] * frames[i, w, c], columns[k] * dim + c
                    for m in range(root_ends[row], root_ends[row + 1]):
                        j = 0
                        while place[j] != root_columns[m]:
                            j += 1
                        found[last + j] += share * roots[m]
            places[last : last + count] = place[:count]
            last += count
            stops[ways * i + w + 1] = last
    return found[:last], places[:last], stops


@compiled
def row_products(given, ends, columns, values, size):
    """Rows of numbers (rows, entries) times a sparse matrix of so many columns."""
    found = np.zeros((len(given), size))
    for i in range(len(given)):
        for j in range(given.shape[1]):
            if given[i, j] != 0.0:
                for k in range(ends[j], ends[j + 1]):
                    found[i, columns[k]] += given[i, j] * values[k]
    return found


@compiled
def directed_weights(weights, rows, frames):
    """Weights (gaps, nodes) of some gaps times directions (rows, ways, dim) of each.

    Of shape (rows ways, nodes dim).
    """
    ways, dim = frames.shape[1:]
    found = np.zeros((len(rows) * ways, weights.shape[1] * dim))
    for i in range(len(rows)):
        for node in range(weights.shape[1]):
            share = weights[rows[i], node]
            if share != 0.0:
                for w in range(ways):
                    for c in range(dim):
                        found[i * ways + w, node * dim + c] = share * frames[i, w, c]
    return found


@compiled
def scaled_rows(ends, columns, values, rows, scale):
    """Ends, columns and values of some rows, times a number each, (rows,)."""
    size = 0
    for i in rows:
        size += ends[i + 1] - ends[i]
    found, places = np.empty(size), np.empty(size, dtype=np.int32)
    stops, last = np.zeros(len(rows) + 1, dtype=np.int32), 0
    for i in range(len(rows)):
        for k in range(ends[rows[i]], ends[rows[i] + 1]):
            found[last], places[last] = scale[i] * values[k], columns[k]
            last += 1
        stops[i + 1] = last
    return stops, places, found


@compiled
def spread_rows(one, two, at, numbers, count):
    """Values, columns and ends of rows of one matrix less another, put among so many others.

    Args:
        one, two: Ends, columns and values of each.
        at: Where each row stands, rising, (rows,).
        numbers: New numbers of the columns of both.
        count: Of all rows.
    """
    size = len(one[2]) + len(two[2])
    found, places = np.empty(size), np.empty(size, dtype=np.int32)
    stops, last, row = np.zeros(count + 1, dtype=np.int32), 0, 0
    for i in range(count):
        if row < len(at) and at[row] == i:
            for k in range(one[0][row], one[0][row + 1]):
                found[last], places[last] = one[2][k], numbers[0][one[1][k]]
                last += 1
            for k in range(two[0][row], two[0][row + 1]):
                found[last], places[last] = -two[2][k], numbers[1][two[1][k]]
                last += 1
            row += 1
        stops[i + 1] = last
    return found, places, stops
