"""Compiled integrals over an exact bar, for many times; loaded only where there are many."""

import math

import numpy as np

from impactfem.compiled import compiled


@compiled
def load_moments(times, values, start, width):
    """As `impactfem.exact.pieces.Load.moments`, of one interval."""
    i = np.searchsorted(times, start, side="right") - 1
    last = len(times) - 1
    zeroth, first, low = 0.0, 0.0, 0.0
    while True:
        high = width
        if i < last and times[i + 1] - start < width:
            high = times[i + 1] - start
        part = values[i] * (high - low)
        zeroth += part
        first += part * (width - 0.5 * (low + high))
        if high >= width:
            return zeroth, first
        low = high
        i += 1


@compiled
def sums(start, value, slope, contact, gap, impulse, load_times, load_values, times, reach, out):
    """Integrals over the bar at many times.

    As `impactfem.exact.pieces.integrate` two Gauss points a piece, here with the breakpoints of
    both waves walked along side by side.

    Args:
        start, value, slope, contact, gap, impulse: Of the `Wave`.
        load_times, load_values: Of the `Load`.
        times: (n,) [s].
        reach: L/c [s].
        out: (4, n), filled over travel times: v^2 / 2, s^2 / 2, v, u.
    """
    pieces, switches = len(start), len(load_times)
    shift = 0.5 / math.sqrt(3.0)
    for k in range(len(times)):
        t = times[k]
        # y grows: breakpoints of the wave that left (t - y) pass backwards, the others forwards.
        left = np.searchsorted(start, t, side="left") - 1
        came = np.searchsorted(start, t, side="right") - 1
        load_left = np.searchsorted(load_times, t, side="left") - 1
        load_came = np.searchsorted(load_times, t, side="right")
        kinetic, elastic, speed, place = 0.0, 0.0, 0.0, 0.0
        y = 0.0
        while y < reach:
            ahead = reach
            if left > 0:
                ahead = min(ahead, t - start[left])
            if came + 1 < pieces:
                ahead = min(ahead, start[came + 1] - t)
            if load_left > 0:
                ahead = min(ahead, t - load_times[load_left])
            if load_came < switches:
                ahead = min(ahead, load_times[load_came] - t)
            width = ahead - y
            if width > 0.0:
                for side in range(2):
                    at = 0.5 * (y + ahead) + (2 * side - 1) * shift * width
                    d = t + at - start[came]
                    w = value[came] + slope[came] * d
                    path = gap[came] + impulse[came] + (value[came] + 0.5 * slope[came] * d) * d
                    e = t - at - start[left]
                    sign = -1.0 if contact[left] else 1.0
                    a = sign * (value[left] + slope[left] * e)
                    path += gap[left] - impulse[left]
                    path += sign * (value[left] + 0.5 * slope[left] * e) * e
                    before, first = load_moments(load_times, load_values, t - at, at)
                    after, lift = load_moments(load_times, load_values, t, at)
                    w += after
                    a -= before
                    kinetic += 0.0625 * width * (w + a) * (w + a)
                    elastic += 0.0625 * width * (w - a) * (w - a)
                    speed += 0.25 * width * (w + a)
                    place += 0.25 * width * (path + lift + at * before - first)
            y = ahead
            if left > 0 and t - start[left] <= y:
                left -= 1
            if came + 1 < pieces and start[came + 1] - t <= y:
                came += 1
            if load_left > 0 and t - load_times[load_left] <= y:
                load_left -= 1
            if load_came < switches and load_times[load_came] - t <= y:
                load_came += 1
        out[0, k], out[1, k], out[2, k], out[3, k] = kinetic, elastic, speed, place
