"""Linear solver of implicit layers: factored once, or preconditioned once, then used many times."""

from typing import Any

import numpy as np

from impactfem.arrays import Booleans
from impactfem.errors import ConvergenceError
from impactfem.fem import PETSc, products_in_order

_RELATIVE = 1e-13  # of conjugate gradients: ranks must agree to 1e-10 after many layers

_ON_ONE_RANK = {2: 1_000_000, 3: 200_000}  # unknowns, by directions of a node
"""Systems up to this size are factored on rank 0 alone.

MUMPS on several ranks adds up contributions in the order in which they come: no run could be
repeated bit by bit. Its solutions are no faster there either (measured on 2 ranks: 1 to 3 times
slower for 18 000 to 290 000 unknowns in 2D and for 20 000 to 80 000 in 3D)."""


class LinearSolver:
    """Solves with one matrix, symmetric and positive definite unless told otherwise.

    ``mumps`` factors it (Cholesky, else LU); ``gamg`` takes conjugate gradients, else GMRES, with
    algebraic multigrid.
    """

    def __init__(
        self,
        matrix: Any,
        kind: str,
        near_null_space: Any = None,
        *,
        symmetric: bool = True,
        owned: bool = True,
    ) -> None:
        """Factor or set the preconditioner up (collective).

        Args:
            matrix: PETSc matrix.
            kind: "mumps" or "gamg".
            near_null_space: PETSc null space of rigid motions, for "gamg".
            symmetric: Whether the matrix is symmetric and positive definite.
            owned: Whether the solver owns the matrix from now on; else `renew` may be asked for.

        Raises:
            ConvergenceError: The matrix cannot be factored.
        """
        self._symmetric, self._given, self._owned = symmetric, matrix, owned
        self._kind, self._comm = kind, matrix.comm.tompi4py()
        self._size = matrix.getSize()[0]
        self._scatter: Any = None
        limit = _ON_ONE_RANK.get(matrix.getBlockSize(), _ON_ONE_RANK[3])
        if kind == "mumps" and self._comm.size > 1 and self._size <= limit:
            matrix = self._gathered(matrix)
        self._matrix = matrix
        matrix.setOption(PETSc.Mat.Option.SPD, symmetric)
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOperators(matrix)
        pc = self._ksp.getPC()
        if kind == "gamg":
            if near_null_space is not None:
                matrix.setNearNullSpace(near_null_space)
            self._ksp.setType("cg" if symmetric else "gmres")
            self._ksp.setTolerances(rtol=_RELATIVE, atol=0.0, max_it=500)
            self._ksp.setInitialGuessNonzero(True)
            pc.setType("gamg")
        else:
            self._ksp.setType("preonly")
            pc.setType("cholesky" if symmetric else "lu")
            pc.setFactorSolverType("mumps")
        self._ksp.setOptionsPrefix("impactfem_layer_")
        self._ksp.setFromOptions()
        if kind == "mumps" and not symmetric and not self._is_idle:
            # Its order follows from the pattern alone: values of another time would show.
            pc.setFactorSetUpSolverType()
            pc.getFactorMatrix().setMumpsIcntl(6, 0)
        self._factor()

    def renew(self) -> None:
        """Factor again, the matrix having new values in the same pattern (collective).

        Raises:
            ConvergenceError: The matrix cannot be factored.
        """
        if self._scatter is not None:
            every = self._whole()
            self._given.createSubMatrices(every, every, submats=[self._matrix])
            every.destroy()
        if self._kind == "gamg":
            self._ksp.reset()  # else coarse grids of the last values are kept
        self._ksp.setOperators(self._matrix)
        self._factor()

    def _factor(self) -> None:
        fault = self._agreed(self._set_up())
        if fault:
            raise ConvergenceError(
                f"linear system of {self._size} unknowns: the factorisation failed ({fault}); use "
                'a coarser mesh, solve.linear_solver = "gamg" or solve.method = "explicit"'
            )

    def _gathered(self, matrix: Any) -> Any:
        """The whole matrix on rank 0, an empty one elsewhere; the distributed one is freed."""
        vector = matrix.createVecRight()
        self._scatter, self._right = PETSc.Scatter.toZero(vector)
        self._solution = self._right.duplicate()
        vector.destroy()
        every = self._whole()
        (whole,) = matrix.createSubMatrices(every, every)
        every.destroy()
        if self._owned:
            matrix.destroy()
        return whole

    def _whole(self) -> Any:
        size = self._size if self._comm.rank == 0 else 0
        return PETSc.IS().createStride(size, 0, 1, comm=PETSc.COMM_SELF)

    def _set_up(self) -> str:
        """What went wrong on this rank, or nothing."""
        if self._is_idle:
            return ""
        try:
            with products_in_order(self._comm):
                self._ksp.setUp()
        except PETSc.Error as error:
            return f"error {error.ierr} of PETSc"
        if self._kind == "mumps":
            factor = self._ksp.getPC().getFactorMatrix()
            code, negative = factor.getMumpsInfog(1), factor.getMumpsInfog(12)
            if code < 0:
                return f"INFOG(1) = {code} of MUMPS"
            # Cholesky's factors of MUMPS exist without square roots: it goes on.
            if negative and self._symmetric:
                return f"it is not positive definite: {negative} negative pivots"
        return ""

    @property
    def _is_idle(self) -> bool:
        """Whether another rank does the work."""
        return self._scatter is not None and self._comm.rank != 0

    def _agreed[T](self, own: T) -> T:
        """The answer of rank 0 if it works alone; else the ranks have the same already."""
        found: T = own if self._scatter is None else self._comm.bcast(own, root=0)
        return found

    @property
    def is_iterative(self) -> bool:
        """Whether `solve` begins with what the solution holds."""
        return self._kind == "gamg"

    def solve(self, right: Any, solution: Any) -> None:
        """Solve for one right-hand side; conjugate gradients begin with what ``solution`` holds.

        Raises:
            ConvergenceError: The iteration did not converge.
        """
        if self._scatter is None:
            self._ksp.solve(right, solution)
        else:
            self._scatter.scatter(right, self._right, mode=PETSc.ScatterMode.FORWARD)
            if not self._is_idle:
                self._ksp.solve(self._right, self._solution)
            self._scatter.scatter(self._solution, solution, mode=PETSc.ScatterMode.REVERSE)
        reason = self._agreed(self._ksp.getConvergedReason())
        if reason < 0:
            raise ConvergenceError(
                f"linear system of {self._size} unknowns: {self._kind} failed after "
                f"{self._ksp.getIterationNumber()} iterations (PETSc's reason {reason}); use "
                'solve.linear_solver = "mumps", a smaller solve.dt, or a better mesh'
            )

    def solve_all(self, rights: Any) -> Any:
        """Solve for several right-hand sides, (several, owned) (collective); at once where it can.

        Raises:
            ConvergenceError: The iteration did not converge.
        """
        found = np.zeros_like(rights)
        if self._kind == "mumps" and self._comm.size == 1:
            shape = (self._size, len(rights))
            right, solution = (
                PETSc.Mat().createDense(shape, array=each.T, comm=PETSc.COMM_SELF)
                for each in (rights, found)
            )
            self._ksp.getPC().getFactorMatrix().matSolve(right, solution)
            found[:] = solution.getDenseArray().T
            right.destroy()
            solution.destroy()
            return found
        sizes = (rights.shape[1], self._size)
        source, image = (PETSc.Vec().createMPI(sizes, comm=self._comm) for _ in range(2))
        for right, each in zip(rights, found, strict=True):
            source.setArray(right)
            image.set(0.0)
            self.solve(source, image)
            each[:] = image.getArray()
        source.destroy()
        image.destroy()
        return found

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._ksp.destroy()
        if self._owned or self._scatter is not None:
            self._matrix.destroy()
        if self._scatter is not None:
            for part in (self._scatter, self._right, self._solution):
                part.destroy()


def of_mass(stiffness: Any, mass: Any, still: Booleans, kind: str) -> LinearSolver:
    """One of a mass matrix with the pattern of a stiffness; held dofs stay (collective)."""
    matrix = stiffness.copy()
    matrix.zeroEntries()
    matrix.axpy(1.0, mass)
    own = matrix.getDiagonal()
    own.setArray(np.where(still, 1.0, own.getArray()))
    matrix.setDiagonal(own)
    own.destroy()
    return LinearSolver(matrix, kind, stiffness.getNearNullSpace())
