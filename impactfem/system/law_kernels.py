"""Hyperelastic laws, compiled: energy, stress and stiffness of a point by Green's strain.

Those of `impactfem.forms.finite_strain`, against which tests hold them, and those that have no
simple form there. A law is a function for each of both tables below, a number in `KERNELS`, and a
branch in `_stress` and in `_stiffness`. Strains are those of space: in the plane the rest is 0,
with an axis zz is the hoop's; of materials that are flat, in plane stress, zz follows.
"""

import math
from collections.abc import Mapping

import numpy as np

from impactfem.compiled import fused
from impactfem.system.spectral_kernels import principal_stiffness, principal_stress, thinned

KERNELS: Mapping[str, int] = {"linear": 0, "mooney_rivlin": 1, "ogden": 2, "orthotropic": 3}
"""Numbers of the laws. The neo-Hookean law is that of Mooney and Rivlin with c01 = 0, the foam's
that of Ogden; the orthotropic one is linear."""
HEAD = 5  # entries of a material before the constants of single laws

_STEPS = 60  # of Newton's method for the thickness, which needs 4 to 8


@fused
def stress(material, xx, yy, zz, xy, yz, zx):
    """W [J/m^3] and S [Pa] (xx, yy, zz, xy, yz, zx) of Green's strain.

    Args:
        material: Number of the law, 1 if it is flat, lambda, mu and c01 [Pa], and what follows of
            single laws, (entries,): of Ogden's mu [Pa], alpha and beta of each term, of the
            orthotropic one its stiffness [Pa], 36 entries.
        xx, yy, zz, xy, yz, zx: Strain; of flat materials only that in the plane counts.
    """
    if material[1] == 0.0:
        return _stress(material, xx, yy, zz, xy, yz, zx)
    zz = thickened(material, xx, yy, xy)
    w, sxx, syy, _, sxy, syz, szx = _stress(material, xx, yy, zz, xy, 0.0, 0.0)
    return w, sxx, syy, 0.0, sxy, syz, szx


@fused
def stiffness(material, xx, yy, zz, xy, yz, zx, matrix):
    """Fill dS / dE [Pa], (6, 6), in the order of `stress`, for shears 2 E_xy, 2 E_yz, 2 E_zx."""
    if material[1] == 0.0:
        _stiffness(material, xx, yy, zz, xy, yz, zx, matrix)
        return
    zz = thickened(material, xx, yy, xy)
    _stiffness(material, xx, yy, zz, xy, 0.0, 0.0, matrix)
    across = 1.0 / matrix[2, 2]
    for i in range(6):
        for j in range(6):
            if i != 2 and j != 2:
                matrix[i, j] -= across * matrix[i, 2] * matrix[2, j]
    matrix[2, :] = 0.0
    matrix[:, 2] = 0.0


@fused
def thickened(material, xx, yy, xy):
    """Green's strain across a flat body by that in its plane: no stress is left across it."""
    law, first, second, third = material[0], material[2], material[3], material[4]
    if law == 0.0:
        return -first * (xx + yy) / (first + 2.0 * second)
    if law == 3.0:
        c = material[HEAD:]
        return -(c[12] * xx + c[13] * yy + 2.0 * c[15] * xy) / c[14]
    # C_zz S_zz grows with x = ln C_zz: Newton's method, whose steps are bounded, finds its zero.
    trace = 2.0 + 2.0 * (xx + yy)
    area = 1.0 + 2.0 * (xx + yy) + 4.0 * (xx * yy - xy * xy)
    log = math.log(area)
    x = -first * log / (first + 2.0 * second)
    for _ in range(_STEPS):
        if law == 1.0:
            bulk, pressing = first - 4.0 * third, second + 2.0 * third
            plain = math.exp(x) * (pressing - 4.0 * third + 2.0 * third * trace)
            value = plain + 0.5 * bulk * (log + x) - pressing
            slope = plain + 0.5 * bulk
        else:
            value, slope = thinned(material, 0.5 * (log + x), x)
        step = max(-1.0, min(1.0, -value / slope))
        x += step
        if not abs(step) > 1e-15 * (1.0 + abs(x)):
            break
    return 0.5 * math.expm1(x)


@fused
def _stress(material, xx, yy, zz, xy, yz, zx):
    """As `stress`, of a strain in space."""
    law, first, second, third = material[0], material[2], material[3], material[4]
    if law == 0.0:
        return _linear(first, second, xx, yy, zz, xy, yz, zx)
    if law == 1.0:
        return _mooney_rivlin(first, second, third, xx, yy, zz, xy, yz, zx)
    if law == 2.0:
        return principal_stress(material, xx, yy, zz, xy, yz, zx)
    return _orthotropic(material[HEAD:], xx, yy, zz, xy, yz, zx)


@fused
def _stiffness(material, xx, yy, zz, xy, yz, zx, matrix):
    """As `stiffness`, of a strain in space."""
    law, first, second, third = material[0], material[2], material[3], material[4]
    if law == 0.0:
        matrix[:] = 0.0
        matrix[:3, :3] = first
        for i in range(3):
            matrix[i, i] += 2.0 * second
            matrix[i + 3, i + 3] = second
        return
    if law == 2.0:
        principal_stiffness(material, xx, yy, zz, xy, yz, zx, matrix)
        return
    if law == 3.0:
        matrix[:] = material[HEAD:].reshape(6, 6)
        return
    log, rest, cxx, cyy, czz, cxy, cyz, czx = _inverse(xx, yy, zz, xy, yz, zx)
    ratio = 1.0 / (1.0 + rest)
    c = (cxx * ratio, cyy * ratio, czz * ratio, cxy * ratio, cyz * ratio, czx * ratio)
    bulk = first - 4.0 * third
    shear = second + 2.0 * third - 0.5 * bulk * log
    # Places of the rows (ij) in the symmetric inverse.
    table = ((0, 3, 5), (3, 1, 4), (5, 4, 2))
    one, two = (0, 1, 2, 0, 1, 2), (0, 1, 2, 1, 2, 0)
    for a in range(6):
        i, j = one[a], two[a]
        for b in range(6):
            k, m = one[b], two[b]
            crossed = c[table[i][k]] * c[table[j][m]] + c[table[i][m]] * c[table[j][k]]
            matrix[a, b] = bulk * c[a] * c[b] + shear * crossed
    for i in range(3):
        matrix[i + 3, i + 3] -= 2.0 * third
        for j in range(3):
            if i != j:
                matrix[i, j] += 4.0 * third


@fused
def _orthotropic(c, xx, yy, zz, xy, yz, zx):
    """S = C : E with c the entries of C."""
    e = (xx, yy, zz, 2.0 * xy, 2.0 * yz, 2.0 * zx)
    s = np.zeros(6)
    w = 0.0
    for i in range(6):
        for j in range(6):
            s[i] += c[6 * i + j] * e[j]
        w += 0.5 * s[i] * e[i]
    return w, s[0], s[1], s[2], s[3], s[4], s[5]


@fused
def _linear(first, second, xx, yy, zz, xy, yz, zx):
    """St. Venant's and Kirchhoff's law."""
    trace, twice = xx + yy + zz, 2.0 * second
    pressed = first * trace
    squares = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + yz * yz + zx * zx)
    return (
        0.5 * pressed * trace + second * squares,
        pressed + twice * xx, pressed + twice * yy, pressed + twice * zz,
        twice * xy, twice * yz, twice * zx,
    )  # fmt: skip


@fused
def _mooney_rivlin(first, second, third, xx, yy, zz, xy, yz, zx):
    """S = (mu + 2 c01 (1 + 2 tr E)) I - 4 c01 E + (lambda' ln(D) / 2 - mu - 2 c01) C^-1.

    D = det C, lambda' = lambda - 4 c01; with c01 = 0 the neo-Hookean law.
    """
    log, rest, cxx, cyy, czz, cxy, cyz, czx = _inverse(xx, yy, zz, xy, yz, zx)
    trace, bulk, pressing = xx + yy + zz, first - 4.0 * third, second + 2.0 * third
    squares = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + yz * yz + zx * zx)
    energy = pressing * (trace - 0.5 * log) + 0.125 * bulk * log * log
    energy += 2.0 * third * (trace * trace - squares)
    slope = (0.5 * bulk * log - pressing) / (1.0 + rest)
    plain, twice = pressing + 4.0 * third * trace, 4.0 * third
    return (
        energy,
        plain - twice * xx + slope * cxx, plain - twice * yy + slope * cyy,
        plain - twice * zz + slope * czz,
        slope * cxy - twice * xy, slope * cyz - twice * yz, slope * czx - twice * zx,
    )  # fmt: skip


@fused
def _inverse(xx, yy, zz, xy, yz, zx):
    """Ln D, D - 1 without cancellation, and the cofactors of C = I + 2 E."""
    axx, ayy, azz, axy, ayz, azx = 2.0 * xx, 2.0 * yy, 2.0 * zz, 2.0 * xy, 2.0 * yz, 2.0 * zx
    # Cofactors of C - I, of which those of C and D - 1 are made.
    cxx, cyy, czz = ayy * azz - ayz * ayz, azz * axx - azx * azx, axx * ayy - axy * axy
    cxy, cyz, czx = ayz * azx - axy * azz, azx * axy - ayz * axx, axy * ayz - azx * ayy
    rest = axx + ayy + azz + (cxx + cyy + czz) + axx * cxx + axy * cxy + azx * czx
    return (
        math.log1p(rest), rest,
        1.0 + ayy + azz + cxx, 1.0 + azz + axx + cyy, 1.0 + axx + ayy + czz,
        cxy - axy, cyz - ayz, czx - azx,
    )  # fmt: skip
