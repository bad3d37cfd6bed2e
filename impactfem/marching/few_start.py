"""Points, rods and beams at rest: what loads leave unbalanced, and what forces do to them.

Places are those of their coordinates, less where they are given. What moves freely is held by mass,
as hard as lets the loads move it by its size: each pass takes it so far, or to where contact stops
it.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.marching.few_forces import tangent
from impactfem.system.rigid_modes import RigidModes

if TYPE_CHECKING:
    from impactfem.marching.few import FewMidpoint

_FREE = 1e-9  # share of the largest stiffness by mass below which a motion has none
_SOFT = 1e-6  # share of the least other one that holds it
BOUND = 1.0
"""Its size over the way that loads let a free body go in a pass."""


PATIENCE = 5
"""Passes along a free motion: what tilts to a face turns some times before it lies on it."""


class FewAtRest:
    """Points, a rod or a beam; see `impactfem.marching.resting.Resting`."""

    patience = PATIENCE

    def __init__(self, march: "FewMidpoint") -> None:
        """Take them where they are."""
        bodies, self._march, self._q = march.bodies, march, self._here(march)
        self.name, self.start = bodies.names[0], np.zeros(len(self._q))
        self.size = extent(bodies.places(march.coordinates), bodies.radius)
        self._mass, weights, moments = self._weighed()
        fields, stiff = self._free()
        loads = np.vstack([weights.T @ fields.T, moments.T @ fields.T])
        mass, dim = float(sum(bodies.masses)), bodies.dim
        self.modes = RigidModes(MPI.COMM_SELF, fields, self._mass, loads, mass, dim)
        driven = np.abs(self.modes.along(self.residual(self.start)) @ fields).max(initial=0.0)
        self._shift = max(_SOFT * float(stiff.min(initial=np.inf)) if len(stiff) else 0.0,
                          BOUND * driven / self.size, float(np.finfo(float).tiny))  # fmt: skip
        self._answer: Callable[[Floats], Floats] | None = None
        self._eased = 1.0

    @staticmethod
    def _here(march: "FewMidpoint") -> Floats:
        """Its coordinates."""
        return march.coordinates.copy()

    def _weighed(self) -> tuple[Floats, Floats, Floats]:
        """Mass (d, d), and momenta and angular momenta by unit rates, (d, dim) and (d, turns)."""
        bodies = self._march.bodies
        return bodies.system.mass(self._q), bodies.weights, bodies.moments

    def _free(self) -> tuple[Floats, Floats]:
        """Free motions of unit mass, (modes, d), and stiffnesses by mass of others [1/s^2]."""
        rates, ways = _vibrations(self._stiffness(self.start), self._mass)
        loose = rates <= float(rates.max(initial=0.0)) * _FREE
        return ways.T[loose], rates[~loose]

    def _jacobian(self, place: Floats) -> Floats:
        """Of the places of the contact nodes, (nodes dim, d)."""
        return self._march.bodies.jacobian(self._q + place)

    def _follows(self) -> bool:
        """Whether its tangent changes."""
        return self._march.bodies.turning or not self._march.linear

    def _stiffness(self, place: Floats) -> Floats:
        march = self._march
        at = self._q + place
        return tangent(march.bodies.system, (0.0, march.dt), at, 0.0 * at)[0]

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, dim)."""
        return self._march.displaced(self._q + place)

    def touch(self, normals: Floats) -> None:
        """Nothing: nodes touch themselves."""

    def touching(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, dim) (collective)."""
        return self.contact(place)

    def moved(self, place: Floats, change: Floats) -> Floats:
        """How they move by a change of the coordinates from a place [m], (count, dim)."""
        moved = self._jacobian(place) @ change
        return np.asarray(moved.reshape(-1, self._march.bodies.dim))

    def pulled(self, forces: Floats, place: Floats) -> Floats:
        """Forces on the coordinates by those on the contact nodes (count, dim) at a place."""
        return np.asarray(self._jacobian(place).T @ forces.ravel())

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces at t = 0, without contact."""
        march, at = self._march, self._q + place
        force = march.bodies.system.force(0.0, at, 0.0 * at)
        return np.asarray(force + march.bodies.weights @ march.gravity(0.0, 0.0))

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:
        """What forces on the coordinates do, with mass that holds what is free."""
        if self._answer is None or self._follows():
            held = self._eased * self._shift * self._mass if self.modes.count else 0.0
            inverse = np.linalg.inv(self._stiffness(place) + held)
            self._answer = lambda forces: np.asarray(inverse @ forces)
        return self._answer

    def ease(self, share: float) -> None:
        """Hold free motions by so much of the mass that holds them at first."""
        if share != self._eased:
            self._eased, self._answer = share, None

    def steady(self) -> bool:
        """Nothing to change."""
        return False

    def destroy(self) -> None:
        """Nothing to free."""

    def turned(self, place: Floats) -> Floats:
        """How far it has turned at a place [rad], as its spins have it, (turns,); 0 of points."""
        bodies, inertia = self._march.bodies, self._march.inertia()[0]
        moment = bodies.moments.T @ place
        return np.linalg.solve(inertia, moment) if inertia.any() else 0.0 * moment

    def settle(self, place: Floats) -> Floats:
        """Begin at a place; mass times the way there [kg m], (dim,)."""
        self._march.put(self._q + place)
        return np.asarray(self._march.bodies.weights.T @ place)


def _vibrations(stiffness: Floats, mass: Floats) -> tuple[Floats, Floats]:
    """Stiffnesses by mass [1/s^2], increasing, and motions of unit mass, (d, modes)."""
    root = np.linalg.inv(np.linalg.cholesky(mass))
    rates, ways = np.linalg.eigh(root @ (0.5 * (stiffness + stiffness.T)) @ root.T)
    return np.abs(rates), root.T @ ways


def extent(places: Floats, radius: Floats) -> float:
    """Size of a body [m], of a point without a radius 1 m."""
    own = float(np.ptp(places, axis=0).max(initial=0.0)) + 2.0 * float(radius.max(initial=0.0))
    return own or 1.0
