"""Compiled loop over the layers of a bar whose waves are followed: exact but for one line a layer.

Both waves of u_tt = c^2 u_xx - p run with c whatever the step is, and what happens at the wall in
a layer follows in closed form from the wave that arrives in it (`impactfem.exact.waves`). The
leaving wave is kept as one straight line a layer.
"""

import math

import numpy as np

from impactfem.compiled import compiled

_VALUE = 64 * float(np.finfo(float).eps)  # waves below this share of the largest are 0
_REACH = 16 * float(np.finfo(float).eps)  # penetration below this share of the gap is rounding
SNAP = 1e-9
"""Events closer than this share of a layer to an end of a piece happen there: rounding then
cannot move them from one layer into the next, whatever the number of contacts."""


@compiled
def _release(width, a, b, speed):
    """Time after which w, from a to b, becomes positive (inf if not), and w then."""
    if max(a, b) <= _VALUE * speed:
        return math.inf, b
    return (0.0, a) if a >= 0.0 else (width * a / (a - b), 0.0)


@compiled
def _impact(width, a, b, gap, least):
    """Time after which the gap falls below ``least`` (inf if not), and w then."""
    low = gap + 0.5 * width * (a + b)
    if a < 0.0 < b:
        low = gap - 0.5 * width * a * a / (b - a)
    if low >= least:
        return math.inf, b
    slope = (b - a) / width
    speed = math.sqrt(max(a * a - 2.0 * slope * gap, 0.0))
    return (2.0 * gap / (speed - a) if a < 0.0 else (a + speed) / -slope), -speed


@compiled
def cross(start, end, snap, a, b, gap, contact, speed, reach, out, count):
    """Let a linear piece of the arriving wave, from a to b, meet the wall.

    Args:
        start, end: Of the piece in its layer [s].
        snap: [s].
        gap, contact: At its start.
        speed, reach: Largest wave and gap so far.
        out, count: Rows (start, width, left, right, in contact) of the arriving wave, 1 or 0 in the
            last column, to which some are added.

    Returns:
        Gap and contact at its end, the impulse [m] of lambda / c, and the number of rows.
    """
    impulse = 0.0
    least = -_REACH * max(reach, speed * end)
    while start < end:
        width = end - start
        if contact:
            after, at = _release(width, a, b, speed)
        else:
            after, at = _impact(width, a, b, gap, least)
        if after <= snap:
            # A flight or contact too short to see; the sign of w keeps it from repeating.
            a = max(a, 0.0) if contact else min(a, 0.0)
        else:
            if after >= width - snap:
                at, until = b, end
            else:
                width, until = after, start + after
            out[count, 0], out[count, 1], out[count, 2], out[count, 3] = start, width, a, at
            out[count, 4] = contact
            count += 1
            if contact:
                impulse += 0.5 * width * (a + at)
            elif after == math.inf:
                gap = max(gap + 0.5 * width * (a + b), 0.0)
            start, a = until, at
        if after != math.inf:
            contact, gap = not contact, 0.0
    return gap, contact, impulse, count


@compiled
def line(out, count, dt):
    """Straight line in place of the leaving wave of a layer: mean and half the rise.

    It has the mean of the wave, so the momentum stays, and its mean square, so the energy does
    (of gravity too: what another first moment does to the potential and to the kinetic energy
    cancels). It rises as the L2 projection does.

    Args:
        out, count: Rows (start, width, left, right) of the wave, over [0, dt].
        dt: Layer [s].
    """
    if count == 1:
        return 0.5 * (out[0, 2] + out[0, 3]), 0.5 * (out[0, 3] - out[0, 2])
    mean = 0.0
    for k in range(count):
        mean += out[k, 1] * 0.5 * (out[k, 2] + out[k, 3]) / dt
    fitted = 0.0
    for k in range(count):
        share = out[k, 1] / dt
        place = (2.0 * out[k, 0] + out[k, 1]) / dt - 1.0
        middle = 0.5 * (out[k, 2] + out[k, 3]) - mean
        fitted += 3.0 * share * (place * middle + share * (out[k, 3] - out[k, 2]) / 6.0)
    lost = 0.0  # three times the mean square of what the projection leaves
    for k in range(count):
        place = 2.0 * out[k, 0] / dt - 1.0
        a = out[k, 2] - mean - fitted * place
        b = out[k, 3] - mean - fitted * (place + 2.0 * out[k, 1] / dt)
        lost += out[k, 1] / dt * (a * a + a * b + b * b)
    return mean, math.copysign(math.sqrt(fitted * fitted + lost), fitted)


@compiled
def measure(
    away, away_rise, mean, rise, past, m, breaks, cells, extra, drops, loads, dt, transit, sign,
    gap, nodes, displacement, rate,
):  # fmt: skip
    """Integrals over the bar at level m, and its fields at some nodes.

    Args:
        away, away_rise: Mean and half the rise of the waves that left the near end, by layer.
        mean, rise: Of those that left where the waves towards the near end come from.
        past, breaks, cells, extra, drops, loads, dt, sign: As in `conserving`.
        m: Level.
        transit: l = L / c [s].
        gap: u(t_m, 0) [m].
        nodes: x / c of the nodes [s]; none: fields are not formed.
        displacement, rate: Filled.

    Returns:
        Kinetic and elastic energy over c, mean displacement, mean velocity.
    """
    squares = 0.0
    products = 0.0
    moment = 0.0
    speed = 0.0
    place = gap
    behind = 0.0  # gravity from t_m - k dt to t_m
    ahead = 0.0  # and from t_m to t_m + k dt
    node = 0
    fresh = False
    tiny = 1e-9 * dt
    last = len(loads) - 1
    start = 0.0
    k = 0
    while start < transit - tiny:
        c = m - 1 - k + past
        before = loads[min(m - 1 - k, last)] if m - 1 - k >= 0 else 0.0
        load, row = loads[min(m + k, last)], min(m + k, last)
        for q in range(len(breaks) - 1):
            x, y = breaks[q], breaks[q + 1]
            start, end = (k + x) * dt, (k + y) * dt
            if start >= transit - tiny:
                break
            away0 = away[c] + (1.0 - 2.0 * x) * away_rise[c] - behind - x * dt * before
            away1 = away[c] + (1.0 - 2.0 * y) * away_rise[c] - behind - y * dt * before
            d = m + k - cells[q] + past
            shift = 2.0 * extra[q] - 1.0
            left = sign * (mean[d] + (shift + 2.0 * x) * rise[d]) + drops[row, q, 0]
            right = sign * (mean[d] + (shift + 2.0 * y) * rise[d]) + drops[row, q, 1]
            left += ahead + x * dt * load
            right += ahead + y * dt * load
            v0, v1 = 0.5 * (left + away0), 0.5 * (right + away1)
            s0, s1 = 0.5 * (left - away0), 0.5 * (right - away1)
            width = end - start
            squares += width * (v0 * v0 + v0 * v1 + v1 * v1) / 3.0
            products += width * (s0 * s0 + s0 * s1 + s1 * s1) / 3.0
            speed += 0.5 * width * (v0 + v1)
            moment += width * (place + width * (2.0 * s0 + s1) / 6.0)
            if fresh:  # a node between two pieces
                rate[node - 1] = 0.5 * (rate[node - 1] + v0)
                fresh = False
            while node < len(nodes) and nodes[node] <= end + tiny:
                far = min(nodes[node] - start, width)
                share = far / width
                displacement[node] = place + far * (s0 + 0.5 * share * (s1 - s0))
                rate[node] = v0 + share * (v1 - v0)
                fresh = nodes[node] >= end - tiny
                node += 1
            place += 0.5 * width * (s0 + s1)
        start = (k + 1) * dt
        behind += dt * before
        ahead += dt * load
        k += 1
    return 0.5 * squares, 0.5 * products, moment / transit, speed / transit


@compiled
def conserving(
    mean, rise, past, breaks, cells, extra, drops, loads, dt, transit, sign, nodes, layers, every,
    gap, multiplier, kinetic, elastic, place, momentum, kept, displacement, rate,
):  # fmt: skip
    """March the waves of a bar through its layers.

    The leaving wave of layer m is mean + rise xi, -1 <= xi <= 1. In piece q of layer m arrives

        sign * (what left in layer m - cells[q], extra[q] later in its layer) + drops[m, q].

    Replacing a leaving wave by a line with the same mean and energy is all that is not exact, so
    energy and momentum are kept to rounding with any step.

    Args:
        mean, rise: Leaving wave [m/s]: the ``past`` layers before t = 0 are given, the others
            filled, shape (past + layers,).
        past: Layers before t = 0.
        breaks: Ends of the pieces as shares of a layer, from 0 to 1, shape (pieces + 1,).
        cells: Layers back to the one that arrives, shape (pieces,).
        extra: Share of a layer by which its time is later than that of its arrival, (pieces,).
        drops: Gravity on the way at both ends of each piece [m/s], shape (rows, pieces, 2), a row
            for each layer; the last row holds from its layer on.
        loads: p of each layer [m/s^2], shape (rows,), likewise.
        dt: Layer [s].
        transit: l = L / c [s].
        sign: 1 if the far end is free, -1 if it is clamped.
        nodes: x / c of the nodes [s], increasing from 0 to transit.
        layers: Number of layers.
        every: Layers of dt in a layer of what is recorded.
        gap: [m]; row 0 is given.
        multiplier: lambda over c [m/s], mean of each recorded layer, filled.
        kinetic, elastic: Over c, filled.
        place, momentum: Mean displacement [m] and velocity [m/s], filled.
        kept: Recorded levels at which fields are stored, increasing.
        displacement, rate: Fields at those levels, filled from row 1 on.
    """
    out = np.empty((8 * len(breaks), 5))
    nowhere = nodes[:0]
    now, contact, push = gap[0], False, 0.0
    speed, reach = 0.0, now
    for c in range(past):
        speed = max(speed, abs(mean[c]) + abs(rise[c]))
    kinetic[0], elastic[0], place[0], momentum[0] = measure(
        mean, rise, mean, rise, past, 0, breaks, cells, extra, drops, loads, dt, transit, sign,
        now, nowhere, displacement[0], rate[0],
    )  # fmt: skip
    slot = 0
    while slot < len(kept) and kept[slot] <= 0:
        slot += 1
    for m in range(layers):
        count, row = 0, min(m, len(drops) - 1)
        for q in range(len(breaks) - 1):
            d = m - cells[q] + past
            shift = 2.0 * extra[q] - 1.0
            a = sign * (mean[d] + (shift + 2.0 * breaks[q]) * rise[d]) + drops[row, q, 0]
            b = sign * (mean[d] + (shift + 2.0 * breaks[q + 1]) * rise[d]) + drops[row, q, 1]
            speed = max(speed, abs(a), abs(b))
            now, contact, impulse, count = cross(
                breaks[q] * dt, breaks[q + 1] * dt, SNAP * dt, a, b, now, contact, speed, reach,
                out, count,
            )  # fmt: skip
            reach = max(reach, now)
            push += impulse
        for k in range(count):
            if out[k, 4] > 0.0:
                out[k, 2], out[k, 3] = -out[k, 2], -out[k, 3]
        mean[m + past], rise[m + past] = line(out, count, dt)
        if (m + 1) % every:
            continue
        row = (m + 1) // every
        gap[row], multiplier[row - 1] = now, min(push, 0.0) / (every * dt)
        push = 0.0
        is_kept = slot < len(kept) and kept[slot] == row
        at = slot if is_kept else 0
        kinetic[row], elastic[row], place[row], momentum[row] = measure(
            mean, rise, mean, rise, past, m + 1, breaks, cells, extra, drops, loads, dt, transit,
            sign, now, nodes if is_kept else nowhere, displacement[at], rate[at],
        )  # fmt: skip
        slot += is_kept
