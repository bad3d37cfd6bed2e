"""Nearly incompressible bodies under finite strain: one ratio of volumes for each cell.

Of the energy the part that grows with Poisson's ratio, U = K (ln J)^2 / 2 with K = lambda', is
asked of the mean of J in each cell, theta, and so has one pressure there (J. C. Simo, R. L. Taylor,
K. S. Pister, Comput. Methods Appl. Mech. Eng. 51 (1985) 177-208). In a step from 0 to 1

    p = (U(theta_1) - U(theta_0)) / (theta_1 - theta_0)

works on theta exactly what U changes, and forces with p times a discrete gradient of J what p does:
`impactfem.forms.finite_strain`. Of viscous bodies p gains K times the change of theta, times the
time of retardation over the step. Cells of degree 2 have one pressure too.

Newton's method has the pressures as unknowns, which each cell eliminates: the tangent knows them as
the last one foresaw them, not as the volumes of its iterate have it. Those are far off as long as
volumes are, by K times that, and would leave tangents that are not definite.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.fem import PETSc, ufl
from impactfem.forms.finite_strain import FiniteForms

_NEAR = 1e-5  # relative change of theta below which the slope of p is a series


@dataclass(frozen=True)
class _Linearised:
    """Where the last tangent was.

    Attributes:
        place: Sum of the displacements at both ends [m], with those of ghosts.
        pressures: Of the volumes there [Pa], of the owned cells.
        slopes: PETSc matrix of their changes with the end of the step [Pa/m].
    """

    place: Floats
    pressures: Floats
    slopes: Any


class MeanDilatation:
    """The pressures of a step between two displacements."""

    def __init__(
        self, forms: FiniteForms, before: Any, after: Any, bulk: Floats, damped: Floats
    ) -> None:
        """Compile the forms (collective).

        Args:
            forms: Their ``pressing`` is a function that is set here.
            before: Displacement at the start of the step.
            after: At its end.
            bulk: K of the owned cells [Pa].
            damped: Shares of the viscosity that they have.
        """
        self._pressing, self._bulk, self._ends = forms.pressing, bulk, (before, after)
        self._viscosity, self._damped = forms.viscosity, damped
        self._memory = forms.memory
        self._last: _Linearised | None = None
        q = ufl.TestFunction(forms.pressing.function_space)
        start, end = (forms.elastic.measured(q * forms.dilatation(u)) for u in (before, after))
        self._start, self._end = fem.compile_form(start), fem.compile_form(end)
        # What a unit of pressure pushes with, and how theta changes.
        pushed = ufl.TrialFunction(forms.elastic.space)
        self._pushes = fem.compile_form(
            forms.elastic.measured(q * forms.swept(before, after, pushed))
        )
        self._slopes = fem.compile_form(ufl.derivative(end, after))
        self._volumes = fem.assemble_vector(fem.compile_form(forms.elastic.measured(q)))

    def update(self, more: Floats | float = 0.0) -> None:
        """Set the pressures of the step (collective).

        Args:
            more: Over the bulk modulus what is added, of the owned cells.
        """
        start, end = self._excess(self._start), self._excess(self._end)
        self._set(self._pressures(start, end) + self._bulk * more)

    def energy(self) -> float:
        """U at the end of the step, of the cells of this rank [J]."""
        logs = np.log1p(self._excess(self._end))
        stored = 0.5 * float(self._volumes @ (self._bulk * logs**2))
        return stored + (
            0.0 if self._memory is None else self._memory.stored(self._bulk * self._volumes)
        )

    def swept(self) -> Floats:
        """Change of theta in the step, of the owned cells (collective)."""
        return self._excess(self._end) - self._excess(self._start)

    def forget(self) -> None:
        """Begin a step: the next tangent is its first."""
        if self._last is not None:
            self._last.slopes.destroy()
        self._last = None

    def linearise(self) -> None:
        """Set the pressures with which a tangent is assembled (collective)."""
        start, end = self._excess(self._start), self._excess(self._end)
        place = self._ends[0].x.array + self._ends[1].x.array
        found, last = self._pressures(start, start), self._last
        if last is not None:
            moved, changed = last.slopes.createVecs()
            moved.setArray((place - last.place)[: moved.getLocalSize()])
            last.slopes.mult(moved, changed)
            found = last.pressures + changed.getArray()
            moved.destroy()
            changed.destroy()
        self.forget()
        slopes = fem.assemble_petsc(self._slopes)
        scale = slopes.createVecLeft()
        scale.setArray(self._slope(start, end) / self._volumes)
        slopes.diagonalScale(L=scale)
        scale.destroy()
        self._last = _Linearised(place, self._pressures(start, end), slopes)
        self._set(found)

    def stiffen(self, matrix: Any, held: NDArray[np.bool_]) -> None:
        """Add to the tangent what changes of the pressures do, since `linearise` (collective).

        Args:
            matrix: PETSc matrix of the displacements.
            held: Owned degrees of freedom whose rows and columns stay as they are.
        """
        assert self._last is not None  # noqa: S101  (`linearise` came first)
        pushes = fem.assemble_petsc(self._pushes)
        product = pushes.transposeMatMult(self._last.slopes)
        rows = np.flatnonzero(held) + product.getOwnershipRange()[0]
        product.zeroRowsColumns(rows.astype(PETSc.IntType), diag=0.0)
        matrix.axpy(1.0, product, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        for thing in (pushes, product):
            thing.destroy()

    def _set(self, pressures: Floats) -> None:
        self._pressing.x.array[: len(pressures)] = pressures
        self._pressing.x.scatter_forward()

    def _pressures(self, start: Floats, end: Floats) -> Floats:
        """Of a step between two theta - 1 [Pa]."""
        logs = 0.5 * (np.log1p(start) + np.log1p(end))
        found: Floats = self._bulk * logs * self._divided(start, end)
        found = found + self._retarding * (end - start)
        if self._memory is not None:
            found += self._bulk * self._memory.pressures(end - start)
        return found

    @property
    def _retarding(self) -> Floats:
        """Pressure by a change of theta of viscous bodies [Pa]."""
        return self._bulk * self._damped * float(getattr(self._viscosity, "value", self._viscosity))

    def _excess(self, form: Any) -> Floats:
        """Theta - 1 of the owned cells."""
        found: Floats = fem.assemble_vector(form) / self._volumes
        return found

    @staticmethod
    def _divided(start: Floats, end: Floats) -> Floats:
        """Difference of the logarithms of theta over that of theta."""
        change = (end - start) / (1.0 + start)
        small = np.abs(change) < 1e-8
        safe = np.where(small, 1.0, change)
        ratio = np.where(small, 1.0 - 0.5 * change, np.log1p(safe) / safe)
        found: Floats = ratio / (1.0 + start)
        return found

    def _slope(self, start: Floats, end: Floats) -> Floats:
        """Derivative of the pressures by theta at the end of the step [Pa]."""
        middle, change = 1.0 + 0.5 * (start + end), end - start
        log = np.log(middle)
        near = 0.5 * (1.0 - log) / middle**2 + change / 12.0 * (2.0 * log - 3.0) / middle**3
        far = np.abs(change) > _NEAR * middle
        logs = np.log1p(start), np.log1p(end)
        pressure = 0.5 * (logs[0] + logs[1]) * self._divided(start, end)
        whole = (logs[1] / (1.0 + end) - pressure) / np.where(far, change, 1.0)
        found: Floats = self._bulk * np.where(far, whole, near) + self._retarding
        return found if self._memory is None else found + self._bulk * self._memory.stiffening


class CondensedMatrix:
    """A repeated tangent with what the pressures add.

    Attributes:
        matrix: The PETSc matrix.
    """

    def __init__(
        self, repeated: fem.RepeatedMatrix, mean: MeanDilatation, held: NDArray[np.bool_]
    ) -> None:
        """Take the tangent at given pressures.

        Args:
            repeated: That tangent.
            mean: The pressures.
            held: Its owned rows and columns that are those of the unit matrix.
        """
        self.matrix = repeated.matrix
        self._repeated, self._mean, self._held = repeated, mean, held

    def assemble(self, factor: float) -> None:
        """As `impactfem.fem.RepeatedMatrix.assemble` (collective)."""
        self._mean.linearise()
        self._repeated.assemble(factor)
        self._mean.stiffen(self.matrix, self._held)

    def destroy(self) -> None:
        """Free PETSc's matrices."""
        self._mean.forget()
        self._repeated.destroy()
