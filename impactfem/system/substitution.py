"""Forward and backward substitution for several right-hand sides at once."""

import numpy as np

from impactfem.compiled import compiled

TOGETHER = 8
"""Right-hand sides; fewer are padded to as many, so that each rounds as it would alone."""


@compiled
def substitute(starts, rows, values, diagonal, x):
    """Solve L D L^T x = b in place for `TOGETHER` right-hand sides, shape (size, 8).

    Unsigned indices and eight named numbers keep the inner loops in registers: three times faster.

    Args:
        starts, rows, values: L by columns, the unit diagonal first; the first two unsigned.
        diagonal: D.
        x: b, then x.
    """
    size, one = np.uint64(len(diagonal)), np.uint64(1)
    for column in range(size):
        j = np.uint64(column)
        a, b, c, d = x[j, 0], x[j, 1], x[j, 2], x[j, 3]
        e, f, g, h = x[j, 4], x[j, 5], x[j, 6], x[j, 7]
        for k in range(starts[j] + one, starts[j + one]):
            i, entry = np.uint64(rows[k]), values[k]
            x[i, 0] -= entry * a
            x[i, 1] -= entry * b
            x[i, 2] -= entry * c
            x[i, 3] -= entry * d
            x[i, 4] -= entry * e
            x[i, 5] -= entry * f
            x[i, 6] -= entry * g
            x[i, 7] -= entry * h
    for column in range(size):
        j = size - one - np.uint64(column)
        s = diagonal[j]
        a, b, c, d = x[j, 0] / s, x[j, 1] / s, x[j, 2] / s, x[j, 3] / s
        e, f, g, h = x[j, 4] / s, x[j, 5] / s, x[j, 6] / s, x[j, 7] / s
        for k in range(starts[j] + one, starts[j + one]):
            i, entry = np.uint64(rows[k]), values[k]
            a -= entry * x[i, 0]
            b -= entry * x[i, 1]
            c -= entry * x[i, 2]
            d -= entry * x[i, 3]
            e -= entry * x[i, 4]
            f -= entry * x[i, 5]
            g -= entry * x[i, 6]
            h -= entry * x[i, 7]
        x[j, 0], x[j, 1], x[j, 2], x[j, 3] = a, b, c, d
        x[j, 4], x[j, 5], x[j, 6], x[j, 7] = e, f, g, h
