"""How gaps between bodies answer to contact forces, from answers of single nodes."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from impactfem.contact.responses import Columns

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

type Weights = Floats | csr_matrix

_TOGETHER = 64  # nodes whose columns are asked for at once: bounds the memory for them


class PairResponses:
    """Responses of gaps that weigh several nodes: gap_i = n_i . sum_j W_ij u_j.

    Kept are the answers of all contact nodes to unit forces along each axis on single nodes, found
    when a gap first needs the node. From them follow C = B A B^T and D alike, B_i = W_i n_i.
    """

    def __init__(self, dim: int, nodes: int, columns: Columns) -> None:
        """Begin without columns.

        Args:
            dim: Components of a node.
            nodes: Number of contact nodes.
            columns: Computes columns (collective).
        """
        self._dim, self._nodes, self._columns = dim, nodes, columns
        self._weights: Weights = csr_matrix((0, nodes))
        self._place = np.full(nodes, -1, dtype=np.int64)
        self._order: list[int] = []
        size = dim * nodes
        self._layer, self._static = np.empty((0, size)), np.empty((0, size))

    def follow(self, weights: Weights) -> None:
        """Take other weights W, shape (pairs, nodes): an array where there are few."""
        self._weights = weights

    @property
    def known(self) -> Integers:
        """Nodes with columns, in the order in which these were computed."""
        return np.asarray(self._order, dtype=np.int64)

    def require(self, rows: Integers) -> None:
        """Compute what is missing for some gaps (collective)."""
        part = self._weights[rows]
        if isinstance(part, np.ndarray):
            self.learn(np.flatnonzero(part.any(axis=0)))
        else:
            self.learn(np.unique(part.indices))

    def learn(self, nodes: Integers) -> None:
        """Compute what is missing for some nodes, in their order (collective)."""
        missing = nodes[self._place[nodes] < 0]
        dim = self._dim
        for first in range(0, len(missing), _TOGETHER):
            part = missing[first : first + _TOGETHER]
            forces = np.zeros((len(part), dim, self._nodes, dim))
            for k, node in enumerate(part):
                forces[k, :, node] = np.eye(dim)
            layer, static = self._columns(forces.reshape(-1, self._nodes, dim))
            for k, node in enumerate(part):
                self._place[node] = len(self._order) + k
            self._order += part.tolist()
            self._layer = np.vstack([self._layer, layer.reshape(len(part) * dim, -1)])
            self._static = np.vstack([self._static, static.reshape(len(part) * dim, -1)])

    def renew(self, changed: NDArray[np.bool_], answers: Columns) -> None:
        """Ask again what is known of nodes whose answers have changed (collective).

        Args:
            changed: Which nodes, shape (nodes,).
            answers: Computes answers that nobody keeps.
        """
        known = [node for node in self._order if changed[node]]
        if not known:
            return
        dim = self._dim
        forces = np.zeros((len(known), dim, self._nodes, dim))
        for k, node in enumerate(known):
            forces[k, :, node] = np.eye(dim)
        found = answers(forces.reshape(-1, self._nodes, dim))
        rows = (dim * self._place[known][:, None] + np.arange(dim)).ravel()
        for kept, new in zip((self._layer, self._static), found, strict=True):
            kept[rows] = new.reshape(len(rows), -1)

    def matrices(self, rows: Integers, normals: Floats) -> tuple[Floats, Floats]:
        """Response C and compliance D of some gaps along their normals [m/N], (k, k) each."""
        return self._reduced(self._operator(rows, normals))

    def approach(
        self, rows: Integers, normals: Floats, forces: Floats, multipliers: Floats
    ) -> Floats:
        """Changes of all gaps by layer forces and static ones on some of them, (pairs,)."""
        known = self._known_part(self._operator(rows, normals[rows]))
        moved = (known.T @ forces) @ self._layer + (known.T @ multipliers) @ self._static
        relative = self._weights @ moved.reshape(self._nodes, self._dim)
        found: Floats = np.einsum("ij,ij->i", normals, relative)
        return found

    def blocks(self, rows: Integers, frames: Floats) -> tuple[Floats, Floats]:
        """C and D of some gaps in all directions [m/N], each (k dim, k dim).

        Args:
            rows: The gaps, known by `require`.
            frames: Orthonormal directions of each, the normal first, shape (k, dim, dim).
        """
        size = len(rows) * self._dim
        each = [self._operator(rows, frames[:, i]) for i in range(self._dim)]
        if isinstance(each[0], np.ndarray):
            return self._reduced(np.stack(each, axis=1).reshape(size, -1))
        parts = csr_matrix(vstack(each))
        order = np.arange(size).reshape(self._dim, len(rows)).T.ravel()
        return self._reduced(csr_matrix(parts[order]))

    def moved(self, rows: Integers, forces: Floats, multipliers: Floats) -> Floats:
        """Relative displacements in all gaps by vector forces on some, (pairs, dim).

        Args:
            rows: The gaps, known by `require`.
            forces: Layer forces [N], shape (k, dim).
            multipliers: Static forces [N], shape (k, dim).
        """
        weights = self._weights[rows]
        total = np.zeros(self._nodes * self._dim)
        for columns, values in ((self._layer, forces), (self._static, multipliers)):
            on_nodes = (weights.T @ values)[self.known]
            total += on_nodes.ravel() @ columns
        found: Floats = self._weights @ total.reshape(self._nodes, self._dim)
        return found

    def parts(self, rows: Integers, forces: Floats) -> Floats:
        """Vector forces (k, dim) in some gaps as a sum of those that were asked for, (asked,)."""
        on_nodes: Floats = (self._weights[rows].T @ forces)[self.known]
        return on_nodes.ravel()

    def displacement(self, rows: Integers, normals: Floats, forces: Floats) -> None:
        """None: the bodies are asked, who need the forces on their nodes anyhow."""

    def static(self, rows: Integers, normals: Floats, multipliers: Floats) -> None:
        """None, as `displacement`."""

    def _reduced(self, parts: Weights) -> tuple[Floats, Floats]:
        """B A B^T of the answers A in a layer and static, without what rounding made asymmetric."""
        known = self._known_part(parts)
        layer, static = (
            np.asarray((known @ columns) @ parts.T) for columns in (self._layer, self._static)
        )
        return 0.5 * (layer + layer.T), 0.5 * (static + static.T)

    def _operator(self, rows: Integers, normals: Floats) -> Weights:
        """B of some gaps, shape (k, nodes * dim)."""
        part = self._weights[rows]
        if isinstance(part, np.ndarray):
            return np.asarray(part[:, :, None] * normals[:, None]).reshape(len(rows), -1)
        counts = np.diff(part.indptr)
        values = part.data[:, None] * np.repeat(normals, counts, axis=0)
        columns = self._dim * part.indices[:, None] + np.arange(self._dim)
        starts = self._dim * part.indptr
        return csr_matrix(
            (values.ravel(), columns.ravel(), starts), shape=(len(rows), self._nodes * self._dim)
        )

    def _known_part(self, operator: Weights) -> Weights:
        """Columns of B in the order of the known answers, shape (k, known * dim)."""
        if isinstance(operator, np.ndarray):
            places = self._dim * self.known[:, None] + np.arange(self._dim)
            return np.asarray(operator[:, places.ravel()])
        node, axis = np.divmod(operator.indices, self._dim)
        columns = self._dim * self._place[node] + axis
        shape = (operator.shape[0], len(self._layer))
        return csr_matrix((operator.data, columns, operator.indptr), shape=shape)
