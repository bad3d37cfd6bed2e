"""How motions from event to event change with parameters: bundles of flights, saltation at events.

The motion of each parameter value takes the same events in the same order, at other times. Between
events a bundle of neighbours, one or two for each parameter, flies with the same steps of one
integrator: differences of neighbours then are smooth, and exact but for the square of their
distance (internal numerical differentiation: Bock, Numerical treatment of inverse problems in
chemical reaction kinetics, 1981). At an event with g = 0 and the rates F- before and F+ after it,
the derivative S of the state becomes

    dt = -(g_y S + g_p) / (g_t + g_y F-),
    S+ = R_y (S + F- dt) + R_p + R_t dt - F+ dt,

with the impact map R, whose active contacts, and what sticks and slides, stay as they were. Source:
Aizerman and Gantmacher, On the stability of periodic motions (1958); Kong, Payne, Zhu, Johnson,
Saltation matrices: the essential tool for linearizing hybrid systems (2023).
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.joined import Room
from impactfem.vibro.event_legs import Event, Leg
from impactfem.vibro.event_motion import Motion
from impactfem.vibro.event_record import Record
from impactfem.vibro.event_rubbing import RubbingMotion
from impactfem.vibro.flight_kernels import refresh, taylor
from impactfem.vibro.flights import Flights

Floats = NDArray[np.float64]
State = tuple[Floats, Floats, Floats]
"""u, v and the integrals of the forces of closed contacts, and of the power of friction."""

_RTOL = 1e-12  # of flights in bundles
_ALONG = 1e-6  # of a flight, over which guards are differentiated along it
_APART = 1e-6  # share of its change by which the times of contacts that close together may differ
_GRAZES = 1e-9  # share of the speeds at which what closes counts as touching only
_DEPENDENT = 1e-12


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


@dataclass
class Tangents:
    """Derivatives of what a run recorded by P parameters, each beside the run in the last axis.

    Attributes:
        position: (rows, coordinates, P).
        velocity: (rows, d, P).
        impulse: Of impacts [N s], (rows, J, P).
        lasting: Integrals of the forces of lasting contact [N s], (rows, J, P).
        rubbed: Work of friction [J], (rows, P).
        impacts: Time, speeds before and after, impulse of each impact, (impacts, 4, P).
        events: Of each event its time (P,), and u and v just after it (coordinates, P), (d, P).
        doubts: Why the motion may have no derivative here, in words.
    """

    position: Floats
    velocity: Floats
    impulse: Floats
    lasting: Floats
    rubbed: Floats
    impacts: list[Floats] = field(default_factory=list)
    events: list[tuple[Floats, Floats, Floats]] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    def moved(self, record: Record, system: GeneralizedSystem, k: int, offset: float) -> Record:
        """The record beside the run, with parameter k changed by an offset."""
        other = copy(record)
        other.system = system
        for name in ("position", "velocity", "impulse", "lasting", "rubbed"):
            setattr(other, name, getattr(record, name) + offset * getattr(self, name)[..., k])
        table = record.table()
        for row, change in zip(table, self.impacts, strict=True):
            row[[0, 2, 3, 4]] += offset * change[:, k]
        other.tables = [table]
        other.legs = [
            replace(
                leg,
                event=replace(leg.event, time=leg.event.time + offset * late[k]),
                position=leg.position + offset * u[:, k],
                velocity=leg.velocity + offset * v[:, k],
            )
            for leg, (late, u, v) in zip(record.legs or (), self.events, strict=True)
        ]
        return other


@dataclass(frozen=True)
class _Bundle:
    """All neighbours of a run in one list."""

    systems: tuple[GeneralizedSystem, ...]
    offsets: Floats
    of: NDArray[np.int64]
    weights: Floats
    flights: tuple[Flights, ...] | None

    @classmethod
    def of_all(cls, each: Sequence[Neighbours], duration: float) -> "_Bundle":
        systems = tuple(s for one in each for s in one.systems)
        of = np.repeat(np.arange(len(each)), [len(one.systems) for one in each])
        weights = np.concatenate([one.weights for one in each])
        linear = [s for s in systems if isinstance(s, LinearSystem) and s.is_exact]
        exact = len(linear) == len(systems) and not any(s.static_friction.any() for s in systems)
        flights = tuple(Flights(s, duration) for s in linear) if exact else None
        return cls(systems, np.concatenate([one.offsets for one in each]), of, weights, flights)

    def derivative(self, values: Sequence[Floats | float] | Floats) -> Floats:
        """Derivatives (..., P) of values at the neighbours (k, ...)."""
        given = np.asarray(values, dtype=float)
        found = np.zeros((int(self.of[-1]) + 1, *given.shape[1:]))
        np.add.at(found, self.of, self.weights.reshape(-1, *[1] * (given.ndim - 1)) * given)
        return np.moveaxis(found, 0, -1)

    def beside(self, value: Floats, change: Floats) -> Floats:
        """Values at the neighbours (k, n), of one (n,) that changes by (n, P)."""
        return np.asarray(value + self.offsets[:, None] * change.T[self.of])


def tangents(
    system: GeneralizedSystem, record: Record, neighbours: Sequence[Neighbours], duration: float
) -> Tangents:
    """Derivatives of a run by parameters.

    Args:
        system: The system.
        record: What the run left, with its flights.
        neighbours: Systems beside it, of each parameter.
        duration: End of the run [s].

    Raises:
        ConvergenceError: Impacts by turns have no derivative that is known, or a flight failed.
    """
    return _Run(system, record, _Bundle.of_all(neighbours, duration), duration).done(neighbours)


class _Run:
    def __init__(
        self, system: GeneralizedSystem, record: Record, bundle: _Bundle, duration: float
    ) -> None:
        self.system, self.record, self.bundle, self.duration = system, record, bundle, duration
        count, rows = int(bundle.of[-1]) + 1, len(record.times)
        contacts = system.num_constraints
        self.found = Tangents(
            np.zeros((rows, system.coordinates, count)), np.zeros((rows, system.dofs, count)),
            np.zeros((rows, contacts, count)), np.zeros((rows, contacts, count)),
            np.zeros((rows, count)),
        )  # fmt: skip
        self.kicks = system.kicks(duration)
        self.step = duration

    def done(self, neighbours: Sequence[Neighbours]) -> Tangents:
        starts = [start for one in neighbours for start in one.starts]
        u = self.bundle.derivative([start[0] for start in starts])
        v = self.bundle.derivative([start[1] for start in starts])
        legs = self.record.legs or []
        closed: Leg | None = None
        for place, leg in enumerate(legs):
            u, v = self._event(closed, leg, u, v)
            closed = leg
            if place + 1 < len(legs):
                u, v = self._flight(leg, legs[place + 1].event, u, v)
        last = legs[-1].event.row
        self.found.position[last:], self.found.velocity[last:] = u, v
        return self.found

    def _flight(self, leg: Leg, until: Event, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Derivatives of u and v at the end of a flight, from those at its start."""
        found, rows = self.found, range(leg.event.row, until.row)
        times = self.record.times[rows.start : rows.stop]
        at = self.bundle.beside(leg.position, u), self.bundle.beside(leg.velocity, v)
        fly = self._exactly if self.bundle.flights else self._together
        states = fly(leg, leg.event.time, at, np.append(times, until.time))
        held: Floats | float = 0.0
        row = 0
        for row, state in zip([*rows, until.row], states, strict=True):
            u, v, pushed = (self.bundle.derivative(part) for part in state)
            if row != until.row:
                found.position[row], found.velocity[row] = u, v
            self._push(row, leg.closed, pushed - held)
            held = pushed
        return u, v

    def _push(self, row: int, closed: tuple[int, ...], pushed: Floats) -> None:
        """Add derivatives of integrals of forces, and of the work of friction behind them."""
        row = min(row, len(self.record.times) - 1)
        self.found.lasting[row, list(closed)] += pushed[: len(closed)]
        self.found.rubbed[row] += pushed[len(closed) :].sum(axis=0)

    def _exactly(
        self, leg: Leg, start: float, at: tuple[Floats, Floats], times: Floats
    ) -> list[State]:
        """States (k, ...) of exact flights at some times."""
        flown = [
            _series(flights, leg.closed, start, u, v, times)
            for flights, u, v in zip(self.bundle.flights or (), *at, strict=True)
        ]
        each = [zip(*at_time, strict=True) for at_time in zip(*flown, strict=True)]
        return [(np.stack(u), np.stack(v), np.stack(pushed)) for u, v, pushed in each]

    def _together(
        self, leg: Leg, start: float, at: tuple[Floats, Floats], times: Floats
    ) -> list[State]:
        """States (k, ...) of flights with the same steps of the integrator at some times."""
        motions = [_motion(system, leg) for system in self.bundle.systems]
        (n, d), extra, count = (part.shape[1] for part in at), motions[0].integrals, len(motions)
        first = np.concatenate([*at, np.zeros((count, extra))], axis=1)
        span = float(times[-1]) - start

        def rates(t: float, y: Floats) -> Floats:
            each = zip(motions, y.reshape(count, -1), strict=True)
            return np.concatenate([motion(t, own) for motion, own in each])

        now = rates(start, first.ravel()).reshape(count, -1)
        speed = np.abs(at[1]).max() + span * np.abs(now[:, n : n + d]).max()
        length = np.abs(at[0]).max() + span * speed
        sizes = np.repeat([length, speed, max(1e-300, speed)], [n, d, extra])
        small = np.tile(np.maximum(1e-2 * _RTOL * sizes, 1e-300), count)
        ends, end = [first] * int((times <= start).sum()), float(times[-1])
        if len(ends) < len(times):
            solver = DOP853(
                rates, start, first.ravel(), end, rtol=_RTOL, atol=small,
                first_step=min(self.step, span),
            )  # fmt: skip
            while solver.status == "running":
                solver.step()
                passed = times[len(ends) :][times[len(ends) :] <= solver.t]
                if len(passed):
                    dense = solver.dense_output()
                    ends += [dense(time).reshape(count, -1) for time in passed]
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                raise ConvergenceError(
                    f"gradient: the flight from t = {start:.6g} s could not be followed beside "
                    "the run; check the forces for a singularity"
                )
            self.step = float(solver.step_size or span)
        return [(y[:, :n], y[:, n : n + d], y[:, n + d :]) for y in ends]

    def _event(self, before: Leg | None, leg: Leg, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Derivatives of u and v just after an event, from those just before at the same time."""
        event, bundle, system = leg.event, self.bundle, self.system
        if any(not strike.known for strike in event.strikes):
            raise ConvergenceError(
                f"gradient: impacts by turns at t = {event.time:.6g} s have no derivative that is "
                'known; use impact_law = "simultaneous"'
            )
        late = np.zeros(u.shape[1])
        rates = np.zeros_like(event.position), np.zeros_like(event.velocity)
        if before is not None:
            rates = _rates(_motion(system, before), event.time, event.position, event.velocity)
            late = self._late(before, event, u, v, rates)
        u, v = u + np.outer(rates[0], late), v + np.outer(rates[1], late)
        near = bundle.beside(event.position, u), bundle.beside(event.velocity, v)
        when = event.time + bundle.offsets * late[bundle.of]
        hits = [_struck(*each, leg) for each in zip(bundle.systems, when, *near, strict=True)]
        v = bundle.derivative([hit[0] for hit in hits])
        row = min(event.row, len(self.record.times) - 1)
        self.found.impulse[row] += bundle.derivative([hit[1] for hit in hits])
        self.found.rubbed[row] += bundle.derivative([hit[2] for hit in hits])
        for change in bundle.derivative([hit[3] for hit in hits]):
            self.found.impacts.append(np.concatenate([late[None], change]))
        self.found.events.append((late, u, v))
        rates = _rates(_motion(system, leg), event.time, leg.position, leg.velocity)
        return u - np.outer(rates[0], late), v - np.outer(rates[1], late)

    def _late(
        self, before: Leg, event: Event, u: Floats, v: Floats, rates: tuple[Floats, Floats]
    ) -> Floats:
        """Derivatives of the time of an event (P,)."""
        if event.kick >= 0:
            return self._kicked(event)
        if event.cause >= 0:
            return self._closing(before, event, u)
        if event.cause == -1:
            return np.zeros(u.shape[1])
        bundle, t, y = self.bundle, event.time, (event.position, event.velocity)
        place = -2 - event.cause
        near = zip(bundle.systems, bundle.beside(y[0], u), bundle.beside(y[1], v), strict=True)
        own = [_motion(system, before).guards(t, a, b)[place] for system, a, b in near]
        h = _ALONG * max(t - before.event.time, 1e-6 * self.duration)
        motion = _motion(self.system, before)
        along = [
            motion.guards(t + s, y[0] + s * rates[0], y[1] + s * rates[1])[place] for s in (-h, h)
        ]
        rate = (along[1] - along[0]) / (2.0 * h)
        if rate == 0.0:
            self._doubt(t, "a force falls to 0 and no further")
            return np.zeros(u.shape[1])
        return np.asarray(-bundle.derivative(own) / rate)

    def _kicked(self, event: Event) -> Floats:
        """That of a motion that changes its velocity at once."""
        kicks = [system.kicks(self.duration) for system in self.bundle.systems]
        if any(len(each) != len(self.kicks) for each in kicks):
            self._doubt(event.time, "kicks of motions come and go with the parameter")
            return np.zeros(int(self.bundle.of[-1]) + 1)
        times = np.array([each[event.kick].at.after for each in kicks])
        return self.bundle.derivative(times - self.kicks[event.kick].at.after)

    def _closing(self, before: Leg, event: Event, u: Floats) -> Floats:
        """That of a gap that closes."""
        bundle, t, y, j = self.bundle, event.time, (event.position, event.velocity), event.cause
        near = zip(bundle.systems, bundle.beside(y[0], u), strict=True)
        gap, system = bundle.derivative([s.gap(t, a) for s, a in near]), self.system
        speeds = system.gap_rate(t, *y)
        sizes = np.abs(system.jacobian(y[0])) @ np.abs(y[1]) + np.abs(system.motion_rate(t))
        if not abs(speeds[j]) > _GRAZES * sizes[j]:
            self._doubt(t, f"constraint {j} is only touched")
            return np.zeros(u.shape[1])
        late = -gap[j] / speeds[j]
        for k in {k for strike in event.strikes for k in strike.rows} - {j, *before.closed}:
            apart = float(np.abs(gap[k] + speeds[k] * late).max())
            if apart > _APART * float(np.abs(gap[k]).max()):
                self._doubt(t, f"constraints {j} and {k} close together, and part when changed")
        return np.asarray(late)

    def _doubt(self, t: float, why: str) -> None:
        self.found.doubts.append(f"at t = {t:.6g} s {why}")


def _motion(system: GeneralizedSystem, leg: Leg) -> Motion:
    """Equations of motion of a flight."""
    if leg.modes or system.static_friction.any():
        return RubbingMotion(system, leg.closed, _RTOL, leg.modes)
    return Motion(system, leg.closed, _RTOL)


def _rates(motion: Motion, t: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    return motion.system.coordinate_rates(u, v), motion.forces(t, u, v)[0]


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


def _struck(
    system: GeneralizedSystem, t: float, u: Floats, v: Floats, leg: Leg
) -> tuple[Floats, Floats, float, Floats]:
    """What an event does, with its contacts, and what sticks and slides, as they were.

    Returns:
        Velocity after it (d,), impulses of all constraints (J,), work of friction [J], and of each
        impact the speeds before and after it and its impulse, (impacts, 3).
    """
    room, jacobian, rate = Room.at(system, u, t), system.jacobian(u), system.motion_rate(t)
    tangents = system.slip(u)[:, 0]
    impulse, work, table = np.zeros(system.num_constraints), 0.0, []
    for strike in leg.event.strikes:
        rows, modes = list(strike.rows), np.array(strike.modes, dtype=float)
        stuck = [j for j, mode in zip(rows, strike.modes, strict=True) if mode == 0]
        rubs = (system.friction[rows] * modes)[:, None] * tangents[rows]
        held = np.concatenate([jacobian[rows], tangents[stuck]])
        answers = room.answers(np.concatenate([jacobian[rows] - rubs, tangents[stuck]]))
        moves = np.concatenate([rate[rows], np.zeros(len(stuck))])
        back = np.concatenate([system.restitution[rows], system.tangential_restitution[stuck]])
        before = held @ v - moves
        push = np.linalg.lstsq(held @ answers, -(1.0 + back) * before, _DEPENDENT)[0]
        after, count = v + answers @ push, len(rows)
        aside = 0.5 * (tangents @ (v + after))
        work -= float((system.friction[rows] * modes * push[:count]) @ aside[rows])
        work += float(push[count:] @ aside[stuck])
        v, ends = after, (held @ after - moves)[:count]
        impulse[rows] += push[:count]
        table.append(np.stack([before[:count], ends, push[:count]], axis=1))
    if leg.closed:
        rows = list(leg.closed)
        stuck = [j for j, mode in zip(rows, leg.modes, strict=False) if mode == 0]
        held = np.concatenate([jacobian[rows], tangents[stuck]])
        answers = room.answers(held)
        wrong = held @ v - np.concatenate([rate[rows], np.zeros(len(stuck))])
        push = np.linalg.lstsq(held @ answers, -wrong, _DEPENDENT)[0]
        v = v + answers @ push
        impulse[rows] += push[: len(rows)]
    flat = np.concatenate(table) if table else np.zeros((0, 3))
    return v, impulse, work, flat
