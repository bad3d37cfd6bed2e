"""Gaps of many pairs of balls at once: one array operation in place of a search for each pair."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from impactfem.contact.ball_pairs import BallPair
from impactfem.contact.pairs import NOTHING, Meeting

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class BallCrowd:
    """Pairs of single balls, as `impactfem.contact.pairs` takes them.

    Attributes:
        one, other: Places of the balls among all contact nodes, (pairs,).
        room: Sum of their radii [m], (pairs,).
        weights: 1 and -1 of both, (pairs, nodes).
    """

    one: Integers
    other: Integers
    room: Floats
    weights: csr_matrix

    follows = True
    memory = NOTHING

    @classmethod
    def of(cls, pairs: Sequence[BallPair]) -> "BallCrowd":
        """Join pairs that are `BallPair.single`."""
        one = np.array([pair.balls[0] for pair in pairs], dtype=np.int64)
        other = np.array([pair.target.nodes[0] for pair in pairs], dtype=np.int64)
        room = np.array([pair.radius[0] + pair.target.radius[0] for pair in pairs])
        count = len(pairs)
        entries = np.tile([1.0, -1.0], count), np.column_stack([one, other]).ravel()
        shape = (count, pairs[0].total)
        return cls(one, other, room, csr_matrix((*entries, 2 * np.arange(count + 1)), shape=shape))

    def recall(self, memory: Floats) -> None:
        """Nothing: it is looked at anew each time."""

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """See `BallPair.__call__`."""
        length = np.linalg.norm(places[self.one] - places[self.other], axis=1)
        way = acting[self.one] - acting[self.other]
        apart = np.linalg.norm(way, axis=1)
        normal = way / np.maximum(apart, np.finfo(float).tiny)[:, None]
        return Meeting(self.weights, length - self.room, normal, np.zeros(len(length)))
