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
"""

import numpy as np

from impactfem.compiled import compiled

_MOST, _SETTLED = 50, 4e-16  # iterates, and the change of spins that is but rounding
_FINE = 1e-12  # change with which the last iterate still counts
_FEW = 5  # iterates after which that is so
_SMALL = 1e-4  # angles whose tangent is known by its series
_LARGEST = 2.0  # rotation in a step [rad]; beyond pi it has no such form


@compiled
def turn(inertia, inverse, rotation, spin, impulse, dt, straight):
    """The rotation of a layer.

    Args:
        inertia, inverse: J [kg m^2] and its inverse, (3, 3).
        rotation: R_a, (3, 3).
        spin: W_a [rad/s], (3,).
        impulse: Of moments in space [N m s], (3,).
        dt: [s].
        straight: Whether T = dt W_m.

    Returns:
        W_b [rad/s] and T / 2, (3,) each; R_b, the mean of R_a and R_b, and the inverse inertia in
        space amid the layer, (3, 3) each; whether they were found.
    """
    own = rotation.T @ impulse
    new = spin.copy()
    # Of what rounding is told by: impulses may stop a body but for that.
    given = max(np.abs(spin).max(), np.abs(inverse @ own).max())
    half, stretch = _stretched(spin, new, dt, straight)
    found = False
    for k in range(_MOST):
        mean = 0.5 * (spin + new)
        momentum = inertia @ mean
        missing = inertia @ (new - spin) + 2.0 * cross(half, momentum)
        missing += cross(half, own) - own
        if not missing.any():  # of balls on which no moments act
            found = stretch > 0.0
            break
        tangent = inertia + skew(half) @ inertia
        tangent -= 0.5 * dt * stretch * skew(momentum + 0.5 * own)
        change = inverted(tangent) @ missing
        new = new - change
        half, stretch = _stretched(spin, new, dt, straight)
        size, left = max(given, np.abs(new).max()), np.abs(change).max()
        if not stretch > 0.0:
            break
        if left <= _SETTLED * size or (k > _FEW and left <= _FINE * size):
            found = True
            break
    end = rotation @ cayley(half)
    # Half the rotation: tan(a / 2) by tan(a).
    amid = rotation @ cayley(half / (1.0 + np.sqrt(1.0 + half @ half)))
    return new, half, end, 0.5 * (rotation + end), amid @ inverse @ amid.T, found


@compiled
def _stretched(spin, new, dt, straight):
    """T / 2, and tan(a) / a of half the angle that a layer turns; 0 if that is too large."""
    mean = 0.5 * (spin + new)
    angle = 0.5 * dt * np.sqrt(mean @ mean)
    if not angle < 0.5 * _LARGEST:
        return np.zeros(3), 0.0
    stretch = 1.0
    if not straight:
        stretch = np.tan(angle) / angle if angle > _SMALL else 1.0 + angle * angle / 3.0
    return 0.5 * dt * stretch * mean, stretch


@compiled
def cayley(half):
    """(1 - h)^-1 (1 + h) of a vector h as a skew matrix."""
    turned = skew(half)
    return np.eye(3) + 2.0 / (1.0 + half @ half) * (turned + turned @ turned)


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
