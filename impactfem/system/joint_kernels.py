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

from impactfem.arrays import Floats
from impactfem.compiled import compiled

POINT, DOT, SLIDE, DISTANCE, ANGLE = range(5)
"""Kinds of terms; see `values`."""

ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
"""Share of what rows could move at most below which their motion is but rounding."""

RANK = 1e-9
"""Share of the largest singular value of rows made alike below which one follows from others."""

_SAME = 1e-5  # relative turn [rad] below which an angle is its linear part to rounding


@compiled
def values(kinds, bodies, arms, axes, across, places, turns, before):
    """Values of terms, (terms,).

    Args:
        kinds: POINT: (p2 - p1) . u with u in space; DOT: u1 . u2; SLIDE: (p2 - p1) . u1; DISTANCE:
            |p2 - p1|; ANGLE: that of body 2 against body 1 about u1, next to the value before.
        bodies: (terms, 2).
        arms, axes: From the centres to p and the u, along the axes of the bodies, (terms, 2, 3).
        across: Directions whose angle is told, perpendicular to the axes, alike, (terms, 2, 3).
        places, turns: Centres and rotations of the bodies, (bodies, 3), (bodies, 3, 3).
        before: Values of angles nearby [rad], (terms,).
    """
    found = np.empty(len(kinds))
    for t in range(len(kinds)):
        i, j = bodies[t]
        d = places[j] + turns[j] @ arms[t, 1] - places[i] - turns[i] @ arms[t, 0]
        u = turns[i] @ axes[t, 0]
        if kinds[t] == POINT:
            found[t] = d @ axes[t, 0]
        elif kinds[t] == DOT:
            found[t] = u @ (turns[j] @ axes[t, 1])
        elif kinds[t] == SLIDE:
            found[t] = d @ u
        elif kinds[t] == DISTANCE:
            found[t] = np.sqrt(d @ d)
        else:
            one, two = turns[i] @ across[t, 0], turns[j] @ across[t, 1]
            angle = np.arctan2(two @ np.cross(u, one), two @ one)
            found[t] = angle + 2.0 * np.pi * np.round((before[t] - angle) / (2.0 * np.pi))
    return found


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
        one_a, two_a = start[1][i] @ arms[t, 0], start[1][j] @ arms[t, 1]
        one_b, two_b = end[1][i] @ arms[t, 0], end[1][j] @ arms[t, 1]
        d_a = start[0][j] + two_a - start[0][i] - one_a
        d_b = end[0][j] + two_b - end[0][i] - one_b
        u_a, u_b = start[1][i] @ axes[t, 0], end[1][i] @ axes[t, 0]
        one, two, d, u = (
            0.5 * (one_a + one_b), 0.5 * (two_a + two_b), 0.5 * (d_a + d_b), 0.5 * (u_a + u_b)
        )  # fmt: skip
        if kinds[t] == DOT:
            w = 0.5 * (start[1][j] @ axes[t, 1] + end[1][j] @ axes[t, 1])
            moment = np.cross(w, u)
            found[t, 0, 3:], found[t, 1, 3:] = -moment, moment
            continue
        if kinds[t] == ANGLE:
            # To first order in the way, for Cayley's rotations; scaled for the rest.
            mean = 0.5 * (turned[i] + turned[j])
            u = u - (0.25 * (mean @ u) / (1.0 + 0.25 * (mean @ mean))) * mean
            way = u @ (turned[j] - turned[i])
            scale = (values_b[t] - values_a[t]) / way if np.abs(way) > _SAME else 1.0
            found[t, 0, 3:], found[t, 1, 3:] = -scale * u, scale * u
            continue
        if kinds[t] == POINT:
            along = axes[t, 0]
        elif kinds[t] == SLIDE:
            along = u
        else:
            along = (d_a + d_b) / (values_a[t] + values_b[t])
        found[t, 0, :3], found[t, 1, :3] = -along, along
        found[t, 0, 3:], found[t, 1, 3:] = -np.cross(one, along), np.cross(two, along)
        if kinds[t] == SLIDE:
            found[t, 0, 3:] += np.cross(u, d)
    return found


@compiled
def at_gradients(kinds, bodies, arms, axes, places, turns, now):
    """Gradients of terms at a state, (terms, 2, 6); values of the terms there as ``now``."""
    here = (places, turns)
    return gradients(kinds, bodies, arms, axes, here, here, np.zeros(places.shape), now, now)


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
    for t in range(len(rows)):
        for side in range(2):
            body = bodies[t, side]
            push, twist = gradient[t, side, :3], gradient[t, side, 3:]
            light, free = 3.0 * inverse_mass[body], np.trace(freedoms[body])
            for c in range(len(couples)):
                if couples[c, 0] == body and couples[c, 1] == body:
                    light += np.trace(compliance[c, :3, :3])
                    free += np.trace(compliance[c, 3:, 3:])
            sizes[rows[t]] += light * (push @ push) + abs(free) * (twist @ twist)
            moved = np.empty(6)
            moved[:3] = inverse_mass[body] * gradient[t, side, :3]
            moved[3:] = freedoms[body] @ gradient[t, side, 3:]
            for s in range(len(rows)):
                for other in range(2):
                    if bodies[s, other] == body:
                        found[rows[s], rows[t]] += last[s, other] @ moved
            for c in range(len(couples)):
                if couples[c, 1] != body:
                    continue
                moved = compliance[c] @ gradient[t, side]
                for s in range(len(rows)):
                    for other in range(2):
                        if bodies[s, other] == couples[c, 0]:
                            found[rows[s], rows[t]] += last[s, other] @ moved
    for r in range(count):
        if abs(found[r, r]) <= ROUNDING * sizes[r]:
            found[r, :] = 0.0
            found[:, r] = 0.0
    return found


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
        found = np.linalg.solve(alike, right)
    return scale.reshape((-1, 1)) * found


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
