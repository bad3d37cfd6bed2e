"""What is asked of a motion: its equation, its limits, its cost; checked before anything is built.

A problem is x' = f(t, x, u, p) with bounds of states, controls and parameters, states at both
ends, paths c(t, x, u, p) <= 0, and the cost end(T, x(T), p) + int running(t, x, u, p) dt.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.trajectory.impacts import Impact
from impactfem.trajectory.symbols import loaded, tried

type Limits = tuple[float, float] | None
"""Least and largest value; None: any."""

type Limited = Mapping[str, Limits] | Sequence[str]
"""Names with their limits, or names alone."""

type Given = Mapping[str, float | tuple[float, float]]
"""Values by name, or least and largest ones."""


@dataclass(frozen=True)
class Row:
    """What is asked at one end of what follows from the states.

    Attributes:
        name: For messages.
        of: States to a number, in symbols.
        low: Least value.
        high: Largest.
        size: In which its distance is counted.
    """

    name: str
    of: Callable[[Any], Any]
    low: float
    high: float
    size: float

    def off(self, states: Floats) -> float:
        """How far states (n,) are from it."""
        value = float(self.of(loaded().DM(states)))
        return max(self.low - value, value - self.high, 0.0)


@dataclass(frozen=True)
class Problem:
    """A motion that is asked for.

    Attributes:
        dynamics: f(t, x, u) or, with parameters, f(t, x, u, p), n entries.
        states: Names with limits, (n).
        controls: Names with limits, (m).
        parameters: Names with limits; they are searched too.
        duration: T [s], or its least and largest value.
        start: States at t = 0, by name.
        end: States at t = T.
        running: Integrand of the cost; None: 0.
        final: Cost of the end, (T, x[, p]); None: 0.
        path: What stays <= 0 all the way; None: nothing.
        path_names: For messages.
        start_rows: What else holds at t = 0.
        end_rows: What else holds at t = T.
        impacts: What the motion strikes; only shooting goes through.
        pairs: Factors >= 0 of products that are 0, one after the other; None: there are none.
        pair_names: For messages.
        sizes: Of states, where ends and bounds say none, as of angles.
    """

    dynamics: Callable[..., Any]
    states: Mapping[str, Limits]
    controls: Mapping[str, Limits]
    parameters: Mapping[str, Limits]
    duration: tuple[float, float]
    start: Given
    end: Given
    running: Callable[..., Any] | None = None
    final: Callable[..., Any] | None = None
    path: Callable[..., Any] | None = None
    path_names: tuple[str, ...] = ()
    start_rows: tuple[Row, ...] = ()
    end_rows: tuple[Row, ...] = ()
    impacts: tuple[Impact, ...] = ()
    pairs: Callable[..., Any] | None = None
    pair_names: tuple[str, ...] = ()
    sizes: Mapping[str, float] = MappingProxyType({})

    @classmethod
    def of(
        cls, dynamics: Callable[..., Any], states: Limited, controls: Limited, parameters: Limited,
        duration: float | tuple[float, float], start: Given, end: Given, **asked: Any,
    ) -> "Problem":  # fmt: skip
        """A problem that is in order.

        Raises:
            SceneError: A limit, a name, an end or the duration cannot be.
        """
        named = _limited("states", states)
        pushes, searched = _limited("controls", controls), _limited("parameters", parameters)
        if not named:
            raise SceneError('states: there are none; name them, as states=["x", "v"]')
        pair = duration if isinstance(duration, Sequence) else (duration, duration)
        low, high = _pair("duration", pair)
        if not (low > 0.0 and np.isfinite(high)):
            raise SceneError(f"duration: {duration} is no span of time; give finite seconds > 0")
        for side, given in (("start", start), ("end", end)):
            _check_end(side, given, named)
        ends = dict(start), dict(end)
        problem = cls(dynamics, named, pushes, searched, (low, high), *ends, **asked)
        problem.check()
        return problem

    @property
    def free(self) -> bool:
        """Whether the duration is searched."""
        return self.duration[0] < self.duration[1]

    def check(self) -> None:
        """Try all functions with symbols, and their count.

        Raises:
            SceneError: One does not work, or has another number of entries.
        """
        rate, cost = self.rate.size1_out(0), self.rate.size1_out(1)
        if rate != len(self.states):
            raise SceneError(
                f"dynamics: has {rate} entries for {len(self.states)} states "
                f"({', '.join(self.states)}); give the rate of each"
            )
        if cost != 1 or self.last.size1_out(0) != 1:
            raise SceneError("cost: is not one number; give a sum")
        for impact, jump in zip(self.impacts, self.jumps, strict=True):
            if jump.size1_out(0) != rate:
                raise SceneError(
                    f"impacts: the jump of {impact.name} has {jump.size1_out(0)} entries for "
                    f"{rate} states; give each just after the impact"
                )
        if self.gaps.size1_out(0) != len(self.impacts):
            raise SceneError("impacts: a gap is not one number; give an Impact for each")

    @cached_property
    def rate(self) -> Any:
        """(t, x, u, p) to the rates (n,) and the integrand of the cost."""
        symbols = self._symbols()
        told = tried("dynamics", self.dynamics, self._asked(symbols))
        cost = 0 if self.running is None else tried("running", self.running, self._asked(symbols))
        return expanded("rate", symbols, [told, cost])

    @cached_property
    def limited(self) -> Any:
        """(t, x, u, p) to what stays <= 0, (c,)."""
        symbols = self._symbols()
        return expanded("limited", symbols, [self._entries("path", self.path, symbols)])

    @cached_property
    def gaps(self) -> Any:
        """(t, x, u, p) to the gaps of impacts, (J,)."""
        symbols = self._symbols()
        told = [tried(each.name, each.gap, self._asked(symbols)) for each in self.impacts]
        return expanded("gaps", symbols, [loaded().vertcat(loaded().MX(0, 1), *told)])

    @cached_property
    def paired(self) -> Any:
        """(t, x, u, p) to the first and the second factors of products that are 0, (k,) each."""
        symbols = self._symbols()
        told = self._entries("pairs", self.pairs, symbols)
        if told.numel() % 2:
            raise SceneError(f"pairs: are {told.numel()} entries; give two of each product")
        return expanded("paired", symbols, [told[::2], told[1::2]])

    @cached_property
    def jumps(self) -> list[Any]:
        """Of each impact (t, x, u, p) to the states just after it, (n,)."""
        symbols = self._symbols()
        return [
            expanded("jump", symbols, [tried(each.name, each.jump, self._asked(symbols))])
            for each in self.impacts
        ]

    @cached_property
    def last(self) -> Any:
        """(T, x, p) to the cost of the end."""
        t, x, _, p = self._symbols()
        told = 0
        if self.final is not None:
            told = tried("final", self.final, (t, x, p) if self.parameters else (t, x))
        return expanded("last", (t, x, p), [told])

    def path_name(self, which: int) -> str:
        """For messages."""
        named = self.path_names[which : which + 1]
        return f"path[{which}]" + (f' ("{named[0]}")' if named else "")

    def _symbols(self) -> tuple[Any, ...]:
        sizes = {"t": 1, "x": len(self.states), "u": len(self.controls), "p": len(self.parameters)}
        return tuple(loaded().MX.sym(name, size) for name, size in sizes.items())

    def _entries(self, name: str, function: Any, symbols: Sequence[Any]) -> Any:
        if function is None:
            return loaded().MX(0, 1)
        return tried(name, function, self._asked(symbols))

    def _asked(self, symbols: Sequence[Any]) -> Sequence[Any]:
        return symbols if self.parameters else symbols[:3]


def expanded(name: str, symbols: Sequence[Any], told: Sequence[Any]) -> Any:
    """A function of CasADi: of scalars, which is faster, where all it holds can be."""
    made = loaded().Function(name, list(symbols), list(told))
    try:
        return made.expand()
    except RuntimeError:  # it calls what is no formula, as an integrator or a library
        return made


def bounds_of(given: Mapping[str, Limits]) -> Floats:
    """Least and largest values, (n, 2)."""
    pairs = [(-np.inf, np.inf) if each is None else each for each in given.values()]
    return np.array(pairs, dtype=float).reshape(-1, 2)


def held(given: Given, bounds: Floats, names: Sequence[str]) -> Floats:
    """The bounds at one end of the motion, (n, 2)."""
    found = bounds.copy()
    for name, value in given.items():
        found[list(names).index(name)] = value
    return found


def _limited(what: str, given: Limited) -> dict[str, Limits]:
    pairs = given.items() if isinstance(given, Mapping) else [(name, None) for name in given]
    return {
        str(name): None if limits is None else _pair(f"{what}.{name}", limits)
        for name, limits in pairs
    }


def _pair(what: str, limits: Sequence[float]) -> tuple[float, float]:
    try:
        low, high = (float(each) for each in limits)
    except (TypeError, ValueError):
        raise SceneError(f"{what}: {limits} is no pair; give least and largest value") from None
    if not low <= high:  # also where one is no number
        raise SceneError(f"{what}: {low:g} to {high:g} holds no number; give the smaller one first")
    return low, high


def _check_end(side: str, given: Given, states: Mapping[str, Limits]) -> None:
    for name, value in given.items():
        if name not in states:
            raise SceneError(f"{side}.{name}: there is no such state; states: {', '.join(states)}")
        wanted = (value, value) if isinstance(value, float | int) else value
        low, high = _pair(f"{side}.{name}", wanted)
        least, most = states[name] or (-np.inf, np.inf)
        if high < least or low > most:
            told = low if low == high else (low, high)
            raise SceneError(
                f"{side}.{name}: {told} lies outside bounds.{name}, {least:g} to {most:g}; "
                "widen them, or move it inside"
            )
        if not np.isfinite(low) and not np.isfinite(high):
            raise SceneError(f"{side}.{name}: {value} says nothing; leave it out")
