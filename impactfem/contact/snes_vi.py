"""Bound-constrained linear problems by PETSc's reduced-space semismooth Newton method."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ConvergenceError
from impactfem.fem import PETSc


@dataclass(frozen=True)
class BoundResult:
    """Solution of a bound-constrained problem and how SNES got there.

    Attributes:
        iterations: Newton iterations.
        converged: Whether SNES met its tolerance.
        message: SNES's reason in words.
    """

    iterations: int
    converged: bool
    message: str


def solve_bounded(
    matrix: Any,
    load: Any,
    solution: Any,
    bounded: NDArray[np.int32],
    *,
    tolerance: float,
    max_iterations: int,
    line_search: str = "basic",
) -> BoundResult:
    """Find x with x_i >= 0 _|_ (A x - b)_i >= 0 for bounded i, and (A x - b)_i = 0 elsewhere.

    Args:
        matrix: PETSc matrix A; row i is paired with unknown i.
        load: PETSc vector b.
        solution: PETSc vector; start on entry, x on return.
        bounded: Global indices of the bounded unknowns (the same on every rank).
        tolerance: Absolute tolerance of the projected residual.
        max_iterations: Limit of Newton iterations.
        line_search: PETSc's line search. "basic" takes full steps: the projected residual need not
            fall from one to the next here, which others ask for.
    """
    comm = matrix.comm
    lower, upper = load.duplicate(), load.duplicate()
    lower.set(PETSc.NINFINITY)
    upper.set(PETSc.INFINITY)
    first, last = lower.getOwnershipRange()
    own = bounded[(bounded >= first) & (bounded < last)]
    lower.setValues(own, np.zeros(len(own)))
    lower.assemble()
    residual = load.duplicate()

    def function(_: Any, x: Any, f: Any) -> None:
        matrix.mult(x, f)
        f.axpy(-1.0, load)

    snes = PETSc.SNES().create(comm)
    try:
        snes.setOptionsPrefix(f"impactfem_vi_{line_search}_")
        snes.setType("vinewtonrsls")
        snes.setFunction(function, residual)
        snes.setJacobian(lambda *_: None, matrix)
        snes.setVariableBounds(lower, upper)
        # The problem is piecewise linear: only the absolute tolerance has a meaning.
        snes.setTolerances(rtol=0.0, atol=tolerance, stol=0.0, max_it=max_iterations)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        ksp.getPC().setType("lu")
        ksp.getPC().setFactorSolverType("mumps")
        # Set by option: the petsc4py of Debian 13 has no other way.
        PETSc.Options(snes.getOptionsPrefix())["snes_linesearch_type"] = line_search
        snes.setFromOptions()
        snes.solve(None, solution)
        reason = int(snes.getConvergedReason())
        return BoundResult(snes.getIterationNumber(), reason > 0, f"SNES reason {reason}")
    finally:
        snes.destroy()
        for vector in (lower, upper, residual):
            vector.destroy()


def solve_by_snes_vi(
    tolerance: float, max_iterations: int
) -> Callable[[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]], Any]:
    """Make a solver of complementarity problems for contact forces, an independent check of PDAS.

    The bound is that of the forces, lambda >= 0: it holds for normals of any direction. (A bound of
    displacements would need unknowns turned into the normals, and fails where these change.)

    Args:
        tolerance: Absolute tolerance of gaps [m].
        max_iterations: Limit of Newton iterations.
    """

    def solver(
        matrix: NDArray[np.float64], offset: NDArray[np.float64], start: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float64], int]:
        size = len(offset)
        if not start.any() and offset.min(initial=0.0) >= -tolerance:
            return np.zeros(size), 0
        scale = float(np.abs(matrix).max())
        rows = np.arange(size, dtype=np.int32)
        dense = PETSc.Mat().createAIJ([size, size], nnz=size, comm=PETSc.COMM_SELF)
        dense.setValues(rows, rows, (matrix / scale).ravel())
        dense.assemble()
        load, force = dense.createVecs()
        load.setArray(-offset)
        try:
            # Full steps may go in circles (once in some thousand random problems); shorter ones
            # then lead on.
            for line_search in ("basic", "bt"):
                force.set(0.0)
                found = solve_bounded(
                    dense, load, force, rows,
                    tolerance=tolerance, max_iterations=max_iterations, line_search=line_search,
                )  # fmt: skip
                if found.converged:
                    break
            else:
                raise ConvergenceError(
                    f"contact: SNES VI failed for {size} pairs ({found.message}); use "
                    'solve.active_set = "pdas", a larger solve.tolerance or a smaller solve.dt'
                )
            return np.maximum(force.getArray() / scale, 0.0), max(1, found.iterations)
        finally:
            for part in (dense, load, force):
                part.destroy()

    return solver
