"""What any march of a body under finite strain tells of it: sums, arms, places."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.marching.layers import Sums
from impactfem.marching.turning import Turning
from impactfem.system.drive import Drive
from impactfem.system.elastic import ElasticSystem
from impactfem.system.finite_statics import FiniteAtRest
from impactfem.system.rigid_modes import spun, unit_spins
from impactfem.system.surface import SurfaceNodes

_TURNS = {2: ([0], [1]), 3: ([1, 2, 0], [2, 0, 1])}  # of a p^T in the moments a x p


class FiniteBody(ABC):
    """Body that may turn and bend at will, with its masses.

    Attributes:
        dt: Length of a layer [s].
        displacement: Of the owned dofs [m].
        velocity: Of the owned dofs [m/s].
        missing: Share of the moment of inertia that its masses have not, by its name.
        size: Its largest extent [m].
    """

    displacement: Floats
    velocity: Floats
    rolling = False
    _turning: Turning | None = None  # of a body of small strains, whose arms stay

    def __init__(
        self,
        system: ElasticSystem,
        surface: SurfaceNodes,
        dt: float,
        weights: Floats,
        missing: dict[str, float],
    ) -> None:
        """Prepare (collective).

        Args:
            system: The body at t = 0, as linear elasticity has it: mass, loads, supports.
            surface: Contact nodes.
            dt: Length of a layer [s].
            weights: Row sums of its mass, 0 where held [kg], (owned dofs,).
            missing: See above.
        """
        self.dt, self.missing, self.size = dt, missing, system.nodes.size
        self._system, self._surface, self._weights = system, surface, weights
        self._drive = Drive(system, None)
        self._ones = np.ones(len(system.positions))  # sums as products: faster by far
        self._arms = self._from_centre(system.positions)

    @abstractmethod
    def _times_mass(self, values: Floats) -> Floats:
        """Mass times values of the owned dofs (collective)."""

    @abstractmethod
    def at_rest(self, name: str, gravity: Floats, spin: Floats) -> FiniteAtRest:
        """The body as the search for equilibrium asks it (collective); see `FiniteAtRest`."""

    def turn(self, spin: Floats) -> None:
        """Add velocities that displacements have in a body that turns (collective).

        Args:
            spin: Angular velocity [rad/s], (1,) or in space (3,), that undeformed places have
                already.
        """
        moved = self._from_centre(self.displacement.reshape(-1, self._system.dim))
        more = spun(moved, spin).ravel()
        self.velocity = self.velocity + np.where(self._system.constrained, 0.0, more)

    @property
    def surface_displacement(self) -> Floats:
        """Displacement of the contact nodes [m], (count, dim) (collective)."""
        return self._surface.gather(self.displacement)

    def inertia(self) -> list[Floats]:
        """None that would stay; what turns is told by `Sums.attitude`."""
        if self._turning is not None:
            return [self._turning.inertia]
        turns = self._system.dim * (self._system.dim - 1) // 2
        return [np.zeros((turns, turns))]

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins now [m], (turns, count, dim)."""
        if self._turning is not None:
            return np.stack([self._surface.gather(row) for row in self._turning.rows])
        places = self._system.positions + self.displacement.reshape(self._system.positions.shape)
        arms = self._surface.gather(self._from_centre(places).ravel())
        return np.stack(unit_spins(arms))

    def gravity(self, start: float, end: float) -> Floats:
        """Mean gravity of a layer [m/s^2], shape (dim,)."""
        return self._drive.gravity(start, end)

    def _summed(self, elastic: float, work: float) -> list[Sums]:
        """Sums of the present state (collective)."""
        dim = self._system.dim
        momentum = self._times_mass(self.velocity)
        each, weights = momentum.reshape(-1, dim), self._weights.reshape(-1, dim)
        spin, attitude = self._turned(momentum)
        whole = self._ones @ each
        moment = self._ones @ (weights * self.displacement.reshape(-1, dim))
        if self._drive.has_moved:
            whole = self._drive.moments(self.velocity)
            moment = self._drive.moments(self.displacement)
        kinetic = 0.5 * float(self.velocity @ momentum)
        sums = Sums(kinetic, elastic, work, whole, moment, spin, attitude)
        return [sums]

    def _turned(self, momentum: Floats) -> tuple[Floats, Floats | None]:
        """Angular momentum and attitude as `Sums` has them (collective)."""
        if self._turning is not None:
            return self._turning.rows @ momentum, None
        system, dim = self._system, self._system.dim
        arms = self._from_centre(system.positions + self.displacement.reshape(-1, dim))
        heavy = self._times_mass(arms.ravel()).reshape(-1, dim)
        fit = (self._weights.reshape(-1, dim) * arms).T @ self._arms
        moment = arms.T @ momentum.reshape(-1, dim)
        spin: Floats = (moment - moment.T)[_TURNS[dim]]
        return spin, np.stack([fit, arms.T @ heavy]).ravel()

    def _from_centre(self, places: Floats) -> Floats:
        """Arms of places of the nodes from their centre of mass; an axis turns nothing."""
        weights = self._weights.reshape(places.shape)
        own = np.stack([self._ones @ (weights * places), self._ones @ weights])
        total = np.asarray(self._system.comm.allreduce(own, op=MPI.SUM))
        arms: Floats = places - total[0] / np.where(total[1] > 0.0, total[1], 1.0)
        return np.zeros_like(arms) if self._system.axisymmetric else arms

    def placed(self, static: Floats) -> Floats:  # noqa: ARG002  (as the interface has it)
        """Displacement of the owned dofs, as a new array."""
        return self.displacement.copy()

    def memory(self) -> dict[str, Floats]:
        """Nothing besides."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:  # noqa: B027  (there is nothing)
        """Nothing."""
