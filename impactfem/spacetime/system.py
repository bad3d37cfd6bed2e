"""The assembled space-time equations, and their coupled solution for a given active set."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.errors import ConvergenceError
from impactfem.fem import PETSc
from impactfem.forms.galerkin import GalerkinForms
from impactfem.spacetime.numbering import Numbering

_MUMPS_ORDERING = 7  # ICNTL(7)
_APPROXIMATE_MINIMUM_FILL = 2  # a quarter of the analysis time of the default ordering here
_MUMPS_WORKSPACE = 14  # ICNTL(14): percentage of extra workspace
_MUMPS_PERMUTATION = 6  # ICNTL(6)
_MUMPS_SCALING = 8  # ICNTL(8)
_BACKWARD_ERROR = 1e-14  # of a direct solution that needs no refinement
_REFINEMENTS = 4
_WORKSPACES = (40, 200, 1000)
_WORKSPACE_TOO_SMALL = (-8, -9, -14, -17, -20)  # INFOG(1)


@dataclass(frozen=True)
class Equations:
    """Equation (3) assembled: this rank's entries, global node and multiplier numbers.

    Attributes:
        comm: MPI communicator.
        numbering: Pairing of rows and unknowns.
        stiffness: (test node, node, value) of the rows this rank owns.
        coupling: (test node, multiplier, value) of the rows this rank owns.
        load: Load of every test node, the same on every rank, shape (nodes,).
        fixed_values: Displacement of ``numbering.fixed`` [m].
        node_ranges: First node of each rank, and the number of nodes, shape (ranks + 1,).
        multiplier_ranges: The same for the multipliers.
        spring: Stiffness of the wall, dimensionless k L / (E A); 0 of a rigid one.
    """

    comm: Any
    numbering: Numbering
    stiffness: tuple[Integers, Integers, Floats]
    coupling: tuple[Integers, Integers, Floats]
    load: Floats
    fixed_values: Floats
    node_ranges: Integers
    multiplier_ranges: Integers
    spring: float = 0.0

    @property
    def num_nodes(self) -> int:
        """Number of displacement unknowns, given ones included."""
        return len(self.load)


def assemble(
    comm: Any, forms: GalerkinForms, entity_maps: Any, numbering: Numbering,
    fixed_values: Floats, spaces: tuple[Any, Any],
) -> Equations:  # fmt: skip
    """Assemble the forms and drop the rows whose test function vanishes."""

    def kept(form: Any) -> tuple[Integers, Integers, Floats]:
        rows, columns, values = fem.assemble_rows(form)
        keep = numbering.row[rows] >= 0
        return rows[keep], columns[keep], values[keep]

    def ranges(space: Any) -> Integers:
        index_map = space.dofmap.index_map
        firsts = comm.allgather(index_map.local_range[0])
        return np.array([*firsts, index_map.size_global], dtype=np.int64)

    stiffness = kept(fem.compile_form(forms.stiffness))
    coupling = kept(fem.compile_form(forms.coupling, entity_maps))
    load = fem.gather(comm, fem.assemble_vector(fem.compile_form(forms.load)))
    of_nodes, of_multipliers = map(ranges, spaces)
    return Equations(
        comm, numbering, stiffness, coupling, load, fixed_values, of_nodes, of_multipliers
    )


def paired_load(equations: Equations) -> Floats:
    """Right-hand side by slots: loads of the test rows, given values in the slots left over."""
    numbering = equations.numbering
    right = np.zeros(equations.num_nodes)
    kept = numbering.row >= 0
    right[numbering.row[kept]] = equations.load[kept]
    right[numbering.fixed] = equations.fixed_values
    return right


class CoupledSystem:
    """The linear system in (u, lambda) of one active set, factored by MUMPS.

    Rows: the test equations in the slots of the displacements they determine, and for each wall
    interval T_m either u_m = 0 (active) or lambda_m = 0 (inactive). Of a wall that gives way the
    mean of u - lambda / spring over T_m vanishes where it is active. The pattern does not depend
    on the set, so the symbolic analysis is done once. Eliminating the wall's rows and recovering
    lambda afterwards by recursion would drop the half force at release, and the sets would never
    settle.

    Args:
        equations: Assembled equations.
    """

    def __init__(self, equations: Equations) -> None:
        self._equations = equations
        comm, numbering = equations.comm, equations.numbering
        node_ranges, multiplier_ranges = equations.node_ranges, equations.multiplier_ranges
        # Composite numbering: on each rank its displacements, then its multipliers.
        nodes = np.arange(node_ranges[-1])
        owner = np.searchsorted(node_ranges, nodes, side="right") - 1
        self._node = nodes + multiplier_ranges[owner]
        indices = np.arange(multiplier_ranges[-1])
        owner = np.searchsorted(multiplier_ranges, indices, side="right") - 1
        self._multiplier = indices + node_ranges[owner + 1]
        self._pairs = len(numbering.multipliers)
        size = int(node_ranges[-1] + multiplier_ranges[-1])
        rank = comm.rank
        local = int(
            node_ranges[rank + 1] - node_ranges[rank]
            + multiplier_ranges[rank + 1] - multiplier_ranges[rank]
        )  # fmt: skip
        self._matrix = fem.sparse_matrix(comm, local, size)
        fem.set_entries(self._matrix, *self._entries(), add=True)
        self._constraints = self._constraint_entries()
        self._load = self._matrix.createVecLeft()
        self._solution = self._matrix.createVecRight()
        self._residual = self._load.duplicate()
        self._correction = self._load.duplicate()
        self._fill_load()
        wall = np.concatenate(
            [self._node[numbering.wall[1:]], self._multiplier[numbering.multipliers]]
        )
        everywhere = PETSc.IS().createGeneral(wall.astype(np.int32), comm=fem.MPI.COMM_SELF)
        self._wall = PETSc.Vec().createSeq(len(wall), comm=fem.MPI.COMM_SELF)
        self._scatter = PETSc.Scatter().create(self._solution, everywhere, self._wall, None)
        everywhere.destroy()
        self._workspace = 0
        self._ksp = self._solver()

    @property
    def num_unknowns(self) -> int:
        """Displacements and multipliers together."""
        return int(self._matrix.getSize()[0])

    def _entries(self) -> tuple[Integers, Integers, Floats]:
        """Entries that do not depend on the active set."""
        equations, numbering = self._equations, self._equations.numbering
        test, node, stiffness = equations.stiffness
        wall_test, multiplier, coupling = equations.coupling
        rows = [self._node[numbering.row[test]], self._node[numbering.row[wall_test]]]
        columns = [self._node[node], self._multiplier[multiplier]]
        values = [stiffness, coupling]
        if equations.comm.rank == 0:
            fixed = self._node[numbering.fixed]
            rows.append(fixed)
            columns.append(fixed)
            values.append(np.ones(len(fixed)))
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)

    def _constraint_entries(self) -> tuple[Integers, Integers]:
        """Places of u_m, then of lambda_m, in the constraint rows; all of them are rank 0's."""
        if self._equations.comm.rank != 0:
            return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        numbering = self._equations.numbering
        constraint = self._multiplier[numbering.multipliers]
        displacement = self._node[numbering.wall[1:]]
        before = self._node[numbering.wall[:-1]]
        columns = [displacement, constraint, before]
        kinds = 3 if self._equations.spring else 2
        return np.tile(constraint, kinds), np.concatenate(columns[:kinds])

    def _constraint_values(self, active: NDArray[np.bool_]) -> Floats:
        """Entries of the constraint rows at these places."""
        on, off = active.astype(np.float64), (~active).astype(np.float64)
        if not self._equations.spring:
            return np.concatenate([on, off])
        return np.concatenate([0.5 * on, off - on / self._equations.spring, 0.5 * on])

    def _fill_load(self) -> None:
        """Set the right-hand side; it does not depend on the active set."""
        load = paired_load(self._equations)
        rank, ranges = self._equations.comm.rank, self._equations.node_ranges
        mine = slice(int(ranges[rank]), int(ranges[rank + 1]))
        self._load.set(0.0)
        self._load.array[: mine.stop - mine.start] = load[mine]

    def _solver(self) -> Any:
        """Make a direct solver with the present workspace."""
        ksp = PETSc.KSP().create(self._equations.comm)
        ksp.setOptionsPrefix("impactfem_")
        ksp.setOperators(self._matrix)
        ksp.setType("preonly")
        pc = ksp.getPC()
        pc.setType("lu")
        pc.setFactorSolverType("mumps")
        ksp.setFromOptions()
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        factor.setMumpsIcntl(_MUMPS_ORDERING, _APPROXIMATE_MINIMUM_FILL)
        factor.setMumpsIcntl(_MUMPS_WORKSPACE, _WORKSPACES[self._workspace])
        if self._equations.numbering.grid is not None:
            # Rows are paired causally already. MUMPS's own permutation and scaling would undo that:
            # the MUMPS of Debian 13 then was wrong in the fourth digit without a complaint.
            factor.setMumpsIcntl(_MUMPS_PERMUTATION, 0)
            factor.setMumpsIcntl(_MUMPS_SCALING, 0)
        return ksp

    def solve(self, active: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Solve for a set of active wall intervals.

        Args:
            active: Shape (pairs,), in the order of time.

        Returns:
            u_m at the later end of each interval [m] and lambda_m [m] (dimensionless time and
            position), each (pairs,), on every rank.

        Raises:
            ConvergenceError: MUMPS could not factor the system.
        """
        rows, columns = self._constraints
        values = self._constraint_values(active)[: len(rows)]
        fem.set_entries(self._matrix, rows, columns, values, add=False)
        while True:
            self._ksp.solve(self._load, self._solution)
            if self._ksp.getConvergedReason() > 0:
                break
            self._more_workspace()
        self._refine()
        self._scatter.scatter(
            self._solution, self._wall, addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD
        )
        wall = self._wall.array.copy()
        return wall[: self._pairs], wall[self._pairs :]

    def _refine(self) -> None:
        """Check the backward error of the direct solution and correct it if need be.

        Raises:
            ConvergenceError: The factors are useless.
        """
        infinity = PETSc.NormType.INFINITY
        matrix, load = self._matrix.norm(infinity), self._load.norm(infinity)
        error = np.inf
        for _ in range(_REFINEMENTS):
            self._matrix.mult(self._solution, self._residual)
            self._residual.aypx(-1.0, self._load)
            scale = matrix * self._solution.norm(infinity) + load
            if scale == 0.0 or not np.isfinite(scale):
                return  # nothing moves; what is not finite is reported by the active set
            error = self._residual.norm(infinity) / scale
            if error <= _BACKWARD_ERROR:
                return
            self._ksp.solve(self._residual, self._correction)
            self._solution.axpy(1.0, self._correction)
        raise ConvergenceError(
            f"the space-time system of {self.num_unknowns} unknowns could be solved only to a "
            f"backward error of {error:.1e}; use fewer elements or a layered mesh"
        )

    def _more_workspace(self) -> None:
        """Give MUMPS more room, or raise if that is not what it lacks."""
        code = self._ksp.getPC().getFactorMatrix().getMumpsInfog(1)
        if code not in _WORKSPACE_TOO_SMALL or self._workspace + 1 == len(_WORKSPACES):
            raise ConvergenceError(
                f"the space-time system of {self.num_unknowns} unknowns could not be factored "
                f"(MUMPS INFOG(1) = {code}); use fewer elements or a layered mesh"
            )
        self._workspace += 1
        self._ksp.destroy()
        self._ksp = self._solver()

    def displacement(self) -> Floats:
        """Displacement of the last solution [m] in global node order, on every rank."""
        rank, ranges = self._equations.comm.rank, self._equations.node_ranges
        own = self._solution.array[: int(ranges[rank + 1] - ranges[rank])]
        return fem.gather(self._equations.comm, own)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        vectors = (self._load, self._solution, self._residual, self._correction, self._wall)
        for item in (self._ksp, self._scatter, self._matrix, *vectors):
            item.destroy()
