"""Neighbours of a run, one or two along each parameter, and flights of all of them together.

They fly with the same steps of one integrator: differences of neighbours then are smooth, and exact
but for the square of their distance (internal numerical differentiation: Bock, Numerical treatment
of inverse problems in chemical reaction kinetics, 1981). Where a flight begins or ends because a
load jumps, each neighbour's flight begins or ends at the time of its own jump, and time is
stretched between.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem, Kin, LinearSystem
from impactfem.vibro.event_legs import Leg
from impactfem.vibro.event_motion import Motion
from impactfem.vibro.event_rubbing import RubbingMotion
from impactfem.vibro.flight_kernels import refresh, taylor
from impactfem.vibro.flights import Flights

State = tuple[Floats, Floats, Floats]
"""u, v and the integrals of the forces of closed contacts, and of the power of friction."""

_RTOL = 1e-12  # of flights


@dataclass(frozen=True)
class Neighbours:
    """Systems beside that of the run, along one parameter.

    Attributes:
        systems: The systems, (k,).
        starts: Their u and v at t = 0.
        offsets: Of the parameter, (k,).
        weights: A derivative is the sum of these times values at the systems, (k,).
    """

    systems: tuple[GeneralizedSystem, ...]
    starts: tuple[tuple[Floats, Floats], ...]
    offsets: Floats
    weights: Floats


class Span(NamedTuple):
    """When a flight takes place, in the run and beside it.

    Attributes:
        start, end: In the run [s].
        early, late: How much later neighbours begin and end [s], (k,).
    """

    start: float
    end: float
    early: Floats
    late: Floats

    @property
    def stretched(self) -> bool:
        """Whether neighbours have times of their own."""
        return bool(self.early.any() or self.late.any())

    def later(self, t: float) -> Floats:
        """How much later than the run neighbours are at its time t [s], (k,)."""
        share = (t - self.start) / (self.end - self.start) if self.end > self.start else 0.0
        return np.asarray((1.0 - share) * self.early + share * self.late)

    @property
    def pace(self) -> Floats:
        """Rate of their times by that of the run, (k,)."""
        span = self.end - self.start
        return np.asarray(1.0 + (self.late - self.early) / span if span else 1.0 + 0.0 * self.late)


@dataclass(frozen=True)
class Bundle:
    """All neighbours of a run in one list."""

    systems: tuple[GeneralizedSystem, ...]
    offsets: Floats
    of: NDArray[np.int64]
    weights: Floats
    flights: tuple[Flights, ...] | None

    @classmethod
    def of_all(cls, each: Sequence[Neighbours], duration: float) -> "Bundle":
        """Those of all parameters of a run that lasts so long [s]."""
        systems = tuple(s for one in each for s in one.systems)
        of = np.repeat(np.arange(len(each)), [len(one.systems) for one in each])
        weights = np.concatenate([one.weights for one in each])
        linear = [s for s in systems if isinstance(s, LinearSystem) and s.is_exact]
        exact = len(linear) == len(systems) and not any(s.static_friction.any() for s in systems)
        flights = tuple(Flights(s, duration) for s in linear) if exact else None
        return cls(systems, np.concatenate([one.offsets for one in each]), of, weights, flights)

    @property
    def count(self) -> int:
        """Number P of parameters."""
        return int(self.of[-1]) + 1

    def derivative(self, values: Sequence[Floats | float] | Floats) -> Floats:
        """Derivatives (..., P) of values at the neighbours (k, ...)."""
        given = np.asarray(values, dtype=float)
        found = np.zeros((self.count, *given.shape[1:]))
        np.add.at(found, self.of, self.weights.reshape(-1, *[1] * (given.ndim - 1)) * given)
        return np.moveaxis(found, 0, -1)

    def beside(self, value: Floats, change: Floats) -> Floats:
        """Values at the neighbours (k, n), of one (n,) that changes by (n, P)."""
        return np.asarray(value + self.offsets[:, None] * change.T[self.of])

    def flown(
        self, leg: Leg, span: Span, at: tuple[Floats, Floats], times: Floats, step: float
    ) -> tuple[list[State], float]:
        """Fly all neighbours.

        Args:
            leg: The flight of the run.
            span: When it takes place.
            at: Their u and v when they begin, (k, coordinates), (k, d).
            times: Of the run, at which states are wanted, the last is its end (n,).
            step: To begin with [s].

        Returns:
            States (k, ...) at these times, and the length of the last step.

        Raises:
            ConvergenceError: The integrator failed.
        """
        if self.flights is None:
            return self._together(leg, span, at, times, step)
        flown = [
            _series(flights, leg.closed, span.start, u, v, times)
            for flights, u, v in zip(self.flights, *at, strict=True)
        ]
        each = [zip(*at_time, strict=True) for at_time in zip(*flown, strict=True)]
        return [(np.stack(u), np.stack(v), np.stack(pushed)) for u, v, pushed in each], step

    def _together(
        self, leg: Leg, span: Span, at: tuple[Floats, Floats], times: Floats, step: float
    ) -> tuple[list[State], float]:
        """With the same steps of the integrator."""
        motions = [motion_of(system, leg) for system in self.systems]
        (n, d), extra, count = (part.shape[1] for part in at), motions[0].integrals, len(motions)
        first = np.concatenate([*at, np.zeros((count, extra))], axis=1)
        length, pace = span.end - span.start, span.pace

        every = _rates_of(motions)

        def rates(t: float, y: Floats) -> Floats:
            found = every(t + span.later(t), y.reshape(count, -1))
            return np.ravel(pace[:, None] * found)

        now = rates(span.start, first.ravel()).reshape(count, -1)
        speed = np.abs(at[1]).max() + length * np.abs(now[:, n : n + d]).max()
        reach = np.abs(at[0]).max() + length * speed
        sizes = np.repeat([reach, speed, max(1e-300, speed)], [n, d, extra])
        small = np.tile(np.maximum(1e-2 * _RTOL * sizes, 1e-300), count)
        ends = [first] * int((times <= span.start).sum())
        if len(ends) < len(times):
            solver = DOP853(
                rates, span.start, first.ravel(), span.end, rtol=_RTOL, atol=small,
                first_step=min(step, length),
            )  # fmt: skip
            while solver.status == "running":
                solver.step()
                passed = times[len(ends) :][times[len(ends) :] <= solver.t]
                if len(passed):
                    dense = solver.dense_output()
                    ends += [dense(time).reshape(count, -1) for time in passed]
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                raise ConvergenceError(
                    f"gradient: the flight from t = {span.start:.6g} s could not be followed "
                    "beside the run; check the forces for a singularity"
                )
            step = float(solver.step_size or length)
        return [(y[:, :n], y[:, n : n + d], y[:, n + d :]) for y in ends], step


def _rates_of(motions: Sequence[Motion]) -> Callable[[Floats, Floats], Floats]:
    """Rates (k, size) of states (k, size) of all motions at times (k,); kin in flight at once."""
    kin: dict[Hashable, dict[int, Kin]] = {}
    alone = []
    for k, motion in enumerate(motions):
        if motion.closed or (own := motion.system.kin) is None:
            alone.append(k)
        else:
            kin.setdefault(own.alike, {})[k] = own
    groups = [group for group in kin.values() if len(group) > 1]
    alone += [k for group in kin.values() if len(group) == 1 for k in group]
    n, d = motions[0].system.coordinates, motions[0].system.dofs

    def rates(times: Floats, states: Floats) -> Floats:
        found = np.zeros_like(states)
        for k in alone:
            found[k] = motions[k](float(times[k]), states[k])
        for group in groups:
            own, first = list(group), next(iter(group.values()))
            u, v = states[own, :n], states[own, n : n + d]
            given = np.array([each.given(float(times[k])) for k, each in group.items()])
            found[own, :n] = v
            found[own, n : n + d] = first.accelerations(times[own], u, v, given)
        return found

    return rates


def motion_of(system: GeneralizedSystem, leg: Leg) -> Motion:
    """Equations of motion of a flight."""
    if leg.modes or system.static_friction.any():
        return RubbingMotion(system, leg.closed, _RTOL, leg.modes)
    return Motion(system, leg.closed, _RTOL)


def _series(
    flights: Flights, closed: tuple[int, ...], start: float, u: Floats, v: Floats, times: Floats
) -> list[State]:
    """States of one exact flight at some times."""
    flight, d = flights.flight(closed), flights.dofs
    z, new = np.zeros(flights.size), np.empty(2 * d)
    z[:d], z[d : 2 * d] = u, v
    terms = np.arange(1, len(flight.powers) + 1)
    pushed, t, found = np.zeros(len(closed)), start, []
    refresh(z, 2 * d, t, flights.waves)
    for time in times:
        while time - t > flight.step:
            pushed = pushed + flight.step * (1.0 / terms) @ (flight.forces @ z)
            taylor(flight.powers, z, 1.0, 2 * d, new)
            z[: 2 * d] = new
            t += flight.step
            refresh(z, 2 * d, t, flights.waves)
        s = (time - t) / flight.step
        taylor(flight.powers, z, s, 2 * d, new)
        more = flight.step * (s**terms / terms) @ (flight.forces @ z)
        found.append((new[:d].copy(), new[d:].copy(), pushed + more))
    return found
