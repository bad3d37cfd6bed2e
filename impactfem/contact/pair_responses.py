"""How gaps between bodies answer to contact forces, from answers of single nodes."""

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags, vstack

from impactfem.arrays import Floats, Integers
from impactfem.contact.responses import Columns
from impactfem.contact.rooted import Matrix, Rooted
from impactfem.contact.sparse_kernels import directed_weights, row_products, rows_among
from impactfem.contact.sparse_rows import across, directed_roots, rows_of, times

type Weights = Floats | csr_matrix

type Roots = tuple[NDArray[np.bool_], csr_matrix]
"""Which nodes have roots, (nodes,), and these, of which other rows are 0, (nodes dim, numbers)."""

_MANY = 600  # coordinates of nodes from which answers of bodies apart are kept sparse
_TOGETHER = 64  # nodes whose columns are asked for at once: bounds the memory for them


class PairResponses:
    """Responses of gaps that weigh several nodes: gap_i = n_i . sum_j W_ij u_j.

    Kept are the answers of all contact nodes to unit forces along each axis on single nodes, found
    when a gap first needs the node. From them follow C = B A B^T and D alike, B_i = W_i n_i.

    Bodies that move by few coordinates give roots R of theirs instead, A = R R^T and D = 0: none of
    their nodes has to be asked.
    """

    def __init__(
        self, dim: int, nodes: int, columns: Columns, apart: Integers | None = None
    ) -> None:
        """Begin without columns.

        Args:
            dim: Components of a node.
            nodes: Number of contact nodes.
            columns: Computes columns (collective).
            apart: Body of each node, where forces on a body move no other one; None: they may.
        """
        self._apart = apart if dim * nodes > _MANY else None
        self._dim, self._nodes, self._columns = dim, nodes, columns
        self._weights: Weights = csr_matrix((0, nodes))
        self._place = np.full(nodes, -1, dtype=np.int64)
        self._order: list[int] = []
        size = dim * nodes
        empty: Weights = np.empty((0, size)) if self._apart is None else csr_matrix((0, size))
        self._layer, self._static = empty, empty
        self._rooted: NDArray[np.bool_] = np.zeros(nodes, dtype=bool)
        self._roots: csr_matrix | None = None
        self._taken: tuple[Weights, Any] = self._weights[:0], ()  # weights as kernels have them

    def follow(self, weights: Weights) -> None:
        """Take other weights W, shape (pairs, nodes): an array where there are few."""
        self._weights = weights

    @property
    def known(self) -> Integers:
        """Nodes with columns, in the order in which these were computed."""
        return np.asarray(self._order, dtype=np.int64)

    def require(self, rows: Integers) -> None:
        """Compute what is missing for some gaps (collective)."""
        if self._rooted.all():
            return
        part = self._weights[rows]
        if isinstance(part, np.ndarray):
            self.learn(np.flatnonzero(part.any(axis=0)))
        else:
            self.learn(np.unique(part.indices))

    def learn(self, nodes: Integers) -> None:
        """Compute what is missing for some nodes, in their order (collective)."""
        missing = nodes[(self._place[nodes] < 0) & ~self._rooted[nodes]]
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
            self._layer = _below(self._layer, layer.reshape(len(part) * dim, -1))
            self._static = _below(self._static, static.reshape(len(part) * dim, -1))

    def renew(
        self, changed: NDArray[np.bool_], answers: Columns, roots: Roots | None = None
    ) -> None:
        """Ask again what is known of nodes whose answers have changed (collective).

        Args:
            changed: Which nodes, shape (nodes,).
            answers: Computes answers that nobody keeps.
            roots: Of the nodes that have some.
        """
        if roots is not None:
            self._rooted, self._roots = roots
        known = [node for node in self._order if changed[node]]
        if not known:
            return
        dim = self._dim
        rows = (dim * self._place[known][:, None] + np.arange(dim)).ravel()
        if self._apart is not None:
            self._layer, self._static = self._renewed(np.asarray(known), rows, answers)
            return
        forces = np.zeros((len(known), dim, self._nodes, dim))
        for k, node in enumerate(known):
            forces[k, :, node] = np.eye(dim)
        found = answers(forces.reshape(-1, self._nodes, dim))
        for kept, new in zip((self._layer, self._static), found, strict=True):
            kept[rows] = new.reshape(len(rows), -1)

    def _renewed(
        self, known: Integers, rows: Integers, answers: Columns
    ) -> tuple[csr_matrix, csr_matrix]:
        """Answers with those of some nodes asked again, of which each body is asked at once.

        Forces on several bodies in one column do not mix: as many columns are asked for as a body
        has nodes, and what each says stands at its own nodes.

        Args:
            known: The nodes.
            rows: Their rows among those of the answers.
            answers: Computes answers that nobody keeps.
        """
        dim, apart = self._dim, cast("Integers", self._apart)
        _, counts = np.unique(apart[known], return_counts=True)
        order = np.argsort(apart[known], kind="stable")
        turn = np.empty(len(known), dtype=np.int64)  # which of its body's nodes each is
        turn[order] = np.arange(len(known)) - np.repeat(np.cumsum(counts) - counts, counts)
        forces = np.zeros((counts.max(), dim, self._nodes, dim))
        forces[turn[:, None], np.arange(dim), known[:, None], np.arange(dim)] = 1.0
        found = answers(forces.reshape(-1, self._nodes, dim))
        # Entries of each row: the coordinates of the nodes of its body.
        first = np.searchsorted(apart, apart[known])
        sizes = dim * (np.searchsorted(apart, apart[known], side="right") - first)
        widths = np.repeat(sizes, dim)
        within = np.arange(widths.sum()) - np.repeat(np.cumsum(widths) - widths, widths)
        columns = np.repeat(np.repeat(dim * first, dim), widths) + within
        asked = np.repeat((dim * turn[:, None] + np.arange(dim)).ravel(), widths)
        entries = np.repeat(rows, widths), columns
        shape = self._layer.shape
        stays = np.ones(shape[0])
        stays[rows] = 0.0
        renewed = []
        for kept, each in zip((self._layer, self._static), found, strict=True):
            values = each.reshape(len(each), -1)[asked, columns]
            own = csr_matrix((values, entries), shape=shape)
            renewed.append(csr_matrix(own + diags(stays) @ kept) if stays.any() else own)
        return renewed[0], renewed[1]

    def matrices(self, rows: Integers, normals: Floats) -> tuple[Floats, Floats]:
        """Response C and compliance D of some gaps along their normals [m/N], (k, k) each."""
        return self._reduced(self._operator(rows, normals))

    def approach(
        self, rows: Integers, normals: Floats, forces: Floats, multipliers: Floats
    ) -> Floats:
        """Changes of all gaps by layer forces and static ones on some of them, (pairs,)."""
        operator = self._operator(rows, normals[rows])
        known = self._known_part(operator)
        moved = (known.T @ forces) @ self._layer + (known.T @ multipliers) @ self._static
        moved += self._rolled(operator.T @ forces)
        relative = self._weights @ moved.reshape(self._nodes, self._dim)
        found: Floats = np.einsum("ij,ij->i", normals, relative)
        return found

    @property
    def rooted(self) -> tuple[Any, Any, int, bool] | None:
        """Weights and roots as kernels take them, the number of coordinates, and if these are many.

        None where no nodes have roots; see `has_roots`.
        """
        if self._roots is None:
            return None
        weights, few = self._weights, isinstance(self._weights, np.ndarray)
        if self._taken[0] is not weights:
            taken = rows_among(weights) if few else rows_of(cast("csr_matrix", weights))
            self._taken = weights, taken
        many = not few and self._apart is not None and not self._order
        return self._taken[1], rows_of(self._roots), self._roots.shape[1], many

    def has_roots(self, rows: Integers) -> bool:
        """Whether some gaps weigh nodes with roots alone."""
        if self._rooted.all():
            return True
        part = self._weights[rows]
        if isinstance(part, np.ndarray):
            return bool(self._rooted[part.any(axis=0)].all())
        return bool(self._rooted[part.indices].all())

    def blocks(self, rows: Integers, frames: Floats) -> tuple[Matrix, Matrix]:
        """C and D of some gaps in all directions [m/N], each (k dim, k dim); of many their roots.

        Args:
            rows: The gaps, known by `require`.
            frames: Orthonormal directions of each, the normal first, shape (k, dim, dim).
        """
        size = len(rows) * self._dim
        if isinstance(self._weights, np.ndarray):
            return self._reduced(np.asarray(directed_weights(self._weights, rows, frames)))
        if not self._order and self._apart is not None and self._roots is not None:
            roots = directed_roots(self._weights, rows, frames, self._roots)
            return Rooted(roots), Rooted.none(size)
        # A row of each direction, with what the gap weighs.
        part = self._weights[rows]
        counts = np.diff(part.indptr)
        every = np.repeat(np.arange(len(rows)), self._dim)
        entries = ranges(part.indptr[every], counts[every])
        directions = np.repeat(frames.reshape(size, -1), counts[every], axis=0)
        values = part.data[entries, None] * directions
        columns = self._dim * part.indices[entries, None] + np.arange(self._dim)
        ends = self._dim * np.concatenate([[0], np.cumsum(counts[every])])
        shape = size, self._nodes * self._dim
        return self._reduced(csr_matrix((values.ravel(), columns.ravel(), ends), shape=shape))

    def moved(self, rows: Integers, forces: Floats, multipliers: Floats) -> Floats:
        """Relative displacements in all gaps by vector forces on some, (pairs, dim).

        Args:
            rows: The gaps, known by `require`.
            forces: Layer forces [N], shape (k, dim).
            multipliers: Static forces [N], shape (k, dim).
        """
        if not self._order:  # bodies with roots are not asked
            whole = np.zeros((self._weights.shape[0], self._dim))
            whole[rows] = forces
            rolled = self._rolled(across(self._weights, whole).ravel())
            return times(self._weights, rolled.reshape(self._nodes, self._dim))
        weights = self._weights[rows]
        total = np.zeros(self._nodes * self._dim)
        for columns, values in ((self._layer, forces), (self._static, multipliers)):
            on_nodes = weights.T @ values
            total += on_nodes[self.known].ravel() @ columns
            if columns is self._layer:
                total += self._rolled(on_nodes.ravel())
        found: Floats = self._weights @ total.reshape(self._nodes, self._dim)
        return found

    def parts(self, rows: Integers, forces: Floats) -> Floats:
        """Vector forces (k, dim) in some gaps as a sum of those that were asked for, (asked,)."""
        if not self._order:
            return np.zeros(0)
        on_nodes: Floats = (self._weights[rows].T @ forces)[self.known]
        return on_nodes.ravel()

    def displacement(self, rows: Integers, normals: Floats, forces: Floats) -> None:
        """None: the bodies are asked, who need the forces on their nodes anyhow."""

    def static(self, rows: Integers, normals: Floats, multipliers: Floats) -> None:
        """None, as `displacement`."""

    def _reduced(self, parts: Weights) -> tuple[Floats, Floats]:
        """B A B^T of the answers A in a layer and static, without what rounding made asymmetric."""
        layer, static = np.zeros((2, parts.shape[0], parts.shape[0]))
        if self._order:  # bodies with roots are not asked
            known = self._known_part(parts)
            layer, static = (
                _full((known @ columns) @ parts.T) for columns in (self._layer, self._static)
            )
            layer, static = 0.5 * (layer + layer.T), 0.5 * (static + static.T)
        if self._roots is not None:
            moved = _by_rows(parts, self._roots)
            layer += _full(moved @ moved.T)
        return layer, static

    def _rolled(self, forces: Floats) -> Floats:
        """Displacements by forces on bodies with roots, (nodes dim,) each."""
        if self._roots is None:
            return np.zeros(len(forces))
        return times(self._roots, across(self._roots, forces))

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
        columns = self._dim * self.known[:, None] + np.arange(self._dim)
        return csr_matrix(operator[:, columns.ravel()])


def ranges(first: Integers, counts: Integers) -> Integers:
    """Numbers from some on, so many of each, one after the other."""
    return np.arange(counts.sum()) + np.repeat(first - np.cumsum(counts) + counts, counts)


def _below(kept: Weights, found: Floats) -> Weights:
    """Further rows, sparse where those before are."""
    if isinstance(kept, np.ndarray):
        return np.vstack([kept, found])
    return csr_matrix(vstack([kept, csr_matrix(found)]))


def _full(matrix: Weights) -> Floats:
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())


def _by_rows(parts: Weights, matrix: csr_matrix) -> Weights:
    """Rows times a sparse matrix."""
    if isinstance(parts, np.ndarray):
        return np.asarray(row_products(parts, *rows_of(matrix), matrix.shape[1]))
    return csr_matrix(parts @ matrix)
