"""Ranges that a formula in time takes on intervals, and where it may change its branch.

Interval arithmetic: no branch between two samples escapes it, whatever the scale of time. Only
``rough`` intervals, on which a comparison is not decided or a function has no smooth value, can
hold a jump, a kink or a pole. Ranges are widened by a few roundings, so that a break at the end
of an interval is seen from both sides.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.scene.formula import Formula
from impactfem.scene.pieces import Table

type Number = float | Floats

_WIDEN = 2.0**-50
_MOST_RADIANS = 1e6  # beyond, the places of maxima are lost in rounding


@dataclass(frozen=True)
class _Range:
    """Values between low and high, each of shape (intervals,); rough: not smooth for sure."""

    low: Floats
    high: Floats
    rough: Booleans

    __array_ufunc__ = None  # arrays leave arithmetic with ranges to these

    def __neg__(self) -> "_Range":
        return _Range(-self.high, -self.low, self.rough)

    def __add__(self, other: "_Range | Number") -> "_Range":
        b = _range(other, self)
        return _made(self.low + b.low, self.high + b.high, self.rough | b.rough)

    __radd__ = __add__

    def __sub__(self, other: "_Range | Number") -> "_Range":
        return self + (-_range(other, self))

    def __rsub__(self, other: Number) -> "_Range":
        return (-self) + other

    def __mul__(self, other: "_Range | Number") -> "_Range":
        b = _range(other, self)
        ends = np.array(
            [self.low * b.low, self.low * b.high, self.high * b.low, self.high * b.high]
        )
        return _made(ends.min(axis=0), ends.max(axis=0), self.rough | b.rough)

    __rmul__ = __mul__

    def __truediv__(self, other: "_Range | Number") -> "_Range":
        b = _range(other, self)
        pole = (b.low <= 0.0) & (b.high >= 0.0)
        inverse = _Range(
            np.where(pole, -np.inf, 1.0 / b.high), np.where(pole, np.inf, 1.0 / b.low),
            b.rough | pole,
        )  # fmt: skip
        return self * inverse

    def __rtruediv__(self, other: Number) -> "_Range":
        return _range(other, self) / self

    def __pow__(self, other: "_Range | Number") -> "_Range":
        b = _range(other, self)
        if not (np.all(b.low == b.high) and np.all(b.low == b.low[0])):
            found: _Range = _exp(b * _log(self))
            return found
        n = float(b.low[0])
        whole = n == np.rint(n)
        if n < 0.0:
            return _range(1.0, self) / self**-n
        if not whole:
            root: _Range = _rising(lambda x: np.power(x, n), least=0.0)(self)
            return root
        ends = np.array([self.low**n, self.high**n])
        low, high = ends.min(axis=0), ends.max(axis=0)
        if n % 2.0 == 0.0:
            low = np.where((self.low <= 0.0) & (self.high >= 0.0), 0.0**n, low)
        return _made(low, high, self.rough | b.rough)

    def __rpow__(self, other: Number) -> "_Range":
        return _range(other, self) ** self


@dataclass(frozen=True)
class _Test:
    """A comparison: whether it holds, and whether it fails, on all of each interval."""

    holds: Booleans
    fails: Booleans


def rough_on(formula: Formula, low: Floats, high: Floats) -> Booleans:
    """On which intervals of time a formula in t may have a jump, a kink or a pole.

    Args:
        formula: Formula in t.
        low: Starts of the intervals [s], shape (intervals,).
        high: Their ends [s].
    """
    return range_on(formula, low, high)[2]


def range_on(
    formula: Formula, low: Floats, high: Floats, others: Mapping[str, Number] | None = None
) -> tuple[Floats, Floats, Booleans]:
    """Least and largest value on intervals of time, or bounds of these, and what `rough_on` says.

    Args:
        formula: Formula in t and others.
        low: Starts of the intervals [s], shape (intervals,).
        high: Their ends [s].
        others: What other variables are, a number or (intervals,) each.
    """
    time = _Range(low, high, np.zeros(len(low), dtype=np.bool_))
    with np.errstate(all="ignore"):
        found = _range(formula.apply(_FUNCTIONS, t=time, **(others or {})), time)
    return found.low, found.high, found.rough


def _range(value: _Range | Number, like: _Range) -> _Range:
    if isinstance(value, _Range):
        return value
    number = np.broadcast_to(np.asarray(value, dtype=np.float64), like.low.shape)
    return _Range(number, number, np.zeros(len(number), dtype=np.bool_))


def _made(low: Floats, high: Floats, rough: Booleans) -> _Range:
    lost = np.isnan(low) | np.isnan(high)
    return _Range(
        np.where(lost, -np.inf, low - _WIDEN * np.abs(low)),
        np.where(lost, np.inf, high + _WIDEN * np.abs(high)),
        rough | lost,
    )


def _rising(
    function: Callable[[Any], Any], least: float = -np.inf, most: float = np.inf
) -> Callable[[_Range | Number], Any]:
    """A function that rises from ``least`` to ``most`` and has no smooth value beyond or there."""

    def apply(x: _Range | Number) -> Any:
        if not isinstance(x, _Range):
            return function(np.float64(x))
        ends = np.clip(x.low, least, most), np.clip(x.high, least, most)
        outside = (x.low <= least) | (x.high >= most)
        return _made(function(ends[0]), function(ends[1]), x.rough | outside)

    return apply


def _wave(function: Callable[[Any], Any], top: float) -> Callable[[_Range | Number], Any]:
    """Sine or cosine, whose first maximum is at ``top``."""

    def apply(x: _Range | Number) -> Any:
        if not isinstance(x, _Range):
            return function(np.float64(x))
        ends = np.array([function(x.low), function(x.high)])
        turn = 2.0 * np.pi
        high, low = (
            np.ceil((x.low - t) / turn - 1e-9) <= np.floor((x.high - t) / turn + 1e-9)
            for t in (top, top + np.pi)
        )
        wide = ~(np.maximum(np.abs(x.low), np.abs(x.high)) < _MOST_RADIANS)
        return _made(
            np.where(low | wide, -1.0, ends.min(axis=0)),
            np.where(high | wide, 1.0, ends.max(axis=0)),
            x.rough,
        )

    return apply


def _tan(x: _Range | Number) -> Any:
    if not isinstance(x, _Range):
        return np.tan(x)
    turns = np.floor(x.low / np.pi - 0.5) < np.floor(x.high / np.pi - 0.5)
    pole = turns | ~np.isfinite(x.low) | ~np.isfinite(x.high)
    low, high = np.where(pole, -np.inf, np.tan(x.low)), np.where(pole, np.inf, np.tan(x.high))
    return _made(low, high, x.rough | pole)


def _cosh(x: _Range | Number) -> Any:
    return np.cosh(x) if not isinstance(x, _Range) else 0.5 * (_exp(x) + _exp(-x))


def _acos(x: _Range | Number) -> Any:
    return np.arccos(x) if not isinstance(x, _Range) else 0.5 * np.pi - _asin(x)


def _abs(x: _Range | Number) -> Any:
    if not isinstance(x, _Range):
        return np.abs(x)
    across = (x.low <= 0.0) & (x.high >= 0.0)
    ends = np.abs([x.low, x.high])
    least, most = np.where(across, 0.0, ends.min(axis=0)), ends.max(axis=0)
    return _Range(least, most, x.rough | (across & (most > 0.0)))


def _choose(test: Any, one: _Range | Number, two: _Range | Number) -> Any:
    if not isinstance(test, _Test):  # decided by numbers: one for all intervals, or one of each
        if np.ndim(test) == 0:
            return one if test else two
        if not isinstance(one, _Range) and not isinstance(two, _Range):
            return np.where(test, one, two)
        test = _Test(np.asarray(test), ~np.asarray(test))
    like = _Range(*(np.zeros(len(test.holds)),) * 2, np.zeros(len(test.holds), dtype=np.bool_))
    a, b = _range(one, like), _range(two, like)
    # Two branches that are the same number hold no break between them.
    differ = (a.low != a.high) | (b.low != b.high) | (a.low != b.low) | a.rough | b.rough
    return _Range(
        np.where(test.holds, a.low, np.where(test.fails, b.low, np.minimum(a.low, b.low))),
        np.where(test.holds, a.high, np.where(test.fails, b.high, np.maximum(a.high, b.high))),
        np.where(test.holds, a.rough, np.where(test.fails, b.rough, differ)),
    )


def _less(one: _Range | Number, two: _Range | Number) -> Any:
    """Whether one < two; equality is left open, which serves <= too."""
    if not isinstance(one, _Range) and not isinstance(two, _Range):
        return one < two
    like = one if isinstance(one, _Range) else two
    a, b = _range(one, like), _range(two, like)  # type: ignore[arg-type]
    return _Test(a.high < b.low, a.low > b.high)


def _least(one: _Range | Number, two: _Range | Number) -> Any:
    return _choose(_less(one, two), one, two)


def _largest(one: _Range | Number, two: _Range | Number) -> Any:
    return _choose(_less(one, two), two, one)


def _table(table: Table, x: _Range | Number) -> Any:
    if not isinstance(x, _Range):
        return table(x)
    return _Range(*table.bounds(x.low, x.high), x.rough | table.breaks(x.low, x.high))


_exp, _log = _rising(np.exp), _rising(np.log, least=0.0)
_asin = _rising(np.arcsin, -1.0, 1.0)

_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "sin": _wave(np.sin, 0.5 * np.pi),
    "cos": _wave(np.cos, 0.0),
    "tan": _tan,
    "asin": _asin,
    "acos": _acos,
    "atan": _rising(np.arctan),
    "sinh": _rising(np.sinh),
    "cosh": _cosh,
    "tanh": _rising(np.tanh),
    "exp": _exp,
    "log": _log,
    "sqrt": _rising(np.sqrt, least=0.0),
    "abs": _abs,
    "min": _least,
    "max": _largest,
    "where": _choose,
    "table": _table,
    "lt": _less,
    "le": _less,
    "gt": lambda a, b: _less(b, a),
    "ge": lambda a, b: _less(b, a),
}
