"""Impacts and releases at the wall, located to rounding from the wave that arrives there."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from impactfem.arrays import Floats
from impactfem.spacetime.reflections import BarWaves

# Relative size of gaps and waves that count as 0: rounding over long times stays below it.
_ZERO = 1e-11
_AT_NODE = 1e-2  # share of that: at the node of an event that the mesh is fitted to
_MOST_PER_EDGE = 8


@dataclass(frozen=True)
class Event:
    """Something at the wall that a characteristic starts from.

    Attributes:
        time: Dimensionless time c t / L.
        kind: "impact", "release", or "load" (gravity is switched during contact).
    """

    time: float
    kind: str


def wall_events(problem: BarWaves, switches: Floats) -> list[Event]:
    """Follow the near end under the arriving wave r, which is a polynomial on each wall edge.

    In flight V = r; contact begins where the gap, its integral, falls to 0 and ends where r rises
    above 0. This needs no decision of the discrete contact but that of two transits before: up to
    the first event whose characteristic is not a line of the mesh, plus 2 L/c, the events are as
    exact as the waves.

    Args:
        problem: Solved.
        switches: Dimensionless times at which gravity changes.
    """
    wall, small = problem.wall, _ZERO * problem.scale
    count = wall.places.shape[1]
    nodes = 0.5 * (1.0 + np.polynomial.legendre.leggauss(count)[0])
    # Coefficients of r in the local coordinate s in [0, 1] of each edge, from s^0 on.
    trace = wall.trace(problem.arriving.values) @ np.linalg.inv(np.vander(nodes, increasing=True)).T
    events: list[Event] = []
    gap, contact = problem.gap, False
    for begin, width, wave in zip(wall.begin, wall.widths, trace, strict=True):
        gap, contact = _follow(events, begin, width, wave, gap, contact=contact, small=small)
    held = contacts(events)
    events += [Event(float(t), "load") for t in switches if any(a < t < b for a, b in held)]
    return sorted(events, key=lambda event: event.time)


def contacts(events: list[Event]) -> list[tuple[float, float]]:
    """Begin and end of each contact; the end of one that lasts is infinite."""
    begins = [event.time for event in events if event.kind == "impact"]
    ends = [event.time for event in events if event.kind == "release"]
    return list(zip(begins, [*ends, np.inf][: len(begins)], strict=True))


def _follow(
    events: list[Event], begin: float, width: float, wave: Floats, gap: float, *, contact: bool,
    small: float,
) -> tuple[float, bool]:  # fmt: skip
    """Follow the near end over one edge; returns gap and contact at its end."""
    start = 0.0
    travelled = width * np.concatenate([[0.0], wave / np.arange(1, len(wave) + 1)])
    for _ in range(_MOST_PER_EDGE):
        if contact:
            place = _crossing(-wave, start, small)
        else:
            height = travelled.copy()
            height[0] = gap - _at(travelled, start)
            place = _crossing(height, start, small)
        if place is None:
            break
        contact = not contact
        events.append(Event(float(begin + width * place), "impact" if contact else "release"))
        start, gap = place, 0.0
    if not contact:
        gap += _at(travelled, 1.0) - _at(travelled, start)
    return gap, contact


def _crossing(values: Floats, start: float, small: float) -> float | None:
    """Where a polynomial leaves the values >= 0 for good, in [start, 1]; None if it does not.

    It must fall below -small; then the last zero before that is the place. Where it is 0 but for
    rounding from the start on, as at the node of an event that the mesh is fitted to, it leaves at
    the start: a root there may have half the digits only.
    """
    turns = [s for s in _roots(_derivative(values)) if start < s < 1.0]
    borders = [start, *turns, 1.0]
    if min(_at(values, s) for s in borders) >= -small:
        return None
    below = values.copy()
    below[0] += small
    low = _at(values, start) < -small
    crossed = start if low else min((s for s in _roots(below) if start <= s <= 1.0), default=1.0)
    if max(_at(values, s) for s in [*borders, crossed] if s <= crossed) <= _AT_NODE * small:
        return start
    zeros = [s for s in _roots(values) if start <= s <= crossed]
    return max(zeros, default=start)


def _at(values: Floats, s: float) -> float:
    """Value of a polynomial with coefficients from s^0 on."""
    return float(np.polynomial.polynomial.polyval(s, values))


def _derivative(values: Floats) -> Floats:
    return np.asarray(np.polynomial.polynomial.polyder(values)) if len(values) > 1 else values[:0]


def _roots(values: Floats) -> list[float]:
    """Places in [0, 1] at which a polynomial changes sign or is 0, in order, to rounding.

    Between its turning points it is monotone: bisection there is safe where the formulas for
    roots lose digits, as for a straight line with a quadratic term of rounding.
    """
    if len(values) < 2:
        return []
    borders = [0.0, *_roots(_derivative(values)), 1.0]
    found = []
    for a, b in pairwise(borders):
        left, right = _at(values, a), _at(values, b)
        if left == 0.0:
            found.append(a)
        elif left * right < 0.0:
            found.append(float(brentq(lambda s: _at(values, s), a, b, xtol=1e-16, rtol=1e-15)))
    if _at(values, 1.0) == 0.0:
        found.append(1.0)
    return found
