"""Periodic motions of systems that flow and jump: where they close, and whether they are stable.

Newton's method for x = P(x), with P from the start of a cycle to that of the next and its
derivative by first variation and saltation: no differences. A motion is stable where all
multipliers, the eigenvalues of that derivative, lie inside the unit circle.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.vibro.hybrid import RTOL, HybridSystem, Passage

_CLOSED = 1e-9  # of how far a state moves: what is farther off has not converged
_FLAT = 1e-12  # share of the size of P' - 1 below which a direction is not told apart
_HALVED = 8  # times a step of Newton's method
_ITERATIONS = 40
_ALONG = 1e-4  # share of a change of parameters for its effect, by differences
_BENDS = 0.3  # share of the way that is foreseen by which a motion may be elsewhere
_STILL = 1e-5  # share of the largest state
_SEEN = 9  # places of a phase, for how far states move
_SHORTEST = 1.0 / 64.0  # share of the way to other parameters that is tried

_PATIENCE = 8.0  # times the longest phase from the start: phases near it last no longer


@dataclass(frozen=True)
class Orbit:
    """A periodic motion of a hybrid system.

    Attributes:
        system: Its system.
        parameters: At which it is.
        start: State at the start of the first phase (n,).
        cycles: After which it repeats.
        passages: Its phases.
        closure: How far it ends from its start, in shares of how far a state moves.
        iterations: Of Newton's method.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    start: Floats
    cycles: int
    passages: tuple[Passage, ...]
    closure: float
    iterations: int
    _longest: float = field(repr=False)

    @property
    def period(self) -> float:
        """Time to the same state [s]."""
        return self.passages[-1].end

    @cached_property
    def map_slope(self) -> Floats:
        """P' (n, n), from the start of a cycle to that of the next, whenever that comes."""
        return _product([each.mapped for each in self.passages])

    @cached_property
    def monodromy(self) -> Floats:
        """The same at one time, by saltation matrices, (n, n); it keeps the rate at the start."""
        return _product([each.saltation @ each.change for each in self.passages])

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Of neighbours, largest first (n - 1,); the one along the motion, 1, is left out."""
        found = np.linalg.eigvals(self.map_slope).astype(complex)
        # The map from event to event has 0 where the monodromy has 1; equal sizes in one order.
        return np.array(sorted(found, key=lambda m: (-round(abs(m), 9), -m.imag))[:-1])

    @property
    def stable(self) -> bool:
        """Whether neighbours come back to it."""
        return bool(np.abs(self.multipliers).max(initial=0.0) < 1.0)

    @cached_property
    def doubt(self) -> float:
        """How far the derivatives are from keeping the rate at the start, which they must: 0."""
        laws = self.system.phases[0]
        rate = np.asarray(laws.rate(self.start, **self.parameters), dtype=float)
        return float(np.abs(self.monodromy @ rate - rate).max() / np.abs(rate).max())

    def states(self, times: ArrayLike) -> Floats:
        """At times from 0 to the period (k,), (k, n); at a jump, before it."""
        asked = np.atleast_1d(np.asarray(times, dtype=float))
        ends = [each.end for each in self.passages]
        which = np.clip(np.searchsorted(ends, asked), 0, len(ends) - 1)
        return np.array([
            self.passages[k].course(t) for k, t in zip(which, asked, strict=True)
        ]).reshape(len(asked), len(self.start))  # fmt: skip

    def at(self, **parameters: float) -> "Orbit":
        """The same motion at other parameters, near these.

        Raises:
            SceneError: A name is not known.
            ConvergenceError: None is found from here.
        """
        for name in parameters:
            _known(self, name)
        ends = {**self.parameters, **parameters}
        last, left, share = self, 1.0, 1.0
        while left > 0.0:
            share = min(share, left)
            change = {
                name: share / left * (value - last.parameters[name]) for name, value in ends.items()
            }
            try:
                last = last._beside(change if share < left else None, ends)
                left, share = left - share, 2.0 * share
            except ConvergenceError:  # closer, where the motion bends
                share *= 0.5
                if share < _SHORTEST:
                    raise
        return last

    def _beside(self, change: Mapping[str, float] | None, ends: Mapping[str, float]) -> "Orbit":
        """The same motion after a change of parameters, or at the end of the way."""
        if change is None:
            change = {name: value - self.parameters[name] for name, value in ends.items()}
            there = dict(ends)
        else:
            there = {name: value + change[name] for name, value in self.parameters.items()}
        sides = [
            self.system.follow(
                self.start, self.cycles,
                {name: value + side * change[name] for name, value in self.parameters.items()},
                longest=_PATIENCE * self.period,
            )[-1].after
            for side in (-_ALONG, _ALONG)
        ]  # fmt: skip
        size = _sizes(self.passages, self.start)
        moved = (sides[1] - sides[0]) / (2.0 * _ALONG)
        way = _solved(np.eye(len(size)) - self.map_slope, moved, size)
        found = periodic_orbit(
            self.system, self.start + way, there, cycles=self.cycles, longest=self._longest
        )
        off = _norm(found.start - self.start - way, size)
        if off > _BENDS * _norm(way, size) + _CLOSED:  # else it may be another motion
            raise ConvergenceError(
                f"periodic_orbit: the motion cannot be followed from {_told(self.parameters)} to "
                f"{_told(there)}: another one may be near, or it ends; give a nearer value"
            )
        return found

    def critical(self, name: str, other: float, multiplier: float = -1.0) -> "Orbit":
        """The motion at the parameter value at which a real multiplier passes a value.

        Args:
            name: Of the parameter.
            other: Value beyond it; the first is that of this orbit.
            multiplier: -1: the period doubles beyond. Not 1, where motions end or meet.

        Raises:
            SceneError: The name is not known, or no multiplier passes the value between.
            ConvergenceError: The motion cannot be followed so far.
        """
        _known(self, name)
        orbits = {float(self.parameters[name]): self}

        def off(value: float) -> float:
            if value not in orbits:
                near = min(orbits, key=lambda each: abs(each - value))
                orbits[value] = orbits[near].at(**{name: value})
            slope = orbits[value].map_slope
            return float(np.linalg.det(slope - multiplier * np.eye(len(slope))))

        one = self.parameters[name]
        if off(one) * off(other) > 0.0:
            told = [np.abs(orbits[v].multipliers).max() for v in (one, other)]
            raise SceneError(
                f"critical: no real multiplier passes {multiplier:g} for {name} from {one:g} to "
                f"{other:g} (largest sizes {told[0]:.6g} and {told[1]:.6g}); give other bounds"
            )
        size = max(abs(one), abs(other))
        value = float(brentq(off, one, other, xtol=1e-13 * size, rtol=1e-13))
        off(value)
        return orbits[value]


def periodic_orbit(
    system: HybridSystem, start: ArrayLike, parameters: Mapping[str, float] | None = None,
    *, cycles: int = 1, longest: float = 100.0,
) -> Orbit:  # fmt: skip
    """Find a periodic motion of a system that flows and jumps.

        >>> ball = impactfem.systems.Phase(  # on a plate that gives back what was lost
        ...     rate=lambda x: [x[1], -9.81], event=lambda x: x[0],
        ...     jump=lambda x: [x[0], -0.8 * x[1] + 0.5],
        ... )
        >>> system = impactfem.systems.HybridSystem([ball], names=["height", "speed"])
        >>> orbit = impactfem.systems.periodic_orbit(system, start=[0.0, 2.0])
        >>> round(float(orbit.start[1]), 9), orbit.multipliers.real.round(9)
        (2.5, array([0.8]))

    Args:
        system: Phases in their order.
        start: State near the start of the first phase (n,).
        parameters: By name, for the functions of the phases.
        cycles: After which it shall repeat: 2, 4 beyond doublings of the period.
        longest: A phase that lasts longer is refused [s].

    Raises:
        SceneError: A shape is wrong.
        ConvergenceError: A phase does not come to its event, or Newton's method does not close it.
    """
    given = dict(parameters or {})
    if not isinstance(cycles, int) or cycles < 1:
        raise SceneError(f"cycles: {cycles} is no number of cycles; give 1, 2, ...")

    def passed(x: Floats, longest: float) -> tuple[Passage, ...]:
        return tuple(system.follow(x, cycles, given, longest=longest, neighbours=True))

    x = system.checked(start)
    passages = passed(x, longest)
    # What falls on the way is not waited for.
    patience = min(longest, _PATIENCE * max(each.end - each.begin for each in passages))
    size, off = _sizes(passages, x), passages[-1].after - x
    best = _norm(off, size)
    count = 0
    while best > RTOL and count < _ITERATIONS:
        count += 1
        slope = _product([each.mapped for each in passages]) - np.eye(len(x))
        way = _solved(slope, -off, size)
        for cut in range(_HALVED if best > _CLOSED else 1):  # then only rounding is left
            try:
                tried = passed(x + 0.5**cut * way, patience)
            except ConvergenceError:
                continue
            missed = tried[-1].after - (x + 0.5**cut * way)
            if _norm(missed, size) < best:
                break
        else:
            break
        x, passages, off = x + 0.5**cut * way, tried, missed
        best, size = _norm(off, size), _sizes(passages, x)
    if best > _CLOSED:
        raise ConvergenceError(
            f"periodic_orbit: no periodic motion was found near the start; the nearest misses by "
            f"{best:.3g} of how far a state moves, after {count} steps; give another start, or "
            "other parameters"
        )
    return Orbit(system, given, x, cycles, passages, best, count, longest)


def _sizes(passages: tuple[Passage, ...], start: Floats) -> Floats:
    """How far each state moves (n,)."""
    within = [p.course(np.linspace(p.begin, p.end, _SEEN)).T for p in passages]
    known = np.concatenate([start[None], *within, *(p.after[None] for p in passages)])
    # What stands still, but for rounding, is seen beside what moves.
    return np.maximum(np.ptp(known, axis=0), max(_STILL * float(np.abs(known).max()), 1e-300))


def _solved(matrix: Floats, right: Floats, size: Floats) -> Floats:
    """In sizes of states; what closes anywhere along a direction stays where it is along it."""
    return np.asarray(
        size * np.linalg.lstsq(matrix * size / size[:, None], right / size, rcond=_FLAT)[0]
    )


def _told(parameters: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in parameters.items())


def _norm(off: Floats, size: Floats) -> float:
    return float(np.abs(off / size).max())


def _product(matrices: list[Floats]) -> Floats:
    return np.asarray(reduce(lambda done, each: each @ done, matrices))


def _known(orbit: Orbit, name: str) -> None:
    if name not in orbit.parameters:
        known = ", ".join(orbit.parameters) or "there are none"
        raise SceneError(f"{name}: there is no such parameter; parameters: {known}")
