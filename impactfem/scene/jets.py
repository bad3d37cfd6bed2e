"""Formulas in time with their first and second derivatives, by Taylor arithmetic.

A value is carried as (f, f', f''): exact to rounding, where difference quotients would need a
time scale and lose half the digits. Where a formula has a kink or jump, the derivatives are those
of the branch taken.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.scene.formula import Formula

type Number = Any  # float or array of floats


@dataclass(frozen=True)
class Jet:
    """Values and their first and second derivatives by t: numbers, or arrays of one shape."""

    value: Number
    rate: Number = 0.0
    second: Number = 0.0

    def __neg__(self) -> "Jet":
        return Jet(-self.value, -self.rate, -self.second)

    def __add__(self, other: "Jet | float") -> "Jet":
        b = _jet(other)
        return Jet(self.value + b.value, self.rate + b.rate, self.second + b.second)

    def __sub__(self, other: "Jet | float") -> "Jet":
        return self + (-_jet(other))

    def __mul__(self, other: "Jet | float") -> "Jet":
        b = _jet(other)
        second = self.second * b.value + 2.0 * self.rate * b.rate + self.value * b.second
        return Jet(self.value * b.value, self.rate * b.value + self.value * b.rate, second)

    def __truediv__(self, other: "Jet | float") -> "Jet":
        return self * _inverse(other)

    def __pow__(self, other: "Jet | float") -> "Jet":
        power = _jet(other)
        if not np.any(power.rate) and not np.any(power.second):
            return _smooth(lambda x: _power(x, power.value))(self)
        return _exp(power * _log(self))

    def __radd__(self, other: float) -> "Jet":
        return _jet(other) + self

    def __rsub__(self, other: float) -> "Jet":
        return _jet(other) - self

    def __rmul__(self, other: float) -> "Jet":
        return _jet(other) * self

    def __rtruediv__(self, other: float) -> "Jet":
        return _jet(other) / self

    def __rpow__(self, other: float) -> "Jet":
        return _jet(other) ** self

    def through(self, value: Number, first: Number, second: Number) -> "Jet":
        """Chain rule for a function with this value and these derivatives here."""
        still = np.logical_and(self.rate == 0.0, self.second == 0.0)
        bend = np.where(self.second == 0.0, 0.0, first * self.second)
        # A constant stays one, even at a pole.
        return Jet(
            value,
            np.where(still, 0.0, first * self.rate),
            np.where(still, 0.0, second * self.rate**2 + bend),
        )


def motion_at(formula: Formula, t: ArrayLike, variable: str = "t") -> Jet:
    """Values, velocities and accelerations of a formula in t, each of the shape of t.

    They are nan or infinite where it has none.
    """
    times = np.asarray(t, dtype=float)
    with np.errstate(all="ignore"):
        found = _jet(formula.apply(_FUNCTIONS, **{variable: Jet(times, 1.0)}))
    parts = (found.value, found.rate, found.second)
    return Jet(*(np.array(np.broadcast_to(part, times.shape))[()] for part in parts))


def _jet(value: Jet | float) -> Jet:
    return value if isinstance(value, Jet) else Jet(np.float64(value))


def _smooth(
    function: Callable[[Number], tuple[Number, Number, Number]],
) -> Callable[[Jet | float], Jet]:
    def apply(x: Jet | float) -> Jet:
        x = _jet(x)
        return x.through(*function(x.value))

    return apply


def _choose(condition: Number, one: Jet | float, two: Jet | float) -> Jet:
    a, b = _jet(one), _jet(two)
    return Jet(
        np.where(condition, a.value, b.value),
        np.where(condition, a.rate, b.rate),
        np.where(condition, a.second, b.second),
    )


def _power(x: Number, n: Number) -> tuple[Number, Number, Number]:
    """Infinite at 0 for n < 0, where the value of t**1.5 must not suffer."""
    first = np.where(n == 0.0, 0.0, n * np.power(x, n - 1.0))
    straight = np.logical_or(n == 0.0, n == 1.0)
    second = np.where(straight, 0.0, n * (n - 1.0) * np.power(x, n - 2.0))
    return np.power(x, n), first, second


def _tangent(x: Number) -> tuple[Number, Number, Number]:
    y = np.tan(x)
    return y, 1.0 + y * y, 2.0 * y * (1.0 + y * y)


def _tanh(x: Number) -> tuple[Number, Number, Number]:
    y = np.tanh(x)
    return y, 1.0 - y * y, -2.0 * y * (1.0 - y * y)


def _root(x: Number) -> tuple[Number, Number, Number]:
    y = np.sqrt(x)
    return y, 0.5 / y, -0.25 / (x * y)


def _arc(sign: float, value: Number, x: Number) -> tuple[Number, Number, Number]:
    first = (1.0 - x * x) ** -0.5
    return value, sign * first, sign * x * first**3


_inverse = _smooth(lambda x: (1.0 / x, -1.0 / x**2, 2.0 / x**3))
_exp = _smooth(lambda x: (np.exp(x),) * 3)
_log = _smooth(lambda x: (np.log(x), 1.0 / x, -1.0 / x**2))

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": _smooth(lambda x: (np.sin(x), np.cos(x), -np.sin(x))),
    "cos": _smooth(lambda x: (np.cos(x), -np.sin(x), -np.cos(x))),
    "tan": _smooth(_tangent),
    "asin": _smooth(lambda x: _arc(1.0, np.arcsin(x), x)),
    "acos": _smooth(lambda x: _arc(-1.0, np.arccos(x), x)),
    "atan": _smooth(lambda x: (np.arctan(x), 1.0 / (1.0 + x * x), -2.0 * x / (1.0 + x * x) ** 2)),
    "sinh": _smooth(lambda x: (np.sinh(x), np.cosh(x), np.sinh(x))),
    "cosh": _smooth(lambda x: (np.cosh(x), np.sinh(x), np.cosh(x))),
    "tanh": _smooth(_tanh),
    "exp": _exp,
    "log": _log,
    "sqrt": _smooth(_root),
    "abs": lambda x: _choose(_jet(x).value < 0.0, -_jet(x), x),
    "min": lambda a, b: _choose(_jet(b).value < _jet(a).value, b, a),
    "max": lambda a, b: _choose(_jet(b).value > _jet(a).value, b, a),
    "where": _choose,
    "table": lambda table, x: _smooth(lambda at: (table(at), table.slope(at), 0.0 * at))(x),
    "lt": lambda a, b: _jet(a).value < _jet(b).value,
    "le": lambda a, b: _jet(a).value <= _jet(b).value,
    "gt": lambda a, b: _jet(a).value > _jet(b).value,
    "ge": lambda a, b: _jet(a).value >= _jet(b).value,
}
