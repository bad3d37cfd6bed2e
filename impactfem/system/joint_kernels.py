"""Rows of joints: how places and directions of two bodies change, term by term.

A term is linear or bilinear in what moves with the bodies but for distances and angles. Its
discrete gradient G between two states is, of a product, the product with the means of both, of a
distance and an angle the gradient amid them, scaled so that

    g_b - g_a = sum over both bodies of G . (way of the centre, T),
    R_b - R_a = T x (R_a + R_b) / 2

with Cayley's rotation of T. What acts along it on both bodies is opposite, in moment too. (O.
Gonzalez, Physica D 132 (1999) 165-174; P. Betsch, S. Leyendecker, Int. J.
Numer. Meth. Eng. 67 (2006) 499-552.)
"""

import numpy as np
from numpy.linalg import LinAlgError

from impactfem.arrays import Floats
from impactfem.compiled import compiled
from impactfem.system.vector_kernels import add, by, crossed, dot, less, plus, put

POINT, DOT, SLIDE, DISTANCE, ANGLE = range(5)
"""Kinds of terms; see `values`."""

ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
"""Share of what rows could move at most below which their motion is but rounding."""

RANK = 1e-9
"""Share of the largest singular value of rows made alike below which one follows from others."""

_SAME = 1e-5  # relative turn [rad] below which an angle is its linear part to rounding


@compiled
def values(kinds, bodies, arms, axes, sides, places, turns, before):
    """Values of terms, (terms,).

    Args:
        kinds: POINT: (p2 - p1) . u with u in space; DOT: u1 . u2; SLIDE: (p2 - p1) . u1; DISTANCE:
            |p2 - p1|; ANGLE: that of body 2 against body 1 about u1, next to the value before.
        bodies: (terms, 2).
        arms, axes: From the centres to p and the u, along the axes of the bodies, (terms, 2, 3).
        sides: Directions whose angle is told, perpendicular to the axes, alike, (terms, 2, 3).
        places, turns: Centres and rotations of the bodies, (bodies, 3), (bodies, 3, 3).
        before: Values of angles nearby [rad], (terms,).
    """
    found = np.empty(len(kinds))
    for t in range(len(kinds)):
        i, j = bodies[t]
        d = _apart(places[i], by(turns[i], arms[t, 0]), places[j], by(turns[j], arms[t, 1]))
        u = by(turns[i], axes[t, 0])
        if kinds[t] == POINT:
            found[t] = dot(d, axes[t, 0])
        elif kinds[t] == DOT:
            found[t] = dot(u, by(turns[j], axes[t, 1]))
        elif kinds[t] == SLIDE:
            found[t] = dot(d, u)
        elif kinds[t] == DISTANCE:
            found[t] = np.sqrt(dot(d, d))
        else:
            one, two = by(turns[i], sides[t, 0]), by(turns[j], sides[t, 1])
            angle = np.arctan2(dot(two, crossed(u, one)), dot(two, one))
            found[t] = angle + 2.0 * np.pi * np.round((before[t] - angle) / (2.0 * np.pi))
    return found


@compiled
def _apart(place, arm, other, far):
    """From the end of an arm to that of another one."""
    return less(plus(other, 1.0, far), plus(place, 1.0, arm))


@compiled
def _mean(a, b):
    return (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))


@compiled
def gradients(kinds, bodies, arms, axes, start, end, turned, values_a, values_b):
    """Discrete gradients of terms by centre and rotation of both bodies, (terms, 2, 6).

    Args:
        kinds, bodies, arms, axes: See `values`.
        start, end: Places and rotations of the bodies at both ends, ((bodies, 3), (bodies, 3, 3)).
        turned: T of the bodies in space [rad], (bodies, 3).
        values_a, values_b: Values of the terms there.
    """
    found = np.zeros((len(kinds), 2, 6))
    for t in range(len(kinds)):
        i, j = bodies[t]
        one_a, two_a = by(start[1][i], arms[t, 0]), by(start[1][j], arms[t, 1])
        one_b, two_b = by(end[1][i], arms[t, 0]), by(end[1][j], arms[t, 1])
        d_a = _apart(start[0][i], one_a, start[0][j], two_a)
        d_b = _apart(end[0][i], one_b, end[0][j], two_b)
        one, two, d = _mean(one_a, one_b), _mean(two_a, two_b), _mean(d_a, d_b)
        u = _mean(by(start[1][i], axes[t, 0]), by(end[1][i], axes[t, 0]))
        first, second = found[t]
        if kinds[t] == DOT:
            w = _mean(by(start[1][j], axes[t, 1]), by(end[1][j], axes[t, 1]))
            moment = crossed(w, u)
            put(moment, -1.0, first[3:])
            put(moment, 1.0, second[3:])
            continue
        if kinds[t] == ANGLE:
            # To first order in the way, for Cayley's rotations; scaled for the rest.
            mean = _mean(turned[i], turned[j])
            u = plus(u, -(0.25 * dot(mean, u) / (1.0 + 0.25 * dot(mean, mean))), mean)
            way = dot(u, less(turned[j], turned[i]))
            scale = (values_b[t] - values_a[t]) / way if np.abs(way) > _SAME else 1.0
            put(u, -scale, first[3:])
            put(u, scale, second[3:])
            continue
        if kinds[t] == POINT:
            along = (axes[t, 0, 0], axes[t, 0, 1], axes[t, 0, 2])
        elif kinds[t] == SLIDE:
            along = u
        else:
            share = 1.0 / (values_a[t] + values_b[t])
            along = plus((share * d_a[0], share * d_a[1], share * d_a[2]), share, d_b)
        put(along, -1.0, first[:3])
        put(along, 1.0, second[:3])
        put(crossed(one, along), -1.0, first[3:])
        put(crossed(two, along), 1.0, second[3:])
        if kinds[t] == SLIDE:
            add(crossed(u, d), 1.0, first[3:])
    return found


@compiled
def at_gradients(kinds, bodies, arms, axes, places, turns, now):
    """Gradients of terms at a state, (terms, 2, 6); values of the terms there as ``now``."""
    here = (places, turns)
    return gradients(kinds, bodies, arms, axes, here, here, np.zeros(places.shape), now, now)


@compiled
def term_rates(gradient, bodies, turns, speeds, spins):
    """Rates of terms, (terms,).

    Args:
        gradient: Of the terms, (terms, 2, 6).
        bodies: (terms, 2).
        turns: Rotations of the bodies, (bodies, 3, 3).
        speeds, spins: Their velocities, and spins along their axes, (bodies, 3).
    """
    found = np.zeros(len(bodies))
    for t in range(len(bodies)):
        for side in range(2):
            body, along = bodies[t, side], gradient[t, side]
            found[t] += dot(along[:3], speeds[body])
            found[t] += dot(along[3:], by(turns[body], spins[body]))
    return found


@compiled
def shown(terms, values_now, gradient, acting, stations, joints, found):
    """Fill in what columns of joints show: coordinate, rate, force and moment, (joints, 4 or more).

    Args:
        terms: Kinds, rows, bodies, arms, axes, shares; see `impactfem.system.joints.Terms`.
        values_now: Of the terms, (terms,).
        gradient: By which forces acted, (terms, 2, 6).
        acting: Forces of the rows, (rows,).
        stations: Places, rotations, velocities, spins along their axes, and the rotations amid the
            layer that forces acted in.
        joints: Joint of each term (terms,), row of the coordinate of each joint or -1, what that is
            more than the row, whether there are no bodies between which a moment could act
            (joints,), factors of forces and moments along the axes and of forces of gears
            (7,), and the dimension.

    Returns:
        Rates of the rows, (rows,).
    """
    kinds, rows, bodies, arms, axes, shares = terms
    places, turns, speeds, spins, middles = stations
    owner, moving, more, geared, factors, dim = joints
    now = at_gradients(kinds, bodies, arms, axes, places, turns, values_now)
    each = term_rates(now, bodies, turns, speeds, spins)
    sums, rates = np.zeros(len(acting)), np.zeros(len(acting))
    pushes, about = np.zeros((len(moving), 6)), np.full(len(moving), -1)
    for t in range(len(rows)):
        sums[rows[t]] += shares[t] * values_now[t]
        rates[rows[t]] += shares[t] * each[t]
        k, size = owner[t], acting[rows[t]] * shares[t]
        for i in range(6):
            pushes[k, i] += size * gradient[t, 1, i]
        if geared[k]:
            found[k, 2], found[k, 3] = factors[6] * size, 0.0
        if about[k] < 0:
            about[k] = t
    for k in range(len(moving)):
        if moving[k] >= 0:
            found[k, 0], found[k, 1] = sums[moving[k]] + more[k], rates[moving[k]]
        if geared[k]:
            continue
        force, first = pushes[k, :3], about[k]
        moment = crossed(by(middles[bodies[first, 1]], arms[first, 1]), force)
        x, y, z = less(pushes[k, 3:], moment)
        x, y, z = factors[3] * x, factors[4] * y, factors[5] * z
        found[k, 3] = z if dim == 2 else np.sqrt(x * x + y * y + z * z)
        x, y, z = factors[:3] * force
        found[k, 2] = np.sqrt(x * x + y * y + z * z)
    return rates


@compiled
def wrenches(acting, gradient, rows, shares, of, count):
    """Impulses by those of rows (several, rows) on bodies, (several, bodies, 6).

    Args:
        acting: Of the rows.
        gradient: Of the terms, (terms, sides, 6).
        rows, shares: Of the terms, (terms,).
        of: Body on each side of the terms, (terms, sides).
        count: Number of bodies.
    """
    found = np.zeros((len(acting), count, 6))
    for n in range(len(acting)):
        for t in range(len(rows)):
            size = acting[n, rows[t]] * shares[t]
            for side in range(of.shape[1]):
                for k in range(6):
                    found[n, of[t, side], k] += size * gradient[t, side, k]
    return found


@compiled
def delassus(rows, bodies, last, gradient, count, inverse_mass, freedoms, couples, compliance):
    """How rows move by unit impulses in them per second, G' A G^T, (rows, rows).

    What is but rounding is 0: across its plane a flat linkage does not move at all.

    Args:
        rows, bodies: Of the terms, (terms,), (terms, 2).
        last, gradient: G' along which rows move, and G along which they act, (terms, 2, 6).
        count: Number of rows.
        inverse_mass, freedoms: Inverse masses and moments of inertia in space of the bodies.
        couples: Bodies of which the second moves the first besides, as stations of an elastic body
            do, (couples, 2).
        compliance: Velocities and spins in space of the first by unit impulses on the second,
            (couples, 6, 6).
    """
    found, sizes = np.zeros((count, count)), np.zeros(count)
    # Terms of each body one after the other; see `_move`.
    ends = np.zeros(len(inverse_mass) + 1, dtype=np.int64)
    for body in bodies.flat:
        ends[body + 1] += 1
    ends = np.cumsum(ends)
    of, filled = np.empty(2 * len(rows), dtype=np.int64), ends.copy()
    for t in range(len(rows)):
        for side in range(2):
            of[filled[bodies[t, side]]] = 2 * t + side
            filled[bodies[t, side]] += 1
    # Couples by the body that moves the other one; each body's own.
    from_, own = np.zeros(len(inverse_mass) + 1, dtype=np.int64), np.zeros((len(inverse_mass), 2))
    for c in range(len(couples)):
        from_[couples[c, 1] + 1] += 1
        if couples[c, 0] == couples[c, 1]:
            for k in range(3):
                own[couples[c, 0], 0] += compliance[c, k, k]
                own[couples[c, 0], 1] += compliance[c, k + 3, k + 3]
    from_ = np.cumsum(from_)
    pushed, filled = np.empty(len(couples), dtype=np.int64), from_.copy()
    for c in range(len(couples)):
        pushed[filled[couples[c, 1]]] = c
        filled[couples[c, 1]] += 1
    moved = np.empty(6)
    for t in range(len(rows)):
        for side in range(2):
            body = bodies[t, side]
            push, twist = gradient[t, side, :3], gradient[t, side, 3:]
            light = 3.0 * inverse_mass[body] + own[body, 0]
            free = np.trace(freedoms[body]) + own[body, 1]
            sizes[rows[t]] += light * dot(push, push) + abs(free) * dot(twist, twist)
            put(push, inverse_mass[body], moved[:3])
            put(by(freedoms[body], twist), 1.0, moved[3:])
            _move(found[:, rows[t]], rows, last, moved, of[ends[body] : ends[body + 1]])
            for c in pushed[from_[body] : from_[body + 1]]:
                other = couples[c, 0]
                for i in range(6):
                    moved[i] = 0.0
                    for k in range(6):
                        moved[i] += compliance[c, i, k] * gradient[t, side, k]
                _move(found[:, rows[t]], rows, last, moved, of[ends[other] : ends[other + 1]])
    for r in range(count):
        if abs(found[r, r]) <= ROUNDING * sizes[r]:
            found[r, :] = 0.0
            found[:, r] = 0.0
    return found


@compiled
def _move(found, rows, last, moved, of):
    """Add how rows move with a body, by its terms: twice their number and one on the far side."""
    for s in of:
        along, total = last[s // 2, s % 2], 0.0
        for k in range(6):
            total += along[k] * moved[k]
        found[rows[s // 2]] += total


@compiled
def solved(matrix, given, scale, redundant):
    """Least solutions x of matrix @ x = given, (rows, several).

    Args:
        matrix: (rows, rows).
        given: (rows, several).
        scale: Typical sizes of the x, (rows,): what the rows are made alike by.
        redundant: Whether some rows follow from others.
    """
    alike = matrix * scale
    sizes = np.empty(len(scale))
    for r in range(len(scale)):
        sizes[r] = np.abs(alike[r]).max()
        if not sizes[r] > 0.0:
            sizes[r] = 1.0
        alike[r] /= sizes[r]
    right = given / sizes.reshape((-1, 1))
    if redundant:
        found = np.linalg.pinv(alike, RANK) @ right
    else:
        found = _eliminated(alike, right)
    return scale.reshape((-1, 1)) * found


@compiled
def _eliminated(matrix, right):
    """The solution of matrix @ x = right, in place of both; rows of chains have few entries.

    Raises:
        LinAlgError: Rows follow from others.
    """
    count = len(matrix)
    ends, depth = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    entries = 0
    for i in range(count):  # of the entries of each row, and of each column
        for j in range(count):
            if matrix[i, j] != 0.0:
                ends[i], depth[j] = j + 1, i + 1
                entries += 1
    if 4 * entries > count * count:
        return np.linalg.solve(matrix, right)
    deep = 0
    for k in range(count):
        best, deep = k, max(deep, depth[k])
        for i in range(k + 1, deep):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if matrix[best, k] == 0.0:
            raise LinAlgError("Matrix is singular to machine precision.")
        if best != k:
            for j in range(k, max(ends[best], ends[k])):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            for j in range(right.shape[1]):
                right[k, j], right[best, j] = right[best, j], right[k, j]
            ends[k], ends[best] = ends[best], ends[k]
        for i in range(k + 1, deep):
            share = matrix[i, k] / matrix[k, k]
            if share != 0.0:
                ends[i] = max(ends[i], ends[k])
                for j in range(k + 1, ends[k]):
                    matrix[i, j] -= share * matrix[k, j]
                for j in range(right.shape[1]):
                    right[i, j] -= share * right[k, j]
    for k in range(count - 1, -1, -1):
        for j in range(right.shape[1]):
            total = right[k, j]
            for i in range(k + 1, ends[k]):
                total -= matrix[k, i] * right[i, j]
            right[k, j] = total / matrix[k, k]
    return right


def sizes_of(matrix: Floats) -> Floats:
    """Impulses in rows that move these alike, by energy, (rows,); `solved` takes them.

    Args:
        matrix: How rows move by unit impulses in them, (rows, rows).
    """
    own = np.sqrt(np.abs(np.diag(matrix)))
    return np.asarray(1.0 / np.where(own > 0.0, own, 1.0))


def least(matrix: Floats, given: Floats, scale: Floats, *, redundant: bool) -> Floats:
    """As `solved`, also where rows have come to follow from others."""
    columns = np.ascontiguousarray(given if given.ndim == 2 else given[:, None])
    if not len(matrix):
        return given
    try:
        found = solved(matrix, columns, scale, redundant)
    except np.linalg.LinAlgError:
        found = solved(matrix, columns, scale, True)
    return np.asarray(found.reshape(given.shape))
