"""What users give of a system in generalised coordinates, in its right shape."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene.values import show

Constraints = Callable[[Floats], ArrayLike] | Sequence[Callable[[Floats], Any]]


def constant_mass(mass: ArrayLike) -> Floats:
    """M as a matrix (d, d).

    Raises:
        SceneError: It has another shape, or a value that is not allowed.
    """
    matrix = np.asarray(mass, dtype=float)
    if matrix.ndim == 0:
        matrix = matrix.reshape(1, 1)
    if matrix.ndim == 1:
        matrix = np.diag(matrix)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not len(matrix):
        raise SceneError(f"mass has shape {matrix.shape}; give (d, d), (d,) or a number")
    return matrix


def square(name: str, matrix: ArrayLike | None, d: int) -> Floats:
    """A matrix (d, d); 0 if None.

    Raises:
        SceneError: It has another shape, or a value that is not allowed.
    """
    if matrix is None:
        return np.zeros((d, d))
    found = np.asarray(matrix, dtype=float)
    if found.ndim == 0:
        found = found.reshape(1, 1)
    if found.ndim == 1:
        found = np.diag(found)
    if found.shape != (d, d):
        raise SceneError(f"LinearSystem: {name} has shape {found.shape}; give ({d}, {d})")
    return found


def as_function(constraints: Constraints | None) -> Callable[[Any], Any]:
    """Constraints as one function u -> (J,).

    Raises:
        SceneError: It has another shape, or a value that is not allowed.
    """
    if constraints is None:
        return lambda u: 0.0 * u[:0]
    if callable(constraints):
        return constraints
    functions = tuple(constraints)
    if not functions or not all(callable(entry) for entry in functions):
        raise SceneError(
            f"constraints = {show(constraints)}: give a function u -> (J,), or a list of functions"
        )
    return lambda u: np.array([entry(u) for entry in functions])


def friction_of(given: float | Sequence[float], count: int) -> Floats:
    """Coefficients of friction, (count,).

    Raises:
        SceneError: It has another shape, or a value that is not allowed.
    """
    values = np.asarray(given, dtype=float)
    values = np.full(count, values) if values.ndim == 0 else values
    if values.shape != (count,):
        raise SceneError(f"friction has {values.size} entries for {count} constraints")
    bad = np.flatnonzero(~((values >= 0.0) & np.isfinite(values)))
    if len(bad):
        raise SceneError(
            f"friction = {values[bad[0]]:g} of constraint {bad[0]} is not allowed: give a number "
            ">= 0"
        )
    return values


def restitution_of(given: float | Sequence[float], count: int, name: str = "restitution") -> Floats:
    """Coefficients of restitution, (count,).

    Raises:
        SceneError: It has another shape, or a value that is not allowed.
    """
    values = np.asarray(given, dtype=float)
    if values.ndim == 0:
        values = np.full(count, float(values))
    if values.shape != (count,):
        raise SceneError(f"{name} has {values.size} entries for {count} constraints")
    bad = np.flatnonzero(~((values >= 0.0) & (values <= 1.0)))
    if len(bad):
        raise SceneError(
            f"{name} = {values[bad[0]]:g} of constraint {bad[0]} is not allowed: give a "
            "number from 0 (no rebound) to 1 (no loss)"
        )
    return values


def static_friction_of(given: float | Sequence[float] | None, friction: Floats) -> Floats:
    """Coefficients of what sticks, (count,).

    Raises:
        SceneError: One is below that of what slides.
    """
    if given is None:
        return friction.copy()
    values = friction_of(given, len(friction))
    low = np.flatnonzero(values < friction)
    if len(low):
        raise SceneError(
            f"static_friction = {values[low[0]]:g} of constraint {low[0]} is below friction = "
            f"{friction[low[0]]:g}: give at least that"
        )
    return values


def entries_of(
    vectors: Sequence[Sequence[int]], count: int, *, moved: bool
) -> tuple[NDArray[np.int64], ...]:
    """Entries of u (count,) of each unit vector.

    Raises:
        SceneError: There are no such entries, or no rates that would turn them.
    """
    found = tuple(np.asarray(one, dtype=np.int64).reshape(-1) for one in vectors)
    for one in found:
        if not moved or not len(one) or one.min() < 0 or one.max() >= count:
            raise SceneError(
                f"unit_vectors = {[list(map(int, each)) for each in found]}: give the entries from "
                f"0 to {count - 1} of each vector of length 1, beside rates"
            )
    return found
