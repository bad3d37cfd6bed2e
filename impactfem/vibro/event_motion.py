"""Equations of motion between events, with the constraints that are closed."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from impactfem.arrays import Floats
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Forced, advanced, closed
from impactfem.vibro.event_choice import Onset
from impactfem.vibro.event_constrained import constrained

_LOOSE = 1e-12  # share of the forces that counts as their rounding


@dataclass(frozen=True)
class End:
    """Why a flight with closed constraints ends.

    Attributes:
        constraint: Which of them ends it.
        how: Its force vanishes, what stuck slips, or what slipped stops.
    """

    constraint: int
    how: Literal["lifts", "slips", "stops"] = "lifts"


@dataclass(frozen=True)
class Motion:
    """Equations of motion with given closed constraints; y = (u, v, integrals of the forces)."""

    system: GeneralizedSystem
    closed: tuple[int, ...]
    rtol: float

    def forces(self, t: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Acceleration (d,), contact forces (S,) [N]."""
        system, rows = self.system, list(self.closed)
        if system.is_flat:
            by_force, by_bend = self._answers
            found = by_force @ system.force(t, u, v)
            if system.moves and rows:
                found = found + by_bend @ system.gap_curvature(t, u, v)[rows]
            return found[: system.dofs], found[system.dofs :]
        forced = Forced.at(system, t, u, v)
        if not rows:
            return forced.free, np.zeros(0)
        normals = system.jacobian(u)[rows]
        bend = system.gap_curvature(t, u, v)[rows] + normals @ forced.drift
        room, load = forced.room, forced.load[:, None]
        found, pressed = constrained(room.mass, room.rows(normals), load, bend[:, None])
        return forced.full(found[:, 0]), pressed[:, 0]

    @cached_property
    def _answers(self) -> tuple[Floats, Floats]:
        """Of a flat system accelerations, then contact forces, by forces and by bends of gaps.

        Each of shape (d + S, d) and (d + S, S).
        """
        mass, rows = self.system.mass(np.zeros(self.system.dofs)), list(self.closed)
        unit, none = np.eye(len(mass)), np.zeros((len(rows), len(mass)))
        if not rows:
            return np.linalg.inv(mass), none.T
        normals = self.system.jacobian(np.zeros(len(mass)))[rows]
        by_force = constrained(mass, normals, unit, none)
        by_bend = constrained(mass, normals, none.T, np.eye(len(rows)))
        return np.concatenate(by_force), np.concatenate(by_bend)

    def doubts(self, t: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Rounding of second rates of the gaps (J,) and of forces (S,), by that of the state."""
        system, n, rows = self.system, len(u), list(self.closed)
        load, y = system.force(t, u, v), np.concatenate([u, v])
        size = _LOOSE * np.abs(load)
        for i in np.flatnonzero(y):
            other = y.copy()
            other[i] *= 1.0 + self.rtol
            size = size + np.abs(system.force(t, other[:n], other[n:]) - load)
        forced = Forced.at(system, t, u, v)
        jacobian, room = system.jacobian(u), forced.room
        inverse = np.linalg.inv(room.mass) if room.basis is None else room.inverse
        bend = _LOOSE * np.abs(system.gap_curvature(t, u, v))
        bend += self.rtol * np.abs(jacobian) @ np.abs(forced.drift)
        gaps = np.abs(jacobian) @ (np.abs(inverse) @ size) + bend
        answers = jacobian @ inverse @ jacobian[rows].T
        forces = np.abs(np.linalg.inv(answers[rows])) @ gaps[rows]
        return gaps + np.abs(answers) @ forces, forces

    def onset(self, t: float, u: Floats, v: Floats, later: float) -> Onset:
        """How gaps and forces begin: their second rates and forces now, and a little later."""
        gaps, forces = [], []
        a = self.forces(t, u, v)[0]
        for s in (0.0, later):
            at = t + s, advanced(self.system, u, s * v + 0.5 * s * s * a), v + s * a
            rate, pressed = self.forces(*at)
            gaps.append(self.system.jacobian(at[1]) @ rate + self.system.gap_curvature(*at))
            forces.append(pressed)
        open_doubt, force_doubt = self.doubts(t, u, v)
        return Onset(
            np.array(gaps), np.tile(open_doubt, (2, 1)),
            np.array(forces), np.tile(force_doubt, (2, 1)),
        )  # fmt: skip

    def split(self, y: Floats) -> tuple[Floats, Floats]:
        """U and v of a state."""
        n = self.system.coordinates
        return y[:n], y[n : n + self.system.dofs]

    def kept(self, y: Floats) -> Floats:
        """The state with its bilateral rows closed."""
        if not self.system.is_joined:
            return y
        u, v = closed(self.system, *self.split(y))
        return np.concatenate([u, v, y[len(u) + len(v) :]])

    @property
    def integrals(self) -> int:
        """Number of integrals behind u and v: of the forces of closed constraints, first of all."""
        return len(self.closed)

    def __call__(self, t: float, y: Floats) -> Floats:
        """Rates of u, v and the integrals."""
        u, v = self.split(y)
        acceleration, pressed = self.forces(t, u, v)
        return np.concatenate([self.system.coordinate_rates(u, v), acceleration, pressed])

    def loose(self, t: float, u: Floats, v: Floats) -> Floats:
        """How far below 0 `guards` may fall by rounding."""
        return self.doubts(t, u, v)[1] if self.closed else np.zeros(0)

    def guards(self, t: float, u: Floats, v: Floats) -> Floats:
        """What must not fall below 0 while these constraints are closed: their forces."""
        return self.forces(t, u, v)[1] if self.closed else np.zeros(0)

    def ended(self, guard: int) -> End:
        """What ends with a guard."""
        return End(self.closed[guard])
