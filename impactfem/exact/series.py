"""Trigonometric series with coefficients n^-2 and n^-3, cut off with a bound of the error."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError

type Array = NDArray[np.float64]

_EPS = float(np.finfo(float).eps)
_SUMMATIONS = 9  # summations by parts tried; more only lose digits
_BATCH = 1_000_000  # terms times points formed together


class PartialSum(NamedTuple):
    """A series cut off.

    Attributes:
        value: The sum, accelerated.
        bound: Largest possible distance from the infinite sum, rounding included.
    """

    value: Array
    bound: Array


def cosines(angle: Array, terms: int) -> PartialSum:
    """Sum of cos(n angle)/n^2 over n >= 1, cut off after `terms` and accelerated."""
    total, bound = _sum(angle, 2, 0.0, terms)
    return PartialSum(np.real(total), bound)


def sines(angle: Array, terms: int) -> PartialSum:
    """Sum of sin((n - 1/2) angle)/(n - 1/2)^3 over n >= 1, cut off and accelerated likewise."""
    total, bound = _sum(angle, 3, 0.5, terms)
    return PartialSum(np.imag(total), bound)


def _sum(
    angle: Array, power: int, shift: float, terms: int
) -> tuple[NDArray[np.complex128], Array]:
    """Sum of a_n exp(i (n - shift) angle), a_n = (n - shift)^-power, and a bound of the error.

    The tail from M = terms + 1 on is summed by parts: with q = exp(i angle) and differences D,
        sum_{n>=M} a_n q^n = sum_{j<J} (D^j a)_M q^{M+j}/(1-q)^{j+1} + remainder,
    and since a_n is completely monotone, |remainder| <= |(D^{J-1} a)_M|/|1-q|^J. Each point takes
    the J that leaves least; at a wave front (q = 1) that is J = 0, the plain tail.
    """
    if terms < 1:
        raise SceneError(f"terms = {terms}: give a number of at least 1")
    n = np.arange(1, terms + 1) - shift
    flat = angle.ravel()
    total = np.empty(flat.shape, dtype=np.complex128)
    batch = max(1, _BATCH // terms)
    for low in range(0, flat.size, batch):
        part = slice(low, low + batch)
        total[part] = np.exp(1j * np.outer(flat[part], n)) @ n ** (-float(power))
    q = np.exp(1j * flat)
    away = np.abs(1.0 - q)
    first = np.exp(1j * (terms + 1 - shift) * flat)  # q^M, turned by the shift
    differences = np.arange(terms + 1, terms + 2 + _SUMMATIONS) - shift
    differences = differences ** (-float(power))
    size = float(differences[0])
    best = np.full(flat.shape, (terms + 0.5 - shift) ** (1 - power) / (power - 1))
    tail, chosen = np.zeros_like(total), np.zeros_like(total)
    rounding = np.zeros(flat.shape)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for j in range(_SUMMATIONS):
            tail = tail + differences[0] * first * q**j / (1.0 - q) ** (j + 1)
            rounding = rounding + 2.0**j * size * _EPS / away ** (j + 1)
            left = np.abs(differences[0]) / away ** (j + 1) + 4.0 * rounding
            better = left < best
            best, chosen = np.where(better, left, best), np.where(better, tail, chosen)
            differences = np.diff(differences)
    # Rounding of the terms themselves: of the angle (1 + its size) and of the sum.
    best = best + 8.0 * _EPS * (1.0 + np.abs(flat)) * (1.0 + np.log(terms))
    return (total + chosen).reshape(angle.shape), best.reshape(angle.shape)
