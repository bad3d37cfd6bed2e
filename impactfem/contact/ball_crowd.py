"""Gaps of many pairs of balls at once: one array operation in place of a search for each pair."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.ball_kernels import (
    fastest_of,
    gaps_of,
    lent_gaps,
    near_among,
    near_of,
    shared_nodes,
)
from impactfem.contact.followed_pair import FAR
from impactfem.contact.meeting import Anew, Meeting
from impactfem.errors import ConvergenceError
from impactfem.system.rigid import NEAR

_BESIDE = 0.25  # of both radii, by which pairs are looked for beside those that are near
_SHARE = 0.499  # of that, which two balls may go towards each other; rounding is the rest


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
    def of(cls, ends: Integers, radii: Floats, shared: Integers) -> "BallCrowd":
        """Join pairs of single balls.

        Args:
            ends: See above.
            radii: Of both [m], (pairs, 2).
            shared: As of `impactfem.system.few.FewBodies`, of all contact nodes.
        """
        several = shared[ends]
        near = np.where(several.any(axis=1), NEAR * radii.min(axis=1), np.inf)
        return cls(ends, several, radii.sum(axis=1), near, len(shared))

    @property
    def room_near(self) -> int:
        """Number of pairs that can be near at once: each takes a node of both balls."""
        own = np.count_nonzero((self.shared == 0).any(axis=1))
        _, first = np.unique(self.ends, return_index=True)
        return min(len(self.ends), int(own + self.shared.ravel()[first].sum() // 2))

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """See `BallPair.__call__`."""
        gap, normal = gaps_of(self.ends, self.room, places, acting)
        near = gap <= self.near
        nodes, most = shared_nodes(self.ends[near], self.shared[near], gap[near])
        _check_room(most)
        starts = 2 * np.concatenate([[0], np.cumsum(near)])
        entries = np.tile([1.0, -1.0], len(nodes)), nodes.ravel(), starts
        weights = csr_matrix(entries, shape=(len(gap), self.total))
        return Meeting(weights, gap, normal, np.zeros(len(gap)))


class NearPairs:
    """The pairs of a crowd that are near, each in a gap of its own as long as it is near.

    Many balls have far more pairs than near ones. A gap that is given back is open in the layer
    that follows, so that nothing of its pair is left when another one gets it. Where none is near
    the nearest pair has one.

    Attributes:
        held, pairs: See `impactfem.contact.meeting.Lent`.
    """

    follows = True

    def __init__(self, crowd: BallCrowd) -> None:
        """Begin with none."""
        self._crowd, self.pairs = crowd, len(crowd.ends)
        self.held: Integers = np.full(crowd.room_near, -1, dtype=np.int64)
        # Places where all pairs were looked at, and which of them may come near beside these.
        self._looked: Floats = np.zeros((0, 0))
        self._some: Integers = self.held[:0]
        self._beside = _BESIDE * float(crowd.room.min())

    def _near(self, places: Floats) -> Integers:
        """Pairs that are near: all are looked at only where balls have gone some way."""
        crowd = self._crowd
        law = crowd.ends, crowd.room, crowd.near
        if not len(self._looked) or not self._covers(places):
            wider = crowd.near + self._beside
            self._some = near_of(crowd.ends, crowd.room, wider, places)
            self._looked = places.copy()
        found: Integers = near_among(self._some, *law, places)
        return found if len(found) else np.asarray(near_of(*law, places))

    def _covers(self, places: Floats) -> bool:
        """Whether no ball has gone half as far as pairs were looked for beside what is near."""
        return bool(fastest_of(places - self._looked, False) <= _SHARE * self._beside)

    @property
    def memory(self) -> Floats:
        """See `impactfem.contact.meeting.Meet`."""
        return self.held.astype(float)

    def recall(self, memory: Floats) -> None:
        """Go on from what `memory` was."""
        self.held = memory.astype(np.int64)

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """See `BallPair.__call__`."""
        crowd, near = self._crowd, self._near(places)
        law = near, self.held, crowd.ends, crowd.room, crowd.shared
        held, enough, gap, normal, rows, most = lent_gaps(*law, places, acting, FAR)
        if not enough:
            raise ConvergenceError(
                f"{len(near)} pairs of balls are near, more than there is room for: use a smaller "
                "solve.dt"
            )
        _check_room(most)
        self.held = held
        weights = csr_matrix(rows[::-1], shape=(len(held), crowd.total))
        return Meeting(weights, gap, normal, np.zeros(len(held)))


def _check_room(most: int) -> None:
    """Stop where more balls lie around one than there is room for.

    Raises:
        ConvergenceError: More than so many do; 0: they do not.
    """
    if most:
        raise ConvergenceError(
            f"more than {most} balls lie around one, in each other: use a smaller solve.dt"
        )
