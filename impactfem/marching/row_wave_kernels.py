"""Compiled loop of a row of bars whose waves are followed: exact but for one line a layer and end.

As `impactfem.marching.wave_kernels`, with a wave from either end of each bar. What happens where
two bars meet follows from w = B - A, the difference of the waves that arrive there: the gap changes
by w in flight; while closed the bars press with -w / (1 / Z_a + 1 / Z_b).
"""

import numpy as np

from impactfem.compiled import compiled
from impactfem.marching.wave_kernels import SNAP, cross, line, measure


@compiled
def _arriving(mean, rise, cell, share, middle, x):
    """Wave at a time, from the lines that left the other end a transit before.

    Args:
        mean, rise: Lines, by layer.
        cell: Layer from which it comes if the transit were whole layers.
        share: What the transit has beyond whole layers.
        middle: A time in the same piece, and x: the time, as shares of a layer.
    """
    if middle < share:
        return mean[cell - 1] + (2.0 * (x - share) + 1.0) * rise[cell - 1]
    return mean[cell] + (2.0 * (x - share) - 1.0) * rise[cell]


@compiled
def _breaks(one, other, out):
    """Fill 0, both shares in order and 1 into ``out`` without repeating; return their number."""
    out[0] = 0.0
    count = 1
    for share in (min(one, other), max(one, other)):
        if share > out[count - 1]:
            out[count] = share
            count += 1
    out[count] = 1.0
    return count + 1


@compiled
def _leave(segments, count, rows, reflect, turn, dt, out, mean, rise, cell):
    """Line of a wave that leaves an end: what arrives times reflect, and turn times w in contact.

    Args:
        segments, count: Rows as in `cross`, of w.
        rows: Arriving wave at both ends of each, shape (rows, 2).
        out: Room for as many rows.
        mean, rise: Filled at ``cell``.

    Returns:
        Sum of the means of the wave that arrives and of that which leaves.
    """
    arriving = 0.0
    for k in range(count):
        arriving += 0.5 * segments[k, 1] * (rows[k, 0] + rows[k, 1]) / dt
        turned = turn * segments[k, 4]
        out[k, 0], out[k, 1] = segments[k, 0], segments[k, 1]
        out[k, 2] = reflect * rows[k, 0] + turned * segments[k, 2]
        out[k, 3] = reflect * rows[k, 1] + turned * segments[k, 3]
    mean[cell], rise[cell] = line(out, count, dt)
    return arriving + mean[cell]


@compiled
def conserving_row(
    mean, rise, past, cells, shares, transits, impedance, wall, clamped, starts, start_place, dt,
    layers, nodes, ends, gap, force, kinetic, elastic, middle, momentum, kept, displacement, rate,
):  # fmt: skip
    """March the waves of bars in a row through common layers.

    Args:
        mean, rise: Leaving waves [m/s] by layer, shape (2 bars, past + layers), near end and far
            end of each bar in turn; the ``past`` layers before t = 0 are given.
        past: Layers before t = 0.
        cells, shares: Transit of each bar: whole layers, at least one, and the share beyond.
        transits: L / c of each bar [s].
        impedance: rho A c of each bar [kg/s].
        wall: Whether a rigid wall stops the first bar.
        clamped: Whether the far end of the last bar is held.
        starts: Gap of each pair at t = 0 [m].
        start_place: Displacement of the near ends at t = 0 [m]; becomes the final one.
        dt: Layer [s].
        layers: Number of layers.
        nodes: x / c of the nodes, bar after bar [s].
        ends: First node of each bar, and the number of nodes.
        gap: [m], (layers + 1, pairs), filled.
        force: Mean over the layer [N], (layers, pairs), filled.
        kinetic, elastic: [J], (layers + 1, bars), filled.
        middle, momentum: Mean displacement [m] and velocity [m/s], (layers + 1, bars), filled.
        kept: Levels at which fields are stored, increasing.
        displacement, rate: Fields at those levels, filled from row 1 on.
    """
    bars = len(cells)
    pairs = len(starts)
    first = 0 if wall else 1  # joint of the first pair
    segments = np.empty((32, 5))
    out = np.empty((32, 4))
    near = np.empty((32, 2))  # what arrives at the end before a joint, and behind it
    far = np.empty((32, 2))
    breaks = np.empty(4)
    nothing = np.zeros((1, 2, 2))
    none = np.zeros(1)
    now = starts.copy()
    closed = np.zeros(pairs, dtype=np.bool_)
    speed = np.abs(mean[:, :past]).max() + np.abs(rise[:, :past]).max()
    reach = now.copy()
    lag = np.empty(2, dtype=np.int64)
    late = np.empty(2)
    slot = 0
    for m in range(-1, layers):
        for j in range(bars + 1 if m >= 0 else 0):
            a, b = j - 1, j
            count = _breaks(
                shares[a] if a >= 0 else 0.0, shares[b] if b < bars else 0.0, breaks
            )  # fmt: skip
            c = j - first
            paired = 0 <= c < pairs
            rows = 0
            push = 0.0
            weight = 0.0  # 2 Z_b / (Z_a + Z_b)
            if a >= 0 and b < bars:
                weight = 2.0 * impedance[b] / (impedance[a] + impedance[b])
            for q in range(count - 1):
                x, y = breaks[q], breaks[q + 1]
                inside = 0.5 * (x + y)
                a0 = a1 = b0 = b1 = 0.0
                if a >= 0:
                    d = m - cells[a] + past
                    a0 = _arriving(mean[2 * a], rise[2 * a], d, shares[a], inside, x)
                    a1 = _arriving(mean[2 * a], rise[2 * a], d, shares[a], inside, y)
                if b < bars:
                    d = m - cells[b] + past
                    b0 = _arriving(mean[2 * b + 1], rise[2 * b + 1], d, shares[b], inside, x)
                    b1 = _arriving(mean[2 * b + 1], rise[2 * b + 1], d, shares[b], inside, y)
                before = rows
                if paired:
                    now[c], closed[c], impulse, rows = cross(
                        x * dt, y * dt, SNAP * dt, b0 - a0, b1 - a1, now[c], closed[c],
                        2.0 * speed, reach[c], segments, rows,
                    )  # fmt: skip
                    push += impulse
                else:
                    segments[rows, 0], segments[rows, 1] = x * dt, (y - x) * dt
                    segments[rows, 2:] = 0.0
                    rows += 1
                for k in range(before, rows):
                    s = (segments[k, 0] / dt - x) / (y - x)
                    e = s + segments[k, 1] / (dt * (y - x))
                    near[k, 0], near[k, 1] = a0 + s * (a1 - a0), a0 + e * (a1 - a0)
                    far[k, 0], far[k, 1] = b0 + s * (b1 - b0), b0 + e * (b1 - b0)
            if paired:
                reach[c] = max(reach[c], now[c])
                gap[m + 1, c] = now[c]
                pressed = 0.5 * impedance[a] * weight if a >= 0 else impedance[b]
                force[m, c] = max(0.0, -push * pressed / dt)
            if a >= 0:
                reflect = -1.0 if clamped and j == bars else 1.0
                _leave(segments, rows, near, reflect, weight, dt, out,
                       mean[2 * a + 1], rise[2 * a + 1], m + past)  # fmt: skip
            if b < bars:
                turn = weight - 2.0 if a >= 0 else -2.0
                both = _leave(segments, rows, far, 1.0, turn, dt, out,
                              mean[2 * b], rise[2 * b], m + past)  # fmt: skip
                start_place[b] += 0.5 * dt * both
        if m < 0:
            gap[0] = now
        is_kept = slot < len(kept) and kept[slot] == m + 1
        for k in range(bars):
            pieces = _breaks(shares[k], 0.0, breaks)
            lag[0], late[0] = cells[k] + 1, 1.0 - shares[k]
            lag[1], late[1] = cells[k], -shares[k]
            skip = 0 if pieces == 3 else 1
            low, high = (ends[k], ends[k + 1]) if is_kept else (0, 0)
            energy = measure(
                mean[2 * k], rise[2 * k], mean[2 * k + 1], rise[2 * k + 1], past, m + 1,
                breaks[:pieces], lag[skip:], late[skip:], nothing, none, dt, transits[k], 1.0,
                start_place[k], nodes[low:high], displacement[slot * is_kept, low:high],
                rate[slot * is_kept, low:high],
            )  # fmt: skip
            kinetic[m + 1, k] = impedance[k] * energy[0]
            elastic[m + 1, k] = impedance[k] * energy[1]
            middle[m + 1, k], momentum[m + 1, k] = energy[2], energy[3]
        slot += is_kept
