"""How the gaps of a layer answer to contact forces; found for each node when it first needs it."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats, Integers
from impactfem.compiled import compiled

Columns = Callable[[Floats], tuple[Floats, Floats]]
"""Maps several forces on the contact nodes (several, count, dim) to their displacements at the end
of the layer with massless nodes in equilibrium, and to the static ones, of the same shape."""

_TOGETHER = 64  # nodes whose columns are asked for at once: bounds the memory for them


class Weighing(Protocol):
    """How gaps weigh contact nodes."""

    def relative(self, values: Floats) -> Floats:
        """What values of the nodes (nodes, dim) make for the gaps, (gaps, dim)."""

    def spread(self, forces: Floats) -> Floats:
        """Forces on the nodes (nodes, dim) by those in the gaps (gaps, dim)."""


class Responses:
    """Responses to unit forces in single gaps.

    Few gaps are ever closed: only for them columns are computed, and then kept. Where the normals
    are fixed a gap has one column, else one for each axis.
    """

    def __init__(
        self,
        count: int,
        dim: int,
        normals: Floats | None,
        columns: Columns,
        whole: int | None = None,
        weighing: Weighing | None = None,
    ) -> None:
        """Begin without columns.

        Args:
            count: Number of gaps.
            dim: Components of a node.
            normals: Fixed normals (count, dim), or None if they change.
            columns: Computes columns (collective).
            whole: With fixed normals, for how many nodes all components are kept: sums of many
                long columns cost more than to answer the summed forces. None: for all.
            weighing: How gaps weigh nodes; None if each has a node of its own.
        """
        self._whole = count if whole is None or normals is None else whole
        self._shape = (count, dim)
        self._normals = normals
        self._columns, self._weighing = columns, weighing
        nodes = count if weighing is None else len(weighing.spread(np.zeros((count, dim))))
        self._nodes = (nodes, dim)
        self._directions = dim if normals is None else 1
        self._place = np.full(count, -1, dtype=np.int64)
        self._layer = np.empty((0, self._directions, nodes, dim))
        self._static = np.empty((0, self._directions, nodes, dim))
        # With fixed normals also the normal parts, shape (columns, count): all that a layer needs.
        self._normal_layer = np.empty((0, count))
        self._normal_static = np.empty((0, count))
        self._known = 0

    @property
    def known(self) -> Integers:
        """Gaps with columns, in the order in which these were computed."""
        order = np.empty(self._known, dtype=np.int64)
        rows = np.flatnonzero(self._place >= 0)
        order[self._place[rows]] = rows
        return order

    def require(self, rows: Integers) -> None:
        """Compute what is missing for some contact nodes (collective)."""
        missing = rows[self._place[rows] < 0]
        for first in range(0, len(missing), _TOGETHER):
            self._learn(missing[first : first + _TOGETHER])

    def learn(self, nodes: Integers) -> None:
        """The same: here each gap has its node."""
        self.require(nodes)

    def renew(self, changed: NDArray[np.bool_], answers: Columns, roots: object = None) -> None:
        """Nothing: answers of gaps with fixed normals never change."""

    def _learn(self, rows: Integers) -> None:
        """Compute and keep the columns of some nodes."""
        several = len(rows)
        forces = np.zeros((several, self._directions, *self._shape))
        for k, row in enumerate(rows):
            forces[k, :, row] = (
                np.eye(self._directions) if self._normals is None else self._normals[row]
            )
        each = forces.reshape(-1, *self._shape)
        if self._weighing is not None:
            each = np.stack([self._weighing.spread(force) for force in each])
        shape = (several, self._directions, *self._nodes)
        layers, statics = (part.reshape(shape) for part in self._columns(each))
        for row, layer, static in zip(rows, layers, statics, strict=True):
            self._grow()
            if self._known < self._whole:
                self._layer[self._known] = layer
                self._static[self._known] = static
            if self._normals is not None:
                self._normal_layer[self._known] = self._along(layer[0], self._normals)
                self._normal_static[self._known] = self._along(static[0], self._normals)
            self._place[row] = self._known
            self._known += 1

    def _along(self, moved: Floats, normals: Floats) -> Floats:
        """Changes of all gaps along their normals by a displacement (nodes, dim)."""
        relative = moved if self._weighing is None else self._weighing.relative(moved)
        found: Floats = np.einsum("ij,ij->i", relative, normals)
        return found

    def _grow(self) -> None:
        if self._known == len(self._layer) and self._known < self._whole:
            shape = (self._directions, *self._nodes)
            self._layer = _longer(self._layer, shape)
            self._static = _longer(self._static, shape)
        if self._normals is not None and self._known == len(self._normal_layer):
            self._normal_layer = _longer(self._normal_layer, self._shape[:1])
            self._normal_static = _longer(self._normal_static, self._shape[:1])

    def matrices(self, rows: Integers, normals: Floats) -> tuple[Floats, Floats]:
        """Response C and compliance D of some nodes along their normals [m/N], (k, k) each.

        Args:
            rows: The nodes, known by `require`.
            normals: Their normals, shape (k, dim).
        """
        place = self._place[rows]
        if self._normals is not None:
            return (
                _symmetric_block(self._normal_layer, place, rows),
                _symmetric_block(self._normal_static, place, rows),
            )

        def reduced(columns: Floats) -> Floats:
            along = np.einsum("jdic,ic->jdi", columns[place][:, :, rows], normals)
            return _symmetric(np.einsum("jd,jdi->ij", normals, along))

        return reduced(self._layer), reduced(self._static)

    def approach(
        self, rows: Integers, normals: Floats, forces: Floats, multipliers: Floats
    ) -> Floats:
        """Changes of the gaps of all contact nodes by layer forces and static ones, (count,).

        Args:
            rows: The nodes on which forces act, known by `require`.
            normals: Normals of all contact nodes, shape (count, dim).
            forces: Layer forces, shape (k,).
            multipliers: Static forces, shape (k,).
        """
        if self._normals is None:
            layer = self._displaced(self._layer, rows, normals[rows], forces)
            static = self._displaced(self._static, rows, normals[rows], multipliers)
            along: Floats = np.einsum("ij,ij->i", normals, layer + static)
            return along
        layer = self._summed(self._normal_layer, rows, forces)
        return layer + self._summed(self._normal_static, rows, multipliers)

    def parts(self, rows: Integers, forces: Floats) -> Floats:
        """Vector forces (k, dim) in some gaps as a sum of those that were asked for, (asked,)."""
        found = np.zeros((self._known, self._directions))
        place = self._place[rows]
        if self._normals is None:
            found[place] = forces
        else:
            found[place, 0] = np.einsum("ij,ij->i", forces, self._normals[rows])
        return found.ravel()

    def displacement(self, rows: Integers, normals: Floats, forces: Floats) -> Floats | None:
        """Displacements of all contact nodes by layer forces on some, (count, dim).

        None if not all their answers are kept in full.
        """
        return self._displaced(self._layer, rows, normals, forces) if self._whole_at(rows) else None

    def static(self, rows: Integers, normals: Floats, multipliers: Floats) -> Floats | None:
        """The same by static forces."""
        if not self._whole_at(rows):
            return None
        return self._displaced(self._static, rows, normals, multipliers)

    def _whole_at(self, rows: Integers) -> bool:
        return bool((self._place[rows] < self._whole).all())

    def _displaced(
        self, columns: Floats, rows: Integers, normals: Floats, values: Floats
    ) -> Floats:
        parts = values[:, None] * (1.0 if self._normals is not None else normals)
        flat = columns.reshape(len(columns), self._directions, -1)
        found = np.zeros(flat.shape[2])
        for direction in range(self._directions):
            found += self._summed(flat[:, direction], rows, parts[:, direction])
        return found.reshape(self._nodes)

    def _summed(self, columns: Floats, rows: Integers, values: Floats) -> Floats:
        """Sum of columns times values, without a copy of the columns."""
        place = self._place[rows]
        used = int(place.max(initial=-1)) + 1
        weights = np.zeros(used)
        weights[place] = values
        found: Floats = weights @ columns[:used]
        return found


def _longer(columns: Floats, shape: tuple[int, ...]) -> Floats:
    """Columns with room for as many again."""
    return np.concatenate([columns, np.empty((max(16, len(columns)), *shape))])


@compiled
def _symmetric_block(columns, place, rows):
    """Entries of some columns in some rows, without what rounding has made asymmetric."""
    size = len(rows)
    block = np.empty((size, size))
    for i in range(size):
        for j in range(i + 1):
            mean = 0.5 * (columns[place[i], rows[j]] + columns[place[j], rows[i]])
            block[i, j] = mean
            block[j, i] = mean
    return block


def _symmetric(matrix: Floats) -> Floats:
    """Remove what rounding has made asymmetric."""
    return 0.5 * (matrix + matrix.T)
