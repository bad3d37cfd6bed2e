"""Gaps of many pairs of balls at once: one array operation in place of a search for each pair."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from impactfem.contact.ball_kernels import gaps_of
from impactfem.contact.ball_pairs import BallPair
from impactfem.contact.meeting import Anew, Meeting
from impactfem.errors import ConvergenceError
from impactfem.system.rigid import NEAR

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class BallCrowd(Anew):
    """Pairs of single balls, as `impactfem.contact.pairs` takes them.

    Where balls have fewer nodes than others that they may meet, each pair that is near has one of
    them in a layer; pairs that are not near weigh nothing.

    Attributes:
        ends: Places of the balls of each pair among all contact nodes, of a ball with shared nodes
            the first of these, (pairs, 2).
        shared: How many of these it has, 0: its node is its own in this pair, (pairs, 2).
        room: Sum of their radii [m], (pairs,).
        near: Gap of pairs that are near [m], (pairs,).
        total: Number of all contact nodes.
    """

    ends: Integers
    shared: Integers
    room: Floats
    near: Floats
    total: int

    @classmethod
    def of(cls, pairs: Sequence[BallPair], shared: Integers) -> "BallCrowd":
        """Join pairs that are `BallPair.single`.

        Args:
            pairs: See there.
            shared: As of `impactfem.system.few.FewBodies`, of all contact nodes.
        """
        ends = np.array([(pair.balls[0], pair.target.nodes[0]) for pair in pairs])
        radii = np.array([(pair.radius[0], pair.target.radius[0]) for pair in pairs])
        several = shared[ends]
        near = np.where(several.any(axis=1), NEAR * radii.min(axis=1), np.inf)
        return cls(ends, several, radii.sum(axis=1), near, pairs[0].total)

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """See `BallPair.__call__`."""
        gap, normal = gaps_of(self.ends, self.room, places, acting)
        near = gap <= self.near
        nodes = self._nodes(np.flatnonzero(near), gap)
        starts = 2 * np.concatenate([[0], np.cumsum(near)])
        entries = np.tile([1.0, -1.0], len(nodes)), nodes.ravel(), starts
        weights = csr_matrix(entries, shape=(len(gap), self.total))
        return Meeting(weights, gap, normal, np.zeros(len(gap)))

    def _nodes(self, pairs: Integers, gap: Floats) -> Integers:
        """Nodes of pairs that are near, the closest first in their choice, (pairs, 2)."""
        nodes, shared = self.ends[pairs], self.shared[pairs]
        flat, room = nodes.ravel(), shared.ravel()
        order = np.lexsort((np.repeat(gap[pairs], 2), flat))
        ranked = flat[order]
        first = np.searchsorted(ranked, ranked)
        rank = np.empty(len(flat), dtype=np.int64)
        rank[order] = np.arange(len(flat)) - first
        if ((room > 0) & (rank >= room)).any():
            raise ConvergenceError(
                f"more than {room.max()} balls lie around one, in each other: use a smaller "
                "solve.dt"
            )
        return np.asarray(flat + np.where(room > 0, rank, 0)).reshape(-1, 2)
