"""How motions from event to event change with parameters: saltation at events.

The motion of each parameter value takes the same events in the same order, at other times. Between
events neighbours fly (see `impactfem.vibro.bundles`). At an event with g = 0 and the rates F-
before and F+ after it, the derivative S of the state becomes

    dt = -(g_y S + g_p) / (g_t + g_y F-),
    S+ = R_y (S + F- dt) + R_p + R_t dt - F+ dt,

with the impact map R, whose active contacts, and what sticks and slides, stay as they were. Where a
load jumps, dt is that of the jump. Source: Aizerman and Gantmacher, On the stability of periodic
motions (1958); Kong, Payne, Zhu, Johnson, Saltation matrices: the essential tool for linearizing
hybrid systems (2023).
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Room
from impactfem.vibro.bundles import Bundle, Neighbours, Span, motion_of
from impactfem.vibro.event_legs import Event, Leg, jumps
from impactfem.vibro.event_motion import Motion
from impactfem.vibro.event_record import Record

_ALONG = 1e-6  # of a flight, over which guards are differentiated along it
_APART = 1e-6  # share of its change by which the times of contacts that close together may differ
_GRAZES = 1e-9  # share of the speeds at which what closes counts as touching only
_BARELY = 1e-2  # share of the run by which the time of an event may differ beside it
_DEPENDENT = 1e-12
_ROUNDINGS = 4.0
_SHORT = 10.0  # times as long as the change of a jump's time a flight has to be


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


def tangents(
    system: GeneralizedSystem, record: Record, neighbours: Sequence[Neighbours], duration: float,
    more: Sequence[float] = (),
) -> Tangents:  # fmt: skip
    """Derivatives of a run by parameters.

    Args:
        system: The system.
        record: What the run left, with its flights.
        neighbours: Systems beside it, of each parameter.
        duration: End of the run [s].
        more: Times at which the run stopped besides [s].

    Raises:
        ConvergenceError: Impacts by turns have no derivative that is known, or a flight failed.
    """
    run = _Run(system, record, Bundle.of_all(neighbours, duration), duration, more)
    return run.done(neighbours)


class _Run:
    def __init__(
        self, system: GeneralizedSystem, record: Record, bundle: Bundle, duration: float,
        more: Sequence[float],
    ) -> None:  # fmt: skip
        self.system, self.record, self.bundle, self.duration = system, record, bundle, duration
        count, rows = bundle.count, len(record.times)
        contacts = system.num_constraints
        self.found = Tangents(
            np.zeros((rows, system.coordinates, count)), np.zeros((rows, system.dofs, count)),
            np.zeros((rows, contacts, count)), np.zeros((rows, contacts, count)),
            np.zeros((rows, count)),
        )  # fmt: skip
        self.kicks, self.jumps = system.kicks(duration), jumps(system, duration, more)
        self.beside = [jumps(each, duration, more) for each in bundle.systems]
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
        span, motion = self._span(leg.event, until), motion_of(self.system, leg)
        held: Floats | float = 0.0
        if span.early.any():
            first, late = _rates(motion, span.start, leg.position, leg.velocity), span.early
            first = np.outer(first, self.bundle.derivative(late))
            u, v = u + first[: len(u)], v + first[len(u) : len(u) + len(v)]
            held = -first[len(u) + len(v) :]
        at = self.bundle.beside(leg.position, u), self.bundle.beside(leg.velocity, v)
        times = np.append(self.record.times[rows.start : rows.stop], span.end)
        states, self.step = self.bundle.flown(leg, span, at, times, self.step)
        for row, t, state in zip([*rows, until.row], times, states, strict=True):
            last = row == until.row
            u, v, pushed = (self.bundle.derivative(part) for part in state)
            if span.stretched:
                y = (until.position, until.velocity) if last else self._known(row)
                late = self.bundle.derivative(span.later(t))
                back = np.split(np.outer(_rates(motion, t, *y), late), [len(u), len(u) + len(v)])
                u, v, pushed = u - back[0], v - back[1], pushed - back[2]
            if not last:
                found.position[row], found.velocity[row] = u, v
            self._push(row, leg.closed, pushed - held)
            held = pushed
        return u, v

    def _known(self, row: int) -> tuple[Floats, Floats]:
        return self.record.position[row], self.record.velocity[row]

    def _span(self, event: Event, until: Event) -> Span:
        """When a flight takes place: neighbours' own times where loads jump at its ends."""
        none = np.zeros(len(self.bundle.systems))
        start, end = event.time, self._before(until)
        early, late = self._changed(event, "after"), self._changed(until, "before")
        if _SHORT * max(np.abs(early).max(), np.abs(late).max()) > end - start:
            early = late = none
        return Span(start, end, early, late)

    def _changed(self, event: Event, side: str) -> Floats:
        """How much later the times before or after a jump of a load are beside the run [s], (k,).

        Roundings to that side: a stage of the integrator across the jump would be an error.
        """
        if event.stop < 0 or any(len(each) != len(self.jumps) for each in self.beside):
            return np.zeros(len(self.bundle.systems))
        own = getattr(self.jumps[event.stop], side)
        times = np.array([getattr(each[event.stop], side) for each in self.beside])
        away = _ROUNDINGS * np.spacing(own)
        return np.asarray(times - own + (away if side == "after" else -away))

    def _before(self, event: Event) -> float:
        """The time just before an event [s]."""
        return self.jumps[event.stop].before if event.stop >= 0 else event.time

    def _push(self, row: int, closed: tuple[int, ...], pushed: Floats) -> None:
        """Add derivatives of integrals of forces, and of the work of friction behind them."""
        row = min(row, len(self.record.times) - 1)
        self.found.lasting[row, list(closed)] += pushed[: len(closed)]
        self.found.rubbed[row] += pushed[len(closed) :].sum(axis=0)

    def _event(self, before: Leg | None, leg: Leg, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Derivatives of u and v just after an event, from those just before at the same time."""
        event, bundle, system = leg.event, self.bundle, self.system
        if any(not strike.known for strike in event.strikes):
            raise ConvergenceError(
                f"gradient: impacts by turns at t = {event.time:.6g} s have no derivative that is "
                'known; use impact_law = "simultaneous"'
            )
        late, n, d = np.zeros(u.shape[1]), len(u), len(v)
        rates = np.zeros(n + d)
        if before is not None:
            motion = motion_of(system, before)
            rates = _rates(motion, self._before(event), event.position, event.velocity)
            late = self._late(before, event, u, v, (rates[:n], rates[n : n + d]))
            self._push(event.row, before.closed, np.outer(rates[n + d :], late))
        u, v = u + np.outer(rates[:n], late), v + np.outer(rates[n : n + d], late)
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
        rates = _rates(motion_of(system, leg), event.time, leg.position, leg.velocity)
        self._push(event.row, leg.closed, -np.outer(rates[n + d :], late))
        return u - np.outer(rates[:n], late), v - np.outer(rates[n : n + d], late)

    def _late(
        self, before: Leg, event: Event, u: Floats, v: Floats, rates: tuple[Floats, Floats]
    ) -> Floats:
        """Derivatives of the time of an event (P,)."""
        if event.kick >= 0:
            return self._kicked(event)
        if event.cause >= 0:
            return self._closing(before, event, u)
        if event.cause == -1:
            return self._jumped(event)
        bundle, t, y = self.bundle, event.time, (event.position, event.velocity)
        place = -2 - event.cause
        near = zip(bundle.systems, bundle.beside(y[0], u), bundle.beside(y[1], v), strict=True)
        own = [motion_of(system, before).guards(t, a, b)[place] for system, a, b in near]
        h = _ALONG * max(t - before.event.time, 1e-6 * self.duration)
        motion = motion_of(self.system, before)
        along = [
            motion.guards(t + s, y[0] + s * rates[0], y[1] + s * rates[1])[place] for s in (-h, h)
        ]
        rate = (along[1] - along[0]) / (2.0 * h)
        if rate == 0.0:
            self._doubt(t, "a force falls to 0 and no further")
            return np.zeros(u.shape[1])
        return np.asarray(-bundle.derivative(own) / rate)

    def _jumped(self, event: Event) -> Floats:
        """That of a load that jumps, 0 where nothing does."""
        if event.stop >= 0 and any(len(each) != len(self.jumps) for each in self.beside):
            self._doubt(event.time, "jumps of loads come and go with the parameter")
        return self.bundle.derivative(self._changed(event, "after"))

    def _kicked(self, event: Event) -> Floats:
        """That of a motion that changes its velocity at once."""
        kicks = [system.kicks(self.duration) for system in self.bundle.systems]
        if any(len(each) != len(self.kicks) for each in kicks):
            self._doubt(event.time, "impulses of motions come and go with the parameter")
            return np.zeros(self.bundle.count)
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
        moved = float(np.abs(bundle.offsets * late[bundle.of]).max())
        if moved > _BARELY * self.duration:
            self._doubt(t, f"constraint {j} is hardly touched: a neighbour is {moved:.2g} s off")
        for k in {k for strike in event.strikes for k in strike.rows} - {j, *before.closed}:
            apart = float(np.abs(gap[k] + speeds[k] * late).max())
            if apart > _APART * float(np.abs(gap[k]).max()):
                self._doubt(t, f"constraints {j} and {k} close together, and part when changed")
        return np.asarray(late)

    def _doubt(self, t: float, why: str) -> None:
        self.found.doubts.append(f"at t = {t:.6g} s {why}")


def _rates(motion: Motion, t: float, u: Floats, v: Floats) -> Floats:
    """Rates of u, v, the integrals of contact forces and of the power of friction."""
    return motion(t, np.concatenate([u, v, np.zeros(motion.integrals)]))


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
