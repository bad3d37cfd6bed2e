"""Gaps whose directions turn with the bodies, so that forces in them have no moment.

Forces F in a gap with the weights W act on the nodes as W^T F. Their sum is 0, as the weights of a
gap have that sum, but about the places x their moment is that of F about the way d = W x between
both sides, d x F: it vanishes only along d. So let the directions of a gap turn with a patch of
nodes on one side, by the spin that fits the displacements v of its nodes best,

    theta = J^-1 sum_j p_j r_j x v_j,   J = sum_j p_j (r_j . r_j I - r_j r_j^T),

r_j the arms from the patch's centre. Seen from directions that turn so, the way changes by

    W v - theta x d,

which is 0 for every rigid motion; and forces that do the work F . (W v - theta x d) have neither
sum nor moment, in any direction, in the plane and in space.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.line_kernels import patch_spins, spread_moments, turned_ways


@dataclass(frozen=True)
class TurningGaps:
    """What the turning of the directions adds, for given places.

    Attributes:
        spins: theta of some gaps by displacements of the nodes, (gaps turns, nodes dim): ends of
            the rows, columns and values.
        numbers: Of those displacements.
        rows: These gaps among all, (gaps,).
        ways: Their d [m], (gaps, dim).
        shape: Of what `relative` returns: all gaps, directions.
    """

    spins: tuple[Integers, Integers, Floats]
    numbers: int
    rows: Integers
    ways: Floats
    shape: tuple[int, int]

    @classmethod
    def of(
        cls, patches: Sequence[tuple[int, csr_matrix]], places: Floats, ways: Floats
    ) -> "TurningGaps | None":
        """Of gaps with patches; None without any.

        Args:
            patches: First gap and weights, >= 0, (gaps, nodes) each.
            places: Of the nodes [m], (nodes, dim).
            ways: d of all gaps [m], (all gaps, dim).
        """
        counts = [np.diff(patch.indptr) for _, patch in patches]
        each = [
            first + np.flatnonzero(own) for (first, _), own in zip(patches, counts, strict=True)
        ]
        if not sum(map(len, each)):
            return None
        rows, sizes = np.concatenate(each), np.concatenate(counts)
        ends = np.concatenate([[0], np.cumsum(sizes[sizes > 0])])
        node, weight = (
            np.concatenate([getattr(patch, name) for _, patch in patches])
            for name in ("indices", "data")
        )
        spins = patch_spins(ends, node, weight, places)
        return cls(spins, places.size, rows, ways[rows], (len(ways), places.shape[1]))

    def relative(self, values: Floats) -> Floats:
        """Theta x d for displacements (nodes, dim), (all gaps, dim)."""
        given = np.ascontiguousarray(values).ravel()
        own = given, self.rows, self.ways, self.shape[0]
        return np.asarray(turned_ways(*self.spins, *own))

    def spread(self, forces: Floats) -> Floats:
        """The transpose: of forces in the gaps (all gaps, dim), on the nodes (nodes, dim)."""
        own = forces, self.rows, self.ways, self.numbers
        found = spread_moments(*self.spins, *own)
        return np.asarray(found.reshape(-1, self.shape[1]))

    def units(self, rows: Integers, directions: Floats) -> Floats:
        """`spread` of unit forces in some gaps, (rows, ways, nodes, dim).

        Args:
            rows: Gaps among all.
            directions: Of the forces, (rows, ways, dim).
        """
        (ends, columns, values), dim = self.spins, self.shape[1]
        turns = dim * (dim - 1) // 2
        found = np.zeros((*directions.shape[:2], self.numbers))
        mine = np.flatnonzero(np.isin(rows, self.rows))
        at = np.searchsorted(self.rows, rows[mine])
        moments = np.einsum("gtk,gwk->gwt", _crossing(self.ways[at]), directions[mine])
        spins = csr_matrix((values, columns, ends), shape=(len(self.rows) * turns, self.numbers))
        lines = spins[(at[:, None] * turns + np.arange(turns)).ravel()].toarray()
        found[mine] = moments @ lines.reshape(len(at), turns, found.shape[-1])
        return found.reshape(*found.shape[:2], -1, dim)


def _crossing(arms: Floats) -> Floats:
    """Matrices A with A v = r x v, and A^T theta = theta x r, (arms, 1 or 3, dim)."""
    if arms.shape[1] == 2:
        return np.stack([-arms[:, 1], arms[:, 0]], axis=1)[:, None, :]
    x, y, z = arms.T
    zero = np.zeros_like(x)
    lines = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.moveaxis(np.array(lines), 2, 0)
