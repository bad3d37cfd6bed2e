"""Derivatives of functions that users write: by complex steps where these take them."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

_COMPLEX_STEP = 1e-30
_REAL_STEP = 6e-6  # about eps^(1/3): the error of central differences is 1e-10 of the curvature
_LONG_STEP = 1e-3  # of differences of fourth order
_AGREES = 1e-5  # share of the largest entry by which complex steps and differences may differ


def differentiate(phi: Callable[[Any], Any], u: Floats) -> Floats:
    """Jacobian of phi (d,) -> (J,) at u, shape (J, d).

    By complex steps, exact to rounding, if phi takes complex numbers and its answers agree with
    differences; else by central differences.
    """
    real = np.stack(
        [
            (np.atleast_1d(phi(u + h)) - np.atleast_1d(phi(u - h))) / (2.0 * h.max())
            for h in _steps(u)
        ],
        axis=1,
    ).astype(float)
    try:
        columns = [
            np.imag(np.atleast_1d(phi(u + 1j * _COMPLEX_STEP * row))) / _COMPLEX_STEP
            for row in np.eye(len(u))
        ]
    except TypeError:
        return real
    complex_one = np.stack(columns, axis=1).astype(float)
    size = max(1.0, float(np.abs(real).max(initial=0.0)))
    # abs, min and max drop the imaginary part: then the complex step is wrong, not inaccurate.
    return complex_one if np.abs(complex_one - real).max(initial=0.0) <= 1e-5 * size else real


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
        h = _LONG_STEP * max(1.0, float(np.abs(u).max(initial=0.0)))
        near, far = (
            (self._at(u + s * way) - self._at(u - s * way)) / (2.0 * s) for s in (h, 2.0 * h)
        )
        rate = np.asarray((4.0 * near - far) / 3.0, dtype=float)
        if self._is_analytic is None and speed > 0.0:
            size = max(1.0, float(np.abs(rate).max()))
            fits = exact is not None and np.abs(exact - rate).max() <= _AGREES * size
            self._is_analytic = bool(fits)
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


def _steps(u: Floats) -> Floats:
    return np.diag(_REAL_STEP * np.maximum(1.0, np.abs(u)))
