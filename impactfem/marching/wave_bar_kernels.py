"""Compiled layers of one bar whose ends are pushed: its waves, one line a layer and end.

A wave that arrives at an end with the velocity a leaves it, pushed by F, with

    a + 2 F / Z,   and the end moves with   a + F / Z,   Z = rho A c.

An end that is held leaves what keeps its velocity. Lines keep mean and mean square of what leaves,
so that momentum and energy are right to rounding with any layer (`wave_kernels.line`).
"""

import numpy as np

from impactfem.compiled import compiled
from impactfem.marching.row_wave_kernels import _arriving, _breaks
from impactfem.marching.wave_kernels import line, measure


@compiled
def arriving_means(mean, rise, share, first, last, means):
    """Mean of what arrives at each end in a part of the layer to come.

    Args:
        mean, rise: Lines that left the ends in the layers of a transit before [m/s], the last one
            in the last column, (2, layers + 1).
        share: What the transit has beyond whole layers.
        first, last: Where the part begins and ends, as shares of the layer.
        means: Filled, (2,).
    """
    breaks = np.empty(4)
    count = _breaks(share, 0.0, breaks)
    for end in range(2):
        means[end] = 0.0
        for q in range(count - 1):
            x, y = max(breaks[q], first), min(breaks[q + 1], last)
            if x >= y:
                continue
            middle = 0.5 * (x + y)
            a = _arriving(mean[1 - end], rise[1 - end], 1, share, middle, x)
            b = _arriving(mean[1 - end], rise[1 - end], 1, share, middle, y)
            means[end] += 0.5 * (y - x) * (a + b)
        means[end] /= last - first


@compiled
def end_layer(mean, rise, share, dt, borders, pushed, held, speeds):
    """Let the waves of a layer leave: the lines move on by one layer.

    Args:
        mean, rise: As in `arriving_means`; the oldest line is dropped, a new one comes last.
        share: See there.
        dt: Layer [s].
        borders: Of the steps in which the layer went, as shares of it: 0, ..., 1, (steps + 1,).
        pushed: 2 F / Z of each end in each step [m/s], (steps, 2).
        held: Whether the far end is.
        speeds: Of the far end if it is held, at the borders [m/s], (steps + 1,).
    """
    breaks = np.empty(4)
    count = _breaks(share, 0.0, breaks)
    steps = len(pushed)
    out = np.empty((steps + count, 4))
    last = mean.shape[1] - 1
    found = np.empty((2, 2))
    for end in range(2):
        rows = 0
        for k in range(steps):
            begin, span = borders[k], borders[k + 1] - borders[k]
            for q in range(count - 1):
                x, y = max(breaks[q], begin), min(breaks[q + 1], borders[k + 1])
                if x >= y:
                    continue
                middle = 0.5 * (x + y)
                a = _arriving(mean[1 - end], rise[1 - end], 1, share, middle, x)
                b = _arriving(mean[1 - end], rise[1 - end], 1, share, middle, y)
                if end == 1 and held:
                    slope = (speeds[k + 1] - speeds[k]) / span
                    a = 2.0 * (speeds[k] + (x - begin) * slope) - a
                    b = 2.0 * (speeds[k] + (y - begin) * slope) - b
                out[rows, 0], out[rows, 1] = x * dt, (y - x) * dt
                out[rows, 2], out[rows, 3] = a + pushed[k, end], b + pushed[k, end]
                rows += 1
        found[end, 0], found[end, 1] = line(out, rows, dt)
    for end in range(2):
        mean[end, :last] = mean[end, 1:].copy()
        rise[end, :last] = rise[end, 1:].copy()
        mean[end, last], rise[end, last] = found[end, 0], found[end, 1]


@compiled
def integrals(mean, rise, share, dt, transit, place, nodes, displacement, rate):
    """Kinetic and elastic energy over Z, mean displacement and mean velocity; fields at nodes.

    Args:
        mean, rise: As in `arriving_means`.
        share: See there.
        dt: Layer [s].
        transit: L / c [s].
        place: Displacement of the near end [m].
        nodes: x / c of the nodes [s]; none: fields are not formed.
        displacement, rate: Filled.
    """
    breaks = np.empty(4)
    pieces = _breaks(share, 0.0, breaks)
    cells = mean.shape[1] - 1
    lag, late = np.empty(2, dtype=np.int64), np.empty(2)
    lag[0], late[0] = cells + 1, 1.0 - share
    lag[1], late[1] = cells, -share
    skip = 0 if pieces == 3 else 1
    return measure(
        mean[0], rise[0], mean[1], rise[1], cells + 1, 0, breaks[:pieces], lag[skip:], late[skip:],
        np.zeros((1, 2, 2)), np.zeros(1), dt, transit, 1.0, place, nodes, displacement, rate,
    )  # fmt: skip
