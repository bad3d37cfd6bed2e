"""Internal forces of all cells of a body under finite strain, and tangents of some of its nodes.

H = grad u, F = I + H, E = sym H + H^T H / 2, S by the law, and the force of node k is the integral
of F S grad N_k.
"""

import numpy as np

from impactfem.compiled import fused
from impactfem.system.law_kernels import stiffness, stress


@fused
def plane_forces(material, u, cells, rows, table, hoop, weights, out):
    """Sum up the forces of plane cells; see `space_forces`.

    Args:
        material, u, cells, rows, table, weights, out: See there, with two directions.
        hoop: Shape functions over the distance from the axis [1/m], (cells, points, corners), or
            with no entry.
    """
    out[:] = 0.0
    energy, least = 0.0, np.inf
    for c in range(len(cells)):
        own = material[c]
        for p in range(table.shape[1]):
            xx = xy = yx = yy = around = 0.0
            for k in range(cells.shape[1]):
                x, y = u[cells[c, k], 0], u[cells[c, k], 1]
                xx += x * table[c, p, k, 0]
                xy += x * table[c, p, k, 1]
                yx += y * table[c, p, k, 0]
                yy += y * table[c, p, k, 1]
                if hoop.size:
                    around += x * hoop[c, p, k]
            fxx, fyy, third = 1.0 + xx, 1.0 + yy, 1.0 + around
            ratio = (fxx * fyy - xy * yx) * third
            least = min(least, ratio)
            if not ratio > 0.0:
                return np.nan, ratio
            w, sxx, syy, szz, sxy, _, _ = stress(
                own, xx + 0.5 * (xx * xx + yx * yx), yy + 0.5 * (xy * xy + yy * yy),
                around + 0.5 * around * around, 0.5 * (xy + yx + xx * xy + yx * yy), 0.0, 0.0,
            )  # fmt: skip
            v = weights[c, p]
            energy += v * w
            pxx, pxy = v * (fxx * sxx + xy * sxy), v * (fxx * sxy + xy * syy)
            pyx, pyy = v * (yx * sxx + fyy * sxy), v * (yx * sxy + fyy * syy)
            for k in range(cells.shape[1]):
                g, h, row = table[c, p, k, 0], table[c, p, k, 1], rows[c, k]
                out[row, 0] += pxx * g + pxy * h
                out[row, 1] += pyx * g + pyy * h
                if hoop.size:
                    out[row, 0] += v * third * szz * hoop[c, p, k]
    return energy, least


@fused
def space_forces(material, u, cells, rows, table, hoop, weights, out):  # noqa: ARG001  (as in the plane)
    """Sum up the forces of cells in space.

    Args:
        material: Of each cell, as `law_kernels.stress` takes them, (cells, entries).
        u: Displacement of the nodes [m], (nodes, 3).
        cells: Nodes of each cell, (cells, corners).
        rows: Where the forces of each are added, (cells, corners).
        table: Gradients of the shape functions [1/m], (cells, points, corners, 3).
        hoop: Empty.
        weights: Volumes, (cells, points).
        out: Filled with the forces [N], (rows, 3).

    Returns:
        Energy [J] and least det F; once that is not positive, no number and this one.
    """
    out[:] = 0.0
    energy, least = 0.0, np.inf
    corners = cells.shape[1]
    tetrahedra = corners == 4
    for c in range(len(cells)):
        own = material[c]
        for p in range(table.shape[1]):
            g = table[c, p]
            if tetrahedra:  # differences along three edges
                o, q, r, s = cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3]
                x, y, z = u[o, 0], u[o, 1], u[o, 2]
                qx, qy, qz = u[q, 0] - x, u[q, 1] - y, u[q, 2] - z
                rx, ry, rz = u[r, 0] - x, u[r, 1] - y, u[r, 2] - z
                sx, sy, sz = u[s, 0] - x, u[s, 1] - y, u[s, 2] - z
                xx = qx * g[1, 0] + rx * g[2, 0] + sx * g[3, 0]
                xy = qx * g[1, 1] + rx * g[2, 1] + sx * g[3, 1]
                xz = qx * g[1, 2] + rx * g[2, 2] + sx * g[3, 2]
                yx = qy * g[1, 0] + ry * g[2, 0] + sy * g[3, 0]
                yy = qy * g[1, 1] + ry * g[2, 1] + sy * g[3, 1]
                yz = qy * g[1, 2] + ry * g[2, 2] + sy * g[3, 2]
                zx = qz * g[1, 0] + rz * g[2, 0] + sz * g[3, 0]
                zy = qz * g[1, 1] + rz * g[2, 1] + sz * g[3, 1]
                zz = qz * g[1, 2] + rz * g[2, 2] + sz * g[3, 2]
            else:
                xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
                for k in range(corners):
                    x, y, z = u[cells[c, k], 0], u[cells[c, k], 1], u[cells[c, k], 2]
                    xx, xy, xz = xx + x * g[k, 0], xy + x * g[k, 1], xz + x * g[k, 2]
                    yx, yy, yz = yx + y * g[k, 0], yy + y * g[k, 1], yz + y * g[k, 2]
                    zx, zy, zz = zx + z * g[k, 0], zy + z * g[k, 1], zz + z * g[k, 2]
            fx, fy, fz = 1.0 + xx, 1.0 + yy, 1.0 + zz
            ratio = fx * (fy * fz - yz * zy) - xy * (yx * fz - yz * zx) + xz * (yx * zy - fy * zx)
            least = min(least, ratio)
            if not ratio > 0.0:
                return np.nan, ratio
            w, sxx, syy, szz, sxy, syz, szx = stress(
                own,
                xx + 0.5 * (xx * xx + yx * yx + zx * zx),
                yy + 0.5 * (xy * xy + yy * yy + zy * zy),
                zz + 0.5 * (xz * xz + yz * yz + zz * zz),
                0.5 * (xy + yx + xx * xy + yx * yy + zx * zy),
                0.5 * (yz + zy + xy * xz + yy * yz + zy * zz),
                0.5 * (zx + xz + xx * xz + yx * yz + zx * zz),
            )  # fmt: skip
            v = weights[c, p]
            energy += v * w
            fx, fy, fz = v * fx, v * fy, v * fz
            xy, xz, yx, yz, zx, zy = v * xy, v * xz, v * yx, v * yz, v * zx, v * zy
            pxx, pxy = fx * sxx + xy * sxy + xz * szx, fx * sxy + xy * syy + xz * syz
            pyx, pyy = yx * sxx + fy * sxy + yz * szx, yx * sxy + fy * syy + yz * syz
            pzx, pzy = zx * sxx + zy * sxy + fz * szx, zx * sxy + zy * syy + fz * syz
            pxz = fx * szx + xy * syz + xz * szz
            pyz = yx * szx + fy * syz + yz * szz
            pzz = zx * szx + zy * syz + fz * szz
            sumx = sumy = sumz = 0.0
            for k in range(1 if tetrahedra else 0, corners):
                x = pxx * g[k, 0] + pxy * g[k, 1] + pxz * g[k, 2]
                y = pyx * g[k, 0] + pyy * g[k, 1] + pyz * g[k, 2]
                z = pzx * g[k, 0] + pzy * g[k, 1] + pzz * g[k, 2]
                row = rows[c, k]
                out[row, 0] += x
                out[row, 1] += y
                out[row, 2] += z
                sumx, sumy, sumz = sumx + x, sumy + y, sumz + z
            if tetrahedra:
                row = rows[c, 0]
                out[row, 0] -= sumx
                out[row, 1] -= sumy
                out[row, 2] -= sumz
    return energy, least


@fused
def strained(u, cell, g, hoop, c, p, full):
    """Green's strain at a point of a cell, xx, yy, zz, xy, yz, zx; ``full`` is filled with F.

    Args:
        u: Displacement of the nodes [m], (nodes, dim).
        cell: Nodes of the cell, (corners,).
        g: Gradients of the shape functions [1/m], (corners, dim).
        hoop, c, p: As for the forces; numbers of the cell and the point.
        full: (3, 3).
    """
    dim = u.shape[1]
    full[:] = 0.0
    for k in range(len(cell)):
        for i in range(dim):
            for j in range(dim):
                full[i, j] += u[cell[k], i] * g[k, j]
        if hoop.size:
            full[2, 2] += u[cell[k], 0] * hoop[c, p, k]
    xx, yy, zz = full[0, 0], full[1, 1], full[2, 2]
    xy, yz, zx = full[0, 1] + full[1, 0], full[1, 2] + full[2, 1], full[2, 0] + full[0, 2]
    for m in range(3):
        x, y, z = full[m, 0], full[m, 1], full[m, 2]
        xx, yy, zz = xx + 0.5 * x * x, yy + 0.5 * y * y, zz + 0.5 * z * z
        xy, yz, zx = xy + x * y, yz + y * z, zx + z * x
    for i in range(3):
        full[i, i] += 1.0
    return xx, yy, zz, 0.5 * xy, 0.5 * yz, 0.5 * zx


@fused
def tangents(material, u, cells, slots, table, hoop, weights, blocks):
    """Sum up blocks of the tangent between some nodes.

    Args:
        material, u, cells, table, hoop, weights: As for the forces, in the plane or in
            space.
        slots: Which block each pair of corners adds to, -1 for none, (cells, corners, corners).
        blocks: Filled [N/m], (blocks, 3, 3); in the plane the third direction stays 0.
    """
    dim, corners = u.shape[1], cells.shape[1]
    blocks[:] = 0.0
    full, law_matrix = np.zeros((3, 3)), np.zeros((6, 6))
    rows, turned, bent = np.zeros((corners, 6, 3)), np.zeros((6, 3)), np.zeros((3, 3))
    for c in range(len(cells)):
        own = material[c]
        for p in range(table.shape[1]):
            g = table[c, p]
            e = strained(u, cells[c], g, hoop, c, p, full)
            _, sxx, syy, szz, sxy, syz, szx = stress(own, *e)
            stiffness(own, *e, law_matrix)
            for k in range(corners):
                for i in range(dim):
                    for j in range(dim):
                        rows[k, j, i] = full[i, j] * g[k, j]
                    rows[k, 3, i] = full[i, 0] * g[k, 1] + full[i, 1] * g[k, 0]
                    if dim == 3:
                        rows[k, 4, i] = full[i, 1] * g[k, 2] + full[i, 2] * g[k, 1]
                        rows[k, 5, i] = full[i, 2] * g[k, 0] + full[i, 0] * g[k, 2]
                if hoop.size:
                    rows[k, 2, 0] = full[2, 2] * hoop[c, p, k]
            v = weights[c, p]
            for k in range(corners):
                if slots[c, k, k] < 0:
                    continue
                for a in range(6):
                    for i in range(3):
                        value = 0.0
                        for b in range(6):
                            value += law_matrix[a, b] * rows[k, b, i]
                        turned[a, i] = v * value
                x, y = sxx * g[k, 0] + sxy * g[k, 1], sxy * g[k, 0] + syy * g[k, 1]
                z = 0.0
                if dim == 3:
                    x, y = x + szx * g[k, 2], y + syz * g[k, 2]
                    z = szx * g[k, 0] + syz * g[k, 1] + szz * g[k, 2]
                for m in range(corners):
                    slot = slots[c, m, k]
                    if slot < 0:
                        continue
                    for i in range(3):
                        for j in range(3):
                            value = 0.0
                            for a in range(6):
                                value += rows[m, a, i] * turned[a, j]
                            bent[i, j] = value
                    direct = g[m, 0] * x + g[m, 1] * y
                    if dim == 3:
                        direct += g[m, 2] * z
                    for i in range(dim):
                        bent[i, i] += v * direct
                    if hoop.size:
                        bent[0, 0] += v * szz * hoop[c, p, m] * hoop[c, p, k]
                    for i in range(3):
                        for j in range(3):
                            blocks[slot, i, j] += bent[i, j]


@fused
def stiffest(material, u, cells, table, hoop, weights, inverse):
    """Largest trace of M^-1 K over the cells [1/s^2].

    Args:
        material, u, cells, table, hoop, weights: As for `tangents`.
        inverse: Inverse masses of the nodes, (nodes, dim).
    """
    dim, corners = u.shape[1], cells.shape[1]
    full, law_matrix = np.zeros((3, 3)), np.zeros((6, 6))
    largest, row = 0.0, np.zeros(6)
    for c in range(len(cells)):
        total = 0.0
        own = material[c]
        for p in range(table.shape[1]):
            g = table[c, p]
            e = strained(u, cells[c], g, hoop, c, p, full)
            _, sxx, syy, szz, sxy, syz, szx = stress(own, *e)
            stiffness(own, *e, law_matrix)
            for k in range(corners):
                gx, gy = g[k, 0], g[k, 1]
                gz = g[k, 2] if dim == 3 else 0.0
                direct = sxx * gx * gx + syy * gy * gy + szz * gz * gz
                direct += 2.0 * (sxy * gx * gy + syz * gy * gz + szx * gz * gx)
                for i in range(dim):
                    row[0], row[1], row[2] = full[i, 0] * gx, full[i, 1] * gy, full[i, 2] * gz
                    row[3] = full[i, 0] * gy + full[i, 1] * gx
                    row[4] = full[i, 1] * gz + full[i, 2] * gy
                    row[5] = full[i, 2] * gx + full[i, 0] * gz
                    if hoop.size and i == 0:
                        row[2] = full[2, 2] * hoop[c, p, k]
                    value = direct
                    for a in range(6):
                        for b in range(6):
                            value += row[a] * law_matrix[a, b] * row[b]
                    total += weights[c, p] * value * inverse[cells[c, k], i]
        largest = max(largest, total)
    return largest
