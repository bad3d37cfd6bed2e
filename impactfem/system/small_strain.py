"""A body of small strains beside others under finite strain, asked the same way as these."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.fem import MPI
from impactfem.system.matrices import body_forms, body_stiffness
from impactfem.system.nodes import Nodes
from impactfem.system.relaxation import Relaxation, named
from impactfem.system.step_solvers import KeptSolvers


class SmallStrain:
    """Internal forces K (u_a + u_b) / 2; see `impactfem.system.finite_strain.FiniteStrain`."""

    arms_stay = True

    def __init__(self, nodes: Nodes, solid: Any) -> None:
        """Assemble the stiffness (collective).

        Args:
            nodes: Nodes of the body.
            solid: `impactfem.scene.solids.Solid`.
        """
        self._comm = nodes.comm
        forms = body_forms(nodes, solid)
        self._stiffness = body_stiffness(nodes, forms, keeps_volume=solid.keeps_volume)
        self._source, self._image = self._stiffness.createVecs()
        self._relaxation = Relaxation.of(solid.relaxing)
        self._relaxing = self._relaxation.rest(self._source.getLocalSize())
        self._step, self._retardation = math.inf, 0.0

    def retard(self, retardation: float, step: float) -> None:
        """Take a time of retardation (Kelvin and Voigt) and a time step [s] from now on."""
        self._retardation, self._step = retardation, step

    def force(self, before: Floats, after: Floats) -> Floats:
        """Forces of the nodes on the body in a step [N], (owned dofs,) (collective)."""
        way = after - before
        strained = 0.5 * (before + after) + self._retardation / self._step * way
        if self._relaxation:
            amid = self._relaxation.amid(self._relaxing, way, self._step)
            strained += self._relaxation.straining(amid)
        return self._product(strained)

    def settle(self, before: Floats, after: Floats) -> None:
        """Take Maxwell terms to the end of a step."""
        if self._relaxation:
            self._relaxing = self._relaxation.after(self._relaxing, after - before, self._step)

    def straining(self, displacement: Floats) -> Floats:
        """Displacement whose elastic stress is that of the body."""
        return displacement + self._relaxation.straining(self._relaxing)

    def state(self) -> dict[str, Floats]:
        """What it remembers, by name."""
        return named(self._relaxing)

    def restore(self, state: Mapping[str, Floats]) -> None:
        """Go on from a state."""
        for name, kept in zip(named(self._relaxing), self._relaxing, strict=True):
            kept[:] = state[name]

    def press(self, start: float, end: float) -> None:
        """Nothing: pressures of small strains keep their direction, as loads."""

    def pressed(self, before: Floats, after: Floats) -> Floats:  # noqa: ARG002  (likewise)
        """No forces."""
        return np.zeros(len(before))

    def tangent(self, before: Floats, after: Floats, *, pressed: bool = True) -> Any:  # noqa: ARG002
        """Their derivative by ``after`` as a new PETSc matrix [N/m] (collective)."""
        tangent = self._stiffness.copy()
        steps = self._retardation / self._step
        tangent.scale(0.5 * (1.0 + self._relaxation.stiffening(self._step)) + steps)
        return tangent

    def step_solver(
        self, mass: Any, held: Booleans, dt: float, damping: tuple[float, float], kind: str,
        near: Any,
    ) -> KeptSolvers:  # fmt: skip
        """What solves with that tangent in steps; see `KeptSolvers`."""
        return KeptSolvers(
            self._stiffness, mass, held, dt, damping, kind, near, self._relaxation.stiffening
        )

    def put(self, before: Floats, after: Floats) -> None:
        """Nothing: the tangent is the same everywhere."""

    def energy(self, displacement: Floats) -> float:
        """Elastic energy, the part of the nodes of this rank [J] (collective)."""
        stored = 0.5 * float(displacement @ self._product(displacement))
        for share, kept in zip(self._relaxation.shares, self._relaxing, strict=True):
            stored += 0.5 * float(share) * float(kept @ self._product(kept))
        return stored

    def is_inverted(self, displacement: Floats) -> bool:
        """Whether a number is not finite (collective)."""
        return bool(self._comm.allreduce(not np.isfinite(displacement).all(), op=MPI.LOR))

    def _product(self, values: Floats) -> Floats:
        self._source.setArray(values)
        self._stiffness.mult(self._source, self._image)
        return np.array(self._image.getArray())

    def destroy(self) -> None:
        """Free PETSc's objects."""
        for thing in (self._stiffness, self._source, self._image):
            thing.destroy()
