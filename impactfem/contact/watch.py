"""A check at run time: nodes that were expected not to meet an obstacle."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.distance import signed_distance
from impactfem.contact.surfaces import ContactNodes


@dataclass(frozen=True)
class Penetration:
    """The deepest penetration of something that carries no contact unknown for it.

    Attributes:
        depth: [m], > 0.
        number: Canonical number of the node.
        obstacle: Index of the obstacle.
        place: Where the node is [m], shape (dim,).
    """

    depth: float
    number: int
    obstacle: int
    place: tuple[float, ...]


def penetration_of_others(
    comm: Any,
    contact: ContactNodes,
    obstacles: Sequence[Any],
    numbers: Integers,
    places: Floats,
    time: float,
) -> Penetration | None:
    """Find how deep nodes are in obstacles that they were expected not to meet (collective).

    Looked at are the nodes of the outside without contact unknowns, and contact nodes against the
    obstacles that they are not held off.

    Args:
        comm: MPI communicator.
        contact: The contact nodes.
        obstacles: As for `contact_nodes`.
        numbers: Canonical numbers of the nodes this rank owns, shape (owned nodes,).
        places: Where they are at ``time`` [m], shape (owned nodes, dim).
        time: [s].

    Returns:
        The deepest, on every rank; None if there is none.
    """
    deepest: Penetration | None = None
    for k, obstacle in enumerate(obstacles):
        other = contact.nodes[contact.obstacle[contact.rows] != k]
        nodes = np.concatenate([contact.watched, other])
        if not len(nodes):
            continue
        gap, _ = signed_distance(obstacle, places[nodes], time)
        at = int(np.argmin(gap))
        if gap[at] < -(deepest.depth if deepest else 0.0):
            node = nodes[at]
            where = tuple(float(value) for value in places[node])
            deepest = Penetration(-float(gap[at]), int(numbers[node]), k, where)
    found = [one for one in comm.allgather(deepest) if one is not None]
    return max(found, key=lambda one: (one.depth, -one.number), default=None)
