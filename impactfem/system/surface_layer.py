"""Equilibrium of massless contact nodes under finite strain: the cells at the surface alone.

Every rank holds all contact nodes and solves for them alike; forces and tangents are sums of what
the ranks' own cells give. What an approximate solution leaves unbalanced is handed to nodes inside
with weights that keep sums and moments (w >= 0 or not: sum w = 1, sum w X = X_node).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from impactfem.errors import ConvergenceError
from impactfem.fem import MPI, gather
from impactfem.system.element_forces import ElementForces
from impactfem.system.nodes import Nodes
from impactfem.system.surface import SurfaceNodes
from impactfem.system.surface_kernels import conjugate_gradients, inverted

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_MOST = 60  # iterations of conjugate gradients
_BALANCED = 1e-8  # fault of weights that keep sum and moments
_SPREAD = 5.0  # sum of amounts of weights from which they are shares instead


class SurfaceLayer:
    """Massless nodes of a body, and the cells that touch them."""

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
        self.inward = _inward(elements, nodes, canonical)

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


def _inward(elements: ElementForces, nodes: Nodes, canonical: Integers) -> csr_matrix:
    """Weights of the owned nodes that take what contact nodes leave, (owned, count) (collective).

    Of the inner neighbours of neighbours, the least ones that keep sum and moments; equal shares
    where these do not exist or are large.
    """
    comm, numbers, dim = nodes.comm, nodes.numbers, nodes.dim
    cells = numbers[elements.cells]
    ring = gather(comm, np.unique(cells[np.isin(cells, canonical).any(axis=1)]))
    near = cells[np.isin(cells, np.unique(ring)).any(axis=1)]
    corners = gather(comm, near.ravel()).reshape(-1, cells.shape[1])
    known = np.unique(corners)
    count, size = len(canonical), len(known)
    if not count:
        return csr_matrix((nodes.owned, 0))
    places = _places(nodes, known)
    at = np.searchsorted(known, corners)
    beside = csr_matrix(
        (
            np.ones(at.size * at.shape[1]),
            (np.repeat(at, at.shape[1], axis=1).ravel(), np.tile(at, at.shape[1]).ravel()),
        ),
        shape=(size, size),
    )
    contact = np.searchsorted(known, canonical)
    wide = (beside[contact] @ beside).tocoo()
    inner = ~np.isin(wide.col, contact)
    row, column = wide.row[inner], wide.col[inner]
    arms = places[column] - places[contact[row]]
    each = np.maximum(1, np.bincount(row, minlength=count))
    scale = np.sqrt(np.bincount(row, (arms**2).sum(axis=1), count) / each)
    basis = np.column_stack([np.ones(len(row)), arms / scale[row][:, None]])
    gram = np.zeros((count, dim + 1, dim + 1))
    np.add.at(gram, row, basis[:, :, None] * basis[:, None, :])
    factors = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)[:, :, 0]
    weights = np.einsum("ei,ei->e", basis, factors[row])
    goal = np.eye(dim + 1)[0]
    fault = np.abs(np.einsum("nij,nj->ni", gram, factors) - goal).max(axis=1)
    poor = (fault > _BALANCED) | (np.bincount(row, np.abs(weights), count) > _SPREAD)
    shares = 1.0 / each[row]
    weights = np.where(poor[row], shares, weights)
    mine = np.argsort(numbers[: nodes.owned])
    sorted_own = numbers[: nodes.owned][mine]
    found = np.searchsorted(sorted_own, known[column])
    here = found < nodes.owned
    here[here] = sorted_own[found[here]] == known[column][here]
    return csr_matrix((weights[here], (mine[found[here]], row[here])), shape=(nodes.owned, count))


def _places(nodes: Nodes, known: Integers) -> Floats:
    """Undeformed places of nodes by their canonical numbers [m], on every rank (collective)."""
    own = np.flatnonzero(np.isin(nodes.numbers[: nodes.owned], known))
    order = np.argsort(gather(nodes.comm, nodes.numbers[own]))
    return gather(nodes.comm, nodes.positions[own])[order]
