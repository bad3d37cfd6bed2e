"""A layer of a rigid body's rotation, by an energy-momentum step in quaternions.

With the spin W along the axes of the body, J its inertia and R its rotation, Euler's equations are
kept as the balance of angular momentum in space,

    R_b J W_b = R_a J W_a + (impulse of moments),   R_b = R_a exp(dt W_m),   W_m = (W_a + W_b) / 2.

The rotation by the angle phi = dt |W_m| about W_m is Cayley's of T = (tan(phi/2) / (phi/2)) dt W_m,
R_b = R_a (1 - T/2)^-1 (1 + T/2) with T as a skew matrix, so that the balance is, times
(1 - T/2) R_a^T,

    J (W_b - W_a) + T x J W_m = (1 - T/2) R_a^T (impulse).

T is along W_m: without moments W_m . J (W_b - W_a) = 0, and the energy stays as exactly as the
angular momentum does. With them W_m R_a^T . impulse is their work, as (1 + T/2) W_m = W_m: that of
a force on a material point r along its chord T x (mean of R_a r, R_b r), but for the square of phi
(bodies in joints, and beside others under finite strain, take T = dt W_m, which has no
such share). Free spin about a principal axis, and
any of a ball, is exact. (After J. C. Simo, K. K. Wong, Int. J. Numer. Meth. Eng. 31 (1991) 19-52,
who take the same balance.)

Where arms do not turn with the body, as those of a ball that touches around its centre, steps may
be of many turns: with J = j 1 the balance is that of spins in space, w_b = w_a + impulse / j, and
the body turns about their mean, on which moments do their work.
"""

import numpy as np

from impactfem.compiled import compiled
from impactfem.system.vector_kernels import across, by, crossed

_MOST, _SETTLED = 50, 4e-16  # iterates, and the change of spins that is but rounding
_FINE = 1e-12  # change with which the last iterate still counts
_FEW = 5  # iterates after which that is so
_SMALL = 1e-4  # angles whose tangent is known by its series
LARGEST = 2.0  # rotation in a step [rad]; beyond pi it has no such form


@compiled
def turn(
    inertia, inverse, rotation, spin, impulse, dt, straight, free, new, half, end, middle, freedom
):  # fmt: skip
    """The rotation of a layer.

    Vectors are tuples here: arrays that are made for each product would take most of the time.

    Args:
        inertia, inverse: J [kg m^2] and its inverse, (3, 3).
        rotation: R_a, (3, 3).
        spin: W_a [rad/s], (3,).
        impulse: Of moments in space [N m s], (3,).
        dt: [s].
        straight: Whether T = dt W_m.
        free: Whether steps may be of many turns; see `impactfem.system.rigid.Rigid.free`.
        new, half: W_b [rad/s] and T / 2, (3,) each; written.
        end, middle, freedom: R_b, the mean of R_a and R_b, and the inverse inertia in space amid
            the layer, (3, 3) each; written.

    Returns:
        Whether they were found.
    """
    first = (spin[0], spin[1], spin[2])
    own = across(rotation, (impulse[0], impulse[1], impulse[2]))
    last = first
    # Of what rounding is told by: impulses may stop a body but for that.
    given = max(_largest(first), _largest(by(inverse, own)))
    h, stretch = _stretched(first, last, dt, straight)
    found = False
    if free:
        gain = by(inverse, own)
        mean = (first[0] + 0.5 * gain[0], first[1] + 0.5 * gain[1], first[2] + 0.5 * gain[2])
        size = np.sqrt(mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2])
        if 0.5 * dt * size >= 0.5 * LARGEST:
            share = np.tan(0.5 * dt * size) / size
            h, found = (share * mean[0], share * mean[1], share * mean[2]), True
            last = (first[0] + gain[0], first[1] + gain[1], first[2] + gain[2])
            share = 2.0 / (1.0 + h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
            once = crossed(last, h)  # along the axes at the end
            twice = crossed(once, h)
            last = (
                last[0] + share * (once[0] + twice[0]),
                last[1] + share * (once[1] + twice[1]),
                last[2] + share * (once[2] + twice[2]),
            )
    for k in range(0 if found else _MOST):
        mean = (0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1]), 0.5 * (first[2] + last[2]))
        p = by(inertia, mean)
        grown = by(inertia, (last[0] - first[0], last[1] - first[1], last[2] - first[2]))
        a, b = crossed(h, p), crossed(h, own)
        x = grown[0] + 2.0 * a[0] + (b[0] - own[0])
        y = grown[1] + 2.0 * a[1] + (b[1] - own[1])
        z = grown[2] + 2.0 * a[2] + (b[2] - own[2])
        if x == 0.0 and y == 0.0 and z == 0.0:  # of balls on which no moments act
            found = stretch > 0.0
            break
        # The tangent J + h x J - dt stretch / 2 (J W_m + own / 2) x, by its rows.
        share = 0.5 * dt * stretch
        e, f, g = (
            share * (p[0] + 0.5 * own[0]),
            share * (p[1] + 0.5 * own[1]),
            share * (p[2] + 0.5 * own[2]),
        )
        one = (
            inertia[0, 0] + (h[1] * inertia[2, 0] - h[2] * inertia[1, 0]),
            inertia[0, 1] + (h[1] * inertia[2, 1] - h[2] * inertia[1, 1]) + g,
            inertia[0, 2] + (h[1] * inertia[2, 2] - h[2] * inertia[1, 2]) - f,
        )
        two = (
            inertia[1, 0] + (h[2] * inertia[0, 0] - h[0] * inertia[2, 0]) - g,
            inertia[1, 1] + (h[2] * inertia[0, 1] - h[0] * inertia[2, 1]),
            inertia[1, 2] + (h[2] * inertia[0, 2] - h[0] * inertia[2, 2]) + e,
        )
        three = (
            inertia[2, 0] + (h[0] * inertia[1, 0] - h[1] * inertia[0, 0]) + f,
            inertia[2, 1] + (h[0] * inertia[1, 1] - h[1] * inertia[0, 1]) - e,
            inertia[2, 2] + (h[0] * inertia[1, 2] - h[1] * inertia[0, 2]),
        )
        c1, c2, c3 = crossed(two, three), crossed(three, one), crossed(one, two)
        volume = three[0] * c3[0] + three[1] * c3[1] + three[2] * c3[2]
        change = (
            (c1[0] * x + c2[0] * y + c3[0] * z) / volume,
            (c1[1] * x + c2[1] * y + c3[1] * z) / volume,
            (c1[2] * x + c2[2] * y + c3[2] * z) / volume,
        )
        last = (last[0] - change[0], last[1] - change[1], last[2] - change[2])
        h, stretch = _stretched(first, last, dt, straight)
        size, left = max(given, _largest(last)), _largest(change)
        if not stretch > 0.0:
            break
        if left <= _SETTLED * size or (k > _FEW and left <= _FINE * size):
            found = True
            break
    square = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
    # Half the rotation: tan(a / 2) by tan(a).
    part = 1.0 / (1.0 + np.sqrt(1.0 + square))
    turned_by(rotation, (part * h[0], part * h[1], part * h[2]), middle)
    turned_by(rotation, h, end)
    for i in range(3):
        row = across(inverse, (middle[i, 0], middle[i, 1], middle[i, 2]))
        for j in range(3):
            freedom[i, j] = row[0] * middle[j, 0] + row[1] * middle[j, 1] + row[2] * middle[j, 2]
    for i in range(3):
        new[i], half[i] = last[i], h[i]
        for j in range(3):
            middle[i, j] = 0.5 * (rotation[i, j] + end[i, j])
    return found


@compiled
def _stretched(first, last, dt, straight):
    """T / 2, and tan(a) / a of half the angle that a layer turns; 0 if that is too large."""
    x, y, z = 0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1]), 0.5 * (first[2] + last[2])
    angle = 0.5 * dt * np.sqrt(x * x + y * y + z * z)
    if not angle < 0.5 * LARGEST:
        return (0.0, 0.0, 0.0), 0.0
    stretch = 1.0
    if not straight:
        stretch = np.tan(angle) / angle if angle > _SMALL else 1.0 + angle * angle / 3.0
    share = 0.5 * dt * stretch
    return (share * x, share * y, share * z), stretch


@compiled
def _largest(a):
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@compiled
def turned_by(rotation, h, found):
    """A rotation times (1 - h)^-1 (1 + h) of a vector h as a skew matrix, (3, 3); written."""
    x, y, z = h
    share = 2.0 / (1.0 + x * x + y * y + z * z)
    for i in range(3):
        row = (rotation[i, 0], rotation[i, 1], rotation[i, 2])
        # Of skew matrices S: r S = r x h, so that r S S is that once more.
        once = crossed(row, h)
        twice = crossed(once, h)
        for j in range(3):
            found[i, j] = row[j] + share * (once[j] + twice[j])


@compiled
def cross(a, b):
    """The cross product of two vectors: compiles in a fraction of what NumPy's takes."""
    found = np.empty(3)
    found[0] = a[1] * b[2] - a[2] * b[1]
    found[1] = a[2] * b[0] - a[0] * b[2]
    found[2] = a[0] * b[1] - a[1] * b[0]
    return found


@compiled
def inverted(matrix):
    """The inverse of a matrix (3, 3) by its cofactors; not finite where there is none."""
    found = np.empty((3, 3))
    volume = 0.0
    for i in range(3):
        across = cross(matrix[(i + 1) % 3], matrix[(i + 2) % 3])
        volume = matrix[i] @ across
        found[:, i] = across
    return found / volume


@compiled
def skew(a):
    """Matrix of the cross product with a vector on the left."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
