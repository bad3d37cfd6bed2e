"""Forces that massless nodes leave unbalanced, handed to nodes inside without a sum or a moment.

Weights keep sums and, of undeformed places, moments (w >= 0 or not: sum w = 1, sum w X = X_node).
The moment that is still lacking, as the body is bent by now, is that of a turning acceleration of
the nodes that take the forces.
"""

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.fem import MPI, gather
from impactfem.system.element_forces import ElementForces
from impactfem.system.nodes import Nodes
from impactfem.system.surface_kernels import accelerate_turning, moments

_BALANCED = 1e-8  # fault of weights that keep sum and moments
_SPREAD = 5.0  # sum of amounts of weights from which they are shares instead
_FLAT = 1e-9  # share of its trace below which the moment of inertia of the nodes tells no turning


class Inward:
    """What nodes inside take of the forces on the contact nodes of their body."""

    def __init__(
        self,
        elements: ElementForces,
        nodes: Nodes,
        canonical: Integers,
        places: Floats,
        masses: Floats,
        *,
        turns: bool,
    ) -> None:
        """Find the weights (collective).

        Args:
            elements: Forces of the body.
            nodes: Its nodes.
            canonical: Canonical numbers of the contact nodes.
            places: Of these, undeformed [m], (count, dim).
            masses: Of the owned nodes, 0 where held [kg], (owned, dim).
            turns: Whether moments mean anything: no axis.
        """
        self._comm, self._dim, self._places = nodes.comm, nodes.dim, places
        self._weights = _weights(elements, nodes, canonical)
        self._turns = turns and len(canonical) > 0
        self._ring = np.flatnonzero(np.diff(self._weights.indptr) > 0)
        self._own = nodes.positions[: nodes.owned][self._ring]
        self._masses = masses[self._ring].min(axis=1, initial=np.inf)

    def forces(self, left: Floats, surface: Floats, displacement: Floats) -> Floats:
        """Forces on the owned dofs by some on the contact nodes (count, dim) [N] (collective).

        Args:
            left: See above.
            surface: Displacement of the contact nodes [m], (count, dim).
            displacement: Of the owned dofs [m].
        """
        found: Floats = self._weights @ left
        if self._turns and left.any():
            there, u = self._places + surface, displacement.reshape(-1, self._dim)
            middle, sums = there.mean(axis=0), np.zeros((2 * self._dim + 2, self._dim))
            own = self._ring, self._own, self._masses, u, found
            moments(*own, middle, sums)
            if self._comm.size > 1:
                self._comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
            centre, turn = _turning(sums, (there - middle).T @ left)
            accelerate_turning(*own, middle + centre, turn)
        return found.ravel()


def _turning(sums: Floats, wanted: Floats) -> tuple[Floats, Floats]:
    """Centre of the nodes, and A of accelerations A a with the moment that is lacking, A = -A^T.

    Args:
        sums: As `moments` has them.
        wanted: Sum of a f^T of the forces that were handed.
    """
    dim = sums.shape[1]
    mass = sums[-1, 0] or 1.0
    centre = sums[dim] / mass
    second = sums[:dim] - np.outer(sums[dim], centre)
    lack = wanted - sums[dim + 1 : -1]
    lack = lack - lack.T  # x_i p_j - x_j p_i
    trace, turn = np.trace(second), np.zeros((dim, dim))
    if dim == 2 and trace > 0.0:
        turn[1, 0] = lack[0, 1] / trace
    elif dim == 3:
        inertia = trace * np.eye(3) - second
        if np.linalg.eigvalsh(inertia)[0] > _FLAT * trace:
            turn[2, 1], turn[0, 2], turn[1, 0] = np.linalg.solve(
                inertia, [lack[1, 2], lack[2, 0], lack[0, 1]]
            )
    return centre, turn - turn.T


def _weights(elements: ElementForces, nodes: Nodes, canonical: Integers) -> csr_matrix:
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
