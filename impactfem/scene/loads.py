"""Loads in time: gravity as a piecewise constant number or vector."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, override

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.scene.formula import Formula
from impactfem.scene.kinds import FormulaOf, Kind
from impactfem.scene.means import mean_of
from impactfem.scene.pieces import Table
from impactfem.scene.values import NotAllowedError, number, show


@dataclass(frozen=True)
class PiecewiseConstant:
    """A function of time with the value ``values[k]`` from ``times[k]`` on.

    Attributes:
        times: [s], strictly increasing from 0. Before 0 the first value holds.
        values: one for each time.
        given: Measured signals that they are the means of, as a scene has them; None if none are.

    Raises:
        SceneError: times or values are not as described.
    """

    times: tuple[float, ...] = (0.0,)
    values: tuple[float, ...] = (0.0,)
    given: tuple[Any, ...] | None = field(default=None, compare=False, repr=False)

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

    def mean(self, t0: ArrayLike, t1: ArrayLike) -> Any:  # float or array
        """Return the means from t0 to t1, which broadcast; where t1 is t0 the value there."""
        span = np.subtract(t1, t0)
        known = span > 0.0
        found = self.integral(t0, t1) / np.where(known, span, 1.0)
        return np.where(known, found, self(np.broadcast_to(t0, span.shape)))[()]

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> Any:  # float or array
        """Return the integrals from t0 to t1, which broadcast; negative where t1 < t0."""
        start, end = np.broadcast_arrays(np.asarray(t0, dtype=float), np.asarray(t1, dtype=float))
        if len(self.values) == 1:
            return self.values[0] * (end - start)[()]
        mean = self._table.mean(np.minimum(start, end), np.maximum(start, end))
        return ((end - start) * mean)[()]

    @cached_property
    def _table(self) -> Table:
        values, none = np.array(self.values), np.zeros(len(self.values))
        return Table.of(np.array(self.times[1:]), values, none, none)

    def __getstate__(self) -> dict[str, Any]:
        """The state without what is made of it."""
        return {name: value for name, value in self.__dict__.items() if name != "_table"}


@dataclass(frozen=True)
class PiecewiseVector:
    """A vector in time with the value ``values[k]`` from ``times[k]`` on.

    Attributes:
        times: [s], strictly increasing from 0. Before 0 the first value holds.
        values: one vector of 1 to 3 numbers for each time, all of one length.
        given: Measured signals that they are the means of, as a scene has them; None if none are.

    Raises:
        SceneError: times or values are not as described.
    """

    times: tuple[float, ...] = (0.0,)
    values: tuple[tuple[float, ...], ...] = ((0.0, 0.0),)
    given: tuple[Any, ...] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        try:
            times = _numbers(self.times)
            vectors = tuple(_vector(entry) for entry in _entries(self.values))
            if len(times) != len(vectors):
                raise NotAllowedError(
                    f"there are {len(times)} times and {len(vectors)} vectors, give as many of each"
                )
            _check_times(times)
            if len({len(vector) for vector in vectors}) > 1:
                raise NotAllowedError("its vectors have different numbers of entries")
        except NotAllowedError as error:
            raise SceneError(f"piecewise constant vector: {error}.") from None
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", vectors)

    @property
    def dim(self) -> int:
        """Number of entries of each vector."""
        return len(self.values[0])

    @property
    def is_constant(self) -> bool:
        """Whether the vector never changes."""
        return len(set(self.values)) == 1

    def at(self, t: ArrayLike) -> Any:  # array of floats
        """Return the vectors (..., dim) at times t (...); at a jump, the one after it."""
        index = np.searchsorted(self.times, np.asarray(t, dtype=float), side="right") - 1
        return np.asarray(self.values)[np.maximum(index, 0)]

    def mean(self, a: float, b: float) -> Any:  # array of floats
        """Return the mean vector (dim,) from time a to time b; the one at a when b is a."""
        if a == b:
            return self.at(a)
        if len(self.values) == 1:  # as usual; asked several times in each step
            return np.array([value * (b - a) / (b - a) for value in self.values[0]])
        columns = zip(*self.values, strict=True)
        parts = (PiecewiseConstant(self.times, tuple(column)) for column in columns)
        return np.array([part.integral(a, b) / (b - a) for part in parts])


def _entries(value: object) -> list[Any] | tuple[Any, ...]:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, list | tuple):
        raise NotAllowedError(f"{show(value)} is not a list, give one")
    return value


def _vector(value: object) -> tuple[float, ...]:
    entries = _numbers(value)
    if len(entries) not in {1, 2, 3}:
        raise NotAllowedError(f"{show(list(entries))} is no vector of 1, 2 or 3 entries")
    return entries


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
    """A number (bars) or vector (other bodies), or a table of times and these."""

    type_name: ClassVar[str] = "number, vector or table"

    @property
    @override
    def allowed(self) -> str:
        return "a number (bar), a vector (others) or a table [[0.0, value], [time, value], ...]"

    @override
    def read(self, value: object) -> PiecewiseConstant | PiecewiseVector:
        if isinstance(value, PiecewiseConstant | PiecewiseVector):
            return value
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if isinstance(value, Mapping) or (isinstance(value, list | tuple) and any(
            isinstance(entry, Mapping | Formula) for entry in value
        )):  # fmt: skip
            return _followed(value)
        if not isinstance(value, list | tuple):
            return PiecewiseConstant((0.0,), (number(value),))
        if value and not any(isinstance(entry, list | tuple) for entry in value):
            return PiecewiseVector((0.0,), (_vector(value),))
        for entry in value:
            if not isinstance(entry, list | tuple) or len(entry) != 2:
                raise NotAllowedError(f"the entry {show(entry)} is not a pair [time, value]")
        times = _numbers([entry[0] for entry in value])
        _check_times(times)
        values = [entry[1] for entry in value]
        if not any(isinstance(entry, list | tuple) for entry in values):
            return PiecewiseConstant(times, _numbers(values))
        vectors = tuple(_vector(entry) for entry in values)
        if len({len(vector) for vector in vectors}) > 1:
            raise NotAllowedError("its vectors have different numbers of entries")
        return PiecewiseVector(times, vectors)

    @override
    def write(self, value: PiecewiseConstant | PiecewiseVector) -> Any:
        if value.given is not None:
            told = [each.plain if isinstance(each, Formula) else each for each in value.given]
            return told if isinstance(value, PiecewiseVector) else told[0]
        if isinstance(value, PiecewiseVector):
            if len(value.values) == 1:
                return list(value.values[0])
            return [[t, list(v)] for t, v in zip(value.times, value.values, strict=True)]
        if len(value.values) == 1:
            return value.values[0]
        return [[t, v] for t, v in zip(value.times, value.values, strict=True)]


_LEAST_PIECES = 200


def _followed(value: Any) -> PiecewiseConstant | PiecewiseVector:
    """Measured signals, as their means between samples: impulses from one to another are exact."""
    several = isinstance(value, list | tuple)
    parts = [
        FormulaOf(("t",)).read(entry) if isinstance(entry, Mapping | Formula) else number(entry)
        for entry in (value if several else [value])
    ]
    told = [part for part in parts if isinstance(part, Formula)]
    last = min(part.record[0][1] for part in told if part.record is not None)
    samples = np.unique(np.concatenate([part.compared("t") for part in told]))
    edges = np.concatenate([[0.0], samples[(samples > 0.0) & (samples < last)], [last]])
    parts_each = -(-_LEAST_PIECES // (len(edges) - 1))  # where there are few samples
    shares = np.arange(parts_each) / parts_each
    times = (edges[:-1, None] + np.diff(edges)[:, None] * shares).ravel()
    ends = np.append(times[1:], last)
    means = [
        mean_of(part, times, ends) if isinstance(part, Formula) else np.full(len(times), part)
        for part in parts
    ]
    if not several:
        return PiecewiseConstant(tuple(times.tolist()), tuple(means[0].tolist()), tuple(parts))
    vectors = tuple(tuple(each) for each in np.array(means).T.tolist())
    return PiecewiseVector(tuple(times.tolist()), vectors, tuple(parts))
