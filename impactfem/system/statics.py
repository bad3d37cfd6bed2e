"""A linear elastic solid at rest: what loads leave unbalanced, and what forces do to it."""

from collections.abc import Callable
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.fem import MPI
from impactfem.system.drive import Drive
from impactfem.system.elastic import ElasticSystem
from impactfem.system.linear import LinearSolver
from impactfem.system.massless import transferred
from impactfem.system.rigid_modes import RigidModes, spun
from impactfem.system.surface import SurfaceNodes

_HELD = 1e-6  # share of a spin that supports take from a body that is not free to turn
_SHIFT = 1e-6
"""Mass that holds free bodies, as a share of what would double the least uniform strain's energy.

Each pass leaves so much of the error; and answers to single forces are so much smaller than the
rigid part of theirs, which rounding must not hide."""


class BodyAtRest:
    """What bodies at rest have in common, whatever their law.

    Attributes:
        name: Of the body.
        start: Displacement from which equilibrium is sought [m], shape (owned dofs,).
        patience: None: along a free motion it goes on until something stops it.
        modes: Its free rigid motions.
    """

    def __init__(
        self, name: str, system: ElasticSystem, surface: SurfaceNodes, linear_solver: str
    ) -> None:
        """Take a body; see `SolidAtRest` (collective)."""
        self.name, self.start, self.modes = name, system.displacement.copy(), RigidModes.of(system)
        self.patience = 0
        self._system, self._surface, self._kind = system, surface, linear_solver
        self._vectors = [system.stiffness.createVecRight() for _ in range(2)]

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes, (count, dim) (collective)."""
        return self._surface.gather(place)

    def touch(self, normals: Floats) -> None:
        """Nothing: nodes touch themselves."""

    def touching(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, dim) (collective)."""
        return self.contact(place)

    def moved(self, place: Floats, change: Floats) -> Floats:  # noqa: ARG002  (as of others)
        """How they move by a change of the owned dofs, (count, dim) (collective)."""
        return self._surface.gather(change)

    def pulled(self, forces: Floats, place: Floats) -> Floats:  # noqa: ARG002  (as of others)
        """Forces on the owned dofs by those on the contact nodes (count, dim)."""
        return self._surface.pulled(forces, self._system.constrained)

    def steady(self) -> bool:
        """Nothing to change: linear bodies bear no stress that turns with them."""
        return False

    @cached_property
    def _shift(self) -> float:
        """Stiffness by mass that holds a free body [1/s^2]."""
        return _SHIFT * least_rate(self._system)

    def hold(self, matrix: Any) -> None:
        """Hold a free body by its mass: add that to a PETSc matrix (collective)."""
        if self.modes.count:
            diagonal = matrix.getDiagonal()
            diagonal.setArray(diagonal.getArray() + self._shift * self.modes.weights)
            matrix.setDiagonal(diagonal)
            diagonal.destroy()


class SolidAtRest(BodyAtRest):
    """A linear body; see `impactfem.marching.static_start.Resting`."""

    def __init__(
        self,
        name: str,
        system: ElasticSystem,
        surface: SurfaceNodes,
        transfer: Any,
        linear_solver: str,
        gravity: Floats,
        spin: Floats,
    ) -> None:
        """Sum its loads at t = 0 up (collective).

        Args:
            name: Of the body.
            system: The body.
            surface: Its contact nodes.
            transfer: What moves loads off massless nodes, as the march does; None for none.
            linear_solver: "mumps" or "gamg".
            gravity: At t = 0 [m/s^2], (dim,).
            spin: Angular velocity [rad/s], (1,) or in space (3,): equilibrium is that in the frame
                which turns so about the centre of mass.

        Raises:
            SceneError: The body spins though supports hold it.
        """
        super().__init__(name, system, surface, linear_solver)
        drive = Drive(system, transfer)
        weight = np.repeat(system.node_mass, system.dim) * np.tile(gravity, len(system.positions))
        self._load = drive.load(0.0, 0.0) + drive.lift(0.0) + transferred(transfer, weight)
        if spin.any():
            flung = self._flung(spin)
            moved = transferred(transfer, flung)
            # Where masses move to their neighbours, moments appear that no turning body has.
            false = self.modes.along(moved) - self.modes.along(flung)
            self._load += moved - self.modes.forces(false)
        self._load[system.constrained] = 0.0

    def _flung(self, spin: Floats) -> Floats:
        """Centrifugal forces of the undeformed body [N], (owned dofs,) (collective)."""
        system = self._system
        arms = system.positions - system.center_of_mass
        velocity = spun(arms, spin)
        lost = velocity.ravel() - self.modes.of_displacement(velocity.ravel())
        sizes = [float(np.abs(part).max(initial=0.0)) for part in (lost, velocity)]
        left, fastest = (system.comm.allreduce(size, op=MPI.MAX) for size in sizes)
        if left > _HELD * fastest:
            raise SceneError(
                f"body {self.name}: angular_velocity = {np.round(spin, 6).tolist()} with start = "
                '"static" needs a body that is free to turn so, but its supports hold it; remove '
                'one of them, or use start = "given"'
            )
        turned = spun(velocity, spin)
        source, image = system.mass.createVecs()
        source.setArray(-turned.ravel())
        system.mass.mult(source, image)
        found: Floats = image.getArray().copy()
        source.destroy()
        image.destroy()
        return found

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces [N], (owned dofs,) (collective)."""
        source, image = self._vectors
        source.setArray(place)
        self._system.stiffness.mult(source, image)
        found = self._load - image.getArray()
        found[self._system.constrained] = 0.0
        return np.asarray(found)

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:  # noqa: ARG002  (linear)
        """What forces on the owned dofs do; the same at every place."""
        return self._answer

    def _answer(self, forces: Floats) -> Floats:
        solver, (source, image) = self._solver, self._vectors
        source.setArray(forces)
        image.set(0.0)
        solver.solve(source, image)
        found = np.array(image.getArray())
        if self.modes.count:
            # Known exactly, and the least that an iterative solver would settle.
            rigid = self.modes.along(forces) / self._shift - self.modes.moved(found)
            found += rigid @ self.modes.fields
        return found

    @cached_property
    def _solver(self) -> LinearSolver:
        system = self._system
        matrix = system.stiffness.copy()
        self.hold(matrix)
        return LinearSolver(matrix, self._kind, system.stiffness.getNearNullSpace())

    def destroy(self) -> None:
        """Free PETSc's objects."""
        if "_solver" in self.__dict__:
            self._solver.destroy()
        for vector in self._vectors:
            vector.destroy()


def least_rate(system: ElasticSystem) -> float:
    """Least quotient of stiffness and mass of uniform strains [1/s^2] (collective)."""
    arms = system.positions - system.center_of_mass
    source, image = system.stiffness.createVecs()
    quotients = []
    for i, j in combinations_with_replacement(range(system.dim), 2):
        field = np.zeros_like(arms)
        field[:, i] += arms[:, j]
        field[:, j] += arms[:, i]
        strain = np.where(system.constrained, 0.0, field.ravel())
        energies = []
        for matrix in (system.stiffness, system.mass):
            source.setArray(strain)
            matrix.mult(source, image)
            energies.append(source.dot(image))
        quotients.append(energies[0] / energies[1])
    source.destroy()
    image.destroy()
    return float(min(quotients))
