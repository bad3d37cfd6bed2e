"""How two surfaces, or nodes and a surface, meet, and what finds it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers


class Turning(NamedTuple):
    """How directions of gaps turn.

    Attributes:
        patch: Weights, >= 0, of nodes whose turning turns the directions, (pairs, nodes); None
            where they stay, as obstacles take any moment.
        beyond: What of the ways between the pushed places weights do not tell [m], (pairs, dim).
    """

    patch: csr_matrix | None
    beyond: Floats | float = 0.0


class Edges(NamedTuple):
    """Lines that others may cross.

    Attributes:
        curves: Coefficients of 1, s, s^2, s^3 of their places [m], s from 0 to 1, (edges, 4, 3).
        radius: Around them [m], (edges,).
        corners: Which node or corner each end is, -1: none, (edges, 2).
        normals: Outward ones of the faces that meet at them, the first one of the face that lies
            to the left seen from outside; 0 if there are none, (edges, 2, 3).
        deep: What lies farther behind them is on another side [m].
    """

    curves: Floats
    radius: Floats
    corners: Integers
    normals: Floats
    deep: float = 0.0


@dataclass(frozen=True)
class Meeting:
    """Weighted gaps between two surfaces at given places.

    Attributes:
        weights: W over all contact nodes, carrier minus other, shape (pairs, nodes).
        gap: Weighted gaps [m], shape (pairs,).
        normal: Unit normals towards the carrier, shape (pairs, dim).
        area: Areas of the multipliers [m^2], shape (pairs,).
        turning: Tells how directions turn amid a step, which only bodies that turn ask for; None
            where forces act along the way between both sides, and so have no moment.
    """

    weights: csr_matrix
    gap: Floats
    normal: Floats
    area: Floats
    turning: Callable[[], Turning] | None = None


NOTHING: Floats = np.zeros(0)
"""Memory of what depends on no earlier answer."""


class Meet(Protocol):
    """Finds how two surfaces meet.

    Attributes:
        follows: Whether the answer is found anew in each layer.
    """

    @property
    def follows(self) -> bool:
        """See above."""

    @property
    def memory(self) -> Floats:
        """What of earlier answers the next one depends on, always as many numbers, (numbers,)."""

    def recall(self, memory: Floats) -> None:
        """Go on from what `memory` was."""

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with the contact nodes at some places, forces acting at others [m]."""


class Anew:
    """A `Meet` that looks anew each time, and depends on no earlier answer."""

    follows = True
    memory = NOTHING

    def recall(self, memory: Floats) -> None:
        """Nothing."""


class NodeMeet(Meet, Protocol):
    """Finds how nodes of bodies without meshes meet others.

    Attributes:
        count: Number of gaps.
        thickness: What a body must not move in a step [m]; infinite if nothing can pass.
        nodes: Places of all nodes of both sides among all contact nodes.
        touch: How much smaller than distances gaps are, so that rounding opens none [m].
    """

    @property
    def count(self) -> int:
        """See above."""

    @property
    def thickness(self) -> float:
        """See above."""

    @property
    def touch(self) -> float:
        """See above."""

    @property
    def nodes(self) -> Integers:
        """See above."""


@runtime_checkable
class Led(Protocol):
    """Also knows the time, as an obstacle that it meets moves or turns.

    Attributes:
        speed: Largest one of what gaps faced on it so far [m/s].
    """

    speed: float

    def tell(self, time: float, acting: float) -> None:
        """At which times the next answer's places are, and forces act [s]."""

    def shift(self, time: float) -> Floats:
        """How far what each gap faces has moved with the obstacle since t = 0 [m], (gaps, dim)."""


@runtime_checkable
class Lent(Protocol):
    """Has fewer gaps than pairs, and lends each to a pair while that is near.

    Attributes:
        held: Which pair has each gap, -1: none, (gaps,).
        pairs: Their number.
    """

    held: Integers
    pairs: int


def patch_of(weights: csr_matrix, nodes: Integers) -> csr_matrix:
    """Weights 1 of those of some nodes that gaps weigh, be it by 0."""
    found = weights.copy()
    found.data = np.isin(found.indices, nodes).astype(float)
    found.eliminate_zeros()
    return found


def weights_on(values: Floats, nodes: Integers, total: int) -> csr_matrix:
    """Weights of all contact nodes in gaps of as many nodes each, (gaps, total).

    Args:
        values: (gaps, k).
        nodes: Places of the nodes among all, (k,) or (gaps, k).
        total: Number of all contact nodes.
    """
    count, width = values.shape
    columns, ends = np.broadcast_to(nodes, values.shape), width * np.arange(count + 1)
    return csr_matrix((values.ravel(), columns.ravel(), ends), shape=(count, total))
