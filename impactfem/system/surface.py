"""Statics of the contact nodes: their part of the stiffness, the same on every rank."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu

from impactfem.arrays import Floats, Integers
from impactfem.errors import ConvergenceError
from impactfem.fem import MPI
from impactfem.system.substitution import TOGETHER, substitute

CHOLESKY: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True},
}  # fmt: skip


@dataclass(frozen=True)
class SurfaceNodes:
    """Contact nodes in canonical order, and where this rank holds its own.

    Attributes:
        comm: MPI communicator.
        dim: Components of a node.
        count: Number of contact nodes on all ranks.
        rows: Positions in canonical order of the nodes this rank owns, shape (owned,).
        nodes: Their numbers among the nodes this rank owns, shape (owned,).
    """

    comm: Any
    dim: int
    count: int
    rows: Integers
    nodes: Integers

    @classmethod
    def of(cls, comm: Any, dim: int, canonical: Integers, numbers: Integers) -> "SurfaceNodes":
        """Find contact nodes among the nodes of this rank.

        Args:
            comm: MPI communicator.
            dim: Components of a node.
            canonical: Canonical numbers of the contact nodes, increasing, the same on every rank.
            numbers: Canonical numbers of the nodes this rank owns, shape (owned nodes,).
        """
        nodes = np.flatnonzero(np.isin(numbers, canonical))
        rows = np.searchsorted(canonical, numbers[nodes])
        return cls(comm, dim, len(canonical), rows.astype(np.int64), nodes.astype(np.int64))

    @cached_property
    def dofs(self) -> Integers:
        """Own contact dofs among the owned dofs, in the order of `places`."""
        return (self.dim * self.nodes[:, None] + np.arange(self.dim)).ravel()

    @cached_property
    def places(self) -> Integers:
        """Places of the own contact dofs in a vector of all contact dofs."""
        return (self.dim * self.rows[:, None] + np.arange(self.dim)).ravel()

    def gather(self, values: Floats) -> Floats:
        """Values of the contact nodes on every rank, shape (count, dim) (collective).

        Args:
            values: Values of the owned dofs, shape (owned dofs,).
        """
        everywhere = np.zeros(self.count * self.dim)
        everywhere[self.places] = values[self.dofs]
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, everywhere)
        return everywhere.reshape(self.count, self.dim)

    def pulled(self, forces: Floats, held: NDArray[np.bool_]) -> Floats:
        """Forces on the owned dofs by those on the contact nodes (count, dim), 0 where held."""
        found = np.zeros(len(held))
        self.spread(forces, found)
        found[held] = 0.0
        return found

    def spread(self, values: Floats, into: Floats) -> None:
        """Put values of the contact nodes (count, dim) into the owned dofs."""
        into[self.dofs] = values.ravel()[self.places]


class SurfaceStatics:
    """Equilibrium of massless contact nodes for given displacements of all others.

    K_cc u_c = f_c - K_ci u_i, with K_cc factored once, on every rank.
    """

    def __init__(self, stiffness: Any, surface: SurfaceNodes) -> None:
        """Take the contact rows out of the stiffness (collective)."""
        self.surface = surface
        comm, size = surface.comm, surface.count * surface.dim
        first, last = stiffness.getOwnershipRange()
        dofs, places = surface.dofs, surface.places
        rows, columns, values = [], [], []
        for dof, place in zip(dofs, places, strict=True):
            found, entries = stiffness.getRow(int(first + dof))
            rows.append(np.full(len(found), place))
            columns.append(found.astype(np.int64))
            values.append(entries)
        everything = comm.allgather(
            (_joined(rows, np.int64), _joined(columns, np.int64), _joined(values, np.float64))
        )
        row, column, value = (np.concatenate(part) for part in zip(*everything, strict=True))
        numbers = comm.allgather((first + dofs, places))
        owner = np.concatenate([pair[0] for pair in numbers]).astype(np.int64)
        place = np.concatenate([pair[1] for pair in numbers]).astype(np.int64)
        order = np.argsort(owner)
        at = np.minimum(np.searchsorted(owner[order], column), max(len(owner) - 1, 0))
        inside = owner[order][at] == column if len(owner) else np.zeros(0, dtype=bool)
        block = coo_matrix(
            (value[inside], (row[inside], place[order][at[inside]])), shape=(size, size)
        ).tocsc()
        block.sort_indices()  # one order of rounding on any number of ranks
        try:
            # Symmetric and positive definite: no pivots, and less fill by minimum degree.
            self._factors = splu(block, **CHOLESKY) if size else None
        except RuntimeError as error:
            raise ConvergenceError(
                f"contact: the stiffness of the {surface.count} contact nodes is singular "
                f"({error}); refine the mesh so that elements have nodes inside the body"
            ) from error
        mine = ~inside & (column >= first) & (column < last)
        near, local = np.unique(column[mine] - first, return_inverse=True)
        coupling = csr_matrix((value[mine], (row[mine], local)), shape=(size, len(near)))
        coupling.sort_indices()
        self.near: Integers = near.astype(np.int64)  # owned dofs that touch a contact node
        self._pull: csr_matrix = coupling
        self._push: csr_matrix = coupling.T.tocsr()

    def equilibrium(self, values: Floats, load: Floats | None = None) -> Floats:
        """Displacements of the contact nodes, shape (count, dim) (collective).

        Args:
            values: Displacements of the owned dofs; those of contact nodes are not used.
            load: Forces on the contact nodes, shape (count, dim).
        """
        return self.equilibrium_of_near(values[self.near], load)

    def equilibrium_of_near(self, values: Floats, load: Floats | None = None) -> Floats:
        """As `equilibrium`, with the values of the dofs `near` only."""
        pulled = -(self._pull @ values)
        if self.surface.comm.size > 1:
            self.surface.comm.Allreduce(MPI.IN_PLACE, pulled)
        if load is not None:
            pulled += load.ravel()
        return self.response(pulled)

    def response(self, forces: Floats) -> Floats:
        """Displacements of the contact nodes under forces on them, shape (count, dim)."""
        if self._factors is None:
            return np.zeros((0, self.surface.dim))
        found: Floats = self._factors.solve(forces.ravel())
        return found.reshape(self.surface.count, self.surface.dim)

    @cached_property
    def _triangle(self) -> tuple[Any, ...] | None:
        """L by columns, D, and the order of the unknowns; None if SuperLU has taken pivots."""
        factors = self._factors
        if factors is None or (factors.perm_r != factors.perm_c).any():
            return None
        lower = factors.L.tocsc()
        lower.sort_indices()
        starts, rows = lower.indptr.astype(np.uint64), lower.indices.astype(np.uint32)
        return starts, rows, lower.data, factors.U.diagonal(), factors.perm_c.astype(np.int64)

    def answers(self, forces: Floats, mobility: Floats) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to several forces on them at once (collective).

        Args:
            forces: Shape (several, count, dim).
            mobility: Of each of the dofs `near`, how far a force on it moves it.

        Returns:
            The equilibrium for the dofs `near` as the static answers move them, and these static
            answers; shape (several, count, dim) each.
        """
        shape, comm = forces.shape, self.surface.comm
        layer, static = np.empty(shape), np.empty(shape)
        for first in range(0, len(forces), TOGETHER):
            part = slice(first, min(first + TOGETHER, len(forces)))
            several = part.stop - first
            right = np.zeros((shape[1] * shape[2], TOGETHER))
            right[:, :several] = forces[part].reshape(several, -1).T
            pressed = self._solved(right)
            moved = -mobility[:, None] * (self._push @ pressed)
            pulled = np.ascontiguousarray(-(self._pull @ moved))
            if comm.size > 1:
                comm.Allreduce(MPI.IN_PLACE, pulled)
            found = self._solved(pulled)
            static[part] = pressed[:, :several].T.reshape(several, *shape[1:])
            layer[part] = found[:, :several].T.reshape(several, *shape[1:])
        return layer, static

    def _solved(self, right: Floats) -> Floats:
        """K_cc^-1 b for `TOGETHER` right-hand sides, shape (size, 8)."""
        if self._triangle is None:
            found = [self.response(b).ravel() for b in right.T]
            return np.ascontiguousarray(np.array(found).T)
        *parts, order = self._triangle
        values = np.empty_like(right)
        values[order] = right
        substitute(*parts, values)
        solved: Floats = values[order]
        return solved

    def pushed(self, values: Floats) -> Floats:
        """K_ic u_c at the dofs `near`, for u_c of shape (count, dim)."""
        found: Floats = self._push @ values.ravel()
        return found


def _joined(parts: list[Any], kind: Any) -> NDArray[Any]:
    return np.concatenate(parts).astype(kind) if parts else np.zeros(0, dtype=kind)
