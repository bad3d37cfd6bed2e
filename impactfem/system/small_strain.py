"""A body of small strains beside others under finite strain, asked the same way as these."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.fem import MPI, PETSc
from impactfem.system.matrices import body_forms, body_stiffness
from impactfem.system.nodes import Nodes

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

_SUBSET = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
_DIFFERENT = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN


class SmallStrain:
    """Internal forces K (u_a + u_b) / 2; see `impactfem.system.finite_strain.FiniteStrain`."""

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
        self._retarded = 0.0

    def retard(self, steps: float) -> None:
        """Take a time of retardation (Kelvin and Voigt), counted in time steps, from now on."""
        self._retarded = steps

    def force(self, before: Floats, after: Floats) -> Floats:
        """Forces of the nodes on the body in a step [N], (owned dofs,) (collective)."""
        return self._product(0.5 * (before + after) + self._retarded * (after - before))

    def press(self, start: float, end: float) -> None:
        """Nothing: pressures of small strains keep their direction, as loads."""

    def pressed(self, before: Floats, after: Floats) -> Floats:  # noqa: ARG002  (likewise)
        """No forces."""
        return np.zeros(len(before))

    def tangent(self, before: Floats, after: Floats, *, pressed: bool = True) -> Any:  # noqa: ARG002
        """Their derivative by ``after`` as a new PETSc matrix [N/m] (collective)."""
        tangent = self._stiffness.copy()
        tangent.scale(0.5 + self._retarded)
        return tangent

    def repeated_tangent(self, fixed: Any, held: Booleans) -> "_Tangent":
        """That tangent for many steps, with a fixed matrix (collective)."""
        return _Tangent(self, self._stiffness, fixed, held)

    def put(self, before: Floats, after: Floats) -> None:
        """Nothing: the tangent is the same everywhere."""

    def add_to(self, matrix: Any) -> None:
        """Add the tangent to a matrix that has its pattern."""
        matrix.axpy(0.5 + self._retarded, self._stiffness, _SUBSET)

    def energy(self, displacement: Floats) -> float:
        """Elastic energy, the part of the nodes of this rank [J] (collective)."""
        return 0.5 * float(displacement @ self._product(displacement))

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


class _Tangent:
    """As `impactfem.fem.RepeatedMatrix`, of a body whose stiffness stays.

    Attributes:
        matrix: The PETSc matrix.
    """

    def __init__(self, strain: SmallStrain, stiffness: Any, fixed: Any, held: Booleans) -> None:
        self._strain, self._fixed = strain, fixed
        self.matrix = fixed.copy()
        self.matrix.axpy(1.0, stiffness, _DIFFERENT)
        self.matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self._held = (np.flatnonzero(held) + fixed.getOwnershipRange()[0]).astype(PETSc.IntType)

    def assemble(self, factor: float) -> None:
        """Add the stiffness and a multiple of the fixed matrix up (collective)."""
        self.matrix.zeroEntries()
        self._strain.add_to(self.matrix)
        self.matrix.axpy(factor, self._fixed, _SUBSET)
        self.matrix.zeroRowsColumns(self._held, diag=1.0)

    def destroy(self) -> None:
        """Free the PETSc matrix, and those of the body."""
        self.matrix.destroy()
        self._strain.destroy()
