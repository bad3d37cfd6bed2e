"""Where two convex bodies touch: the direction that separates them most, and places on both sides.

A body is what lies within a radius of a core: a point, a line, a polygon or a polyhedron. The
separation of two cores along a unit vector n, from the other one to the first,

    s(n) = min n . a - max n . b,

is largest along a face normal, across two edges, or along the way between closest features; the
largest one is their distance, or the least depth if they overlap (S. Gottschalk, M. C. Lin,
D. Manocha, SIGGRAPH 1996, for boxes). Where a face decides, the face of the other body that looks
at it most is clipped at the planes around it (I. Sutherland, G. Hodgman, Comm. ACM 17 (1974) 32-42)
and its corners are the contact points, in the plane the ends of an edge. So faces that meet touch
at all corners of what they share. Everything is in space: polygons in a plane have edges for faces.
"""

import numpy as np

from impactfem.compiled import compiled

_ALIKE = 1e-9  # share of the size by which separations, or planes, do not differ
_MERGED = 1e-6  # the same for contact points
_BETTER = 0.02  # share of a depth by which edges have to beat faces: they touch at one point only
_LEVEL = 0.02  # sine of the angle below which edges are parallel, or lie across a direction
_PARALLEL = 1e-6  # the same below which their cross product says nothing
_ITERATES, _ROUNDED = 30, 1e-9  # for a rotation; a change whose square is below rounding
_MOST = 64  # corners of a clipped face


@compiled
def _apart(n, va, vb):
    """Separation of two sets of corners along a direction [m]."""
    least, most = np.inf, -np.inf
    for v in va:
        least = min(least, n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
    for v in vb:
        most = max(most, n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
    return least - most


@compiled
def separate(a, b, hint, size):
    """The direction that separates two cores most.

    Args:
        a, b: Corners (corners, 3), outward normals of faces (faces, 3), which of them are flat,
            starts of their loops and the corners of these, edges (edges, 2), their directions
            (ways, 3), radius [m]; all in space.
        hint: A direction that is looked at besides, (3,); zero: none.
        size: Of the bodies [m].

    Returns:
        The direction, from b to a; 0 and the face of a that it belongs to, 1 and that of b, or 2
        and nothing.
    """
    va, na, fa, _, _, ea, wa, ra = a
    vb, nb, fb, _, _, eb, wb, rb = b
    best, kind, index = -np.inf, 2, 0
    found = np.array([0.0, 1.0, 0.0])
    for k in range(len(na)):
        if fa[k]:
            s = _apart(-na[k], va, vb)
            if s > best + _ALIKE * size:
                best, kind, index, found = s, 0, k, -na[k]
    for k in range(len(nb)):
        if fb[k]:
            s = _apart(nb[k], va, vb)
            if s > best + _ALIKE * size:
                best, kind, index, found = s, 1, k, nb[k].copy()
    over = -np.inf
    if best > -np.inf:
        over = best + _ALIKE * size + _BETTER * max(0.0, -best)
    for one in wa:
        for two in wb:
            n = np.cross(one, two)
            length = np.sqrt(n @ n)
            if length > _PARALLEL:
                n = n / length
                for sign in (1.0, -1.0):
                    s = _apart(sign * n, va, vb)
                    if s > over:
                        over, kind, found = s, 2, sign * n
    if np.abs(hint).max() > 0.0:
        s = _apart(hint, va, vb)
        if s > over:
            over, kind, found = s, 2, hint.copy()
    if ra + rb > 0.0:
        for one in va:
            for two in vb:
                over, kind, found = _along(one - two, va, vb, over, kind, found, size)
        for one in va:
            for edge in eb:
                foot = _foot(one, vb[edge[0]], vb[edge[1]])
                over, kind, found = _along(one - foot, va, vb, over, kind, found, size)
        for two in vb:
            for edge in ea:
                foot = _foot(two, va[edge[0]], va[edge[1]])
                over, kind, found = _along(foot - two, va, vb, over, kind, found, size)
    return found, kind, index


@compiled
def _along(way, va, vb, over, kind, found, size):
    """Take a way between features if it separates more."""
    length = np.sqrt(way @ way)
    if length > _ALIKE * size:
        n = way / length
        s = _apart(n, va, vb)
        if s > over + _ALIKE * size:
            return s, 2, n
    return over, kind, found


@compiled
def _foot(point, start, end):
    """Closest place on a line between two ends to a point."""
    way = end - start
    share = (point - start) @ way / max(way @ way, 1e-300)
    return start + min(1.0, max(0.0, share)) * way


@compiled
def touching(a, b, n, kind, index, size, slots):
    """Places where two cores are nearest to each other, across a direction from `separate`.

    Args:
        a, b: See there, and so are the others.
        n: See there.
        kind: See there.
        index: See there.
        size: See there.
        slots: Number of places at most.

    Returns:
        Places on a and on b [m], (slots, 3) each, of which the difference is along n but for
        edges, and how many there are.
    """
    one, two = np.zeros((_MOST, 3)), np.zeros((_MOST, 3))
    count = 0
    if kind == 0:
        ref, loop = _face(a, index), _facing(b, n)
        count = _clipped(ref, -n, loop, one, size)
        for k in range(count):
            two[k] = one[k]
            one[k] = two[k] + n * (n @ (ref[0] - two[k]))
    elif kind == 1:
        ref, loop = _face(b, index), _facing(a, -n)
        count = _clipped(ref, n, loop, one, size)
        for k in range(count):
            two[k] = one[k] - n * (n @ (one[k] - ref[0]))
    if count == 0:
        count = _edges(a, b, n, one, two, size)
    return _fewer(one, two, n, count, size, slots)


@compiled
def _face(body, index):
    """Corners of a face, (corners, 3)."""
    vertices, _, _, starts, loop, _, _, _ = body
    return vertices[loop[starts[index] : starts[index + 1]]]


@compiled
def _facing(body, n):
    """Corners of the face that looks along a direction most; the core itself if it has none."""
    vertices, normals = body[0], body[1]
    if not len(normals):
        return vertices.copy()
    best, index = -np.inf, 0
    for k in range(len(normals)):
        s = normals[k] @ n
        if s > best + _ALIKE:
            best, index = s, k
    return _face(body, index)


@compiled
def _clipped(ref, normal, loop, out, size):
    """Cut a face, a line or a point at the planes around another face or at the ends of a line.

    Args:
        ref: The other one's corners, around its outward normal.
        normal: That normal.
        loop: What is cut, (corners, 3).
        out: Takes the corners that are left.
        size: Of the bodies.

    Returns:
        How many are left.
    """
    work = np.zeros((_MOST, 3))
    count, sides = len(loop), len(ref)
    out[:count] = loop
    for k in range(sides):
        if sides > 2:
            inwards = np.cross(normal, ref[(k + 1) % sides] - ref[k])
        elif sides == 2:
            inwards = ref[1 - k] - ref[k]
        else:
            return count
        inwards = inwards / np.sqrt(inwards @ inwards)
        last = 0
        for i in range(count):
            here, there = out[i], out[(i + 1) % count]
            s, t = inwards @ (here - ref[k]), inwards @ (there - ref[k])
            inside, next_inside = s >= -_ALIKE * size, t >= -_ALIKE * size
            if inside:
                work[last] = here
                last += 1
            # A line has no way back from its end.
            if inside != next_inside and (count > 2 or i == 0) and last < _MOST:
                work[last] = here + s / (s - t) * (there - here)
                last += 1
        # What is left of a line stays one: its cut comes after what is inside, or before.
        count = last
        out[:count] = work[:count]
        if count == 0:
            break
    return count


@compiled
def _low_edge(vertices, edges, n):
    """The edge, or the corner twice, that lies lowest along a direction."""
    heights = vertices @ n
    low = int(np.argmin(heights))
    start, end, best = low, low, _LEVEL
    for k in range(len(edges)):
        i, j = edges[k]
        way = vertices[j] - vertices[i]
        length = np.sqrt(way @ way)
        rise = (max(heights[i], heights[j]) - heights[low]) / max(length, 1e-300)
        if rise < best - _ALIKE:
            start, end, best = i, j, rise
    return vertices[start], vertices[end]


@compiled
def _edges(a, b, n, one, two, size):
    """Places of the lowest edge or corner of a and of the highest of b; how many."""
    p0, p1 = _low_edge(a[0], a[5], n)
    q0, q1 = _low_edge(b[0], b[5], -n)
    way, other = p1 - p0, q1 - q0
    long, wide = np.sqrt(way @ way), np.sqrt(other @ other)
    if long > 0.0 and wide > 0.0:
        across = np.cross(way, other)
        if np.sqrt(across @ across) <= _LEVEL * long * wide:
            ends, line = np.empty((2, 3)), np.empty((2, 3))
            ends[0], ends[1], line[0], line[1] = q0, q1, p0, p1
            count = _clipped(ends, n, line, one, size)
            for k in range(count):
                two[k] = q0 + other * ((one[k] - q0) @ other) / (other @ other)
            if count:
                return count
    one[0], two[0] = _closest(p0, way, q0, other)
    return 1


@compiled
def _closest(p, u, q, v):
    """Closest places of the lines p + s u and q + t v, s and t from 0 to 1."""
    w, uu, vv, uv = p - q, u @ u, v @ v, u @ v
    uw, vw = u @ w, v @ w
    s = t = 0.0
    if uu > 0.0 and vv > 0.0:
        det = uu * vv - uv * uv
        s = min(1.0, max(0.0, (uv * vw - vv * uw) / det)) if det > 0.0 else 0.0
        t = (uv * s + vw) / vv
        if not 0.0 <= t <= 1.0:
            t = min(1.0, max(0.0, t))
            s = min(1.0, max(0.0, (uv * t - uw) / uu))
    elif uu > 0.0:
        s = min(1.0, max(0.0, -uw / uu))
    elif vv > 0.0:
        t = min(1.0, max(0.0, vw / vv))
    return p + s * u, q + t * v


@compiled
def _fewer(one, two, n, count, size, slots):
    """Places without what lies together, the deepest and what is farthest from it if too many."""
    kept = 0
    for k in range(count):
        alone = True
        for j in range(kept):
            way = one[k] - one[j]
            alone &= way @ way > (_MERGED * size) ** 2
        if alone:
            one[kept], two[kept] = one[k], two[k]
            kept += 1
    if kept <= slots:
        return one[:slots], two[:slots], kept
    chosen = np.zeros(slots, dtype=np.int64)
    away = np.full(kept, np.inf)
    depth = np.empty(kept)
    for k in range(kept):
        depth[k] = n @ (one[k] - two[k])
    following = int(np.argmin(depth))
    for j in range(slots):
        chosen[j] = following
        for k in range(kept):
            way = one[k] - one[following]
            away[k] = min(away[k], way @ way)
        following = int(np.argmax(away))
    chosen = np.sort(chosen)
    return one[chosen], two[chosen], slots


@compiled
def inverted(matrix):
    """The inverse of a matrix (3, 3), by its cofactors."""
    found, volume = np.empty((3, 3)), 0.0
    for i in range(3):
        a, b = matrix[(i + 1) % 3], matrix[(i + 2) % 3]
        for j in range(3):
            found[j, i] = a[(j + 1) % 3] * b[(j + 2) % 3] - a[(j + 2) % 3] * b[(j + 1) % 3]
            volume += matrix[i, j] * found[j, i] / 3.0
    return found / volume


@compiled
def nearest_rotation(axes):
    """The rotation closest to three axes (3, 3) that hardly differ from one: their polar factor.

    Means of a matrix and its inverse transpose converge as Newton's method does (N. J. Higham,
    SIAM J. Sci. Stat. Comput. 7 (1986) 1160-1174).
    """
    found = axes.copy()
    for _ in range(_ITERATES):
        after = 0.5 * (found + inverted(found).T)
        change = np.abs(after - found).max()
        found = after
        if not change > _ROUNDED:
            break
    return found
