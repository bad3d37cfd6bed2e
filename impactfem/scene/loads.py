"""Loads in time: gravity as a piecewise constant function."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.scene.kinds import Kind, NotAllowedError, number, show


@dataclass(frozen=True)
class PiecewiseConstant:
    """A function of time with the value ``values[k]`` from ``times[k]`` on.

    Attributes:
        times: [s], the first is 0, strictly increasing. Before 0 the first value holds.
        values: one for each time.

    Raises:
        SceneError: times or values are not as described.
    """

    times: tuple[float, ...] = (0.0,)
    values: tuple[float, ...] = (0.0,)

    def __post_init__(self) -> None:
        try:
            pairs = list(zip(_numbers(self.times), _numbers(self.values), strict=True))
            _check_table(pairs)
        except NotAllowedError as error:
            raise SceneError(f"piecewise constant function: {error}.") from None
        except ValueError:
            raise SceneError(
                f"piecewise constant function: {len(self.times)} times but {len(self.values)} values; "
                "give one value for each time."
            ) from None
        object.__setattr__(self, "times", tuple(t for t, _ in pairs))
        object.__setattr__(self, "values", tuple(v for _, v in pairs))

    @property
    def is_constant(self) -> bool:
        """Whether there is one value only."""
        return len(set(self.values)) == 1

    def __call__(self, t: ArrayLike) -> Any:
        """Return the value at times t (any shape); at a jump, the value after it."""
        index = np.searchsorted(self.times, np.asarray(t, dtype=float), side="right") - 1
        return np.asarray(self.values)[np.maximum(index, 0)]

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> Any:
        """Return the integral from t0 to t1 (broadcast against each other; negative when t1 < t0)."""
        start, end = np.broadcast_arrays(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        total = np.zeros(start.shape)
        edges = (-np.inf, *self.times[1:], np.inf)
        # Piece by piece, not as a difference of antiderivatives: short intervals late keep their digits.
        for value, (left, right) in zip(self.values, pairwise(edges), strict=True):
            total = total + value * (np.clip(end, left, right) - np.clip(start, left, right))
        return total[()]


def _numbers(entries: object) -> list[float]:
    if isinstance(entries, np.ndarray):
        entries = entries.tolist()
    if not isinstance(entries, list | tuple):
        raise NotAllowedError(f"{show(entries)} is not a list of numbers")
    return [number(entry) for entry in entries]


def _check_table(pairs: list[tuple[float, float]]) -> None:
    if not pairs:
        raise NotAllowedError("the table is empty, give at least [[0.0, value]]")
    if pairs[0][0] != 0.0:
        raise NotAllowedError(f"the first time is {pairs[0][0]}, it must be 0.0")
    for (before, _), (after, _) in pairwise(pairs):
        if not after > before:
            raise NotAllowedError(f"the times must increase, but {after} follows {before}")


@dataclass(frozen=True)
class LoadKind(Kind):
    """A number, or a table of times and values."""

    type_name: ClassVar[str] = "number or table"
    allowed: ClassVar[str] = "a number or a table [[0.0, value], [time, value], ...]"  # type: ignore[misc]

    def read(self, value: object) -> PiecewiseConstant:
        """Return a PiecewiseConstant; raise NotAllowedError saying why not."""
        if isinstance(value, PiecewiseConstant):
            return value
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if isinstance(value, str | Mapping) or not isinstance(value, list | tuple):
            return PiecewiseConstant((0.0,), (number(value),))
        if value and not any(isinstance(entry, list | tuple) for entry in value):
            raise NotAllowedError(
                "it is a vector, but a bar is one-dimensional: give one number, positive towards the wall, "
                "such as gravity = 9.81"
            )
        pairs = []
        for entry in value:
            if not isinstance(entry, list | tuple) or len(entry) != 2:
                raise NotAllowedError(f"the entry {show(entry)} is not a pair [time, value]")
            pairs.append((number(entry[0]), number(entry[1])))
        _check_table(pairs)
        return PiecewiseConstant(tuple(t for t, _ in pairs), tuple(v for _, v in pairs))

    def write(self, value: PiecewiseConstant) -> float | list[list[float]]:
        """Return a number, or a list of pairs."""
        if len(value.values) == 1:
            return value.values[0]
        return [[t, v] for t, v in zip(value.times, value.values, strict=True)]
