"""Formulas in time with their first and second derivatives, by Taylor arithmetic.

A value is carried as (f, f', f''): exact to rounding, where difference quotients would need a
time scale and lose half the digits. Where a formula has a kink or jump, the derivatives are those
of the branch taken.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from impactfem.scene import Formula


@dataclass(frozen=True)
class Jet:
    """A value and its first and second derivative by t."""

    value: float
    rate: float = 0.0
    second: float = 0.0

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
        if power.rate == 0.0 and power.second == 0.0:
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

    def through(self, value: float, first: float, second: float) -> "Jet":
        """Chain rule for a function with this value and these derivatives here."""
        if self.rate == 0.0 and self.second == 0.0:  # a constant stays one, even at a pole
            return Jet(value)
        bend = first * self.second if self.second != 0.0 else 0.0
        return Jet(value, first * self.rate, second * self.rate**2 + bend)


def motion_at(formula: Formula, t: float) -> Jet:
    """Value, velocity and acceleration of a formula in t; nan where it has none."""
    return _jet(formula.apply(_FUNCTIONS, t=Jet(float(t), 1.0)))


def _jet(value: Jet | float) -> Jet:
    return value if isinstance(value, Jet) else Jet(float(value))


def _smooth(
    function: Callable[[float], tuple[float, float, float]],
) -> Callable[[Jet | float], Jet]:
    def apply(x: Jet | float) -> Jet:
        x = _jet(x)
        try:
            return x.through(*function(x.value))
        except (ArithmeticError, ValueError):  # as with numpy; `where` may not choose it
            return _NOWHERE

    return apply


def _power(x: float, n: float) -> tuple[float, float, float]:
    first = n * _pow(x, n - 1.0) if n != 0.0 else 0.0
    second = n * (n - 1.0) * _pow(x, n - 2.0) if n not in {0.0, 1.0} else 0.0
    return _pow(x, n), first, second


def _pow(x: float, n: float) -> float:
    """As numpy: infinite at 0 for n < 0, where the value of t**1.5 must not suffer."""
    if x == 0.0 and n < 0.0:
        return math.inf
    return math.pow(x, n)


def _tangent(x: float) -> tuple[float, float, float]:
    y = math.tan(x)
    return y, 1.0 + y * y, 2.0 * y * (1.0 + y * y)


def _tanh(x: float) -> tuple[float, float, float]:
    y = math.tanh(x)
    return y, 1.0 - y * y, -2.0 * y * (1.0 - y * y)


def _root(x: float) -> tuple[float, float, float]:
    y = math.sqrt(x)
    return y, 0.5 / y, -0.25 / (x * y)


def _arc(sign: float, value: float, x: float) -> tuple[float, float, float]:
    first = (1.0 - x * x) ** -0.5
    return value, sign * first, sign * x * first**3


_NOWHERE = Jet(math.nan, math.nan, math.nan)

_inverse = _smooth(lambda x: (1.0 / x, -1.0 / x**2, 2.0 / x**3))
_exp = _smooth(lambda x: (math.exp(x),) * 3)
_log = _smooth(lambda x: (math.log(x), 1.0 / x, -1.0 / x**2))

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": _smooth(lambda x: (math.sin(x), math.cos(x), -math.sin(x))),
    "cos": _smooth(lambda x: (math.cos(x), -math.sin(x), -math.cos(x))),
    "tan": _smooth(_tangent),
    "asin": _smooth(lambda x: _arc(1.0, math.asin(x), x)),
    "acos": _smooth(lambda x: _arc(-1.0, math.acos(x), x)),
    "atan": _smooth(lambda x: (math.atan(x), 1.0 / (1.0 + x * x), -2.0 * x / (1.0 + x * x) ** 2)),
    "sinh": _smooth(lambda x: (math.sinh(x), math.cosh(x), math.sinh(x))),
    "cosh": _smooth(lambda x: (math.cosh(x), math.sinh(x), math.cosh(x))),
    "tanh": _smooth(_tanh),
    "exp": _exp,
    "log": _log,
    "sqrt": _smooth(_root),
    "abs": lambda x: -_jet(x) if _jet(x).value < 0.0 else _jet(x),
    "min": lambda a, b: _jet(b) if _jet(b).value < _jet(a).value else _jet(a),
    "max": lambda a, b: _jet(b) if _jet(b).value > _jet(a).value else _jet(a),
    "where": lambda condition, a, b: _jet(a) if condition else _jet(b),
    "lt": lambda a, b: _jet(a).value < _jet(b).value,
    "le": lambda a, b: _jet(a).value <= _jet(b).value,
    "gt": lambda a, b: _jet(a).value > _jet(b).value,
    "ge": lambda a, b: _jet(a).value >= _jet(b).value,
}
