"""Compiled gaps of many pairs of balls."""

import numpy as np

from impactfem.compiled import compiled


@compiled
def gaps_of(ends, room, places, acting):
    """Gaps of pairs of balls at some places, and their directions at others, to the first one.

    Args:
        ends: Both balls of each pair, (pairs, 2).
        room: Sum of their radii [m], (pairs,).
        places, acting: Of all balls [m], (nodes, dim).

    Returns:
        Shapes (pairs,) and (pairs, dim).
    """
    count, dim = len(ends), places.shape[1]
    gap, normal = np.empty(count), np.empty((count, dim))
    for k in range(count):
        i, j = ends[k]
        length, apart = 0.0, 0.0
        for c in range(dim):
            way = acting[i, c] - acting[j, c]
            normal[k, c] = way
            apart += way * way
            length += (places[i, c] - places[j, c]) ** 2
        gap[k] = np.sqrt(length) - room[k]
        apart = max(np.sqrt(apart), 1e-300)
        for c in range(dim):
            normal[k, c] /= apart
    return gap, normal


@compiled
def near_of(ends, room, near, places):
    """Pairs of balls that are near, in rising order; where none is the nearest one.

    Args:
        ends, room, places: See `gaps_of`.
        near: Gap up to which a pair is near [m], (pairs,).

    Returns:
        Their numbers, (near,).
    """
    found, count = np.empty(len(ends), dtype=np.int64), 0
    nearest, least = 0, np.inf
    for k in range(len(ends)):
        i, j = ends[k]
        apart = 0.0
        for c in range(places.shape[1]):
            apart += (places[i, c] - places[j, c]) ** 2
        reach = room[k] + near[k]
        if apart <= reach * reach:
            found[count] = k
            count += 1
        elif not count and apart < (least + room[k]) ** 2:
            nearest, least = k, np.sqrt(apart) - room[k]
    if not count:
        found[0], count = nearest, 1
    return found[:count].copy()
