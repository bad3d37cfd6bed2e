"""Functions of time whose form is known, so that linear motions can be followed exactly."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.scene.breaks import Break, find_breaks
from impactfem.scene.formula import Formula
from impactfem.scene.jets import motion_at
from impactfem.scene.loads import PiecewiseConstant
from impactfem.scene.means import mean_of, stops_of


@dataclass(frozen=True)
class Signal:
    """A scalar function of time: ``constant + slope t + sum of a cos(w t) + b sin(w t) + more``.

    Attributes:
        constant: Value at t = 0 of the polynomial part.
        slope: Its rate [1/s].
        harmonics: Entries (w, a, b), w > 0 [rad/s], each w once.
        formulas: Entries (factor, formula in t): further terms, with exact derivatives and breaks.
        rest: Anything else, a function of time that takes arrays; None if there is nothing else.
    """

    constant: float = 0.0
    slope: float = 0.0
    harmonics: tuple[tuple[float, float, float], ...] = ()
    formulas: tuple[tuple[float, Formula], ...] = ()
    rest: Callable[[Any], Any] | None = field(default=None, compare=False)

    @property
    def is_zero(self) -> bool:
        """Whether it vanishes at all times."""
        return self.is_constant and self.constant == 0.0

    @property
    def is_constant(self) -> bool:
        """Whether it does not depend on time."""
        return not self.slope and not self.harmonics and self.is_exact

    @property
    def is_exact(self) -> bool:
        """Whether constant, slope and harmonics are all."""
        return self.rest is None and not self.formulas

    def __call__(self, t: ArrayLike) -> Any:  # float or array of floats
        """Value at the times t [s], shape of t."""
        times = np.asarray(t)
        value = self.constant + self.slope * times
        for w, a, b in self.harmonics:
            value = value + a * np.cos(w * times) + b * np.sin(w * times)
        for factor, formula in self.formulas:
            value = value + factor * formula(t=times)
        if self.rest is not None:
            value = value + self.rest(times)
        return value if np.ndim(value) else value[()]

    def mean(self, start: ArrayLike, end: ArrayLike) -> Any:  # float or array of floats
        """Mean values between times [s], which broadcast; that of a callable rest by samples."""
        first, last = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        middle, span = 0.5 * (first + last), last - first
        value = self.constant + self.slope * middle
        for w, a, b in self.harmonics:
            flat = np.sinc(w * span / (2.0 * np.pi))
            value = value + flat * (a * np.cos(w * middle) + b * np.sin(w * middle))
        at_once = first.ndim == last.ndim == 0 and first == last
        for factor, formula in self.formulas:
            now = formula.number({"t": float(first)}) if at_once else mean_of(formula, first, last)
            value = value + factor * now
        if isinstance(self.rest, PiecewiseConstant):
            value = value + self.rest.mean(first, last)
        elif self.rest is not None:
            nodes, weights = np.polynomial.legendre.leggauss(8)
            for node, weight in zip(nodes, weights, strict=True):
                value = value + 0.5 * weight * self.rest(middle + 0.5 * node * span)
        return value if np.ndim(value) else value[()]

    def rate(self, t: ArrayLike) -> Any:  # float or array of floats
        """Derivative at the times t; that of the rest by central differences (to about 1e-9)."""
        times = np.asarray(t, dtype=float)
        value = self.slope + 0.0 * times
        for w, a, b in self.harmonics:
            value = value + w * (b * np.cos(w * times) - a * np.sin(w * times))
        for factor, formula in self.formulas:
            value = value + factor * motion_at(formula, times).rate
        if self.rest is not None:
            h = 1e-5 * np.maximum(1.0, np.abs(times))
            value = value + (self.rest(times + h) - self.rest(times - h)) / (2.0 * h)
        return value if np.ndim(value) else value[()]

    def curvature(self, t: ArrayLike) -> Any:  # float or array of floats
        """Second derivative at the times t; that of the rest by differences (to about 1e-6)."""
        times = np.asarray(t, dtype=float)
        value = 0.0 * times
        for w, a, b in self.harmonics:
            value = value - w * w * (a * np.cos(w * times) + b * np.sin(w * times))
        for factor, formula in self.formulas:
            value = value + factor * motion_at(formula, times).second
        if self.rest is not None:
            h = 1e-4 * np.maximum(1.0, np.abs(times))
            outer = self.rest(times + h) + self.rest(times - h)
            value = value + (outer - 2.0 * self.rest(times)) / (h * h)
        return value if np.ndim(value) else value[()]

    def kicks(self, end: float) -> list[tuple[Break, float, float]]:
        """Breaks of its formulas up to a time, with its rate before and after each."""
        breaks = {at for _, formula in self.formulas for at in find_breaks(formula, end)}
        return [
            (at, float(self.rate(at.before)), float(self.rate(at.after)))
            for at in sorted(breaks, key=lambda at: at.before)
        ]

    def stops(self, end: float) -> list[Break]:
        """Where an integrator with its own steps should stop, up to an end [s]."""
        jumps = self.rest.times[1:] if isinstance(self.rest, PiecewiseConstant) else ()
        found = [stop for _, formula in self.formulas for stop in stops_of(formula, end)]
        return [*found, *(Break.at(time) for time in jumps if time < end)]

    def plus(self, other: "Signal") -> "Signal":
        """The sum of two signals."""
        terms = {w: (a, b) for w, a, b in self.harmonics}
        for w, a, b in other.harmonics:
            first = terms.get(w, (0.0, 0.0))
            terms[w] = (first[0] + a, first[1] + b)
        rest = self.rest if other.rest is None else other.rest
        if self.rest is not None and other.rest is not None:
            one, two = self.rest, other.rest

            def rest(t: Any) -> Any:
                return one(t) + two(t)

        return Signal(
            self.constant + other.constant,
            self.slope + other.slope,
            tuple((w, a, b) for w, (a, b) in sorted(terms.items()) if a or b),
            (*self.formulas, *other.formulas),
            rest,
        )

    def times(self, factor: float) -> "Signal":
        """The signal times a number."""
        if factor == 0.0:
            return Signal()
        inner, rest = self.rest, None
        if inner is not None:
            whole = inner

            def rest(t: Any) -> Any:
                return factor * whole(t)

        return Signal(
            factor * self.constant,
            factor * self.slope,
            tuple((w, factor * a, factor * b) for w, a, b in self.harmonics),
            tuple((factor * own, formula) for own, formula in self.formulas),
            rest,
        )

    def sine(self, phase: float = 0.0) -> "Signal | None":
        """sin(signal + phase) of a signal that is linear in time; None of another."""
        if self.harmonics or not self.is_exact:
            return None
        start, w = self.constant + phase, self.slope
        if w == 0.0:
            return Signal(math.sin(start))
        a, b = math.sin(start), math.cos(start)
        return Signal(harmonics=((w, a, b),) if w > 0 else ((-w, a, -b),))
