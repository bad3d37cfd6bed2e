"""Compiled loops of the mortar overlaps in the plane; see `contact.mortar_lines`."""

from typing import NamedTuple

import numpy as np

from impactfem.arrays import Floats
from impactfem.compiled import compiled

_FLAT = 1e-12  # share of its trace below which a patch's J tells no spin


@compiled
def line(r, values, slopes):
    """Shape functions of a line at a place on [0, 1] and their slopes, (2 or 3,) each; written."""
    if len(values) == 2:
        values[0], values[1], slopes[0], slopes[1] = 1.0 - r, r, -1.0, 1.0
        return
    values[0], values[1] = (1.0 - r) * (1.0 - 2.0 * r), r * (2.0 * r - 1.0)
    values[2] = 4.0 * r * (1.0 - r)
    slopes[0], slopes[1], slopes[2] = 4.0 * r - 3.0, 4.0 * r - 1.0, 4.0 - 8.0 * r


@compiled
def ways_of(points, faces, sides, smooth):
    """Directions in which the ends of the parts look, (lines, parts + 1, 2).

    Args:
        points: Places of the nodes [m], (nodes, 2).
        faces: Nodes of each line, (lines, 2 or 3).
        sides: See `impactfem.contact.mortar_surface.Surface`.
        smooth: Least square of the sum of two normals that have a mean.
    """
    nodes = faces.shape[1]
    values, slopes = np.empty(nodes), np.empty(nodes)
    own = np.empty((len(faces), nodes, 2))
    total, count = np.zeros((len(points), 2)), np.zeros(len(points))
    for f in range(len(faces)):
        for q in range(nodes):
            line(q / (nodes - 1.0), values, slopes)
            x, y = 0.0, 0.0
            for k in range(nodes):
                x += slopes[k] * points[faces[f, k], 0]
                y += slopes[k] * points[faces[f, k], 1]
            size = np.sqrt(x * x + y * y)
            size = size if size > 0.0 else 1.0
            own[f, q, 0], own[f, q, 1] = y * sides[f] / size, -x * sides[f] / size
        for end in range(2):
            node, place = faces[f, end], end * (nodes - 1)
            total[node, 0] += own[f, place, 0]
            total[node, 1] += own[f, place, 1]
            count[node] += 1.0
    for f in range(len(faces)):
        for end in range(2):
            node = faces[f, end]
            square = total[node, 0] ** 2 + total[node, 1] ** 2
            if count[node] == 2.0 and square > smooth:
                for c in range(2):
                    own[f, end * (nodes - 1), c] = total[node, c] / np.sqrt(square)
    return own


@compiled
def _seen(ax, ay, bx, by, nx, ny, mx, my, yx, yy):
    """Where s on the part from a to b, with the normals n and m of its ends, a point is seen."""
    tx, ty, ux, uy, dx, dy = bx - ax, by - ay, mx - nx, my - ny, yx - ax, yy - ay
    a, b = -(tx * uy - ty * ux), (dx * uy - dy * ux) - (tx * ny - ty * nx)
    c = dx * ny - dy * nx
    root = np.sqrt(max(b * b - 4.0 * a * c, 0.0))
    below = b - root if b < 0.0 else b + root  # of both roots the one that stays finite
    return min(max(-2.0 * c / below, 0.0), 1.0) if below != 0.0 else 0.0


@compiled
def overlaps(carrier, other, ways, backs, pairs, limits, rule, factors, tests):
    """Integrals over the overlaps of pairs of lines.

    Args:
        carrier: (points (nodes, 2), lines (lines, nodes of a line), sides (lines,), nodes at both
            ends of the parts (parts, 2), their places on the line (parts, 2)).
        other: The same of the surface opposite.
        ways: Of the carrier, by `ways_of`.
        backs: Unit normals of the parts of the other, (lines, parts, 2).
        pairs: Lines of both, (pairs, 2).
        limits: Largest distance [m], largest penetration (lines,) [m], and least cosine.
        rule: Gauss points on [0, 1] and weights.
        factors: Of lengths [m], or 0 where it is 2 pi times the first coordinate.
        tests: Functions of a line that test: those of its ends, and the shape function of its
            middle.

    Returns:
        What `impactfem.contact.mortar_surface.Overlap` has.
    """
    points, faces, sides, parts, places = carrier
    points_other, faces_other, _, parts_other, places_other = other
    reach, depth, facing = limits
    gauss, weights = rule
    count, nodes, others = len(pairs), faces.shape[1], faces_other.shape[1]
    here, there = np.zeros((count, tests, nodes)), np.zeros((count, tests, others))
    vectors, cover, gaps = np.zeros((count, tests, 2)), np.zeros(count), np.zeros(count)
    phi, slope = np.empty((len(gauss), nodes)), np.empty((len(gauss), nodes))
    phi_other, none = np.empty((len(gauss), others)), np.empty(others)
    for i in range(count):
        f, g = pairs[i]
        for p in range(len(parts)):
            one, two = points[faces[f, parts[p, 0]]], points[faces[f, parts[p, 1]]]
            nx, ny = ways[f, p]
            mx, my = ways[f, p + 1]
            size = np.sqrt((nx + mx) ** 2 + (ny + my) ** 2)
            size = size if size > 0.0 else 1.0
            for q in range(len(parts_other)):
                back = backs[g, q]
                if not ((nx + mx) * back[0] + (ny + my) * back[1]) / size < -facing:
                    continue
                y = points_other[faces_other[g, parts_other[q, 0]]]
                z = points_other[faces_other[g, parts_other[q, 1]]]
                own = one[0], one[1], two[0], two[1], nx, ny, mx, my
                s, t = _seen(*own, y[0], y[1]), _seen(*own, z[0], z[1])
                low, high = min(s, t), max(s, t)
                if not high > low:
                    continue
                gap = 0.0
                for k in range(len(gauss)):
                    at = low + (high - low) * gauss[k]
                    ax, ay = one[0] + at * (two[0] - one[0]), one[1] + at * (two[1] - one[1])
                    vx, vy = nx + at * (mx - nx), ny + at * (my - ny)
                    below = (z[0] - y[0]) * vy - (z[1] - y[1]) * vx
                    e = 0.0
                    if below != 0.0:
                        e = -((y[0] - ax) * vy - (y[1] - ay) * vx) / below
                    e = min(max(e, 0.0), 1.0)
                    r = places[p, 0] + (places[p, 1] - places[p, 0]) * at
                    first, last = places_other[q]
                    line(r, phi[k], slope[k])
                    line(first + (last - first) * e, phi_other[k], none)
                    wx, wy = 0.0, 0.0
                    for j in range(others):
                        wx += phi_other[k, j] * points_other[faces_other[g, j], 0]
                        wy += phi_other[k, j] * points_other[faces_other[g, j], 1]
                    for j in range(nodes):
                        wx -= phi[k, j] * points[faces[f, j], 0]
                        wy -= phi[k, j] * points[faces[f, j], 1]
                    length = np.sqrt(vx * vx + vy * vy)
                    gap += weights[k] * (wx * vx + wy * vy) / (length if length > 0.0 else 1.0)
                if not -depth[f] <= gap <= reach:
                    continue
                share = (high - low) / len(parts)
                for k in range(len(gauss)):
                    r = places[p, 0] + (places[p, 1] - places[p, 0]) * (
                        low + (high - low) * gauss[k]
                    )
                    tx, ty, radius = 0.0, 0.0, 0.0
                    for j in range(nodes):
                        x = points[faces[f, j]]
                        tx += slope[k, j] * x[0]
                        ty += slope[k, j] * x[1]
                        radius += phi[k, j] * x[0]
                    dr = share * weights[k] * (factors or 2.0 * np.pi * radius)
                    ds = dr * np.sqrt(tx * tx + ty * ty)
                    for h in range(tests):
                        hat = phi[k, 2] if h == 2 else r if h else 1.0 - r
                        for j in range(nodes):
                            here[i, h, j] += ds * hat * phi[k, j]
                        for j in range(others):
                            there[i, h, j] += ds * hat * phi_other[k, j]
                        vectors[i, h, 0] += dr * hat * ty * sides[f]
                        vectors[i, h, 1] -= dr * hat * tx * sides[f]
                cover[i] += share
                gaps[i] += share * gap
        gaps[i] /= cover[i] if cover[i] > 0.0 else 1.0
    return here, there, vectors, cover, gaps


class Balls(NamedTuple):
    """Centres (faces, dim), radii and normals of faces, and how far ways turn from these."""

    centre: Floats
    radius: Floats
    normal: Floats
    tilt: Floats


@compiled
def balls_of(points, faces, vectors, ways):
    """`Balls` of faces.

    Args:
        points: Places of the nodes [m], (nodes, dim).
        faces: Their nodes, (faces, nodes of a face).
        vectors: Normals of their parts times areas, (faces, parts, dim).
        ways: Unit vectors in which they look, (faces, directions, dim).
    """
    (count, nodes), dim = faces.shape, points.shape[1]
    centre, normal = np.zeros((count, dim)), np.zeros((count, dim))
    radius, tilt = np.zeros(count), np.zeros(count)
    for f in range(count):
        for k in range(nodes):
            centre[f] += points[faces[f, k]] / nodes
        for p in range(vectors.shape[1]):
            normal[f] += vectors[f, p]
        size = np.sqrt((normal[f] ** 2).sum())
        normal[f] /= size if size > 0.0 else 1.0
        for k in range(nodes):
            radius[f] = max(radius[f], np.sqrt(((points[faces[f, k]] - centre[f]) ** 2).sum()))
        for k in range(ways.shape[1]):
            tilt[f] = max(tilt[f], np.sqrt(((ways[f, k] - normal[f]) ** 2).sum()))
    return Balls(centre, radius, normal, tilt)


@compiled
def clipped_ways(here, there, begin, end):
    """Ways shortened to where they can meet the box about all of ``there``; empty ones end first.

    Args:
        here, there: Of both.
        begin, end: Ends of the ways [m], (faces,) each; written.
    """
    centre, radius, normal, tilt = here
    for c in range(centre.shape[1]):
        low, high = np.inf, -np.inf
        for g in range(len(there.centre)):
            low = min(low, there.centre[g, c] - there.radius[g])
            high = max(high, there.centre[g, c] + there.radius[g])
        for f in range(len(centre)):
            margin = radius[f] + tilt[f] * max(abs(begin[f]), abs(end[f]))
            slope, start = normal[f, c], centre[f, c]
            if abs(slope) >= 1e-12:
                one, two = (low - margin - start) / slope, (high + margin - start) / slope
                begin[f], end[f] = max(begin[f], min(one, two)), min(end[f], max(one, two))
            elif start < low - margin or start > high + margin:
                begin[f], end[f] = np.inf, -np.inf
    return begin, end


@compiled
def _are_opposite(f, g, here, there, begin, end, facing):
    """Whether two faces face each other and lie beside each other's way."""
    size, tilt = here.radius[f] + there.radius[g], here.tilt[f]
    along, cosine, square = 0.0, 0.0, 0.0
    for c in range(here.centre.shape[1]):
        along += (there.centre[g, c] - here.centre[f, c]) * here.normal[f, c]
        cosine += here.normal[f, c] * there.normal[g, c]
    for c in range(here.centre.shape[1]):
        square += (there.centre[g, c] - here.centre[f, c] - along * here.normal[f, c]) ** 2
    slack = size + tilt * max(abs(begin[f]), abs(end[f]))
    faces_it = cosine < -facing + 2.0 * (tilt + there.tilt[g])
    beside = np.sqrt(square) <= size + tilt * (abs(along) + size)
    return faces_it and beside and begin[f] - slack <= along <= end[f] + slack


@compiled
def opposite(pairs, here, there, begin, end, facing):
    """Those of some pairs of faces (pairs, 2) that are opposite; see `contact.broad_phase`.

    Args:
        pairs: Faces of both.
        here, there: Of both.
        begin, end: Ends of the ways of the first ones [m].
        facing: Least cosine between one normal and the other reversed.
    """
    kept = np.empty(len(pairs), dtype=np.bool_)
    for i in range(len(pairs)):
        kept[i] = _are_opposite(pairs[i, 0], pairs[i, 1], here, there, begin, end, facing)
    return pairs[kept]


@compiled
def pairs_among(looking, here, there, begin, end, facing):
    """Opposite ones among all pairs of some faces, rising, with all others; see `opposite`."""
    found, last = np.empty((len(looking) * len(there.centre), 2), dtype=np.int64), 0
    for f in looking:
        for g in range(len(there.centre)):
            if _are_opposite(f, g, here, there, begin, end, facing):
                found[last, 0], found[last, 1] = f, g
                last += 1
    return found[:last].copy()


@compiled
def summed_blocks(rows, columns, values, count, size):
    """Sum of blocks (blocks, k, m) as ``count`` sparse rows of so many columns.

    Ends, columns in rising order, and values.
    """
    blocks, k, m = values.shape
    keys, entries = np.empty(blocks * k * m, dtype=np.int64), 0
    for b in range(blocks):
        for i in range(k):
            for j in range(m):
                keys[entries] = rows[b, i] * size + columns[b, j]
                entries += 1
    order = np.argsort(keys, kind="mergesort")
    flat = values.copy().reshape(-1)
    data, place = np.zeros(entries), np.empty(entries, dtype=np.int32)
    ends, last, before = np.zeros(count + 1, dtype=np.int32), -1, -1
    for at in order:
        if keys[at] != before:
            before, last = keys[at], last + 1
            place[last] = before % size
            ends[before // size + 1] = last + 1
        data[last] += flat[at]
    for row in range(count):
        ends[row + 1] = max(ends[row + 1], ends[row])
    return ends, place[: last + 1].copy(), data[: last + 1].copy()


@compiled
def summed_vectors(rows, vectors, count):
    """Sums of vectors (blocks, k, dim) in so many rows, (count, dim)."""
    found = np.zeros((count, vectors.shape[2]))
    for b in range(len(rows)):
        for i in range(rows.shape[1]):
            for c in range(vectors.shape[2]):
                found[rows[b, i], c] += vectors[b, i, c]
    return found


@compiled
def met_normals(met, faces, vectors, count):
    """Sums at so many nodes of the normals of the faces that are met, times areas, (count, dim).

    Args:
        met: Numbers of these faces, some of them repeated.
        faces: Nodes of all faces.
        vectors: Normals of their parts times areas, (faces, parts, dim).
        count: Number of nodes.
    """
    found, seen = np.zeros((count, vectors.shape[2])), np.zeros(len(faces), dtype=np.bool_)
    seen[met] = True
    for k in range(faces.shape[1]):
        for f in range(len(faces)):
            if seen[f]:
                for c in range(vectors.shape[2]):
                    normal = 0.0
                    for p in range(vectors.shape[1]):
                        normal += vectors[f, p, c]
                    found[faces[f, k], c] += normal
    return found


@compiled
def line_vectors(points, faces, sides, parts):
    """Outward normals of the parts of lines times their lengths, (lines, parts, 2)."""
    found = np.empty((len(faces), len(parts), 2))
    for f in range(len(faces)):
        for p in range(len(parts)):
            one, two = points[faces[f, parts[p, 0]]], points[faces[f, parts[p, 1]]]
            found[f, p, 0] = (two[1] - one[1]) * sides[f]
            found[f, p, 1] = -(two[0] - one[0]) * sides[f]
    return found


@compiled
def patch_spins(ends, node, weight, places):
    """Spins of patches by displacements of nodes; see `impactfem.contact.turning_gaps`.

    Args:
        ends: Where each patch ends among all entries, after 0, (patches + 1,).
        node, weight: Entries of the patches.
        places: Of the nodes [m], (nodes, dim).

    Returns:
        Ends, columns and values of sparse rows, (patches turns, nodes dim).
    """
    dim = places.shape[1]
    turns = dim * (dim - 1) // 2
    values = np.zeros(len(node) * turns * dim)
    columns = np.empty(len(node) * turns * dim, dtype=np.int32)
    stops = np.zeros((len(ends) - 1) * turns + 1, dtype=np.int32)
    cross, centre = np.zeros((turns, dim)), np.zeros(dim)
    last = 0
    for g in range(len(ends) - 1):
        first, end, total = ends[g], ends[g + 1], 0.0
        centre[:] = 0.0
        for e in range(first, end):
            total += weight[e]
            for c in range(dim):
                centre[c] += weight[e] * places[node[e], c]
        centre /= total
        inertia, trace = np.zeros((turns, turns)), 0.0
        for e in range(first, end):
            _crossing(places[node[e]] - centre, cross)
            inertia += weight[e] * (cross @ cross.T)
        for t in range(turns):
            trace += inertia[t, t]
        fine = np.linalg.det(inertia) > (_FLAT * trace) ** turns
        for t in range(turns):
            stops[g * turns + t + 1] = stops[g * turns + t] + (end - first) * dim
        for e in range(first, end):
            _crossing(places[node[e]] - centre, cross)
            if fine and turns == 1:  # for one equation the call of LAPACK takes far longer
                found = (1.0 / inertia[0, 0]) * (weight[e] * cross)
            elif fine:
                found = np.linalg.solve(inertia, weight[e] * cross)
            else:
                found = 0.0 * cross
            for t in range(turns):
                for c in range(dim):
                    at = last + (t * (end - first) + e - first) * dim + c
                    values[at], columns[at] = found[t, c], node[e] * dim + c
        last += (end - first) * dim * turns
    return stops, columns, values


@compiled
def _crossing(arm, found):
    """A with A v = r x v, and A^T theta = theta x r, (1 or 3, dim); written."""
    if len(arm) == 2:
        found[0, 0], found[0, 1] = -arm[1], arm[0]
        return
    found[0, 1], found[0, 2] = -arm[2], arm[1]
    found[1, 0], found[1, 2] = arm[2], -arm[0]
    found[2, 0], found[2, 1] = -arm[1], arm[0]


@compiled
def turned_ways(ends, columns, values, given, rows, ways, count):
    """Spins by displacements (numbers,) times ways of some gaps, (all gaps, dim)."""
    dim = ways.shape[1]
    turns = dim * (dim - 1) // 2
    found, cross = np.zeros((count, dim)), np.zeros((turns, dim))
    for g in range(len(rows)):
        _crossing(ways[g], cross)
        for t in range(turns):
            theta = 0.0
            for k in range(ends[g * turns + t], ends[g * turns + t + 1]):
                theta += values[k] * given[columns[k]]
            for c in range(dim):
                found[rows[g], c] += cross[t, c] * theta
    return found


@compiled
def spread_moments(ends, columns, values, forces, rows, ways, size):
    """The transpose of `turned_ways`: forces (all gaps, dim) on so many numbers of nodes."""
    dim = ways.shape[1]
    turns = dim * (dim - 1) // 2
    found, cross = np.zeros(size), np.zeros((turns, dim))
    for g in range(len(rows)):
        _crossing(ways[g], cross)
        for t in range(turns):
            moment = 0.0
            for c in range(dim):
                moment += cross[t, c] * forces[rows[g], c]
            for k in range(ends[g * turns + t], ends[g * turns + t + 1]):
                found[columns[k]] += values[k] * moment
    return found
