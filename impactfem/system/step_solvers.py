"""Solvers with the tangents of steps: factored anew in each, or kept where they stay."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from impactfem.fem import PETSc
from impactfem.system.linear import LinearSolver

_DIFFERENT = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
_ROUNDING = 1e-9  # of steps


class StepSolver(Protocol):
    """Solves with the tangent of a step: that of the strains, and a multiple of the mass.

    Attributes:
        generation: Changes with the tangent.
        stays: Whether the present tangent comes back in other steps.
    """

    generation: int

    @property
    def stays(self) -> bool:
        """See above."""

    def renew(self, step: float) -> LinearSolver:
        """Solver with the tangent of the present iterate (collective).

        Args:
            step: Its length [s].

        Raises:
            ConvergenceError: The tangent cannot be factored.
        """

    def destroy(self) -> None:
        """Free PETSc's objects."""


class RenewedSolver:
    """Of tangents that change with the iterate; see `StepSolver`."""

    stays = False

    def __init__(self, tangent: Any, damping: float, kind: str, near: Any) -> None:
        """Prepare.

        Args:
            tangent: `impactfem.fem.RepeatedMatrix` or the like.
            damping: By mass [1/s].
            kind: "mumps" or "gamg".
            near: PETSc null space of rigid motions.
        """
        self._tangent, self._damping, self._kind, self._near = tangent, damping, kind, near
        self._solver: LinearSolver | None = None
        self.generation = 0

    def renew(self, step: float) -> LinearSolver:
        """Factor the tangent of the iterate (collective)."""
        self.generation += 1
        self._tangent.assemble(inertia(step, self._damping))
        if self._solver is None:
            self._solver = LinearSolver(
                self._tangent.matrix, self._kind, self._near, symmetric=False, owned=False
            )
        else:
            self._solver.renew()
        return self._solver

    def destroy(self) -> None:
        """Free PETSc's objects."""
        if self._solver is not None:
            self._solver.destroy()
        self._tangent.destroy()


class KeptSolvers:
    """Of tangents that change with the length of the step only; see `StepSolver`.

    That of steps which are whole layers is kept, and that of the last step of another length.
    """

    def __init__(
        self,
        tangent: Callable[[float], Any],
        mass: Any,
        held: NDArray[np.bool_],
        dt: float,
        damping: float,
        kind: str,
        near: Any,
    ) -> None:
        """Prepare.

        Args:
            tangent: Makes that of the strains, a PETSc matrix, by the length of a step [s].
            mass: PETSc matrix.
            held: Owned dofs that supports hold.
            dt: Length of a layer [s].
            damping: By mass [1/s].
            kind: "mumps" or "gamg".
            near: PETSc null space of rigid motions.
        """
        self._tangent, self._mass, self._kind, self._near = tangent, mass, kind, near
        own = np.flatnonzero(held) + mass.getOwnershipRange()[0]
        self._held = own.astype(PETSc.IntType)
        self._dt, self._damping = dt, damping
        self._whole: LinearSolver | None = None
        self._other: LinearSolver | None = None
        self._last, self.generation = 0.0, 0

    @property
    def stays(self) -> bool:
        """Whether the last step was a whole layer."""
        return self._last == self._dt

    def renew(self, step: float) -> LinearSolver:
        """Factor what is not known (collective)."""
        if abs(step - self._dt) <= _ROUNDING * self._dt:
            step = self._dt  # as differences of times are not
        known = self._whole if step == self._dt else self._other
        if step == self._last and known is not None:
            return known
        self._last, self.generation = step, self.generation + 1
        if self.stays:
            if self._whole is None:
                self._whole = self._factored(step)
            return self._whole
        if self._other is not None:
            self._other.destroy()
        self._other = self._factored(step)
        return self._other

    def _factored(self, step: float) -> LinearSolver:
        matrix = self._tangent(step)
        matrix.axpy(inertia(step, self._damping), self._mass, _DIFFERENT)
        matrix.zeroRowsColumns(self._held, diag=1.0)
        return LinearSolver(matrix, self._kind, self._near)

    def destroy(self) -> None:
        """Free PETSc's objects."""
        for solver in (self._whole, self._other):
            if solver is not None:
                solver.destroy()


def inertia(step: float, damping: float) -> float:
    """Forces of unit mass by a unit way in a step, with damping by mass [1/s^2]."""
    return 2.0 / step**2 + damping / step
