"""What a motion from event to event was, event by event: what tangents go along."""

from collections.abc import Sequence
from dataclasses import dataclass

from impactfem.arrays import Floats
from impactfem.scene.breaks import Break
from impactfem.system.generalized import GeneralizedSystem

_SAME = 1e-13  # share of the duration within which changes are one
Mode = int | None
"""Of a contact: direction of what slides, 1 or -1; 0: it sticks; None: it opens."""


@dataclass(frozen=True)
class Strike:
    """One impact of some constraints at one place.

    Attributes:
        rows: Constraints that got an impulse.
        modes: Of these; 1 where nothing rubs.
        known: Whether their impulses follow from these by linear equations: not where impacts went
            on by turns.
    """

    rows: tuple[int, ...]
    modes: tuple[int, ...]
    known: bool = True


@dataclass(frozen=True)
class Event:
    """What ended a flight, and what happened then.

    Attributes:
        time: [s].
        cause: Constraint that closed; -2 - place of what fell below 0 in `Motion.guards`; -1 for
            none, as at the start and the end.
        kick: Where a motion changed its velocity, its place in `GeneralizedSystem.kicks`; else -1.
        stop: Where a force or motion changed at once, its place among the `jumps` of the system;
            else -1.
        strikes: Impacts, in their order.
        position, velocity: Just before, (coordinates,), (d,).
        row: The output row that follows.
    """

    time: float
    cause: int
    kick: int
    stop: int
    strikes: tuple[Strike, ...]
    position: Floats
    velocity: Floats
    row: int


def stops(system: GeneralizedSystem, end: float, more: Sequence[float] = ()) -> list[Break]:
    """Where flights stop besides events, up to an end [s], in the order of time.

    Args:
        system: The system, whose forces and motions change there.
        end: [s].
        more: Times at which they may change, though they do not as the system is [s].
    """
    found: list[Break] = []
    every = [*system.stops(end), *(Break.at(time) for time in more if 0.0 < time < end)]
    for at in sorted(every, key=lambda at: (at.before, at.after)):
        if found and at.before - found[-1].after <= _SAME * end:
            at = Break(found[-1].before, max(found.pop().after, at.after))  # noqa: PLW2901
        found.append(at)
    return found


def jumps(system: GeneralizedSystem, end: float, more: Sequence[float] = ()) -> list[Break]:
    """Where forces and motions change at once, or may; see `stops`."""
    return [at for at in stops(system, end, more) if at.before < at.after]


@dataclass(frozen=True)
class Leg:
    """A flight that follows an event.

    Attributes:
        event: That event.
        position, velocity: Just after that event, (coordinates,), (d,).
        closed: Constraints that are closed in flight.
        modes: Of these, () where nothing rubs.
    """

    event: Event
    position: Floats
    velocity: Floats
    closed: tuple[int, ...]
    modes: tuple[Mode, ...]
