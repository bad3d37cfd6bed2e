"""Equilibrium of massless contact nodes under finite strain: the cells at the surface alone.

Every rank holds all contact nodes and solves for them alike; forces and tangents are sums of what
the ranks' own cells give. What an approximate solution leaves unbalanced is handed to nodes inside
(`impactfem.system.inward`).
"""

from typing import Any

import numpy as np
from scipy.sparse import bsr_matrix, diags
from scipy.sparse.linalg import splu

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.errors import ConvergenceError
from impactfem.fem import MPI, gather
from impactfem.system.element_forces import ElementForces
from impactfem.system.nodes import Nodes
from impactfem.system.surface import CHOLESKY, SurfaceNodes
from impactfem.system.surface_kernels import conjugate_gradients, inverted

_MOST = 60  # iterations of conjugate gradients


class SurfaceLayer:
    """Massless nodes of a body, and the cells that touch them.

    Attributes:
        count: Number of the nodes.
        canonical: Their canonical numbers, in their order.
    """

    def __init__(
        self, elements: ElementForces, nodes: Nodes, surface: SurfaceNodes, free: Booleans
    ) -> None:
        """Number blocks and weights (collective).

        Args:
            elements: Forces of the body.
            nodes: Its nodes.
            surface: Contact nodes.
            free: Whether no support holds a direction, (count, dim).
        """
        comm, count, self._dim = nodes.comm, surface.count, nodes.dim
        self._comm, self.count, self._elements = comm, count, elements
        order = np.argsort(gather(comm, surface.rows))
        canonical = gather(comm, nodes.numbers[surface.nodes])[order]
        row = np.full(len(nodes.numbers), count)
        here = np.isin(nodes.numbers, canonical)
        row[here] = np.searchsorted(canonical, nodes.numbers[here])
        self._local, self._rows_here = np.flatnonzero(here), row[here]
        touching = np.flatnonzero((row[elements.cells] < count).any(axis=1))
        self._cells = elements.part(touching)
        self._rows = np.ascontiguousarray(row[self._cells.cells])
        self._number_blocks()
        self._out = np.zeros((count + 1, nodes.dim))
        self._free = np.zeros((count, 3))
        self._free[:, : nodes.dim] = free
        self._work = [np.zeros((count, 3)) for _ in range(5)]
        self._inverse = np.zeros((count, 3, 3))
        self._factors: Any = None
        self._known: dict[int, Floats] = {}
        self.canonical = canonical

    def _number_blocks(self) -> None:
        """Number the blocks of the tangent by rows, on all ranks alike (collective)."""
        rows, count = self._rows, self.count
        corners = rows.shape[1]
        first, second = np.repeat(rows, corners, axis=1).ravel(), np.tile(rows, corners).ravel()
        both = (first < count) & (second < count)
        keys = first[both] * np.int64(count) + second[both]
        known = np.unique(gather(self._comm, np.unique(keys)))
        slots = np.full(len(first), -1, dtype=np.int64)
        slots[both] = np.searchsorted(known, keys)
        self._slots = slots.reshape(-1, corners, corners)
        row, column = np.divmod(known, max(count, 1))
        self._starts = np.searchsorted(row, np.arange(count + 1))
        self._columns = column
        self._diagonal = np.flatnonzero(row == column)
        self._blocks = np.zeros((len(known), 3, 3))

    def place(self, values: Floats) -> None:
        """Move the contact nodes, (count, dim) on every rank [m]."""
        self._elements.displacement[self._local] = values[self._rows_here]

    def forces(self) -> Floats:
        """Internal forces on the contact nodes [N], (count, dim) (collective).

        Raises:
            ConvergenceError: A cell is turned inside out.
        """
        least = self._cells.forces(self._rows, self._out)
        if self._comm.size > 1:
            self._comm.Allreduce(MPI.IN_PLACE, self._out, op=MPI.SUM)
            least = self._comm.allreduce(least, op=MPI.MIN)
        if not least > 0.0:
            raise ConvergenceError("cells at the surface turn inside out")
        return self._out[:-1]

    def renew(self) -> None:
        """Take the tangent of the present places (collective)."""
        self._cells.tangents(self._slots, self._blocks)
        if self._comm.size > 1:
            self._comm.Allreduce(MPI.IN_PLACE, self._blocks, op=MPI.SUM)
        if self._dim < 3:
            self._blocks[self._diagonal, 2, 2] = 1.0
        inverted(self._blocks, self._diagonal, self._inverse)
        self._factors, self._known = None, {}

    def answers(self, nodes: Integers) -> Floats:
        """How all nodes move by unit forces on some [m/N], (some, dim, count, dim).

        They are kept as long as the tangent, which is factored for them.
        """
        dim, size = self._dim, self.count * self._dim
        free = self._free[:, :dim].ravel()
        fresh = [node for node in nodes.tolist() if node not in self._known]
        for node in fresh:  # each by itself: the same to the last bit in any order
            unit = np.zeros((size, dim))
            unit[node * dim + np.arange(dim), np.arange(dim)] = free[node * dim : (node + 1) * dim]
            moved = self._factored().solve(unit)
            self._known[node] = np.ascontiguousarray(moved.T).reshape(dim, self.count, dim)
        found = [self._known[node] for node in nodes.tolist()]
        return np.array(found).reshape(len(nodes), dim, self.count, dim)

    def _factored(self) -> Any:
        if self._factors is None:
            dim, size = self._dim, self.count * self._dim
            free = self._free[:, :dim].ravel()
            blocks = np.ascontiguousarray(self._blocks[:, :dim, :dim])
            tangent = bsr_matrix((blocks, self._columns, self._starts), shape=(size, size))
            held = diags(free)
            self._factors = splu((held @ tangent @ held + diags(1.0 - free)).tocsc(), **CHOLESKY)
        return self._factors

    def answer(self, right: Floats) -> Floats:
        """How the nodes move by forces (count, dim), by the factors that `answers` takes.

        Cells that are pressed from several sides, as in a corner, may be stable only with what
        presses them: their tangents alone are not positive, and conjugate gradients break off.
        """
        if not self.count:
            return right
        forces = self._free[:, : self._dim] * right
        return np.asarray(self._factored().solve(forces.ravel()).reshape(forces.shape))

    def solve(self, right: Floats, held: Booleans, normals: Floats, share: float) -> Floats:
        """How the nodes move by forces, along what is free, (count, dim).

        Args:
            right: [N], (count, dim).
            held: Nodes that are held along their normals, (count,).
            normals: Unit vectors, (count, dim).
            share: Of the forces that may be left.
        """
        full, normal = np.zeros((self.count, 3)), np.zeros((self.count, 3))
        full[:, : self._dim] = right
        normal[:, : self._dim] = normals
        normal *= self._free
        length = np.linalg.norm(normal, axis=1)
        normal /= np.where(length > 0.0, length, 1.0)[:, None]
        conjugate_gradients(
            self._starts, self._columns, self._blocks, self._inverse, self._free, held, normal,
            full, share, _MOST, *self._work,
        )  # fmt: skip
        return self._work[0][:, : self._dim].copy()
