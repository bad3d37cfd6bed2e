"""What happens at an event with friction: impacts, sticking, sliding, reversal, release.

Impacts follow Moreau's law: 0 <= p _|_ w+ + e w- >= 0 of normal velocities, Coulomb's cone on the
impulse with the slip s+ just after; with tangential restitution f with s+ + f s-.
"""

from dataclasses import dataclass, field
from typing import Any, override

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.impact_law import delassus
from impactfem.errors import ConvergenceError
from impactfem.system.joined import Forced, Room, advanced
from impactfem.system.joined import answers as answers_to
from impactfem.vibro.event_choice import rank
from impactfem.vibro.event_contacts import MAX_SPELLS, Begin, Contacts, Row
from impactfem.vibro.event_legs import Mode, Strike
from impactfem.vibro.event_motion import End, Motion
from impactfem.vibro.event_rubbing import (
    Rubbing,
    RubbingMotion,
    Solutions,
    solutions,
    unsolved,
)
from impactfem.vibro.vibro_rows import cone_impulses

_EPS = 2.0**-52
_STILL = 1e-11  # share of the velocities, before and after impacts, that is no sliding
_REPEATS = 100  # impacts at one instant until nothing approaches
_FLAT = 1e-9  # share of the accelerations below which a gap does not open
_AT_EDGE = 1e-9  # share of the cone's edge by which an impulse may miss it and slide
_IN_WORDS = {None: "opens", 0: "sticks", 1: "slides", -1: "slides"}


@dataclass
class RubbingContacts(Contacts):
    """Closed constraints with friction during a run.

    Attributes:
        nonunique: The first instant at which several motions fit: its time, the number of
            solutions, and what each of its constraints does in the one that was taken.
        overconstrained: The first instant at which forces were not determined by the motion: its
            time, their dimensions, and the number of contacts.
        changes: The first times at which constraints begin to stick, slide or open [time,
            constraint, what].
        liveliest: Largest kinetic energy so far [J]: its rounding is left when motion stops.
        settled: Time of the last event at contacts [s].
    """

    nonunique: dict[str, Any] | None = None
    overconstrained: dict[str, Any] | None = None
    changes: list[list[Any]] = field(default_factory=list)
    liveliest: float = 0.0
    settled: float = 0.0

    @override
    def motion(self, rtol: float) -> Motion:
        return RubbingMotion(self.system, self.closed, rtol, self.modes)

    @property
    @override
    def details(self) -> dict[str, Any]:
        several = {} if self.nonunique is None else {"friction_nonunique": self.nonunique}
        free = self.overconstrained
        undetermined = {} if free is None else {"overconstrained": free}
        return {"friction_changes": self.changes, **several, **undetermined}

    @override
    def settle(
        self, t: float, u: Floats, v: Floats, near: Booleans, begin: Begin,
        released: End | None = None, earlier: Floats | None = None,
    ) -> tuple[Floats, Floats, list[Row], Floats]:  # fmt: skip
        system, count = self.system, self.system.num_constraints
        near = near.copy()
        near[list(self.closed + self.implied)] = True
        self.strikes = ()
        rows, before_spell = np.flatnonzero(near), set(self.closed)
        past: dict[int, Mode] = dict(zip(self.closed, self.modes, strict=True))
        self.order = np.zeros(count, dtype=np.int64)
        if not len(rows):
            self.modes = ()
            self._enter((), (), t, before_spell, {})
            self._note(t, past)
            return u, v, [], np.zeros(count)
        jacobian, tangents = system.jacobian(u), system.slip(u)[:, 0]
        rate = system.motion_rate(t)
        drift = jacobian @ v - (rate if earlier is None else earlier)
        u, v, _, _ = self._hold(t, u, v, jacobian, tangents, drift)
        self.liveliest = max(self.liveliest, system.kinetic_energy(u, v))
        rounded = self._rounded(t, u, v, np.stack([jacobian, tangents]))
        noise = rounded[0] + 64.0 * _EPS * (np.abs(jacobian) @ np.abs(v) + np.abs(rate))
        still = rounded[1] + _STILL * np.abs(tangents) @ np.abs(v)
        v, impacts = self._rub(t, u, v, rate, rows, noise)
        still = np.maximum(still, _STILL * np.abs(tangents) @ np.abs(v))
        speed, aside = jacobian @ v - rate, tangents @ v
        slow = rows[np.abs(speed[rows]) <= np.maximum(noise[rows], self.threshold)]
        if released is not None and released.how == "stops":  # and so what is as slow
            sizes = np.abs(tangents).sum(axis=1)
            slowest = abs(aside[released.constraint]) / sizes[released.constraint]
            still = np.maximum(still, 2.0 * slowest * sizes)
        moving = np.abs(aside) > still
        found = self._chosen(t, u, v, slow, moving, aside, released)
        lasts = [mode is not None for mode in found.modes]
        closed = tuple(int(j) for j, stays in zip(slow, lasts, strict=True) if stays)
        self.modes = tuple(mode for mode in found.modes if mode is not None)
        applied = Forced.at(system, t, u, v).free
        curvature = system.gap_curvature(t, u, v)
        falls = jacobian @ applied + curvature
        tails = {
            j: self._tail(j, speed[j], falls[j])
            for j in closed
            if speed[j] > noise[j] and falls[j] < 0.0
        }
        self.closed = closed
        u, v, dropped, lost = self._hold(t, u, v, jacobian, tangents, speed)
        self.dropped_energy += lost
        self.dropped_speed = max(self.dropped_speed, *(abs(float(speed[j])) for j in closed), 0.0)
        self.order[rows] = np.where(
            speed[rows] > noise[rows], 1, np.where(np.isin(rows, slow), 2, 0)
        )
        own = Room.at(system, u, t).rows(jacobian)
        implied = self._implied(slow, found, own, closed)
        self._enter(closed, implied, t, before_spell, tails)
        self._note(t, past)
        if (free := found.pushed.undetermined) and self.overconstrained is None:
            self.overconstrained = {"time": t, "dimension": free, "contacts": len(closed)}
        total = np.zeros(count)
        for _, j, _, _, impulse in impacts:
            total[j] += impulse
        total[list(closed)] = np.maximum(total[list(closed)] + dropped, 0.0)
        return u, v, impacts, total

    def _rounded(self, t: float, u: Floats, v: Floats, rows: Floats) -> Floats:
        """Velocities along rows (2, J, d) that are rounding of what was and of forces, (2, J)."""
        flat = rows.reshape(-1, rows.shape[-1])
        easy = np.einsum("ij,ji->i", flat, answers_to(self.system, u, flat))
        quick = np.sqrt(2.0 * self.liveliest * np.maximum(easy, 0.0)).reshape(rows.shape[:-1])
        gained = np.abs(rows) @ np.abs(Forced.at(self.system, t, u, v).free) * (t - self.settled)
        self.settled = t
        return np.asarray(64.0 * _EPS * (quick + gained))

    def _hold(
        self, t: float, u: Floats, v: Floats, jacobian: Floats, tangents: Floats, speed: Floats
    ) -> tuple[Floats, Floats, Floats, float]:
        """Take away gaps and normal speeds of closed constraints, and the slip of what sticks.

        Returns:
            Position, velocity, impulses of the closed constraints, and the energy lost by them.
        """
        rows = list(self.closed)
        if not rows:
            return u, v, np.zeros(0), 0.0
        stuck = [j for j, mode in zip(rows, self.modes, strict=True) if mode == 0]
        held = np.concatenate([jacobian[rows], tangents[stuck]])
        answers = answers_to(self.system, u, held)
        gaps = np.concatenate([self.system.gap(t, u)[rows], np.zeros(len(stuck))])
        slips = np.concatenate([speed[rows], tangents[stuck] @ v])
        wrong = np.stack([gaps, slips], axis=1)
        pushes = np.linalg.lstsq(held @ answers, -wrong, 1e-12)[0]
        change, push = answers @ pushes, pushes[: len(rows), 1]
        kinetic = self.system.kinetic_energy
        faster, end = v + change[:, 1], advanced(self.system, u, change[:, 0])
        return end, faster, push, kinetic(u, v) - kinetic(u, faster)

    def _rub(
        self, t: float, u: Floats, v: Floats, rate: Floats, rows: Integers, noise: Floats
    ) -> tuple[Floats, list[Row]]:
        """Impacts until nothing approaches; noise becomes at least theirs."""
        system, impacts = self.system, list[Row]()
        room, jacobian = Room.at(system, u, t), system.jacobian(u)
        both = np.stack([jacobian, system.slip(u)[:, 0]], axis=1)[rows].reshape(-1, len(v))
        coupling, answers = delassus(room.factor, room.rows(both))
        answers = room.full(answers)
        for _ in range(_REPEATS):
            before = both @ v
            before[::2] -= rate[rows]
            if (before[::2] >= -noise[rows]).all():
                return v, impacts
            self.fastest = max(self.fastest, -float(before[::2].min()))
            self.last_impact = t
            offset = before.copy()
            offset[::2] *= 1.0 + system.restitution[rows]
            offset[1::2] *= 1.0 + system.tangential_restitution[rows]
            try:
                push = cone_impulses(coupling, offset, system.friction[rows], 1)
            except ConvergenceError as error:
                raise ConvergenceError(
                    f"events: the impact with friction on constraints {rows.tolist()} at t = "
                    f"{t:.9g} has no solution ({error})"
                ) from error
            v = v + answers @ push
            self.strikes += (_strike(rows, push, system.friction[rows]),)
            after = both @ v
            after[::2] -= rate[rows]
            self.work += 0.5 * float(push[1::2] @ (before + after)[1::2])
            size = np.abs(answers) @ np.abs(push)
            np.maximum(noise, 64.0 * _EPS * np.abs(jacobian) @ size, out=noise)
            impacts += [
                (t, int(j), float(before[2 * i]), float(after[2 * i]), float(push[2 * i]))
                for i, j in enumerate(rows)
                if push[2 * i] > 0.0
            ]
        raise ConvergenceError(
            f"events: {_REPEATS} impacts at t = {t:.9g} did not separate constraints "
            f"{rows.tolist()}: do they leave room?"
        )

    def _chosen(
        self, t: float, u: Floats, v: Floats, slow: Integers, moving: Booleans, aside: Floats,
        released: End | None,
    ) -> Solutions:  # fmt: skip
        """Modes of the constraints without normal speed.

        Of several motions the one that goes on as before; else that in which contacts stay closed
        and stick.

        Raises:
            ConvergenceError: None fit.
        """
        contacts = Rubbing.at(self.system, t, u, v, slow.tolist())
        past = dict(zip(self.closed, self.modes, strict=True))
        choices: list[list[Mode]] = []
        for j in slow.tolist():
            given: list[Mode] = [int(np.sign(aside[j])), None] if moving[j] else [0, 1, -1, None]
            stopped = released is not None and released.how == "stops" and not moving[j]
            if j in past and past[j] in given and not stopped:
                given.insert(0, given.pop(given.index(past[j])))
            choices.append(given)
        slides = [bool(moving[j]) for j in slow]
        found = None
        if released is not None and released.constraint in slow:
            place = slow.tolist().index(released.constraint)
            left = {"lifts": [None], "slips": [m for m in choices[place] if m != 0], "stops": None}
            fewer = left[released.how]
            if fewer is not None:
                narrowed = [*choices[:place], fewer, *choices[place + 1 :]]
                found = solutions(contacts, narrowed, slides)
        found = found or solutions(contacts, choices, slides)
        if found is None:
            raise unsolved(t, slow.tolist(), self.system)
        if found.count > 1 and self.nonunique is None:
            words = [f"{j} {_IN_WORDS[m]}" for j, m in zip(slow.tolist(), found.modes, strict=True)]
            self.nonunique = {"time": t, "solutions": found.count, "taken": ", ".join(words)}
        return found

    def _note(self, t: float, past: dict[int, Mode]) -> None:
        """Keep what constraints do now and did not before."""
        now: dict[int, Mode] = dict(zip(self.closed, self.modes, strict=True))
        for j in sorted(past.keys() | now.keys()):
            if past.get(j) != now.get(j) and len(self.changes) < MAX_SPELLS:
                self.changes.append([t, j, _IN_WORDS[now.get(j)]])

    def _implied(
        self, slow: Integers, found: Solutions, jacobian: Floats, closed: tuple[int, ...]
    ) -> tuple[int, ...]:
        """Open constraints that stay closed because those do that are."""
        pushed, size = found.pushed, float(np.abs(found.pushed.acceleration).max(initial=0.0))
        return tuple(
            int(j)
            for i, j in enumerate(slow)
            if found.modes[i] is None
            and abs(pushed.opening[i]) <= _FLAT * np.abs(jacobian[j]).sum() * size
            and len(closed)
            and rank(jacobian[[*closed, j]]) == rank(jacobian[list(closed)])
        )


def _strike(rows: Integers, push: Floats, friction: Floats) -> Strike:
    """Which constraints got impulses (normal and along the tangent by turns), and what slid."""
    hits = np.flatnonzero(push[::2] > 0.0)
    normal, tangential = push[2 * hits], push[2 * hits + 1]
    slid = np.abs(tangential) >= (1.0 - _AT_EDGE) * friction[hits] * normal
    modes = np.where(slid, np.where(tangential > 0.0, -1, 1), 0)
    return Strike(tuple(rows[hits].tolist()), tuple(modes.tolist()))
