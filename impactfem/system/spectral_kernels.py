"""Ogden's law and that of Ogden and Storakers for foams, compiled: by principal stretches.

With x = 2 ln of the stretches and ln J = (x1 + x2 + x3) / 2, each term mu, alpha, beta has

    W = 2 mu / alpha^2 (sum (exp(alpha x_i / 2) - 1) + (exp(-alpha beta ln J) - 1) / beta)

and all together lambda' (ln J)^2 / 2, where beta = 0 leaves -alpha ln J of the last part. A foam
has no lambda'; Ogden's law no beta; with alpha = 2 the latter is neo-Hookean. Sources: R. W. Ogden,
Proc. R. Soc. A 326 (1972) 565-584; B. Storakers, J. Mech. Phys. Solids 34 (1986) 125-145.

Stress and stiffness have the directions of the strain; where two of its values are alike the
stiffness is the limit (J. C. Simo, R. L. Taylor, Comput. Methods Appl. Mech. Eng. 85 (1991)
273-310), so that no direction has to be known then.
"""

import math

import numpy as np

from impactfem.compiled import fused

_HEAD = 5  # entries of a material before the terms, see `law_kernels`
_SWEEPS = 12  # of Jacobi's method, which needs 4 or 5
_ALIKE = 1e-5  # difference of principal strains below which the limit stands for the quotient


@fused
def _rest(y):
    """exp(y) - 1 - y without cancellation."""
    if abs(y) > 0.1:
        return math.expm1(y) - y
    found = 1.0
    for k in range(12, 2, -1):
        found = 1.0 + y / k * found
    return 0.5 * y * y * found


@fused
def _terms(material, log, x, slopes):
    """W [J/m^3] and its derivatives by x [Pa], which fill ``slopes`` (3,)."""
    bulk = material[2]
    w = 0.5 * bulk * log * log
    slopes[:] = 0.5 * bulk * log
    for k in range(_HEAD, len(material), 3):
        mu, alpha, beta = material[k], material[k + 1], material[k + 2]
        if mu == 0.0:
            continue
        z = -alpha * beta * log
        sums = _rest(z) / beta if beta != 0.0 else 0.0
        volume = math.expm1(z)
        for i in range(3):
            y = 0.5 * alpha * x[i]
            sums += _rest(y)
            slopes[i] += mu / alpha * (math.expm1(y) - volume)
        w += 2.0 * mu / (alpha * alpha) * sums
    return w


@fused
def thinned(material, log, x):
    """C S [Pa] along a principal direction, and its derivative by x there.

    Args:
        material: See `law_kernels.stress`.
        log: ln J.
        x: Twice the logarithm of the stretch along it.
    """
    bulk = material[2]
    value, slope = bulk * log, 0.5 * bulk
    for k in range(_HEAD, len(material), 3):
        mu, alpha, beta = material[k], material[k + 1], material[k + 2]
        if mu == 0.0:
            continue
        y, z = 0.5 * alpha * x, -alpha * beta * log
        value += 2.0 * mu / alpha * (math.expm1(y) - math.expm1(z))
        slope += mu * (math.exp(y) + beta * math.exp(z))
    return value, slope


@fused
def _principal(xx, yy, zz, xy, yz, zx, values, ways):
    """Fill principal strains (3,) and their directions in columns (3, 3), by Jacobi's method."""
    ways[:] = 0.0
    a = np.zeros((3, 3))
    a[0, 0], a[1, 1], a[2, 2] = xx, yy, zz
    a[0, 1] = a[1, 0] = xy
    a[1, 2] = a[2, 1] = yz
    a[0, 2] = a[2, 0] = zx
    for i in range(3):
        ways[i, i] = 1.0
    for _ in range(_SWEEPS):
        off = a[0, 1] * a[0, 1] + a[1, 2] * a[1, 2] + a[0, 2] * a[0, 2]
        if off == 0.0:
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if a[p, q] == 0.0:
                    continue
                theta = 0.5 * (a[q, q] - a[p, p]) / a[p, q]
                t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
                t = t if theta >= 0.0 else -t
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                changed = t * a[p, q]
                a[p, p] -= changed
                a[q, q] += changed
                a[p, q] = a[q, p] = 0.0
                r = 3 - p - q
                one, two = a[r, p], a[r, q]
                a[r, p] = a[p, r] = c * one - s * two
                a[r, q] = a[q, r] = s * one + c * two
                for m in range(3):
                    one, two = ways[m, p], ways[m, q]
                    ways[m, p], ways[m, q] = c * one - s * two, s * one + c * two
    for i in range(3):
        values[i] = a[i, i]


@fused
def _seen(material, xx, yy, zz, xy, yz, zx, ways):
    """W, x, derivatives of W by x, principal strains and ln J; ``ways`` is filled."""
    values, x, slopes = np.zeros(3), np.zeros(3), np.zeros(3)
    _principal(xx, yy, zz, xy, yz, zx, values, ways)
    for i in range(3):
        x[i] = math.log1p(2.0 * values[i])
    log = 0.5 * (x[0] + x[1] + x[2])
    w = _terms(material, log, x, slopes)
    return w, x, slopes, values, log


@fused
def principal_stress(material, xx, yy, zz, xy, yz, zx):
    """See `law_kernels.stress`."""
    ways = np.zeros((3, 3))
    w, _, slopes, values, _ = _seen(material, xx, yy, zz, xy, yz, zx, ways)
    sxx = syy = szz = sxy = syz = szx = 0.0
    for i in range(3):
        own = 2.0 * slopes[i] / (1.0 + 2.0 * values[i])
        a, b, c = ways[0, i], ways[1, i], ways[2, i]
        sxx, syy, szz = sxx + own * a * a, syy + own * b * b, szz + own * c * c
        sxy, syz, szx = sxy + own * a * b, syz + own * b * c, szx + own * c * a
    return w, sxx, syy, szz, sxy, syz, szx


@fused
def principal_stiffness(material, xx, yy, zz, xy, yz, zx, matrix):
    """See `law_kernels.stiffness`."""
    ways, own, slopes_by = np.zeros((3, 3)), np.zeros(3), np.zeros((6, 6))
    _, x, slopes, values, log = _seen(material, xx, yy, zz, xy, yz, zx, ways)
    slopes_by[:3, :3] = 0.25 * material[2]
    for k in range(_HEAD, len(material), 3):
        mu, alpha, beta = material[k], material[k + 1], material[k + 2]
        if mu == 0.0:
            continue
        slopes_by[:3, :3] += 0.5 * mu * beta * math.exp(-alpha * beta * log)
        for i in range(3):
            slopes_by[i, i] += 0.5 * mu * math.exp(0.5 * alpha * x[i])
    for i in range(3):
        c = 1.0 + 2.0 * values[i]
        own[i] = 2.0 * slopes[i] / c
        for j in range(3):
            slopes_by[i, j] *= 4.0 / (c * (1.0 + 2.0 * values[j]))
        slopes_by[i, i] -= 4.0 * slopes[i] / (c * c)
    one, two = (0, 1, 2, 0, 1, 2), (0, 1, 2, 1, 2, 0)
    for a in range(3, 6):
        i, j = one[a], two[a]
        apart = values[i] - values[j]
        if abs(apart) > _ALIKE * (1.0 + 2.0 * min(values[i], values[j])):
            slopes_by[a, a] = 0.5 * (own[i] - own[j]) / apart
        else:
            mean = 0.5 * (slopes_by[i, i] + slopes_by[j, j])
            slopes_by[a, a] = 0.5 * (mean - slopes_by[i, j])
    # Directions carry stresses as rows, strains as columns.
    turn = np.zeros((6, 6))
    for a in range(6):
        i, j = one[a], two[a]
        for b in range(6):
            k, m = one[b], two[b]
            turn[a, b] = ways[i, k] * ways[j, m]
            if b > 2:
                turn[a, b] += ways[i, m] * ways[j, k]
    for a in range(6):
        for b in range(6):
            value = 0.0
            for k in range(6):
                if k < 3:
                    for m in range(3):
                        value += turn[a, k] * slopes_by[k, m] * turn[b, m]
                else:
                    value += turn[a, k] * slopes_by[k, k] * turn[b, k]
            matrix[a, b] = value
