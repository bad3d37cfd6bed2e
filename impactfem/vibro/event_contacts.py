"""What happens at an event: impacts of all closed constraints, sticking, release.

Impacts by turns on several constraints may accumulate, as in an acute corner, so that their times
can no longer be told apart while the speeds are not small. They go on one after the other at one
place then, whatever the law for impacts that are simultaneous from the start.

A constraint sticks if its normal speed is at most the threshold and the complementarity problem of
lasting contact leaves it without acceleration away from the other side.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import cho_solve

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.impact_law import Law, resolve_impact
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Forced, Room, advanced
from impactfem.vibro.event_choice import Onset, accumulate, independent, lasting, signs, stay
from impactfem.vibro.event_constrained import constrained
from impactfem.vibro.event_legs import Mode, Strike
from impactfem.vibro.event_motion import End, Motion

Row = tuple[float, int, float, float, float]
Begin = Callable[[float, Floats, Floats, tuple[int, ...]], Onset]

MAX_SPELLS = 100

_EPS = 2.0**-52
_SAME_PLACE = 1e-10  # share of the lengths within which impacts by turns are continued
_MAX_REPEATS = 100  # impacts at one instant until nothing approaches


@dataclass
class Contacts:
    """Closed constraints during a run, and what was dropped to close them.

    Attributes:
        system: The system.
        impact_law: Impact law of several constraints.
        stick_speed: Threshold [m/s]; None: a share of the largest impact speed so far.
        share: That share.
        closed: Linearly independent constraints that are closed.
        implied: Constraints that stay closed because those do.
        order: Multiplicity of the root of each gap just after the event, shape (J,).
        fastest: Largest impact speed so far.
        last_impact: Time of the last impact [s].
        spells: The first lasting contacts [constraint, start, end], NaN if it still lasts.
        spell_count: Number of lasting contacts.
        dropped_speed: Largest normal speed set to 0 by sticking.
        dropped_energy: Energy [J] lost by that.
        work: Of friction in impacts [J].
        strikes: Impacts of the last event.
        modes: Of the closed constraints, where anything rubs.
    """

    system: GeneralizedSystem
    impact_law: Law
    stick_speed: float | None
    share: float
    closed: tuple[int, ...] = ()
    implied: tuple[int, ...] = ()
    order: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    fastest: float = 0.0
    last_impact: float = -math.inf
    spells: list[list[float]] = field(default_factory=list)
    spell_count: int = 0
    dropped_speed: float = 0.0
    dropped_energy: float = 0.0
    work: float = 0.0
    strikes: tuple[Strike, ...] = ()
    modes: tuple[Mode, ...] = ()
    _lasting: dict[int, list[float]] = field(default_factory=dict)

    @property
    def threshold(self) -> float:
        """Normal speed [m/s] at or below which a rebound counts as none."""
        given = self.stick_speed
        return self.share * self.fastest if given is None else given

    def motion(self, rtol: float) -> Motion:
        """The equations of motion with the closed constraints, flown to this relative tolerance."""
        return Motion(self.system, self.closed, rtol)

    @property
    def details(self) -> dict[str, Any]:
        """What else the effort tells."""
        return {}

    def settle(
        self, t: float, u: Floats, v: Floats, near: Booleans, begin: Begin,
        released: End | None = None, earlier: Floats | None = None,
    ) -> tuple[Floats, Floats, list[Row], Floats]:  # fmt: skip
        """Treat an event.

        Args:
            t: Time [s].
            u: Position, shape (d,).
            v: Velocity just before, shape (d,).
            near: Which constraints are closed to rounding, shape (J,) of bool.
            begin: How gaps and forces begin at t, u, v with given closed constraints.
            released: What has just ended a flight.
            earlier: Rates of the motions just before (J,), where they have just changed: what is
                in contact is struck or left by that.

        Returns:
            Position and velocity just after, and rows (time, constraint, before, after, impulse)
            of the impacts, and the impulses of all constraints, shape (J,), in which the
            rebounds that sticking drops do not count.
        """
        system = self.system
        near = near.copy()
        near[list(self.closed + self.implied)] = True
        self.strikes = ()
        rows = np.flatnonzero(near)
        self.order = np.zeros(system.num_constraints, dtype=np.int64)
        before_spell = set(self.closed)
        if not len(rows):
            self._enter((), (), t, before_spell, {})
            return u, v, [], np.zeros(system.num_constraints)
        room, jacobian = Room.at(system, u, t), system.jacobian(u)
        rate = system.motion_rate(t)
        drift = jacobian @ v - (rate if earlier is None else earlier)
        u, v, _, _ = self._close(t, room, jacobian, u, v, drift, self.closed)
        noise = 64.0 * _EPS * (np.abs(jacobian) @ np.abs(v) + np.abs(rate))
        # Impacts that follow each other within some thousand times the rounding of places.
        lengths = np.abs(system.gradient(u)) @ np.abs(u) + t * np.abs(jacobian) @ np.abs(v)
        place = float(lengths[rows].max())
        approach = -float((jacobian @ v - rate)[rows].min())
        again = (t - self.last_impact) * approach <= _SAME_PLACE * place
        v, impacts = self._strike(t, room, jacobian, v, rate, rows, noise, again=again)
        speed = jacobian @ v - rate
        slow = rows[np.abs(speed[rows]) <= np.maximum(noise[rows], self.threshold)]
        forced, own = Forced.at(system, t, u, v, room), room.rows(jacobian)
        applied = cho_solve((room.factor, True), forced.load)
        curvature = system.gap_curvature(t, u, v) + jacobian @ forced.drift
        state = room.mass, room.factor, own, forced.load, applied, curvature
        loosened = released.constraint if released else -1
        guess, _ = independent(own, lasting(state, slow[slow != loosened]))
        closed, implied, order = stay(partial(begin, t, u, v), own, guess, slow)
        back = [j for j in closed if speed[j] > noise[j]]  # rebounds that are dropped
        tails: dict[int, float] = {}
        if back:
            free = begin(t, u, v, ())
            sign, first = signs(free.gaps, free.gap_doubts)
            tails = {
                j: self._tail(j, speed[j], own[j] @ applied + curvature[j])
                for j in back
                if first[j] == 0 and sign[j] < 0.0  # else the acceleration is rounding
            }
        u, v, dropped, lost = self._close(t, room, jacobian, u, v, speed, closed)
        self.dropped_energy += lost
        self.dropped_speed = max(self.dropped_speed, *(abs(float(speed[j])) for j in closed), 0.0)
        for j in rows.tolist():
            self.order[j] = 1 if speed[j] > noise[j] else order[j] if j in slow else 0
        self._enter(closed, implied, t, before_spell, tails)
        total = np.zeros(system.num_constraints)
        for _, j, _, _, impulse in impacts:
            total[j] += impulse
        total[list(closed)] = np.maximum(total[list(closed)] + dropped, 0.0)
        return u, v, impacts, total

    def _strike(
        self, t: float, room: Room, jacobian: Floats, v: Floats, rate: Floats, rows: Integers,
        noise: Floats, *, again: bool,
    ) -> tuple[Floats, list[Row]]:  # fmt: skip
        """Impacts until no closed constraint approaches; noise becomes at least theirs."""
        impacts: list[Row] = []
        own = room.rows(jacobian[rows])
        for _ in range(_MAX_REPEATS):
            before = jacobian[rows] @ v - rate[rows]
            if (before >= -noise[rows]).all():
                return v, impacts
            self.fastest = max(self.fastest, -float(before.min()))
            self.last_impact = t
            restitution = self.system.restitution[rows]
            state = room.factor, own, room.own(v), rate[rows], restitution
            try:
                hit = (
                    accumulate(room.mass, *state, noise[rows])
                    if again
                    else resolve_impact(*state, self.impact_law)
                )
            except ConvergenceError as error:
                raise ConvergenceError(
                    f"events: the impact on constraints {rows.tolist()} at t = {t:.9g} has no "
                    f"solution: do they leave room? ({error})"
                ) from error
            v = room.full(hit.velocity)
            hits = tuple(rows[hit.impulse > 0.0].tolist())
            turns = again or (self.impact_law == "sequential" and len(rows) > 1)
            self.strikes += (Strike(hits, (1,) * len(hits), not turns or len(hits) == 1),)
            pushed = np.abs(room.answers(jacobian[rows])) @ hit.impulse
            np.maximum(noise, 64.0 * _EPS * np.abs(jacobian) @ pushed, out=noise)
            impacts += [
                (t, int(j), float(hit.before[i]), float(hit.after[i]), float(hit.impulse[i]))
                for i, j in enumerate(rows)
                if hit.impulse[i] > 0.0
            ]
        raise ConvergenceError(
            f"events: {_MAX_REPEATS} impacts at t = {t:.9g} did not separate constraints "
            f"{rows.tolist()}: do they leave room? If so, choose the other impact law"
        )

    def _tail(self, j: int, speed: float, acceleration: float) -> float:
        """Time that the dropped rebounds would still take, 2 v / (a (1 - e)) [s]."""
        e = float(self.system.restitution[j])
        if e >= 1.0:
            return 0.0
        return 2.0 * speed / (-acceleration * (1.0 - e))

    def _close(
        self, t: float, room: Room, jacobian: Floats, u: Floats, v: Floats,
        speed: Floats, closed: tuple[int, ...],
    ) -> tuple[Floats, Floats, Floats, float]:  # fmt: skip
        """Take normal speeds and gaps of closed constraints away; the impulses and energy of it."""
        if not closed:
            return u, v, np.zeros(0), 0.0
        rows = list(closed)
        wrong = np.stack([self.system.gap(t, u)[rows], speed[rows]], axis=1)
        normals, none = room.rows(jacobian[rows]), np.zeros((len(room.mass), 2))
        found, impulse = constrained(room.mass, normals, none, wrong)
        change, push = room.full(found), impulse[:, 1]
        lost = -0.5 * float(push @ speed[rows])
        return advanced(self.system, u, change[:, 0]), v + change[:, 1], push, lost

    def _enter(
        self, closed: tuple[int, ...], implied: tuple[int, ...], t: float,
        before: set[int], tails: dict[int, float],
    ) -> None:  # fmt: skip
        for j in before - set(closed):
            spell = self._lasting.pop(j)
            spell[2] = max(t, spell[1])
        for j in closed:
            if j not in before:
                spell = self._lasting[j] = [float(j), t + tails.get(j, 0.0), math.nan]
                self.spell_count += 1
                if len(self.spells) < MAX_SPELLS:
                    self.spells.append(spell)
        self.closed, self.implied = closed, implied
