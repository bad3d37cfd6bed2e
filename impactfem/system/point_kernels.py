"""Stress of a step at points of cells, and how it changes with the end of the step.

Between Green's strains E_0 and E_1 it is the mean of the law's stress on the straight way,

    S = int_0^1 dW/dE (E_0 + s (E_1 - E_0)) ds,

which does the work W_1 - W_0 whatever the law (E. Hairer, J. Numer. Anal. Ind. Appl. Math. 5 (2010)
73-84), without a quotient that is 0 / 0 in small steps. It is integrated by Gauss' rule with three
points; what that leaves of the work in large steps is added along E_1 - E_0.
"""

import math

import numpy as np

from impactfem.compiled import fused
from impactfem.system.force_kernels import strained
from impactfem.system.law_kernels import stiffness, stress, thickened

_FAR = 1e-3  # change of strain below which Gauss' rule leaves less than rounding
_PLACES = (0.5 - 0.5 * math.sqrt(0.6), 0.5, 0.5 + 0.5 * math.sqrt(0.6))
_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


@fused
def step_stress(material, before, after, cells, table, hoop, stresses, slopes, across):
    """Fill what a step has at the points of cells.

    Args:
        material: Of each cell, as `law_kernels.stress` takes them, (cells, entries).
        before, after: Displacements of the nodes at both ends [m], (nodes, dim).
        cells: Nodes of each cell, (cells, corners).
        table: Gradients of the shape functions [1/m], (cells, points, corners, dim).
        hoop: Shape functions over the distance from the axis [1/m], (cells, points, corners), or
            with no entry.
        stresses: S [Pa], (cells, points, n) of xx, yy, zz, xy, yz, zx or the first four.
        slopes: Their derivatives by the strain at the end, (cells, points, n n), or with no entry
            where they are not asked for.
        across: Strain zz at the end, (cells, points).
    """
    full, matrix = np.zeros((3, 3)), np.zeros((6, 6))
    start, end, change, at = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    found, sums = np.zeros(6), np.zeros((6, 6))
    count = stresses.shape[2]
    for c in range(len(cells)):
        own = material[c]
        linear = own[0] == 0.0 or own[0] == 3.0
        for p in range(table.shape[1]):
            start[:] = strained(before, cells[c], table[c, p], hoop, c, p, full)
            end[:] = strained(after, cells[c], table[c, p], hoop, c, p, full)
            for i in range(6):
                change[i] = end[i] - start[i]
                found[i] = 0.0
            sums[:] = 0.0
            for k in range(1, 2) if linear else range(3):
                weight = 1.0 if linear else _WEIGHTS[k]
                for i in range(6):
                    at[i] = start[i] + _PLACES[k] * change[i]
                _, xx, yy, zz, xy, yz, zx = stress(own, at[0], at[1], at[2], at[3], at[4], at[5])
                for i, value in enumerate((xx, yy, zz, xy, yz, zx)):
                    found[i] += weight * value
                if slopes.size:
                    stiffness(own, at[0], at[1], at[2], at[3], at[4], at[5], matrix)
                    for i in range(6):
                        for j in range(6):
                            sums[i, j] += weight * _PLACES[k] * matrix[i, j]
            squares = work = 0.0
            for i in range(6):
                twice = 1.0 if i < 3 else 2.0
                squares += twice * change[i] * change[i]
                work += twice * found[i] * change[i]
            if squares > _FAR * _FAR and not linear:
                low = stress(own, start[0], start[1], start[2], start[3], start[4], start[5])
                high = stress(own, end[0], end[1], end[2], end[3], end[4], end[5])
                rest = (high[0] - low[0] - work) / squares
                if slopes.size:
                    for j in range(6):
                        turned = high[j + 1] - found[j] - 2.0 * rest * change[j]
                        for i in range(6):
                            turned -= sums[i, j] * change[i] * (1.0 if i < 3 else 2.0)
                        at[j] = turned / squares
                    for i in range(6):
                        for j in range(6):
                            sums[i, j] += change[i] * at[j]
                        sums[i, i] += rest * (1.0 if i < 3 else 0.5)
                for i in range(6):
                    found[i] += rest * change[i]
            for i in range(count):
                stresses[c, p, i] = found[i]
            if slopes.size:
                for i in range(count):
                    for j in range(count):
                        slopes[c, p, count * i + j] = sums[i, j]
            flat = own[1] != 0.0
            across[c, p] = thickened(own, end[0], end[1], end[3]) if flat else end[2]


@fused
def stored(material, u, cells, table, hoop, weights):
    """Energy of the cells [J].

    Args:
        material, u, cells, table, hoop: As for `step_stress`, with one displacement.
        weights: Volumes, (cells, points).
    """
    full, total = np.zeros((3, 3)), 0.0
    for c in range(len(cells)):
        for p in range(table.shape[1]):
            xx, yy, zz, xy, yz, zx = strained(u, cells[c], table[c, p], hoop, c, p, full)
            total += weights[c, p] * stress(material[c], xx, yy, zz, xy, yz, zx)[0]
    return total


@fused
def strain_change(before, after, cells, table, hoop, out):
    """Fill changes of Green's strain, (cells, points, n); see `step_stress`."""
    full = np.zeros((3, 3))
    for c in range(len(cells)):
        for p in range(table.shape[1]):
            start = strained(before, cells[c], table[c, p], hoop, c, p, full)
            end = strained(after, cells[c], table[c, p], hoop, c, p, full)
            for i, (low, high) in enumerate(zip(start, end)):  # noqa: B905  (Numba has no strict)
                if i < out.shape[2]:
                    out[c, p, i] = high - low
