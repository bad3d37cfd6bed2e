"""Compiled parts of layers whose law acts on speeds in all gaps; see `contact.speed_law`."""

import numpy as np

from impactfem.compiled import compiled


@compiled
def approaching(relative, shift, normals, gap, before, pushed, lively, slides, times):
    """Which gaps take part in a layer, and their `impactfem.contact.speed_law.Halfway.way`.

    Args:
        relative: What gaps weigh of nodes: places at the end without contact forces and at the
            start [m], velocities at the start and at the end [m/s], (gaps, 4 dim).
        shift: The same of what nodes face on obstacles.
        normals: Of the gaps, (gaps, dim).
        gap, before: At the end without contact forces and at the start [m], (gaps,).
        pushed: Normal forces of the layer before [N], (gaps,).
        lively, slides: Restitution along normals and tangents, (gaps,).
        times: Rounding level of places [m], step [s], and `SolidMarch._reach` [s].

    Returns:
        Gaps that take part, (rows,); ways (gaps, dim) [m]; normal speeds at the start [m/s] and
        normal ways of the speeds [m], (gaps,); which arrive, leave and are reached by impacts,
        (gaps,); the largest component of the velocities at the start [m/s].
    """
    tolerance, dt, reach = times
    count, dim = normals.shape
    one, mean, half = np.empty(count), np.empty(count), np.empty((count, dim))
    arriving, leaving = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.bool_)
    takes, struck = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.bool_)
    fastest, arrives = 0.0, False
    for i in range(count):
        first, second = 0.0, 0.0
        for c in range(dim):
            fastest = max(fastest, abs(relative[i, 2 * dim + c]))
            first += normals[i, c] * (relative[i, 2 * dim + c] - shift[i, 2 * dim + c])
            second += normals[i, c] * (relative[i, 3 * dim + c] - shift[i, 3 * dim + c])
        one[i], mean[i] = first, 0.5 * dt * (first + second)
        slow = max(abs(second - first), tolerance / dt)  # than forces make, and than rounding
        arriving[i], leaving[i] = first < -slow, first > slow
        along = reach * (second + (first if first > 0.0 else lively[i] * first))
        share = reach * slides[i] if arriving[i] else 0.0
        for c in range(dim):
            half[i, c] = reach * (relative[i, 3 * dim + c] - shift[i, 3 * dim + c])
            half[i, c] += share * (relative[i, 2 * dim + c] - shift[i, 2 * dim + c])
            along -= normals[i, c] * half[i, c]
        for c in range(dim):
            half[i, c] += along * normals[i, c]
        takes[i] = pushed[i] > 0.0 or gap[i] < -tolerance
        struck[i] = takes[i] and gap[i] <= tolerance
        arrives = arrives or (struck[i] and arriving[i])
    for i in range(count):
        if arrives and before[i] <= tolerance and not leaving[i]:
            struck[i] = True
        takes[i] = takes[i] or struck[i]
    return np.flatnonzero(takes), half, one, mean, arriving, leaving, struck, fastest


@compiled
def frames_of(normals):
    """Orthonormal directions with the normals first, (k, dim, dim)."""
    count, dim = normals.shape
    found = np.empty((count, dim, dim))
    for i in range(count):
        found[i, 0] = normals[i]
        if dim == 2:
            found[i, 1, 0], found[i, 1, 1] = -normals[i, 1], normals[i, 0]
            continue
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        a, b, c = 0.0, z, -y  # across the axis that the normal is the least along
        if abs(y) < abs(x) and abs(y) <= abs(z):
            a, b, c = -z, 0.0, x
        elif abs(z) < abs(x) and abs(z) < abs(y):
            a, b, c = y, -x, 0.0
        size = np.sqrt(a * a + b * b + c * c)
        a, b, c = a / size, b / size, c / size
        found[i, 1, 0], found[i, 1, 1], found[i, 1, 2] = a, b, c
        found[i, 2, 0] = y * c - z * b
        found[i, 2, 1] = z * a - x * c
        found[i, 2, 2] = x * b - y * a
    return found


@compiled
def prepared(rows, half, normals, tangential, pushed, relative, shift, still):
    """The law of the gaps that take part, along their directions.

    Args:
        rows, half, normals, pushed, relative, shift: As of `approaching`.
        tangential: Forces of the layer before [N], (gaps, dim).
        still: Speed up to which nothing slips [m/s].

    Returns:
        Directions, the normal first, (rows, dim, dim); ways [m] and forces of the layer before [N]
        along them, (rows, dim); slip at the start [m/s], (rows, dim - 1).
    """
    dim = normals.shape[1]
    directions = frames_of(normals[rows])
    way, near = np.zeros((len(rows), dim)), np.zeros((len(rows), dim))
    slip = np.zeros((len(rows), dim - 1))
    for i in range(len(rows)):
        k, size = rows[i], 0.0
        for d in range(dim):
            for c in range(dim):
                way[i, d] += directions[i, d, c] * half[k, c]
                near[i, d] += directions[i, d, c] * tangential[k, c]
                if d > 0:
                    moved = relative[k, 2 * dim + c] - shift[k, 2 * dim + c]
                    slip[i, d - 1] += directions[i, d, c] * moved
            if d > 0:
                size += slip[i, d - 1] ** 2
        near[i, 0] = pushed[k]
        if np.sqrt(size) <= still:
            slip[i] = 0.0
    return directions, way, near, slip


@compiled
def vectors_of(rows, directions, force, count):
    """Forces (rows, dim) along directions as vectors in space in all gaps, (gaps, dim)."""
    dim = force.shape[1]
    found = np.zeros((count, dim))
    for i in range(len(rows)):
        for d in range(dim):
            for c in range(dim):
                found[rows[i], c] += directions[i, d, c] * force[i, d]
    return found


@compiled
def closing(rows, directions, normals, gap, relative, shift, force, answered, moved, whole, bounds):
    """What the forces of a layer leave in the gaps.

    Args:
        rows, directions: Gaps that took part, and their directions, (rows, dim, dim).
        normals, gap, relative, shift: As of `approaching`.
        force: Along the directions [N], (rows, dim).
        answered: Places by forces along them [m], (rows, dim).
        moved: Relative displacements of all gaps by them [m], (gaps, dim).
        whole: Forces as vectors [N], (gaps, dim).
        bounds: Largest tangential forces of what sticks over normal ones, (rows,).

    Returns:
        Tangential forces, (gaps, dim); normal ones, true gaps, frictional work, and 1 where nothing
        slips, (gaps,) each; what `impactfem.marching.rubbing.told` tells of the rows.
    """
    count, dim = normals.shape
    across, stuck = whole.copy(), np.zeros(count)
    pushes, work, true = np.zeros(count), np.zeros(count), gap.copy()
    told, slid = np.zeros((len(rows), 2 if dim == 2 else 4)), np.empty(len(rows))
    for i in range(count):
        for c in range(dim):
            true[i] += normals[i, c] * moved[i, c]
    for j in range(len(rows)):
        i, far, way = rows[j], 0.0, 0.0
        pushes[i], true[i], told[j, 0] = force[j, 0], gap[i] + answered[j, 0], force[j, 0]
        size = 0.0
        for c in range(dim):
            across[i, c] -= force[j, 0] * normals[i, c]
        for d in range(1, dim):
            way = answered[j, d]
            for c in range(dim):
                first = relative[i, dim + c] - shift[i, dim + c]
                way += directions[j, d, c] * (relative[i, c] - shift[i, c] - first)
            work[i] += force[j, d] * way
            far += way * way
            size += force[j, d] * force[j, d]
        stuck[i] = 1.0 if np.sqrt(size) < bounds[j] * force[j, 0] else 0.0
        if dim == 2:  # the frames have the opposite tangent
            told[j, 1], slid[j] = -force[j, 1], -way
            continue
        slid[j] = np.sqrt(far)
        for c in range(dim):
            told[j, 1 + c] = across[i, c]
    return across, pushes, true, work, stuck, told, slid


@compiled
def jamming(own, friction, slip):
    """Which contacts jam while they slip; see `impactfem.contact.friction_solutions.jams`.

    Args:
        own: Answers to their own forces, (pairs, dim, dim).
        friction: Coefficients, (pairs,).
        slip: Along the tangents, of any length, (pairs, dim - 1).
    """
    found = np.zeros(len(own), dtype=np.bool_)
    for j in range(len(own)):
        size, across = 0.0, 0.0
        for c in range(slip.shape[1]):
            size += slip[j, c] * slip[j, c]
            across += own[j, 0, 1 + c] * slip[j, c]
        found[j] = size > 0.0 and own[j, 0, 0] <= friction[j] * across / np.sqrt(size)
    return found


@compiled
def struck_sums(force, fast, way, change, before, arriving):
    """Work of forces between nodes with mass, and the sum of those of an impact, 0 without one.

    Args:
        force: Of the layer [N], (gaps,).
        fast: Gaps whose law acts on speeds, (gaps,).
        way: In the layer without contact forces, and what these add [m], (gaps,) each.
        change: See ``way``.
        before: Forces of the layer before [N], (gaps,).
        arriving: Gaps that close faster than forces make them, (gaps,).

    Returns:
        Besides both whether forces are those of an impact, (gaps,).
    """
    work, total, strikes = 0.0, 0.0, False
    for i in range(len(force)):
        if fast[i] and force[i] > 0.0:
            work += force[i] * (way[i] + change[i])
            total += force[i]
            strikes = strikes or (before[i] == 0.0 and arriving[i])
    impulsive = np.zeros(len(force), dtype=np.bool_)
    for i in range(len(force) if strikes else 0):
        impulsive[i] = fast[i] and force[i] > 0.0
    return work, total if strikes else 0.0, impulsive


@compiled
def row_sums(force, impulsive, gap, pair, count):
    """What a row of the history has of forces in the gaps.

    Args:
        force, gap: [N], [m], (gaps,).
        impulsive: Whether forces are those of an impact, (gaps,).
        pair: Of each gap, (gaps,); not asked for where there is one.
        count: Number of pairs.

    Returns:
        Lasting forces, (gaps,); the least gap, sum and largest of the lasting forces and how many
        forces there are; of each pair sums of lasting forces and of others and the least gap.
    """
    lasting, least, total, largest, active = force.copy(), np.inf, 0.0, 0.0, 0
    sums, struck, gaps = np.zeros(count), np.zeros(count), np.full(count, np.inf)
    for i in range(len(force)):
        if impulsive[i]:
            lasting[i] = 0.0
        if force[i] > 0.0:
            active += 1
        total += lasting[i]
        largest, least = max(largest, lasting[i]), min(least, gap[i])
        if count:
            k = pair[i] if count > 1 else 0
            sums[k] += lasting[i]
            struck[k] += force[i] - lasting[i]
            gaps[k] = min(gaps[k], gap[i])
    return lasting, least, total, largest, active, sums, struck, gaps


@compiled
def rubbing_sums(pair, acting, way, count):
    """Tangential forces and slips of pairs; arguments as of `TimeLoop._close_rubbing`."""
    whole, slid = np.zeros(count), np.zeros(count)
    tangential = np.zeros((count, acting.shape[1] - 1))
    for i in range(len(pair)):
        k = pair[i]
        whole[k] += acting[i, 0]
        slid[k] += acting[i, 0] * way[i]
        for c in range(tangential.shape[1]):
            tangential[k, c] += acting[i, 1 + c]
    for k in range(count):
        slid[k] = slid[k] / whole[k] if whole[k] > 0.0 else 0.0
    return tangential, slid
