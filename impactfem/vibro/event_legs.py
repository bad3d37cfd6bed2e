"""What a motion from event to event was, event by event: what tangents go along."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.breaks import Break
from impactfem.system.generalized import GeneralizedSystem

Floats = NDArray[np.float64]
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


def jumps(system: GeneralizedSystem, end: float) -> list[Break]:
    """Where forces and motions of a system change at once, up to an end [s]."""
    return [at for at in system.stops(end) if at.before < at.after]


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
