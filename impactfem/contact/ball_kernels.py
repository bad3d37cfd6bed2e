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


@compiled
def near_among(some, ends, room, near, places):
    """Those of some pairs in rising order that are near, (near,); else as of `near_of`."""
    found, count = np.empty(len(some), dtype=np.int64), 0
    for k in some:
        i, j = ends[k]
        apart = 0.0
        for c in range(places.shape[1]):
            apart += (places[i, c] - places[j, c]) ** 2
        reach = room[k] + near[k]
        if apart <= reach * reach:
            found[count] = k
            count += 1
    return found[:count].copy()


@compiled
def reached(points, thick, farther, places, simplices):
    """Simplices that may be closest to balls, and all that share a corner with one of these.

    Args:
        points: Centres of the balls [m], (balls, dim).
        thick: Least distance that is looked at from each [m], (balls,).
        farther: Times the distance of the closest one, others that are looked at.
        places: Of all contact nodes [m], (nodes, dim).
        simplices: Corners among these, (simplices, corners).

    Returns:
        Distances up to which none is missing [m], (balls,), and which these are, (simplices,).
    """
    count, corners = simplices.shape
    dim = points.shape[1]
    middle, around = np.zeros((count, dim)), np.zeros(count)
    for s in range(count):
        for c in range(dim):
            for k in range(corners):
                middle[s, c] += places[simplices[s, k], c] / corners
        for k in range(corners):
            square = 0.0
            for c in range(dim):
                square += (places[simplices[s, k], c] - middle[s, c]) ** 2
            around[s] = max(around[s], square)
        around[s] = np.sqrt(around[s])
    reach = np.empty(len(points))
    away = np.empty(count)
    touched = np.zeros(len(places), dtype=np.bool_)
    for p in range(len(points)):
        least = np.inf
        for s in range(count):
            square = 0.0
            for c in range(dim):
                square += (points[p, c] - middle[s, c]) ** 2
            away[s] = np.sqrt(square)
            least = min(least, away[s] + around[s])
        reach[p] = farther * max(least, thick[p])
        for s in range(count):
            if away[s] - around[s] <= reach[p]:
                for k in range(corners):
                    touched[simplices[s, k]] = True
    chosen = np.zeros(count, dtype=np.bool_)
    for s in range(count):
        for k in range(corners):
            chosen[s] = chosen[s] or touched[simplices[s, k]]
    return reach, chosen


@compiled
def ranked(nodes, gap):
    """How many pairs of a ball are closer than each one, (pairs, 2).

    Args:
        nodes: First nodes of both balls, (pairs, 2).
        gap: Of the pairs [m].
    """
    found = np.empty(nodes.shape, dtype=np.int64)
    seen = np.zeros(nodes.max() + 1 if len(nodes) else 1, dtype=np.int64)
    for j in np.argsort(gap, kind="mergesort"):
        for k in range(2):
            found[j, k] = seen[nodes[j, k]]
            seen[nodes[j, k]] += 1
    return found
