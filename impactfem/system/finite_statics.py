"""A body under finite strain at rest: what loads leave unbalanced, and what forces do to it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI, PETSc
from impactfem.system.drive import Drive
from impactfem.system.elastic import ElasticSystem
from impactfem.system.finite_strain import FiniteStrain
from impactfem.system.linear import LinearSolver
from impactfem.system.rigid_modes import RigidModes, spun
from impactfem.system.small_strain import SmallStrain
from impactfem.system.statics import BodyAtRest
from impactfem.system.surface import SurfaceNodes


class FiniteAtRest(BodyAtRest):
    """A body with any law; see `impactfem.marching.resting.Resting`."""

    def __init__(
        self,
        name: str,
        system: ElasticSystem,
        strain: FiniteStrain | SmallStrain,
        surface: SurfaceNodes,
        mass: Any,
        weights: Floats,
        linear_solver: str,
        gravity: Floats,
        spin: Floats,
    ) -> None:
        """Sum its loads at t = 0 up (collective).

        Args:
            name: Of the body.
            system: The body at t = 0, as linear elasticity has it.
            strain: Its forces.
            surface: Its contact nodes.
            mass: PETSc matrix of the march, without the mass of contact nodes.
            weights: Its row sums, (owned dofs,).
            linear_solver: "mumps" or "gamg".
            gravity: At t = 0 [m/s^2], (dim,).
            spin: Angular velocity [rad/s] about the centre of mass, (1,) or in space (3,).
        """
        super().__init__(name, system, surface, linear_solver)
        self._strain, self._spin, self._steady = strain, spin, False
        strain.press(0.0, 0.0)
        self._mass, self._weights = mass, weights.reshape(-1, system.dim)
        drive = Drive(system, None)
        self._load = drive.load(0.0, 0.0) + (self._weights * gravity).ravel()
        self._solver: LinearSolver | None = None

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces [N]; not numbers where cells are inside out (collective)."""
        if self._strain.is_inverted(place):
            return np.full(len(place), np.nan)
        found = self._load + self._strain.pressed(place, place) - self._strain.force(place, place)
        if self._spin.any():
            found += self._flung(place)
        found[self._system.constrained] = 0.0
        return np.asarray(found)

    def _flung(self, place: Floats) -> Floats:
        """Centrifugal forces about the centre of mass where it is now [N] (collective)."""
        system, weights = self._system, self._weights
        places = system.positions + place.reshape(-1, system.dim)
        own = np.vstack([(weights * places).sum(axis=0), weights.sum(axis=0)])
        moments, mass = np.asarray(system.comm.allreduce(own, op=MPI.SUM))
        arms = places - moments / mass
        for _ in range(2):
            arms = spun(arms, self._spin)
        source, image = self._vectors
        source.setArray(-arms.ravel())
        self._mass.mult(source, image)
        return np.array(image.getArray())

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:
        """What forces on the owned dofs do where the body is (collective).

        A step's forces are symmetric in both its ends: by one of them they change half as much.
        """
        # What pressures that follow do as a free body turns outweighs the mass that holds it.
        matrix = self._strain.tangent(place, place, pressed=not self.modes.count)
        matrix.scale(2.0)
        self.hold(matrix)
        held = np.flatnonzero(self._system.constrained) + matrix.getOwnershipRange()[0]
        matrix.zeroRowsColumns(held.astype(PETSc.IntType), diag=1.0)
        self._drop()
        near = self._system.stiffness.getNearNullSpace()
        self._solver = solver = LinearSolver(matrix, self._kind, near, symmetric=False)
        source, image = self._vectors

        def answer(forces: Floats) -> Floats:
            source.setArray(forces)
            image.set(0.0)
            solver.solve(source, image)
            return np.array(image.getArray())

        return self._steadied(answer, place) if self._steady else answer

    def steady(self) -> bool:
        """Take what stresses do to rigid motions out of the answers; whether there are any."""
        self._steady = bool(self.modes.count)
        return self._steady

    def _steadied(
        self, answer: Callable[[Floats], Floats], place: Floats
    ) -> Callable[[Floats], Floats]:
        """Answers of which the rigid part is that of the mass that holds the body (collective).

        Weight above what bears it makes a tangent negative along a turn, which gaps would stop.
        """
        modes = RigidModes.of(self._system, place)
        images = np.array([answer(modes.forces(way)) for way in np.eye(modes.count)])
        moved = np.array([modes.moved(image) for image in images])

        def steadied(forces: Floats) -> Floats:
            along = modes.along(forces)
            found = answer(forces - modes.forces(along))
            held = np.linalg.solve(moved.T, modes.moved(found))
            right: Floats = found - held @ images + (along / self._shift) @ modes.fields
            return right

        return steadied

    def _drop(self) -> None:
        if self._solver is not None:
            self._solver.destroy()

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._drop()
        for vector in self._vectors:
            vector.destroy()
