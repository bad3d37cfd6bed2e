"""Loads in time: gravity as a piecewise constant function."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, override

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.scene.kinds import Kind
from impactfem.scene.values import NotAllowedError, number, show


@dataclass(frozen=True)
class PiecewiseConstant:
    """A function of time with the value ``values[k]`` from ``times[k]`` on.

    Attributes:
        times: [s], strictly increasing from 0. Before 0 the first value holds.
        values: one for each time.

    Raises:
        SceneError: times or values are not as described.
    """

    times: tuple[float, ...] = (0.0,)
    values: tuple[float, ...] = (0.0,)

    def __post_init__(self) -> None:
        try:
            times, values = _numbers(self.times), _numbers(self.values)
            if len(times) != len(values):
                raise NotAllowedError(
                    f"there are {len(times)} times and {len(values)} values, give as many of each"
                )
            _check_times(times)
        except NotAllowedError as error:
            raise SceneError(f"piecewise constant function: {error}.") from None
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    @property
    def is_constant(self) -> bool:
        """Whether the value never changes."""
        return len(set(self.values)) == 1

    def __call__(self, t: ArrayLike) -> Any:  # float or array of floats
        """Return the values at times t (any shape); at a jump, the value after it."""
        index = np.searchsorted(self.times, np.asarray(t, dtype=float), side="right") - 1
        return np.asarray(self.values)[np.maximum(index, 0)]

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> Any:  # float or array
        """Return the integrals from t0 to t1, which broadcast; negative where t1 < t0."""
        start, end = np.broadcast_arrays(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        total = np.zeros(start.shape)
        edges = (-np.inf, *self.times[1:], np.inf)
        # Piece by piece, not as a difference of antiderivatives: short late intervals keep digits.
        for value, (left, right) in zip(self.values, pairwise(edges), strict=True):
            total = total + value * (np.clip(end, left, right) - np.clip(start, left, right))
        return total[()]


def _numbers(entries: object) -> tuple[float, ...]:
    if isinstance(entries, np.ndarray):
        entries = entries.tolist()
    if not isinstance(entries, list | tuple):
        raise NotAllowedError(f"{show(entries)} is not a list of numbers, give one")
    result = []
    for entry in entries:
        try:
            result.append(number(entry))
        except NotAllowedError as error:
            raise NotAllowedError(f"the entry {show(entry)} is not allowed, {error}") from None
    return tuple(result)


def _check_times(times: tuple[float, ...]) -> None:
    if not times:
        raise NotAllowedError("it is empty, give at least the time 0.0")
    if times[0] != 0.0:
        raise NotAllowedError(f"the first time is {times[0]}, it must be 0.0")
    for before, after in pairwise(times):
        if not after > before:
            raise NotAllowedError(f"the times must increase, but {after} follows {before}")


@dataclass(frozen=True)
class LoadKind(Kind):
    """A number, or a table of times and values."""

    type_name: ClassVar[str] = "number or table"

    @property
    @override
    def allowed(self) -> str:
        return "a number or a table [[0.0, value], [time, value], ...]"

    @override
    def read(self, value: object) -> PiecewiseConstant:
        if isinstance(value, PiecewiseConstant):
            return value
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, list | tuple):
            return PiecewiseConstant((0.0,), (number(value),))
        if value and not any(isinstance(entry, list | tuple) for entry in value):
            raise NotAllowedError(
                "it is a vector, but a bar moves along one axis with gravity positive towards the "
                "wall (gravity = 9.81)"
            )
        for entry in value:
            if not isinstance(entry, list | tuple) or len(entry) != 2:
                raise NotAllowedError(f"the entry {show(entry)} is not a pair [time, value]")
        times = _numbers([entry[0] for entry in value])
        _check_times(times)
        return PiecewiseConstant(times, _numbers([entry[1] for entry in value]))

    @override
    def write(self, value: PiecewiseConstant) -> float | list[list[float]]:
        if len(value.values) == 1:
            return value.values[0]
        return [[t, v] for t, v in zip(value.times, value.values, strict=True)]
