"""Regions of a plate that joints hold, in a step: how impulses there move it, solved for once."""

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats

if TYPE_CHECKING:
    from impactfem.marching.plate import PlateMidpoint


class PlateTips:
    """Coordinates of the tips of a plate; see `impactfem.marching.held_rows.Linear`.

    Attributes:
        counts, span, noise, volatile: See there.
        moves: Which of all motions of the stations they are, (d,).
        reach, reach_ahead: See there.
    """

    def __init__(self, plate: "PlateMidpoint", rows: Floats) -> None:
        """Solve for what impulses do.

        Args:
            plate: What marches it.
            rows: Motions of the stations by its coordinates, (6 stations, coordinates).
        """
        self.counts, self.span, self.noise = plate.counts, plate.dt, 0.0
        self.volatile = plate.volatile
        self.moves = np.flatnonzero(rows.any(axis=1))
        own, self._plate = rows[self.moves], plate
        self._rows, self._joined = csr_matrix(own), np.zeros(len(own))
        self._by_impulses = np.array([plate.answer(row / plate.dt) for row in own])
        self._touched = np.array([plate.contact_moved(each) for each in self._by_impulses])
        self.reach = 2.0 / plate.dt * (self._rows @ self._by_impulses.T)
        weight = plate.bodies.weight
        self._by_kicks = np.divide(own, weight, where=weight > 0.0, out=np.zeros_like(own))
        self.reach_ahead = self._rows @ self._by_kicks.T

    @property
    def joined_coordinates(self) -> Floats:
        """At the start of the layer."""
        return np.asarray(self._rows @ self._plate.before)

    @property
    def rates(self) -> Floats:
        """At its start."""
        return np.asarray(self._rows @ self._plate.rates)

    @property
    def rates_ahead(self) -> Floats:
        """At its end, as it is solved now."""
        way = self._rows @ (self._plate.coordinates - self._plate.before)
        return np.asarray(2.0 / self.span * way - self.rates)

    rates_left = rates_ahead

    def look(self) -> None:
        """Nothing: contact nodes move with each force."""

    def set_out(self, start: float, end: float) -> None:
        """Solve a step without forces of contact and joints."""
        self._plate.begin(start, end)
        self._joined = np.zeros(len(self._joined))

    def impel(self, impulse: Floats) -> bool:
        """Solve the layer with an impulse of joints (d,); it answers linearly."""
        self._plate.shift((impulse - self._joined) @ self._by_impulses)
        self._joined = impulse
        return True

    def kick(self, impulse: Floats) -> None:
        """Let the next layer start with rates that an impulse (d,) has changed."""
        self._plate.kick(impulse @ self._by_kicks)

    def strike(self, forces: Floats) -> None:
        """Add contact forces (count, 3)."""
        self._plate.push(forces, None, np.zeros(0))

    def reached(self, forces: Floats) -> Floats:
        """Rates by several contact forces (several, count, 3) for a second, (several, d)."""
        moved = np.array([self._plate.answer_to(force) for force in forces])
        return np.asarray(2.0 / self.span**2 * moved @ self._rows.T)

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses (several, d), (several, count, 3)."""
        return np.asarray(2.0 / self.span * np.tensordot(impulses, self._touched, axes=1))
