"""Principal stretches and volumes at the points of all cells of a body; see `stretches`."""

import math

import numpy as np

from impactfem.compiled import compiled
from impactfem.system.law_kernels import thickened


@compiled
def in_plane(u, cells, table, inverse, hoop, across, material, weights, known, strain, volume):
    """Look at the points of plane cells; see `in_space`.

    Args:
        u, cells, table, inverse, weights, known, strain, volume: See there.
        hoop: Shape functions over the distance from the axis [1/m], shape (cells, points, corners)
            or with no entry.
        across: Strain of the thickness over the sum of those in the plane, (cells,).
        material: Instead, of bodies in plane stress under finite strain, as
            `impactfem.system.law_kernels.thickened` takes it, (cells, entries), or with no entry.
    """
    largest, least, above, count = 0.0, np.inf, 0.0, 0
    for c in range(len(cells)):
        for p in range(len(table)):
            aa = ab = ba = bb = third = 0.0
            for k in range(cells.shape[1]):
                x, y = u[cells[c, k], 0], u[cells[c, k], 1]
                aa += x * table[p, k, 0]
                ab += x * table[p, k, 1]
                ba += y * table[p, k, 0]
                bb += y * table[p, k, 1]
                if hoop.size:
                    third += hoop[c, p, k] * x
            j = inverse[c, p]
            xx, xy = aa * j[0, 0] + ab * j[1, 0], aa * j[0, 1] + ab * j[1, 1]
            yx, yy = ba * j[0, 0] + bb * j[1, 0], ba * j[0, 1] + bb * j[1, 1]
            # Half the sum and half the difference of the singular values of I + grad u.
            mean = 0.5 * math.sqrt((2.0 + xx + yy) ** 2 + (yx - xy) ** 2) - 1.0
            half = 0.5 * math.sqrt((xx - yy) ** 2 + (xy + yx) ** 2)
            third += 2.0 * across[c] * mean
            if material.size:
                one, two = xx + 0.5 * (xx * xx + yx * yx), yy + 0.5 * (yy * yy + xy * xy)
                both = 0.5 * (xy + yx + xx * xy + yx * yy)
                third = math.sqrt(1.0 + 2.0 * thickened(material[c], one, two, both)) - 1.0
            value = max(abs(mean) + half, abs(third))
            if not value <= largest:
                largest = min(np.inf, value)  # also if it is not a number
            if value > known:
                strain[count], volume[count] = value, weights[c, p]
                above += weights[c, p]
                count += 1
            least = min(least, ((1.0 + xx) * (1.0 + yy) - xy * yx) * (1.0 + third))
    return largest, least, above, count


@compiled
def in_space(u, cells, table, inverse, weights, known, strain, volume):
    """Look at the points of cells in space.

    Args:
        u: Displacement of the nodes [m], shape (nodes, dim).
        cells: Nodes of each cell, shape (cells, corners).
        table: Reference gradients of their shape functions, shape (points, corners, dim).
        inverse: Of the Jacobian, shape (cells, points, dim, dim).
        weights: Volumes, shape (cells, points).
        known: Strain up to which nothing is wanted but that it is not more.
        strain: Filled from its start with the largest principal strains by amount that are above.
        volume: Filled with the weights of these.

    Returns:
        The largest strain, if it is above the known one, the least det F, the volume in which
        strain is above the known one, and the number of these strains.
    """
    largest, least, above, count = 0.0, np.inf, 0.0, 0
    tetrahedra = cells.shape[1] == 4
    # A norm of Green's strain up to which no stretch is off by more than the known one.
    small = min(known * (1.0 - 0.5 * known), 0.5) ** 2 if known < 1.0 else 0.25
    for c in range(len(cells)):
        for p in range(len(table)):
            if tetrahedra:  # of degree 1: differences along three edges
                o, q, r, s = cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3]
                x, y, z = u[o, 0], u[o, 1], u[o, 2]
                aa, ab, ac = u[q, 0] - x, u[r, 0] - x, u[s, 0] - x
                ba, bb, bc = u[q, 1] - y, u[r, 1] - y, u[s, 1] - y
                ca, cb, cc = u[q, 2] - z, u[r, 2] - z, u[s, 2] - z
            else:
                aa = ab = ac = ba = bb = bc = ca = cb = cc = 0.0
                for k in range(cells.shape[1]):
                    x, y, z = u[cells[c, k], 0], u[cells[c, k], 1], u[cells[c, k], 2]
                    f, g, h = table[p, k, 0], table[p, k, 1], table[p, k, 2]
                    aa, ab, ac = aa + x * f, ab + x * g, ac + x * h
                    ba, bb, bc = ba + y * f, bb + y * g, bc + y * h
                    ca, cb, cc = ca + z * f, cb + z * g, cc + z * h
            j = inverse[c, p]
            xx = aa * j[0, 0] + ab * j[1, 0] + ac * j[2, 0]
            xy = aa * j[0, 1] + ab * j[1, 1] + ac * j[2, 1]
            xz = aa * j[0, 2] + ab * j[1, 2] + ac * j[2, 2]
            yx = ba * j[0, 0] + bb * j[1, 0] + bc * j[2, 0]
            yy = ba * j[0, 1] + bb * j[1, 1] + bc * j[2, 1]
            yz = ba * j[0, 2] + bb * j[1, 2] + bc * j[2, 2]
            zx = ca * j[0, 0] + cb * j[1, 0] + cc * j[2, 0]
            zy = ca * j[0, 1] + cb * j[1, 1] + cc * j[2, 1]
            zz = ca * j[0, 2] + cb * j[1, 2] + cc * j[2, 2]
            exx = xx + 0.5 * (xx * xx + yx * yx + zx * zx)
            eyy = yy + 0.5 * (xy * xy + yy * yy + zy * zy)
            ezz = zz + 0.5 * (xz * xz + yz * yz + zz * zz)
            exy = 0.5 * (xy + yx + xx * xy + yx * yy + zx * zy)
            eyz = 0.5 * (yz + zy + xy * xz + yy * yz + zy * zz)
            ezx = 0.5 * (zx + xz + xx * xz + yx * yz + zx * zz)
            off = exy * exy + eyz * eyz + ezx * ezx
            if not exx * exx + eyy * eyy + ezz * ezz + 2.0 * off <= small:
                value = _largest(exx, eyy, ezz, exy, eyz, ezx)
                if not value <= largest:
                    largest = min(np.inf, value)  # also if it is not a number
                if value > known:
                    strain[count], volume[count] = value, weights[c, p]
                    above += weights[c, p]
                    count += 1
            xx, yy, zz = xx + 1.0, yy + 1.0, zz + 1.0
            ratio = xx * (yy * zz - yz * zy) - xy * (yx * zz - yz * zx) + xz * (yx * zy - yy * zx)
            least = min(least, ratio)
    return largest, least, above, count


@compiled
def _largest(xx, yy, zz, xy, yz, zx):
    """Largest amount of a stretch less 1, for Green's strain.

    By the roots of the characteristic polynomial (J. Kopp, Int. J. Mod. Phys. C 19 (2008) 523-548,
    section 3.1). In Green's strain 1 has cancelled: the result is right to rounding if small.
    """
    off = xy * xy + yz * yz + zx * zx
    mean = (xx + yy + zz) / 3.0
    xx, yy, zz = xx - mean, yy - mean, zz - mean
    size = math.sqrt((xx * xx + yy * yy + zz * zz + 2.0 * off) / 6.0)
    third = 0.0
    if size > 0.0:
        value = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * zx) + zx * (xy * yz - yy * zx)
        third = math.acos(min(1.0, max(-1.0, 0.5 * value / size**3))) / 3.0
    high = mean + 2.0 * size * math.cos(third)
    low = mean + 2.0 * size * math.cos(third + 2.0 * math.pi / 3.0)
    return max(abs(_stretched(high)), abs(_stretched(low)))


@compiled
def _stretched(green):
    """Stretch less 1 of a principal value of Green's strain."""
    return 2.0 * green / (1.0 + math.sqrt(max(0.0, 1.0 + 2.0 * green)))
