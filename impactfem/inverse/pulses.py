"""Figures of a pulse of force whose bar presses a spring: smooth in what it depends on."""

import numpy as np

from impactfem.arrays import Floats


def pressed_time(times: Floats, places: Floats) -> float:
    """How long a way, straight between levels, is below 0 [s].

    Args:
        times: Levels [s], (levels,).
        places: Of the bar's end from the wall at rest [m], (levels,).
    """
    low, high = np.minimum(places[1:], places[:-1]), np.maximum(places[1:], places[:-1])
    crossed = (low < 0.0) & (high > 0.0)
    share = np.where(crossed, -low / np.where(crossed, high - low, 1.0), high <= 0.0)
    share[(low == 0.0) & (high == 0.0)] = 0.0
    return float(share @ np.diff(times))


def force_rise(times: Floats, places: Floats, force: Floats) -> float:
    """Mean rate of a force from the first touch until it is half of its largest value [N/s].

    The force is straight between the middles of layers, and 0 at the first touch.

    Args:
        times: Levels [s], (layers + 1,).
        places: As in `pressed_time`.
        force: Means of layers [N], (layers,).

    Returns:
        NaN where nothing touches.
    """
    below = np.flatnonzero(places < 0.0)
    if not below.size:
        return float("nan")
    first = max(int(below[0]) - 1, 0)
    before, after = places[first], places[first + 1]
    begin = times[first] + (times[first + 1] - times[first]) * before / (before - after)
    return rise_rate(times, float(begin), force)


def rise_rate(times: Floats, begin: float, force: Floats) -> float:
    """The same from a time at which it touches first [s]."""
    half = 0.5 * float(force.max(initial=0.0))
    if not half > 0.0:
        return float("nan")
    middles = 0.5 * (times[1:] + times[:-1])
    found = np.flatnonzero((force >= half) & (middles > begin))
    if not found.size:
        return float("nan")
    over, start = int(found[0]), (begin, 0.0)
    if over and middles[over - 1] > begin:
        start = (middles[over - 1], force[over - 1])
    share = (half - start[1]) / (force[over] - start[1])
    return float(half / (start[0] + share * (middles[over] - start[0]) - begin))
