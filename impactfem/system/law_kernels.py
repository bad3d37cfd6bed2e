"""Hyperelastic laws, compiled: energy, stress and stiffness of a point by Green's strain.

The same laws as `impactfem.forms.finite_strain`, against which tests hold them. A law is a function
for each of both tables below, a number in `KERNELS`, and a branch in `stress` and in `stiffness`.
Strains are those of space: in the plane the rest is 0, with an axis zz is the hoop's.
"""

import math
from collections.abc import Mapping

from impactfem.compiled import fused

KERNELS: Mapping[str, int] = {"linear": 0, "neo_hookean": 1, "mooney_rivlin": 1}
"""Numbers of the laws by the name of the scene's key ``material``."""


@fused
def stress(material, xx, yy, zz, xy, yz, zx):
    """W [J/m^3] and S [Pa] (xx, yy, zz, xy, yz, zx) of Green's strain.

    Args:
        material: Number of the law, lambda, mu and c01 [Pa].
        xx, yy, zz, xy, yz, zx: Strain.
    """
    law, first, second, third = material
    if law == 0:
        return _linear(first, second, xx, yy, zz, xy, yz, zx)
    return _mooney_rivlin(first, second, third, xx, yy, zz, xy, yz, zx)


@fused
def stiffness(material, xx, yy, zz, xy, yz, zx, matrix):
    """Fill dS / dE [Pa], (6, 6), in the order of `stress`, for shears 2 E_xy, 2 E_yz, 2 E_zx."""
    law, first, second, third = material
    if law == 0:
        matrix[:] = 0.0
        matrix[:3, :3] = first
        for i in range(3):
            matrix[i, i] += 2.0 * second
            matrix[i + 3, i + 3] = second
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
