"""Gaps of two kinds that different laws see to, one after the other, as observers look at them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.pairs import PairGaps


@dataclass(frozen=True)
class GapsBeside:
    """Gaps of contact nodes, all of which both kinds know.

    What the next layer needs of the second ones their own march keeps.

    Attributes:
        first, second: They; no pair of the scene has gaps of both.
    """

    first: PairGaps
    second: PairGaps

    @cached_property
    def pairs(self) -> tuple[str, ...]:
        """Names of the pairs of the scene."""
        return (*self.first.pairs, *self.second.pairs)

    @cached_property
    def count(self) -> int:
        """Of the first ones."""
        return len(self.first.pair_of())

    @property
    def moves(self) -> bool:
        """Whether what some nodes face moves by itself."""
        return self.first.moves or self.second.moves

    @property
    def shares_nodes(self) -> bool:
        """Whether a node may have gaps to several obstacles."""
        return self.first.shares_nodes or self.second.shares_nodes

    def pair_of(self) -> Integers:
        """Which of `pairs` each gap belongs to now, (gaps,)."""
        more = len(self.first.pairs) + self.second.pair_of()
        return np.concatenate([self.first.pair_of(), more])

    def at(
        self, displacement: Floats, begin: Floats, last: Floats, time: float
    ) -> tuple[Floats, Floats]:
        """Gaps (gaps,) and normals (gaps, dim); see `PairGaps.at`."""
        each = [gaps.at(displacement, begin, last, time) for gaps in (self.first, self.second)]
        gap, normals = zip(*each, strict=True)
        return np.concatenate(gap), np.concatenate(normals)

    def relative(self, values: Floats) -> Floats:
        """Values of nodes (nodes, dim) as differences in the gaps, (gaps, dim)."""
        return np.concatenate([self.first.relative(values), self.second.relative(values)])

    def spread(self, forces: Floats) -> Floats:
        """Forces on the nodes (nodes, dim) by those in the gaps (gaps, dim)."""
        own = self.count
        return self.first.spread(forces[:own]) + self.second.spread(forces[own:])

    def entries(self, rows: Integers) -> tuple[Integers, Integers, Floats]:
        """What some gaps weigh; see `PairGaps.entries`."""
        found = []
        for gaps, first, own in (
            (self.first, 0, rows < self.count),
            (self.second, self.count, rows >= self.count),
        ):
            gap, node, weight = gaps.entries(rows[own] - first)
            found.append((np.flatnonzero(own)[gap], node, weight))
        gap, node, weight = (np.concatenate(each) for each in zip(*found, strict=True))
        return gap, node, weight

    def nodal(self, force: Floats, gap: Floats) -> tuple[Floats, Floats, Floats]:
        """Gap, pressure and whether pressed of the contact nodes; see `PairGaps.nodal`."""
        own = self.count
        one = self.first.nodal(force[:own], gap[:own])
        two = self.second.nodal(force[own:], gap[own:])
        return np.fmin(one[0], two[0]), one[1] + two[1], np.maximum(one[2], two[2])

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs to know of the first ones."""
        return self.first.memory()

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self.first.remember(memory)
