"""Derivatives of functions that users write: by complex steps where these take them."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats

_COMPLEX_STEP = 1e-30
_REAL_STEP = 6e-6  # about eps^(1/3): the error of central differences is 1e-10 of the curvature
_AGREES = 1e-5  # share of the largest entry by which complex steps and differences may differ
_FALL, _SHORTER = 16.0, 7  # of steps that are looked for, and how often they fall
_SETTLED = 1e-6  # share by which rates of two steps may differ; the shorter is 256 times better
_EPS = float(np.finfo(float).eps)


def differentiate(phi: Callable[[Any], Any], u: Floats) -> Floats:
    """Jacobian of phi (d,) -> (J,) at u, shape (J, d).

    By complex steps, exact to rounding, if phi takes complex numbers and its answers agree with
    differences; else by central differences.
    """
    size = float(np.abs(u).max(initial=0.0))
    step, axes = _REAL_STEP * max(1.0, size), np.eye(len(u))
    lines = [partial(_along, phi, u, axis) for axis in axes]
    try:
        columns = [np.imag(line(1j * _COMPLEX_STEP)) / _COMPLEX_STEP for line in lines]
        exact = np.stack(columns, axis=1).astype(float)
    except TypeError:
        exact = None
    # abs, min and max drop the imaginary part: then the complex step is wrong, not inaccurate.
    if exact is not None and _agree(exact, np.stack([_central(at, step) for at in lines], axis=1)):
        return exact
    real = np.stack([slope(line, step, size) for line in lines], axis=1)
    return exact if exact is not None and _agree(exact, real) else real


def slope(curve: Callable[[float], Floats], longest: float, size: float) -> Floats:
    """Rates of values curve(s) at s = 0, by central differences of the step that fits each.

    No length tells how far a function is straight: balls of 1e-7 m bend their gap over that. So
    the step falls while the rates that two steps find differ by more than rounding.

    Args:
        curve: Takes s to values (m,).
        longest: First step; the last is 4e-9 of it.
        size: Of what s is added to, for its rounding.

    Returns:
        The rates (m,), right to about 1e-8 of themselves, or as rounding lets them be.
    """
    found = last = _central(curve, longest)
    error, most, h = np.full(found.shape, np.inf), np.abs(found), longest
    for _ in range(_SHORTER):
        h /= _FALL
        new = _central(curve, h)
        most = np.maximum(most, np.abs(new))
        noise = 4.0 * _EPS * (np.abs(curve(0.0)) + size * most) / h
        apart = np.abs(new - last)
        better = apart + noise < error
        error = np.where(better, apart + noise, error)
        found = np.where(better & (apart > noise), new, found)  # else the longer is rounded less
        if (apart <= _SETTLED * np.abs(new) + noise).all():
            break
        last = new
    return found


def _central(curve: Callable[[float], Floats], h: float) -> Floats:
    return np.asarray((curve(h) - curve(-h)) / (2.0 * h), dtype=float)


def _along(phi: Callable[[Any], Any], u: Floats, way: Floats, s: complex) -> Any:
    return np.atleast_1d(phi(u + s * way))


def _agree(one: Floats, other: Floats, size: float = 0.0) -> bool:
    """Whether two arrays of rates are the same, as seen beside the largest, or a size."""
    size = max(size, float(np.abs(other).max(initial=0.0)))
    return bool(np.abs(one - other).max(initial=0.0) <= _AGREES * size)


class Derivative:
    """Jacobian of a function u (n,) -> (m,), as `differentiate`, which is asked once only."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        """Take the function."""
        self._function = function
        self._is_analytic: bool | None = None  # whether complex steps agree; None: unknown

    @property
    def is_exact(self) -> bool:
        """Whether it is found by complex steps, once it was asked for."""
        return bool(self._is_analytic)

    def __call__(self, u: Floats) -> Floats:
        """D phi / d u, (m, n)."""
        if self._is_analytic:
            steps = 1j * _COMPLEX_STEP * np.eye(len(u))
            columns = [np.imag(np.atleast_1d(self._function(u + row))) for row in steps]
            return np.stack(columns, axis=1) / _COMPLEX_STEP
        found = differentiate(self._function, u)
        if self._is_analytic is None:
            self._is_analytic = True
            try:
                same = bool((self(u) == found).all())
            except TypeError:
                same = False
            self._is_analytic = same
        return found

    def along(self, u: Floats, way: Floats) -> Floats:
        """(D phi / d u) way, (m,), at the cost of one evaluation where it is exact."""
        if not self._is_analytic:
            return np.asarray(self(u) @ way)
        found = self._function(u + 1j * _COMPLEX_STEP * way)
        return np.asarray(np.atleast_1d(np.imag(found)) / _COMPLEX_STEP)


class MatrixRate:
    """Rate of a matrix M(u) along a motion; (u, u') -> (d, d)."""

    def __init__(self, matrix: Callable[[Floats], ArrayLike]) -> None:
        """Take the function; a vector is a diagonal."""
        self._matrix: Callable[[Any], Any] = matrix
        self._is_analytic: bool | None = None  # whether it takes complex numbers; None: unknown

    def __call__(self, u: Floats, v: Floats) -> Floats:
        """dM/dt at u with u' = v, (d, d)."""
        speed = float(np.abs(v).max(initial=0.0))
        way = v / speed if speed > 0.0 else v
        exact = None if self._is_analytic is False else self._by_complex_step(u, way)
        if exact is not None and self._is_analytic:
            return speed * exact
        size = float(np.abs(u).max(initial=0.0))
        step = _REAL_STEP * max(1.0, size)
        rate = slope(lambda s: np.asarray(self._at(u + s * way), dtype=float), step, size)
        if self._is_analytic is None and speed > 0.0:
            usual = float(np.abs(self._at(u)).max()) / max(1.0, size)
            self._is_analytic = exact is not None and _agree(exact, rate, usual)
        return speed * rate

    def _at(self, u: Any) -> Any:
        found = np.asarray(self._matrix(u))
        return np.diag(found) if found.ndim == 1 else np.atleast_2d(found)

    def _by_complex_step(self, u: Floats, way: Floats) -> Floats | None:
        try:
            found = self._at(u + 1j * _COMPLEX_STEP * way)
        except TypeError:
            return None
        return np.asarray(np.imag(found) / _COMPLEX_STEP, dtype=float)
