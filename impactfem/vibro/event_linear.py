"""Events of linear systems along exact flights: the loop around the compiled kernels."""

import math
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import LinearSystem
from impactfem.vibro.event_choice import Onset
from impactfem.vibro.event_contacts import MAX_SPELLS, Contacts
from impactfem.vibro.event_motion import End
from impactfem.vibro.event_record import Record
from impactfem.vibro.flight_alone import STALLED, fly_alone
from impactfem.vibro.flight_kernels import BROKEN, DONE, FULL, fly, refresh
from impactfem.vibro.flights import Flights

_MAX_STALL = 1000  # events at one instant
_TABLE = 16_384  # impacts between two visits to Python; where flights are kept it sees each one


class _Run:
    """State of a run, in the arrays that the kernels change."""

    def __init__(
        self, system: LinearSystem, u: Floats, v: Floats, duration: float, contacts: Contacts,
        record: Record,
    ) -> None:  # fmt: skip
        self.system, self.contacts, self.record = system, contacts, record
        self.flights = Flights(system, duration)
        self.duration = duration
        self.z = np.zeros(self.flights.size)
        self.clock, self.counts = np.zeros(3), np.zeros(3, dtype=np.int64)
        rows = _TABLE if record.legs is None else 0
        self.table, self.who = np.empty((rows, 5)), np.full(1, -1, dtype=np.int64)
        self.put(u, v)
        self.held: tuple[int, ...] = ()
        stick = contacts.stick_speed
        given, share = (0.0, contacts.share) if stick is None else (stick, 0.0)
        flights = self.flights
        self.law: tuple[Any, ...] = (
            flights.answers, flights.response, system.restitution, given, share,
        )  # fmt: skip
        self.output: tuple[Any, ...] = (
            self.z, self.clock, self.counts, duration, record.times, record.position,
            record.velocity, record.impulse, record.lasting, self.table, self.who,
        )  # fmt: skip

    @property
    def time(self) -> float:
        return float(self.clock[0])

    def state(self) -> tuple[Floats, Floats]:
        d = self.system.dofs
        return self.z[:d].copy(), self.z[d : 2 * d].copy()

    def put(self, u: Floats, v: Floats) -> None:
        d = self.system.dofs
        self.z[:d], self.z[d : 2 * d] = u, v

    def settle(self, event: int | None, released: int | None) -> None:
        """Treat an event in Python."""
        u, v = self.state()
        near = self.record.near(self.time, u, v)
        if event is not None:
            near[event] = True
        end = None if released is None else End(released)
        before, row = (u, v), int(self.counts[0])
        u, v, impacts, impulses = self.contacts.settle(self.time, u, v, near, self.begin, end)
        self.record.add(impacts, impulses, row)
        self.put(u, v)
        cause = -1 if event is None else event
        if released is not None:
            cause = -2 - self.held.index(released)
        self.held, strikes = self.contacts.closed, self.contacts.strikes
        self.record.depart(self.time, before, (u, v), row, self.contacts, strikes, cause)
        self.clock[1] = self.contacts.fastest

    def begin(self, t: float, u: Floats, v: Floats, closed: tuple[int, ...]) -> Onset:
        """How gaps and forces begin at a state with given closed constraints."""
        z, d = np.concatenate([u, v, self.z[2 * len(u) :]]), self.system.dofs
        refresh(z, 2 * d, t, self.flights.waves)
        return self.flights.flight(closed).onset(z)

    def collect(self, status: int) -> None:
        """Take the impacts over; refuse what is not finite or does not move on."""
        if self.counts[1]:
            self.contacts.last_impact = float(self.table[self.counts[1] - 1, 0])
        self.record.extend(self.table[: self.counts[1]])
        self.counts[1] = 0
        self.record.steps = int(self.counts[2])
        self.record.peak = float(self.clock[2])
        self.contacts.fastest = float(self.clock[1])
        if status == BROKEN:
            raise ConvergenceError(
                f"events: the motion is not finite at t = {self.time:.6g}; check stiffness, "
                "damping and loads for an instability"
            )
        if status == STALLED:
            raise stall(_MAX_STALL, self.time)


def stall(events: int, t: float) -> ConvergenceError:
    """The error of events that do not move on."""
    return ConvergenceError(
        f"events: {events} events at t = {t:.9g} without moving on; give a larger stick_speed"
    )


def fly_linear(
    system: LinearSystem, u: Floats, v: Floats, duration: float, contacts: Contacts, record: Record
) -> None:
    """Follow a linear system with exact signals; fills the record.

    Raises:
        ConvergenceError: Too many impacts, events that do not move on, or no finite motion.
    """
    run = _Run(system, u, v, duration, contacts, record)
    run.settle(None, None)  # constraints may be closed at the start
    if system.num_constraints == 1 and record.legs is None:
        _alone(run)
    else:
        _several(run)


def _several(run: _Run) -> None:
    flights, contacts = run.flights, run.contacts
    stalled, last = 0, -1.0
    while True:
        flight = flights.flight(contacts.closed)
        ignored = np.zeros(run.system.num_constraints, dtype=np.bool_)
        ignored[list(contacts.closed + contacts.implied)] = True
        status = fly(
            flight.powers, flight.whole, flight.gaps, flights.rate_rows,
            flight.forces, flight.doubt, flight.step, flights.waves,
            flight.closed, ignored, contacts.order, *run.law, *run.output,
        )  # fmt: skip
        run.collect(status)
        if status == DONE:
            end, rows = run.state(), int(run.counts[0])
            run.record.depart(run.time, end, end, rows, contacts, ())
            return
        if status == FULL and run.record.legs is None:
            continue
        stalled = stalled + 1 if run.time == last else 0
        last = run.time
        if stalled > _MAX_STALL:
            raise stall(_MAX_STALL, last)
        event = int(run.who[0])
        if event >= 0:
            run.settle(event, None)
        else:
            run.settle(None, int(flight.closed[-1 - event]))


def _alone(run: _Run) -> None:
    flights, contacts = run.flights, run.contacts
    free, held = flights.flight(()), flights.flight((0,))
    mode = np.array([len(contacts.closed)], dtype=np.int64)
    spells = np.full((MAX_SPELLS, 2), math.nan)
    drops = np.array([contacts.dropped_speed, contacts.dropped_energy, float(mode[0])])
    if mode[0]:
        spells[0, 0] = contacts.spells[0][1]
    status = FULL
    while status != DONE:
        status = fly_alone(
            free.powers, free.whole, free.gaps, free.gap_doubts, free.step,
            held.powers, held.whole, held.gaps, held.step, held.forces, held.doubt,
            flights.rate_rows, flights.waves, free.closed, held.closed,
            np.zeros(1, dtype=np.bool_), np.ones(1, dtype=np.bool_), contacts.order,
            *run.law, *run.output, mode, spells, drops,
        )  # fmt: skip
        run.collect(status)
    contacts.dropped_speed, contacts.dropped_energy = float(drops[0]), float(drops[1])
    contacts.spell_count = int(drops[2])
    count = min(contacts.spell_count, MAX_SPELLS)
    contacts.spells = [[0.0, *map(float, row)] for row in spells[:count]]
