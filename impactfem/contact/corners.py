"""Nodes that reach several obstacles at once, as in a corner: which of them they can touch.

A node has a gap to each of its obstacles. But the surface of one may lie in another: where two
blocks of a floor meet, each has a side in the other's, which would stop what slides over the seam.
Such a gap is carried by that of the other one there: what pressed on the one presses on the other
as soon as the node has passed from one to the next.

Whether it is so: a node that is lifted off one obstacle by a little has its nearest point on the
other one above the first one's surface, if that rises from it as a wall does; on or below it, if
both are flush. Lifted, it also sees the face that the other one shows: at the foot of a wall the
nearest way out of a floor that ends there may lead into the wall.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.distance import signed_distance

_NEAR = 0.25  # of the size of the body: gaps that are looked at
_LIFTS = (1e-5, 1e-3, 0.03)  # of it; the larger ones where iterates lie deep
_RISES = 1e-3  # of what the node is lifted: sides that rise at 2 degrees do
_ALIKE = 0.999  # cosine between normals that are one to a node: 2.6 degrees
_OTHER = 0.9  # between those of two faces of an obstacle


def several_gaps(
    obstacles: Sequence[Any],
    own: Integers,
    node: Integers,
    places: Floats,
    size: float,
    time: float,
) -> tuple[Integers, Floats, Floats]:
    """Which gap of the same node takes each one's place, distances [m] and normals.

    Args:
        obstacles: The obstacles.
        own: That of each gap, (gaps,).
        node: That of each gap, (gaps,).
        places: Of the nodes, by gaps [m], (gaps, dim).
        size: Of the body [m].
        time: [s].

    Returns:
        Itself where a gap can close, else that of what is in its way there, (gaps,); distances
        (gaps,) and normals (gaps, dim), each of the own obstacle.
    """
    gap, normal = np.empty(len(places)), np.empty_like(places)
    for k, obstacle in enumerate(obstacles):
        mine = own == k
        gap[mine], normal[mine] = signed_distance(obstacle, places[mine], time)
    carrier = np.arange(len(gap))
    near = np.flatnonzero(gap < _NEAR * size)
    near = near[np.bincount(node[near], minlength=1)[node[near]] > 1]
    if not len(near):
        return carrier, gap, normal
    table = np.full((len(obstacles), int(node[near].max()) + 1), -1)
    table[own[near], node[near]] = near
    pairs = [
        (k, j, table[k, both], table[j, both])
        for k in range(len(obstacles))
        for j in range(len(obstacles))
        if k != j and len(both := np.flatnonzero((table[k] >= 0) & (table[j] >= 0)))
    ]
    rises, shows = {}, {}
    seen, shown = gap.copy(), normal.copy()
    for k, j, rows, others in pairs:
        rises[k, j], shows[k, j] = np.zeros((2, len(rows)), dtype=bool)
        for height in _LIFTS:
            left = np.flatnonzero(~rises[k, j])
            if not len(left):
                break
            row, other = rows[left], others[left]
            up, lift = normal[other], np.maximum(height * size - gap[other], 0.0)
            lifted = places[row] + lift[:, None] * up
            way, face = signed_distance(obstacles[k], lifted, time)
            above, _ = signed_distance(obstacles[j], lifted - way[:, None] * face, time)
            found = above > _RISES * (gap[other] + lift)
            turned = found & (np.einsum("ij,ij->i", face, normal[row]) < _OTHER)
            rises[k, j][left], shows[k, j][left] = found, turned
            seen[row[turned]] = (way - lift * np.einsum("ij,ij->i", up, face))[turned]
            shown[row[turned]] = face[turned]
    raw = gap
    gap, normal = seen, shown
    in_way = np.full(len(gap), np.inf)
    for k, j, rows, others in pairs:
        nearer = raw[others] < raw[rows] if k < j else raw[others] <= raw[rows]
        alike = np.einsum("ij,ij->i", normal[rows], normal[others]) > _ALIKE
        hidden = nearer & (alike | ~(rises[k, j] | shows[j, k])) & (raw[others] < in_way[rows])
        carrier[rows[hidden]], in_way[rows[hidden]] = others[hidden], raw[others[hidden]]
    for _ in obstacles:  # what carries may be carried itself
        carrier = carrier[carrier]
    return carrier, gap, normal
