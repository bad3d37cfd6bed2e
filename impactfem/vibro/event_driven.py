"""The event-driven method: flights up to each impact, which is located to rounding.

Linear systems with known signals fly exactly (`event_linear`), all others by a library integrator
with dense output (`event_general`). Accumulating impacts end in lasting contact below a normal
speed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.contact.impact_law import Law
from impactfem.errors import SceneError
from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.start_checks import check_start
from impactfem.vibro.event_contacts import Contacts
from impactfem.vibro.event_friction import RubbingContacts
from impactfem.vibro.event_general import fly_general
from impactfem.vibro.event_legs import Leg
from impactfem.vibro.event_linear import fly_linear
from impactfem.vibro.event_record import Record

EXACT_SHARE = 1e-8
"""Share of the largest impact speed so far at or below which a rebound counts as none."""

GENERAL_SHARE = 1e-7
"""The same for flights by the library integrator: lower rebounds are lost in rounding."""


@dataclass(frozen=True)
class EventSettings:
    """How events are followed.

    Attributes:
        rows: Intervals of the uniform output grid; there are rows + 1 rows, 0 and the end included.
        stick_speed: Normal speed [m/s] at or below which a rebound that is pressed back ends in
            lasting contact; None: `EXACT_SHARE` or `GENERAL_SHARE` of
            the largest impact speed so far.
        impact_law: How several constraints share an impact.
        rtol: Relative tolerance of flights that are not exact.
        atol: Absolute tolerance of these.
        max_impacts: Limit of the number of impacts.
        keep_impacts: Number of impacts, the last ones, that are kept one by one; None for all.
        times: Output rows at these times instead, from 0 to the end [s].

    Raises:
        SceneError: A value is out of range.
    """

    rows: int = 1000
    stick_speed: float | None = None
    impact_law: Law = "simultaneous"
    rtol: float = 1e-10
    atol: float = 1e-12
    max_impacts: int = 10_000_000
    keep_impacts: int | None = None
    times: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.rows < 1:
            raise SceneError(f"rows = {self.rows}: give at least 1")
        if self.impact_law not in {"simultaneous", "sequential"}:
            raise SceneError(
                f'impact_law = "{self.impact_law}": give "simultaneous" or "sequential"'
            )
        if self.stick_speed is not None and not 0.0 <= self.stick_speed < math.inf:
            raise SceneError(f"stick_speed = {self.stick_speed}: give a speed >= 0, or None")
        for name in ("rtol", "atol"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise SceneError(f"{name} = {getattr(self, name)}: give a number between 0 and 1")
        if self.max_impacts < 1:
            raise SceneError(f"max_impacts = {self.max_impacts}: give at least 1")
        if self.keep_impacts is not None and self.keep_impacts < 0:
            raise SceneError(f"keep_impacts = {self.keep_impacts}: give a number >= 0, or None")

    def resolution(self, duration: float) -> float:
        """Impacts closer in time than this are one [s]."""
        return 1e-9 * duration


def check_friction(system: GeneralizedSystem, u: Floats, impact_law: Law) -> None:
    """Refuse friction that this method does not know.

    Raises:
        SceneError: It acts along two tangents, or impacts are to be shared by turns.
    """
    if not system.static_friction.any():
        return
    if system.slip(u).shape[1] > 1:
        raise SceneError(
            "slip has two tangents: event_driven takes friction along one; use method = "
            '"moreau_jean"'
        )
    if impact_law != "simultaneous":
        raise SceneError(
            f'impact_law = "{impact_law}" knows no friction: use impact_law = "simultaneous"'
        )


def integrate_events(
    system: GeneralizedSystem,
    position: ArrayLike,
    velocity: ArrayLike,
    duration: float,
    settings: EventSettings | None = None,
) -> Trajectory:
    """Follow a system from impact to impact.

    Args:
        system: The system; a `LinearSystem` with exact signals is flown exactly.
        position: u at t = 0, shape (d,).
        velocity: u' at t = 0, shape (d,).
        duration: End T > 0 [s].
        settings: `EventSettings`; its defaults if None.

    Returns:
        Rows at uniform times. ``effort.details`` tells impacts, stick_speed (the threshold at the
        end), sticking (at most 100 entries [start, end, constraint]), stuck_at_speed (largest
        speed dropped by sticking) and energy_dropped [J].

    Raises:
        SceneError: The system cannot be started from this state, or the duration is not positive.
        ConvergenceError: Too many impacts, events that do not move on, or a motion that is not
            finite.
    """
    record, contacts = follow(system, position, velocity, duration, settings or EventSettings())
    return record.trajectory(contacts)


def follow(
    system: GeneralizedSystem,
    position: ArrayLike,
    velocity: ArrayLike,
    duration: float,
    settings: EventSettings,
    legs: list[Leg] | None = None,
    more: Sequence[float] = (),
) -> tuple[Record, Contacts]:
    """As `integrate_events`: what the run leaves; its flights are kept in ``legs``, if given.

    Flights of the integrator stop at ``more`` times [s], where loads may change.
    """
    u = np.atleast_1d(np.array(position, dtype=float))
    v = np.atleast_1d(np.array(velocity, dtype=float))
    if not 0.0 < duration < math.inf:
        raise SceneError(f"duration = {duration}: give a time > 0")
    check_start(system, u, v)
    check_friction(system, u, settings.impact_law)
    even = np.linspace(0.0, duration, settings.rows + 1)
    times = even if settings.times is None else np.array(settings.times)
    record = Record(system, times, settings.max_impacts, settings.keep_impacts, legs)
    rubs = bool(system.static_friction.any())
    exact = isinstance(system, LinearSystem) and system.is_exact and not rubs
    share = EXACT_SHARE if exact else GENERAL_SHARE
    kind = RubbingContacts if rubs else Contacts
    contacts = kind(system, settings.impact_law, settings.stick_speed, share)
    if isinstance(system, LinearSystem) and exact:
        fly_linear(system, u, v, duration, contacts, record)
    else:
        tolerances = settings.rtol, settings.atol
        fly_general(system, u, v, duration, contacts, record, tolerances, more)
    return record, contacts
