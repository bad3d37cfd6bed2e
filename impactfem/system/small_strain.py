"""A body of small strains beside others under finite strain, asked the same way as these."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.fem import MPI, PETSc
from impactfem.system.materials import materials_of, relaxing_of
from impactfem.system.matrices import body_forms, body_stiffness
from impactfem.system.nodes import Nodes
from impactfem.system.point_memory import TermPlaces
from impactfem.system.relaxation import Relaxation, named
from impactfem.system.step_solvers import KeptSolvers

_SAME = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN


class SmallStrain:
    """Internal forces K (u_a + u_b) / 2; see `impactfem.system.finite_strain.FiniteStrain`."""

    arms_stay = True

    def __init__(self, nodes: Nodes, solid: Any, places: TermPlaces | None = None) -> None:
        """Assemble the stiffness (collective).

        Args:
            nodes: Nodes of the body.
            solid: `impactfem.scene.solids.Solid`.
            places: Is told what terms of unlike materials remember.
        """
        self._comm = nodes.comm
        self._stiffness = body_stiffness(
            nodes, body_forms(nodes, solid), keeps_volume=solid.keeps_volume
        )
        self._source, self._image = self._stiffness.createVecs()
        # Of materials that creep each in its own way terms and damping have their own stiffness.
        self._own: list[Any] | None = None
        self._damping = self._stiffness
        self._relaxation = Relaxation.of(solid.relaxing)
        if solid.creeps_unlike:
            times, shares = relaxing_of(nodes, solid)
            self._relaxation = Relaxation(np.ones(len(times)), times)
            every = [*shares, materials_of(nodes, solid).damped]
            *self._own, self._damping = (
                body_stiffness(
                    nodes, body_forms(nodes, solid, share), keeps_volume=solid.keeps_volume
                )
                for share in every
            )
        self._places = places
        self._remember(self._relaxation.rest(self._source.getLocalSize()))
        self._step, self._retardation = math.inf, 0.0

    def retard(self, retardation: float, step: float) -> None:
        """Take a time of retardation (Kelvin and Voigt) and a time step [s] from now on."""
        self._retardation, self._step = retardation, step

    def force(self, before: Floats, after: Floats) -> Floats:
        """Forces of the nodes on the body in a step [N], (owned dofs,) (collective)."""
        way = after - before
        strained, slowed = 0.5 * (before + after), self._retardation / self._step * way
        amid = self._relaxation.amid(self._relaxing, way, self._step)
        if self._own is None:
            strained += slowed + self._relaxation.straining(amid)
            return self._product(strained)
        found = self._product(strained) + self._product(slowed, self._damping)
        for matrix, each in zip(self._own, amid, strict=True):
            found += self._product(each, matrix)
        return found

    def settle(self, before: Floats, after: Floats) -> None:
        """Take Maxwell terms to the end of a step."""
        if self._relaxation:
            way = after - before
            self._remember(self._relaxation.after(self._relaxing, way, self._step))

    def _remember(self, relaxing: Floats) -> None:
        self._relaxing = relaxing
        if self._places is not None:
            self._places.values = relaxing

    def straining(self, displacement: Floats) -> Floats:
        """Displacement whose elastic stress is that of the body, but for unlike materials."""
        if self._own is not None:
            return displacement
        return displacement + self._relaxation.straining(self._relaxing)

    def state(self) -> dict[str, Floats]:
        """What it remembers, by name."""
        return named(self._relaxing)

    def restore(self, state: Mapping[str, Floats]) -> None:
        """Go on from a state."""
        for name, kept in zip(named(self._relaxing), self._relaxing, strict=True):
            kept[:] = state[name]

    def memory(self) -> dict[str, Floats]:
        """Nothing besides."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Nothing."""

    def press(self, start: float, end: float) -> None:
        """Nothing: pressures of small strains keep their direction, as loads."""

    def pressed(self, before: Floats, after: Floats) -> Floats:  # noqa: ARG002  (likewise)
        """No forces."""
        return np.zeros(len(before))

    def tangent(self, before: Floats, after: Floats, *, pressed: bool = True) -> Any:  # noqa: ARG002
        """Their derivative by ``after`` as a new PETSc matrix [N/m] (collective)."""
        return self._tangent(self._step)

    def _tangent(self, step: float) -> Any:
        """The tangent of a step [s]."""
        tangent, slowed = self._stiffness.copy(), self._retardation / step
        if self._own is None:
            tangent.scale(0.5 * (1.0 + self._relaxation.stiffening(step)) + slowed)
            return tangent
        tangent.scale(0.5)
        weights = self._relaxation.weights(step)
        for matrix, weight in zip(self._own, weights.tolist(), strict=True):
            tangent.axpy(0.5 * weight, matrix, _SAME)
        tangent.axpy(slowed, self._damping, _SAME)
        return tangent

    def step_solver(
        self, mass: Any, held: Booleans, dt: float, damping: tuple[float, float], kind: str,
        near: Any,
    ) -> KeptSolvers:  # fmt: skip
        """What solves with that tangent in steps; see `KeptSolvers`."""
        by_mass, self._retardation = damping
        return KeptSolvers(self._tangent, mass, held, dt, by_mass, kind, near)

    def put(self, before: Floats, after: Floats) -> None:
        """Nothing: the tangent is the same everywhere."""

    def energy(self, displacement: Floats) -> float:
        """Elastic energy, the part of the nodes of this rank [J] (collective)."""
        stored = 0.5 * float(displacement @ self._product(displacement))
        each = self._own or [self._stiffness] * len(self._relaxing)
        for share, kept, matrix in zip(self._relaxation.shares, self._relaxing, each, strict=True):
            stored += 0.5 * float(share) * float(kept @ self._product(kept, matrix))
        return stored

    def is_inverted(self, displacement: Floats) -> bool:
        """Whether a number is not finite (collective)."""
        return bool(self._comm.allreduce(not np.isfinite(displacement).all(), op=MPI.LOR))

    def _product(self, values: Floats, matrix: Any = None) -> Floats:
        self._source.setArray(values)
        (self._stiffness if matrix is None else matrix).mult(self._source, self._image)
        return np.array(self._image.getArray())

    def destroy(self) -> None:
        """Free PETSc's objects."""
        own = [] if self._own is None else [*self._own, self._damping]
        for thing in (self._stiffness, self._source, self._image, *own):
            thing.destroy()
