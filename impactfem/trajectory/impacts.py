"""Impacts of a motion: gaps that close, the state after them, and when they happen."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats

LOOKS = 13
"""At gaps along a flight, with their rates: what happens between is seen as cubics have it."""

MOST = 60
"""Impacts in one interval: more accumulate."""

_ITERATES = 100


@dataclass(frozen=True)
class Impact:
    """What a motion may strike.

    Functions are written as the dynamics, of (t, x, u), and of (t, x, u, p) with parameters.

    Attributes:
        gap: A number, >= 0 while it is open.
        jump: States just after the gap has closed, of those just before, n entries.
        name: For messages.
    """

    gap: Callable[..., Any]
    jump: Callable[..., Any]
    name: str = "impact"


type Look = Callable[[Floats], tuple[Floats, Floats]]
"""Of `LOOKS` times into a flight, or of one (k,), to gaps (J, k) and their rates."""


def first_impact(look: Look, span: float, struck: int = -1) -> tuple[float, int] | None:
    """When and which gap of a flight closes first; None: none does.

    A gap that is closed a little already, and closes on, as at nodes between which a search is
    under way, was struck a little before: the time is negative.

    Args:
        look: Gaps and their rates along the flight.
        span: Its length [s].
        struck: The gap that opens where it begins, as it was struck there.
    """
    times = span * np.linspace(0.0, 1.0, LOOKS)
    gaps, rates = look(times)
    if not np.isfinite(gaps).all():
        return None
    best: tuple[float, int] | None = None
    for j, (own, changes) in enumerate(zip(gaps, rates, strict=True)):

        def one(t: float, j: int = j) -> tuple[float, float]:
            found = look(np.array([t]))
            return float(found[0][j, 0]), float(found[1][j, 0])

        found = _first(one, times, own, changes, j == struck)
        if found is not None and (best is None or found < best[0]):
            best = found, j
    return best


def _first(
    of: Callable[[float], tuple[float, float]], times: Floats, gaps: Floats, rates: Floats,
    struck: bool,
) -> float | None:  # fmt: skip
    """First time at which one gap closes."""
    if gaps[0] <= 0.0 and rates[0] < 0.0 and not struck:
        return _newton(of, times[1] - times[0])
    open_ = gaps[0] > 0.0 or struck or rates[0] >= 0.0
    for i in range(len(times) - 1):
        h, (a, b), (da, db) = times[i + 1] - times[i], gaps[i : i + 2], rates[i : i + 2]
        outside = open_ if i == 0 else a > 0.0
        if not outside:
            continue
        low, high = times[i], times[i + 1]
        if da < 0.0 < db and b > 0.0:  # a valley between
            high = low + h * _turn(a, b, h * da, h * db)
            if of(high)[0] >= 0.0:
                continue
        elif b >= 0.0:
            continue
        elif a <= 0.0 or (i == 0 and struck):  # it opens first
            low = low + h * _turn(a, b, h * da, h * db)
            if of(low)[0] <= 0.0:
                if b < a:  # it stays closed: lasting contact, which is an endless row of impacts
                    return float(times[i])
                continue
        return _between(of, low, high)
    return None


def _turn(a: float, b: float, da: float, db: float) -> float:
    """Where a cubic on [0, 1] has its turn, between slopes of unlike sign."""
    one, two, three = da, 2.0 * (3.0 * (b - a) - 2.0 * da - db), 3.0 * (da + db - 2.0 * (b - a))
    roots = np.roots([three, two, one]) if three else np.array([-one / two if two else 0.5])
    real = roots[np.abs(roots.imag) < 1e-12].real
    inside = real[(real > 0.0) & (real < 1.0)]
    return float(inside.min()) if len(inside) else 0.5


def _between(of: Callable[[float], tuple[float, float]], low: float, high: float) -> float:
    """Root of a gap that is open at low and closed at high, by Newton's iterates kept between."""
    t = high
    for _ in range(_ITERATES):
        gap, rate = of(t)
        low, high = (t, high) if gap > 0.0 else (low, t)
        new = t - gap / rate if rate < 0.0 else low
        if not low < new < high:
            if abs(new - t) <= 4.0 * np.spacing(abs(t)):
                return t
            new = 0.5 * (low + high)
        if abs(new - t) <= 2.0 * np.spacing(max(abs(new), abs(t))):
            return new
        t = new
    return t


def _newton(of: Callable[[float], tuple[float, float]], most: float) -> float | None:
    """Root of a gap near 0, to either side."""
    t = 0.0
    for _ in range(_ITERATES):
        gap, rate = of(t)
        if not rate < 0.0:
            return None
        step = gap / rate
        if abs(t - step) > most:
            return None
        t -= step
        if abs(step) <= 1e-15 * most:
            break
    return t
