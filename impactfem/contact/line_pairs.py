"""Gaps between two bodies on a line, whose order never changes."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.meeting import NOTHING, Meeting


@dataclass(frozen=True)
class LinePair:
    """Two contact nodes on the x axis, as `impactfem.contact.pairs` takes pairs.

    Attributes:
        lower, upper: Their places among all contact nodes; the gap is that from one to the other.
        room: Sum of their radii [m].
        total: Number of all contact nodes.
    """

    lower: int
    upper: int
    room: float
    total: int

    follows = False  # weights and normal stay
    touch = 0.0
    memory = NOTHING
    count = 1
    thickness = np.inf  # nothing can pass through

    @property
    def nodes(self) -> Integers:
        """Both nodes."""
        return np.array([self.lower, self.upper])

    def recall(self, memory: Floats) -> None:
        """Nothing: it stays."""

    def __call__(self, places: Floats, acting: Floats) -> Meeting:  # noqa: ARG002  (others ask)
        """How they meet with all contact nodes at some places (nodes, 1)."""
        gap = places[self.upper] - places[self.lower] - self.room
        weights = csr_matrix(([1.0, -1.0], ([0, 0], [self.upper, self.lower])), (1, self.total))
        return Meeting(weights, gap, np.ones((1, 1)), np.zeros(1))
