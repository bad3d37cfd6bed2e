"""Formulas that are affine in some variables: their coefficients, found by walking their tree."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.scene.formula import Formula
from impactfem.scene.grammar import NUMPY_FUNCTIONS
from impactfem.scene.pieces import Table
from impactfem.scene.signal import Signal

_HALF_TURN = 0.5 * np.pi


class _NotAffineError(Exception):
    """The formula has products or functions of the variables."""


@dataclass(frozen=True)
class _Affine:
    """Coefficients of the variables, and a function of time beside them."""

    coefficients: tuple[float, ...]
    signal: Signal

    @property
    def is_number(self) -> bool:
        return self.signal.is_constant and not any(self.coefficients)

    def scaled(self, factor: float) -> "_Affine":
        return _Affine(tuple(factor * c for c in self.coefficients), self.signal.times(factor))

    def _other(self, other: "float | _Affine") -> "_Affine":
        if isinstance(other, _Affine):
            return other
        return _Affine((0.0,) * len(self.coefficients), Signal(float(other)))

    def __add__(self, other: "float | _Affine") -> "_Affine":
        entry = self._other(other)
        pairs = zip(self.coefficients, entry.coefficients, strict=True)
        return _Affine(tuple(a + b for a, b in pairs), self.signal.plus(entry.signal))

    __radd__ = __add__

    def __neg__(self) -> "_Affine":
        return self.scaled(-1.0)

    def __sub__(self, other: "float | _Affine") -> "_Affine":
        return self + (-self._other(other))

    def __rsub__(self, other: "float | _Affine") -> "_Affine":
        return self._other(other) + (-self)

    def __mul__(self, other: "float | _Affine") -> "_Affine":
        entry = self._other(other)
        if entry.is_number:
            return self.scaled(entry.signal.constant)
        if self.is_number:
            return entry.scaled(self.signal.constant)
        return _combined(np.multiply, self, entry)

    __rmul__ = __mul__

    def __truediv__(self, other: "float | _Affine") -> "_Affine":
        entry = self._other(other)
        if entry.is_number and entry.signal.constant != 0.0:
            return self.scaled(1.0 / entry.signal.constant)
        return _combined(np.divide, self, entry)

    def __rtruediv__(self, other: "float | _Affine") -> "_Affine":
        return self._other(other) / self

    def __pow__(self, other: "float | _Affine") -> "_Affine":
        entry = self._other(other)
        if entry.is_number and entry.signal.constant == 1.0:
            return self
        return _combined(np.power, self, entry)

    def __rpow__(self, other: "float | _Affine") -> "_Affine":
        return self._other(other) ** self


def _combined(function: Callable[..., Any], *entries: "_Affine | float") -> _Affine:
    """A function of functions of time.

    Raises:
        _NotAffineError: A variable occurs in it.
    """
    size = next(len(e.coefficients) for e in entries if isinstance(e, _Affine))
    parts: list[Any] = []
    for entry in entries:
        if isinstance(entry, _Affine):
            if any(entry.coefficients):
                raise _NotAffineError
            parts.append(entry.signal)
        else:
            parts.append(entry)

    def rest(t: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*(part(t) if isinstance(part, Signal) else part for part in parts))

    return _Affine((0.0,) * size, Signal(rest=rest))


def _functions() -> Mapping[str, Callable[..., Any]]:
    def make(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *entries: _combined(function, *entries)

    def wave(phase: float, function: Callable[..., Any]) -> Callable[[_Affine], _Affine]:
        def walk(entry: _Affine) -> _Affine:
            found = None if any(entry.coefficients) else entry.signal.sine(phase)
            if found is None:
                return _combined(function, entry)
            return _Affine(entry.coefficients, found)

        return walk

    def held(_: Any) -> Any:  # what others set has no signal of time
        raise _NotAffineError

    def table(own: Table, entry: Any) -> Any:
        return _combined(own, entry) if isinstance(entry, _Affine) else own(entry)

    names = {name: make(function) for name, function in NUMPY_FUNCTIONS.items()}
    names |= {"held": held, "table": table}
    return names | {"sin": wave(0.0, np.sin), "cos": wave(_HALF_TURN, np.cos)}


_FUNCTIONS = _functions()


def affine_parts(formula: Formula, variables: Sequence[str]) -> tuple[list[float], Signal] | None:
    """Split a formula into ``sum of coefficients * variables + signal(t)``.

    Args:
        formula: Formula of ``t`` and of the variables.
        variables: Names of the state.

    Returns:
        Coefficients, one a variable, and the rest as a function of time; None if the formula is
        not affine in the variables with constant coefficients.
    """
    size = len(variables)
    values: dict[str, Any] = {
        name: _Affine(tuple(float(i == j) for j in range(size)), Signal())
        for i, name in enumerate(variables)
    }
    values["t"] = _Affine((0.0,) * size, Signal(slope=1.0))
    try:
        found = formula.apply(_FUNCTIONS, **values)
    except _NotAffineError:
        return None
    if not isinstance(found, _Affine):
        return [0.0] * size, Signal(float(found))
    return list(found.coefficients), found.signal
