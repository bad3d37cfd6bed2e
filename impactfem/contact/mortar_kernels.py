"""Compiled loops of the mortar overlaps in space: shape functions, clipping, integration."""

import numpy as np

from impactfem.compiled import compiled

SLIVER = 1e-14
"""Share of an area below which an overlap is rounding."""


@compiled
def shapes(nodes, r, s, values, slopes):
    """Shape functions of a face at (r, s) and their derivatives, in DOLFINx's order of nodes.

    Args:
        nodes: Nodes of the face: 3 or 6 for triangles, 4 or 9 for quadrilaterals.
        r, s: Place in the reference face.
        values: Filled, shape (>= nodes,).
        slopes: Filled with the derivatives by r and s, shape (2, >= nodes).
    """
    if nodes == 3:
        values[0], values[1], values[2] = 1.0 - r - s, r, s
        slopes[0, 0], slopes[0, 1], slopes[0, 2] = -1.0, 1.0, 0.0
        slopes[1, 0], slopes[1, 1], slopes[1, 2] = -1.0, 0.0, 1.0
    elif nodes == 6:
        t = 1.0 - r - s
        values[0], values[1], values[2] = t * (2 * t - 1), r * (2 * r - 1), s * (2 * s - 1)
        values[3], values[4], values[5] = 4 * r * s, 4 * s * t, 4 * r * t
        slopes[0, 0], slopes[0, 1], slopes[0, 2] = 1 - 4 * t, 4 * r - 1, 0.0
        slopes[0, 3], slopes[0, 4], slopes[0, 5] = 4 * s, -4 * s, 4 * (t - r)
        slopes[1, 0], slopes[1, 1], slopes[1, 2] = 1 - 4 * t, 0.0, 4 * s - 1
        slopes[1, 3], slopes[1, 4], slopes[1, 5] = 4 * r, 4 * (t - s), -4 * r
    elif nodes == 4:
        values[0], values[1] = (1 - r) * (1 - s), r * (1 - s)
        values[2], values[3] = (1 - r) * s, r * s
        slopes[0, 0], slopes[0, 1], slopes[0, 2], slopes[0, 3] = s - 1, 1 - s, -s, s
        slopes[1, 0], slopes[1, 1], slopes[1, 2], slopes[1, 3] = r - 1, -r, 1 - r, r
    else:
        a, b, m = (1 - r) * (1 - 2 * r), r * (2 * r - 1), 4 * r * (1 - r)
        da, db, dm = 4 * r - 3, 4 * r - 1, 4 - 8 * r
        c, d, n = (1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)
        dc, dd, dn = 4 * s - 3, 4 * s - 1, 4 - 8 * s
        values[0], values[1], values[2], values[3] = a * c, b * c, a * d, b * d
        values[4], values[5], values[6], values[7], values[8] = m * c, a * n, b * n, m * d, m * n
        slopes[0, 0], slopes[0, 1], slopes[0, 2], slopes[0, 3] = da * c, db * c, da * d, db * d
        slopes[0, 4], slopes[0, 5], slopes[0, 6] = dm * c, da * n, db * n
        slopes[0, 7], slopes[0, 8] = dm * d, dm * n
        slopes[1, 0], slopes[1, 1], slopes[1, 2], slopes[1, 3] = a * dc, b * dc, a * dd, b * dd
        slopes[1, 4], slopes[1, 5], slopes[1, 6] = m * dc, a * dn, b * dn
        slopes[1, 7], slopes[1, 8] = m * dd, m * dn


@compiled
def twice_area(polygon, count):
    """Twice the signed area of a polygon in a plane, corners (count, 2)."""
    total = 0.0
    for i in range(1, count - 1):
        total += (polygon[i, 0] - polygon[0, 0]) * (polygon[i + 1, 1] - polygon[0, 1])
        total -= (polygon[i, 1] - polygon[0, 1]) * (polygon[i + 1, 0] - polygon[0, 0])
    return total


@compiled
def turn(polygon, count):
    """Reverse a polygon unless it runs anticlockwise."""
    if twice_area(polygon, count) < 0.0:
        for i in range(count // 2):
            for k in range(2):
                j = count - 1 - i
                polygon[i, k], polygon[j, k] = polygon[j, k], polygon[i, k]


@compiled
def clip(window, sides, polygon, count, work):
    """Clip a convex polygon by a convex window (Sutherland, Hodgman 1974), both anticlockwise.

    Args:
        window: Corners, shape (>= sides, 2).
        sides: Their number.
        polygon: Corners; overwritten by those of the common part, shape (>= sides + count, 2).
        count: Their number.
        work: As large as polygon.

    Returns:
        Number of corners of the common part, 0 if there is none.
    """
    for a in range(sides):
        b = (a + 1) % sides
        ex, ey = window[b, 0] - window[a, 0], window[b, 1] - window[a, 1]
        kept = 0
        for i in range(count):
            j = (i + 1) % count
            here = ex * (polygon[i, 1] - window[a, 1]) - ey * (polygon[i, 0] - window[a, 0])
            there = ex * (polygon[j, 1] - window[a, 1]) - ey * (polygon[j, 0] - window[a, 0])
            if here >= 0.0:
                work[kept, 0], work[kept, 1] = polygon[i, 0], polygon[i, 1]
                kept += 1
            if (here > 0.0 and there < 0.0) or (here < 0.0 and there > 0.0):
                part = here / (here - there)
                for k in range(2):
                    work[kept, k] = polygon[i, k] + part * (polygon[j, k] - polygon[i, k])
                kept += 1
        count = kept
        if count < 3:
            return 0
        for i in range(count):
            polygon[i, 0], polygon[i, 1] = work[i, 0], work[i, 1]
    return count


@compiled
def locate(corners, count, x, y, weights):
    """Weights of the (bi)linear functions of a part's corners at a place in the plane.

    Args:
        corners: Projected corners around the part, shape (count, 2).
        count: 3 or 4.
        x, y: The place.
        weights: Filled, shape (>= count,).

    Returns:
        Area of the plane by area of the reference part.
    """
    ax, ay = corners[1, 0] - corners[0, 0], corners[1, 1] - corners[0, 1]
    if count == 3:
        bx, by = corners[2, 0] - corners[0, 0], corners[2, 1] - corners[0, 1]
        det = ax * by - ay * bx
        px, py = x - corners[0, 0], y - corners[0, 1]
        weights[1], weights[2] = (px * by - py * bx) / det, (ax * py - ay * px) / det
        weights[0] = 1.0 - weights[1] - weights[2]
        return abs(det)
    bx, by = corners[3, 0] - corners[0, 0], corners[3, 1] - corners[0, 1]
    cx = corners[2, 0] - corners[1, 0] - bx
    cy = corners[2, 1] - corners[1, 1] - by
    u, v = 0.5, 0.5
    for _ in range(20):  # Newton; one step for parallelograms
        px = corners[0, 0] + ax * u + bx * v + cx * u * v - x
        py = corners[0, 1] + ay * u + by * v + cy * u * v - y
        ux, uy, vx, vy = ax + cx * v, ay + cy * v, bx + cx * u, by + cy * u
        det = ux * vy - uy * vx
        du, dv = (px * vy - py * vx) / det, (ux * py - uy * px) / det
        u, v = u - du, v - dv
        if abs(du) + abs(dv) < 1e-12:
            break
    u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
    weights[0], weights[1], weights[2], weights[3] = (
        (1 - u) * (1 - v),
        u * (1 - v),
        u * v,
        (1 - u) * v,
    )
    ux, uy, vx, vy = ax + cx * v, ay + cy * v, bx + cx * u, by + cy * u
    return abs(ux * vy - uy * vx)


@compiled
def dot(a, b):
    """Scalar product of two vectors in space."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a, b, c):
    """Fill c with the vector product of a and b."""
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def frame(points, face, part, vector, center, axes):
    """Fill the plane of a flat part: the mean of its corners, two axes, its unit normal.

    Args:
        points: Nodes, shape (nodes, 3).
        face: Nodes of the face.
        part: Corners of the part, as places in face.
        vector: Normal of the part, of any length.
        center: Filled, shape (3,).
        axes: Filled, shape (3, 3); the last is the normal.
    """
    length, along = np.sqrt(dot(vector, vector)), 0.0
    for d in range(3):
        axes[2, d] = vector[d] / length
        center[d] = 0.0
        for c in range(len(part)):
            center[d] += points[face[part[c]], d] / len(part)
        axes[0, d] = points[face[part[1]], d] - points[face[part[0]], d]
        along += axes[0, d] * axes[2, d]
    for d in range(3):
        axes[0, d] -= along * axes[2, d]
    length = np.sqrt(dot(axes[0], axes[0]))
    for d in range(3):
        axes[0, d] /= length
    cross(axes[2], axes[0], axes[1])


@compiled
def project(points, face, part, center, axes, flat):
    """Fill flat, (corners, 2), with a part's corners in the first two axes about a centre."""
    for c in range(len(part)):
        node = face[part[c]]
        for k in range(2):
            flat[c, k] = 0.0
            for d in range(3):
                flat[c, k] += (points[node, d] - center[d]) * axes[k, d]


@compiled
def apart(a, b):
    """Whether two sets of points in the plane, (count, 2) each, have separate boxes."""
    beside = False
    for k in range(2):
        beside = beside or a[:, k].min() >= b[:, k].max() or b[:, k].min() >= a[:, k].max()
    return beside


@compiled
def reference(flat, places, x, y, weights):
    """Place r, s in the reference face of a place in the plane of a part, and `locate`'s area."""
    stretch = locate(flat, len(places), x, y, weights)
    r, s = 0.0, 0.0
    for c in range(len(places)):
        r += weights[c] * places[c, 0]
        s += weights[c] * places[c, 1]
    return r, s, stretch


@compiled
def place(points, face, values, x):
    """Fill x with the sum of values times the places of a face's nodes."""
    x[:] = 0.0
    for j in range(len(face)):
        for d in range(3):
            x[d] += values[j] * points[face[j], d]


@compiled
def add_polygon(
    polygon, count, rule, parts, normal, side,
    points, face, flat, places, other_points, other_face, other_flat, other_places,
    here, there, vectors,
):  # fmt: skip
    """Add the integrals over a convex polygon in the plane of a part of the carrier.

    Args:
        polygon, count: Its corners, anticlockwise, and their number.
        rule: Points r, s and weights of a rule on the triangle, shape (points, 3).
        parts: Parts of the carrier's face.
        normal: Outward unit normal of the plane.
        side: Side of the face; see `Surface`.
        points, face, flat, places: Nodes of the carrier; those of the face; corners of its part in
            the plane and in the reference face.
        other_points, other_face, other_flat, other_places: The same of the other surface.
        here, there, vectors: Integrals of psi phi of both and of psi m; added to.

    Returns:
        Area of the polygon and integral of the distance over it.
    """
    nodes, others, functions = len(face), len(other_face), len(vectors)
    corners = 4 if nodes in (4, 9) else 3
    weights, hats, phi, phi_other = np.empty(4), np.empty(9), np.empty(9), np.empty(9)
    slopes, unused, across = np.empty((2, 9)), np.empty((2, 9)), np.empty(3)
    x, y, t, u = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    covered, distance = 0.0, 0.0
    for corner in range(1, count - 1):
        ax, ay = polygon[corner, 0] - polygon[0, 0], polygon[corner, 1] - polygon[0, 1]
        bx, by = polygon[corner + 1, 0] - polygon[0, 0], polygon[corner + 1, 1] - polygon[0, 1]
        double = ax * by - ay * bx
        for point in range(len(rule)):
            r, s = rule[point, 0], rule[point, 1]
            px, py = polygon[0, 0] + r * ax + s * bx, polygon[0, 1] + r * ay + s * by
            dplane = rule[point, 2] * double
            r, s, stretch = reference(flat, places, px, py, weights)
            shapes(corners, r, s, hats, unused)
            shapes(nodes, r, s, phi, slopes)
            hats[corners:functions] = phi[corners:functions]
            r, s, _ = reference(other_flat, other_places, px, py, weights)
            shapes(others, r, s, phi_other, unused)
            place(points, face, phi, x)
            place(other_points, other_face, phi_other, y)
            place(points, face, slopes[0], t)
            place(points, face, slopes[1], u)
            # The curved area dA = |x_r cross x_s| dr ds, with dr ds from that of the plane.
            cross(t, u, across)
            drds = dplane / (stretch * parts)
            area = drds * np.sqrt(dot(across, across))
            covered += dplane
            distance += dplane * (dot(y, normal) - dot(x, normal))
            for i in range(functions):
                for j in range(nodes):
                    here[i, j] += area * hats[i] * phi[j]
                for j in range(others):
                    there[i, j] += area * hats[i] * phi_other[j]
                for d in range(3):
                    vectors[i, d] += drds * hats[i] * side * across[d]
    return covered, distance


@compiled
def integrate(
    points, faces, sides, parts, places, vectors,
    other_points, other_faces, other_parts, other_places, other_vectors,
    pairs, reach, depth, facing, rule,
    carrier_part, other_part, normals, cover, gaps,
):  # fmt: skip
    """Integrate over the overlaps of pairs of faces; see `impactfem.contact.mortar_faces`.

    Args:
        points, faces, sides, parts, places, vectors: The carrier, as in `Surface`; vectors are
            those of its parts, shape (faces, parts, 3).
        other_points, other_faces, other_parts, other_places, other_vectors: The other surface.
        pairs: Faces of both, shape (pairs, 2).
        reach: Largest distance of overlaps [m].
        depth: Largest penetration [m], shape (carrier's faces,).
        facing: Least cosine between one normal and the other reversed.
        rule: Points r, s and weights of a rule on the triangle, shape (points, 3).
        carrier_part, other_part, normals, cover, gaps: Filled; fields of `Overlap`, at first 0.
    """
    corners, corners_there = parts.shape[1], other_parts.shape[1]
    center, axes = np.empty(3), np.empty((3, 3))
    flat, window, flat_other = (
        np.empty((corners, 2)),
        np.empty((4, 2)),
        np.empty((corners_there, 2)),
    )
    polygon, work = np.empty((16, 2)), np.empty((16, 2))
    here, there = np.empty(carrier_part.shape[1:]), np.empty(other_part.shape[1:])
    turned = np.empty(normals.shape[1:])
    for pair in range(len(pairs)):
        f, g = pairs[pair, 0], pairs[pair, 1]
        plane = 0.0
        for p in range(len(parts)):
            length = np.sqrt(dot(vectors[f, p], vectors[f, p]))
            plane += length
            if length == 0.0:
                continue
            frame(points, faces[f], parts[p], vectors[f, p], center, axes)
            project(points, faces[f], parts[p], center, axes, flat)
            window[:corners] = flat
            turn(window, corners)
            for q in range(len(other_parts)):
                span = np.sqrt(dot(other_vectors[g, q], other_vectors[g, q]))
                if dot(other_vectors[g, q], axes[2]) >= -facing * span:
                    continue
                project(other_points, other_faces[g], other_parts[q], center, axes, flat_other)
                if apart(flat, flat_other):
                    continue
                polygon[:corners_there] = flat_other
                turn(polygon, corners_there)
                count = clip(window, corners, polygon, corners_there, work)
                if count == 0 or twice_area(polygon, count) < SLIVER * min(length, span):
                    continue
                here[:], there[:], turned[:] = 0.0, 0.0, 0.0
                covered, distance = add_polygon(
                    polygon, count, rule, len(parts), axes[2], sides[f],
                    points, faces[f], flat, places[p],
                    other_points, other_faces[g], flat_other, other_places[q],
                    here, there, turned,
                )  # fmt: skip
                if distance > reach * covered or distance < -depth[f] * covered:
                    continue
                cover[pair] += covered
                gaps[pair] += distance
                carrier_part[pair] += here
                other_part[pair] += there
                normals[pair] += turned
        if cover[pair] > 0.0:
            gaps[pair] /= cover[pair]
            cover[pair] /= plane
