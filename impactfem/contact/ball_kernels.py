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
def plane_gaps(nodes, rows, points, normals, radius, places, displacement, gap, normal):
    """Gaps of balls to planes at rest and their directions, written in some rows of all.

    Args:
        nodes, rows: Of each gap, (gaps,).
        points, normals: Of its plane, (gaps, dim).
        radius: Of its ball [m], (gaps,).
        places, displacement: Of all nodes [m], (nodes, dim).
        gap, normal: Of all gaps, (all,) and (all, dim).
    """
    for i in range(len(rows)):
        k, total = nodes[i], 0.0
        for c in range(places.shape[1]):
            way = places[k, c] + displacement[k, c] - points[i, c]
            total += way * normals[i, c]
            normal[rows[i], c] = normals[i, c]
        gap[rows[i]] = total - radius[i]


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
def shared_nodes(ends, shared, gap):
    """Nodes of pairs, of balls that share some a node each, the closest pairs the first.

    Args:
        ends, shared: As of `impactfem.contact.ball_crowd.BallCrowd`, of these pairs.
        gap: Of them [m].

    Returns:
        (pairs, 2), and the most that a ball has shared where these are not enough, else 0.
    """
    found = ends.copy()
    seen = np.zeros(ends.max() + 1 if len(ends) else 1, dtype=np.int64)
    for j in np.argsort(gap, kind="mergesort"):
        for k in range(2):
            rank, most = seen[ends[j, k]], shared[j, k]
            seen[ends[j, k]] += 1
            if 0 < most <= rank:
                return found, most
            found[j, k] += rank if most else 0
    return found, 0


@compiled
def lent(near, before):
    """Which pairs have gaps: those that are near, in rising order, and have some already keep them.

    Others get free gaps; such as are given back now only where there are no more.

    Args:
        near: Pairs that are near, rising, (near,).
        before: Pair of each gap, -1: none, (gaps,).

    Returns:
        Pair of each gap, place of each among those near, -1: none, (gaps,), and whether there are
        enough.
    """
    found, places = np.full(len(before), -1), np.full(len(before), -1)
    known = np.zeros(len(near), dtype=np.bool_)
    at = np.searchsorted(near, before)
    for g in range(len(before)):
        if before[g] >= 0 and at[g] < len(near) and near[at[g]] == before[g]:
            found[g], places[g], known[at[g]] = before[g], at[g], True
    new, count = np.flatnonzero(~known), 0
    for turn in range(2):
        for g in range(len(before)):
            if count < len(new) and found[g] < 0 and (before[g] < 0) == (turn == 0):
                found[g], places[g] = near[new[count]], new[count]
                count += 1
    return found, places, count == len(new)


@compiled
def lent_gaps(near, before, ends, room, shared, places, acting, far):
    """Gaps that are lent to pairs of balls.

    Args:
        near, before: As of `lent`.
        ends, room, shared: Of all pairs, as `impactfem.contact.ball_crowd.BallCrowd` has them.
        places, acting: As of `gaps_of`.
        far: Gap of what is lent to nobody [m].

    Returns:
        What `lent` tells but for places; gaps (gaps,), directions (gaps, dim) and what they weigh
        of nodes, as ends of rows, columns and values; what `shared_nodes` says besides nodes.
    """
    own = ends[near]
    away, ways = gaps_of(own, room[near], places, acting)
    nodes, most = shared_nodes(own, shared[near], away)
    now, at, enough = lent(near, before)
    count, dim = len(before), places.shape[1]
    gap, normal = np.full(count, far), np.zeros((count, dim))
    stops, columns = np.zeros(count + 1, dtype=np.int32), np.empty(2 * len(near), dtype=np.int32)
    values, last = np.empty(2 * len(near)), 0
    for g in range(count):
        normal[g, dim - 1] = 1.0
        if at[g] >= 0:
            gap[g], normal[g] = away[at[g]], ways[at[g]]
            columns[last], columns[last + 1] = nodes[at[g], 0], nodes[at[g], 1]
            values[last], values[last + 1] = 1.0, -1.0
            last += 2
        stops[g + 1] = last
    return now, enough, gap, normal, (stops, columns[:last], values[:last]), most


@compiled
def fastest_of(velocities, apart):
    """Speed with which nodes of some velocities (nodes, dim) may near each other [m/s].

    Args:
        velocities: [m/s].
        apart: Whether that is also not more than twice that from what is amid all.
    """
    count, dim = velocities.shape
    low, high = velocities[0].copy(), velocities[0].copy()
    for i in range(count):
        for c in range(dim):
            low[c], high[c] = min(low[c], velocities[i, c]), max(high[c], velocities[i, c])
    fast, away = 0.0, 0.0
    for i in range(count):
        one, two = 0.0, 0.0
        for c in range(dim):
            one += velocities[i, c] ** 2
            two += (velocities[i, c] - 0.5 * (low[c] + high[c])) ** 2
        fast, away = max(fast, one), max(away, two)
    return min(np.sqrt(fast), 2.0 * np.sqrt(away)) if apart else np.sqrt(fast)
