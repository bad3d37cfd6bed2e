"""Compiled searches in a tree of triangles: what is nearest to a point, and what crosses.

The tree is `impactfem.scene.closed_surface.Tree`: boxes of all triangles below each node, the
children of node k are 2 k + 1 and 2 k + 2, leaves hold runs of the sorted triangles.
"""

import numpy as np

from impactfem.compiled import compiled

_EDGES = 1e-9  # share of a weight by which a nearest point counts as on an edge or corner
_ALIKE = 0.9  # cosine between directions from which two faces look the same way
_BACK = 0.5  # cosine between directions from which a face is the back of another
_DEEP = 0.1  # share of a triangle's size by which a point may lie behind it and still touch it
_ASIDE = 1e-9  # share of a triangle's size that is rounding


@compiled
def _nearest_on(point, a, b, c):  # noqa: PLR0911  (one for each of its parts)
    """Weights of the corners a, b, c of a triangle in its point that is nearest to a point.

    Source: Ericson, Real-time collision detection (2005), section 5.1.5.
    """
    ab, ac, ap = b - a, c - a, point - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    bp = point - b
    d3, d4 = np.dot(ab, bp), np.dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
        return 1.0 - v, v, 0.0
    cp = point - c
    d5, d6 = np.dot(ab, cp), np.dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
        return 1.0 - w, 0.0, w
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - w, w
    total = va + vb + vc
    return va / total, vb / total, vc / total


@compiled
def _box_distance(point, low, high):
    """Square of the distance of a point from a box."""
    total = 0.0
    for axis in range(3):
        away = max(low[axis] - point[axis], 0.0, point[axis] - high[axis])
        total += away * away
    return total


@compiled
def nearest_faces(points, corners, order, low, high, starts, known, below, found, feature, place):
    """Nearest triangle of each point, and where on it.

    With normals that are known already it is the nearest one that looks elsewhere and has the foot
    of the point. That lies before it, or little behind where it is inside the surface anyway. -1 if
    there is none.

    Args:
        points: Places, shape (points, 3).
        corners: Of the triangles, shape (triangles, 3, 3).
        order: Triangles as the leaves hold them, shape (triangles,).
        low, high: Boxes of the tree's nodes, shape (nodes, 3) each.
        starts: First place in ``order`` of each node's triangles and the one behind the last, shape
            (nodes, 2).
        known: Normals that are known, shape (points, 3); 0 to take the nearest of all.
        below: Whether points are inside, shape (points,); with normals that are known.
        found: Gets the triangle of each point, shape (points,).
        feature: Gets where on it: 0 its inside, 1 to 3 the edge from that corner to the next, 4 to
            6 the corner, shape (points,).
        place: Gets the nearest point, shape (points, 3).
    """
    nodes = len(starts)
    stack = np.empty(128, dtype=np.int64)
    for k in range(len(points)):
        point, best, filled = points[k], np.inf, 1
        stack[0], found[k] = 0, -1
        other = np.dot(known[k], known[k]) > 0.0
        while filled:
            filled -= 1
            node = stack[filled]
            if _box_distance(point, low[node], high[node]) >= best:
                continue
            left = 2 * node + 1
            if left >= nodes:
                for at in range(starts[node, 0], starts[node, 1]):
                    one = corners[order[at]]
                    u, v, w = _nearest_on(point, one[0], one[1], one[2])
                    near = u * one[0] + v * one[1] + w * one[2]
                    away = point - near
                    size = np.dot(away, away)
                    if size < best:
                        if other:
                            normal = np.cross(one[1] - one[0], one[2] - one[0])
                            area = np.sqrt(np.dot(normal, normal))
                            normal /= area
                            height = np.dot(away, normal)
                            beside = np.sqrt(max(0.0, size - height * height))
                            if beside > _ASIDE * np.sqrt(area) or np.dot(normal, known[k]) > _ALIKE:
                                continue
                            if height < 0.0 and (
                                height < -_DEEP * np.sqrt(area)
                                or not below[k]
                                or np.dot(normal, known[k]) < -_BACK
                            ):
                                continue
                        best = size
                        found[k] = order[at]
                        place[k] = near
                        zero_u, zero_v, zero_w = u <= _EDGES, v <= _EDGES, w <= _EDGES
                        if zero_v and zero_w:
                            feature[k] = 4
                        elif zero_u and zero_w:
                            feature[k] = 5
                        elif zero_u and zero_v:
                            feature[k] = 6
                        elif zero_w:
                            feature[k] = 1
                        elif zero_u:
                            feature[k] = 2
                        elif zero_v:
                            feature[k] = 3
                        else:
                            feature[k] = 0
                continue
            first = _box_distance(point, low[left], high[left])
            second = _box_distance(point, low[left + 1], high[left + 1])
            if first <= second:
                stack[filled], stack[filled + 1] = left + 1, left
            else:
                stack[filled], stack[filled + 1] = left, left + 1
            filled += 2


@compiled
def triangles_in(least, most, order, low, high, starts):
    """Triangles whose boxes meet a box; the tree as above."""
    nodes, stack = len(starts), np.empty(128, dtype=np.int64)
    found, count, filled = np.empty(16, dtype=np.int64), 0, 1
    stack[0] = 0
    while filled:
        filled -= 1
        node = stack[filled]
        apart = False
        for axis in range(3):
            apart |= least[axis] > high[node, axis] or most[axis] < low[node, axis]
        if apart:
            continue
        left = 2 * node + 1
        if left < nodes:
            stack[filled], stack[filled + 1] = left, left + 1
            filled += 2
            continue
        for at in range(starts[node, 0], starts[node, 1]):
            if count == len(found):
                more = np.empty(2 * count, dtype=np.int64)
                more[:count] = found
                found = more
            found[count] = order[at]
            count += 1
    return found[:count]


@compiled
def crossing(edges, points, triangles, corners, order, low, high, starts):
    """First edge that passes through a triangle with which it shares no corner.

    Args:
        edges: Corners of the edges, shape (edges, 2).
        points: Places of the corners, shape (corners, 3).
        triangles: Corners of the triangles, shape (triangles, 3).
        corners: Their places, shape (triangles, 3, 3).
        order, low, high, starts: The tree; see `nearest_faces`.

    Returns:
        Number of the edge, and of the triangle; -1, -1 if there is none.
    """
    for k in range(len(edges)):
        i, j = edges[k]
        start, end = points[i], points[j]
        way = end - start
        least, most = np.minimum(start, end), np.maximum(start, end)
        for number in triangles_in(least, most, order, low, high, starts):
            shares = False
            for corner in triangles[number]:
                shares |= corner in (i, j)
            if shares:
                continue
            # Moeller and Trumbore, J. Graphics Tools 2 (1997) 21-28.
            one = corners[number]
            first, second = one[1] - one[0], one[2] - one[0]
            across = np.cross(way, second)
            det = np.dot(first, across)
            if det == 0.0:
                continue
            arm = start - one[0]
            u = np.dot(arm, across) / det
            other = np.cross(arm, first)
            v = np.dot(way, other) / det
            t = np.dot(second, other) / det
            if min(u, v, 1.0 - u - v) > _ASIDE and _ASIDE < t < 1.0 - _ASIDE:
                return k, number
    return -1, -1
