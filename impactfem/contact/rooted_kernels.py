"""Compiled sweeps for the contact forces of many bodies, by the roots of their answers."""

import numpy as np

from impactfem.compiled import compiled, fused

_LOCAL = 2  # alternations between the normal and the tangential force of a contact
_SAME = 1e-3  # share of the change that counts at which they end
_MOMENTUM, _GROWS = 0.9, 1.2  # share of the last step that is added, but where steps grow so much


@compiled
def own_of(ends, columns, values, pairs, dim):
    """Answers R_j R_j^T of pairs to their own forces, (pairs, dim, dim).

    Args:
        ends, columns, values: R as SciPy has sparse rows, columns of a row in rising order.
        pairs: Their number.
        dim: Rows of each.
    """
    found = np.zeros((pairs, dim, dim))
    for j in range(pairs):
        for a in range(dim):
            for b in range(a, dim):
                k, last = ends[j * dim + a], ends[j * dim + a + 1]
                m, end = ends[j * dim + b], ends[j * dim + b + 1]
                total = 0.0
                while k < last and m < end:
                    if columns[k] == columns[m]:
                        total += values[k] * values[m]
                        k += 1
                        m += 1
                    elif columns[k] < columns[m]:
                        k += 1
                    else:
                        m += 1
                found[j, a, b] = found[j, b, a] = total
    return found


@compiled
def squares_of(ends, values):
    """Sums of the squares of rows, (rows,): the diagonal of R R^T; arguments as of `own_of`."""
    found = np.zeros(len(ends) - 1)
    for i in range(len(ends) - 1):
        for k in range(ends[i], ends[i + 1]):
            found[i] += values[k] * values[k]
    return found


@fused
def sweep_roots(
    ends, columns, values, own, offset, friction, base, force, motion, sweeps, share, least
):
    """Block Gauss-Seidel for forces in their cones, A = R R^T: v = R^T x is kept up to date.

    A sweep begins where the one before has come and a share of its step further, within the cones
    (heavy ball): of 400 contacts five to ten times fewer sweeps are needed so.

    Args:
        ends, columns, values: R as SciPy has sparse rows.
        own: R_j R_j^T of each pair, (pairs, dim, dim).
        offset: o, (pairs, dim), the normal component first.
        friction, base: See `impactfem.contact.friction_newton.ConeProblem`.
        force: x to begin with, (pairs, dim); changed.
        motion: v, (coordinates,); changed.
        sweeps: Limit.
        share: Ends where no force changes by more than this share of the largest,
        least: or by more than this [N], (pairs,).

    Returns:
        Sweeps made, and whether it has ended.
    """
    pairs, dim = offset.shape
    answer, old, slip = np.zeros(dim), np.zeros(dim), np.zeros(dim)
    largest = np.abs(force).max() if pairs else 0.0
    last, step, before = force.copy(), np.inf, 0.0
    for sweep in range(sweeps):
        settled, size, before, step = True, 0.0, step, 0.0
        for j in range(pairs):
            block = own[j]
            for c in range(dim):
                total = offset[j, c]
                for k in range(ends[j * dim + c], ends[j * dim + c + 1]):
                    total += values[k] * motion[columns[k]]
                answer[c], old[c] = total, force[j, c]
            counts = max(share * largest, least[j])
            # Between the largest eigenvalue of the tangential part and twice that.
            steep = 0.0
            for c in range(1, dim):
                row = 0.0
                for i in range(1, dim):
                    row += abs(block[c, i])
                steep = max(steep, row)
            for _ in range(_LOCAL):
                pushed = max(0.0, force[j, 0] - answer[0] / block[0, 0])
                change = pushed - force[j, 0]
                moved = abs(change)
                force[j, 0] = pushed
                for c in range(dim):
                    answer[c] += block[c, 0] * change
                bound, length = friction[j] * (base[j] + pushed), 0.0
                for c in range(1, dim):
                    slip[c] = force[j, c] - answer[c] / steep
                    length += slip[c] ** 2
                length = np.sqrt(length)
                shrink = bound / length if length > bound else 1.0
                for c in range(1, dim):
                    slip[c] = shrink * slip[c] - force[j, c]
                for c in range(1, dim):
                    force[j, c] += slip[c]
                    moved = max(moved, abs(slip[c]))
                    for i in range(dim):
                        answer[i] += block[i, c] * slip[c]
                if moved <= _SAME * counts:
                    break
            for c in range(dim):
                change = force[j, c] - old[c]
                if abs(change) > counts:
                    settled = False
                step += change * change
                if change != 0.0:
                    for k in range(ends[j * dim + c], ends[j * dim + c + 1]):
                        motion[columns[k]] += values[k] * change
                size = max(size, abs(force[j, c]))
        largest = size
        if settled:
            return sweep + 1, True
        further = _MOMENTUM if step <= _GROWS * _GROWS * before and sweep < sweeps - 1 else 0.0
        for j in range(pairs):
            for c in range(dim):
                old[c] = force[j, c]
                force[j, c] += further * (old[c] - last[j, c])
                last[j, c] = old[c]
            force[j, 0] = max(force[j, 0], 0.0)
            bound, length = friction[j] * (base[j] + force[j, 0]), 0.0
            for c in range(1, dim):
                length += force[j, c] ** 2
            length = np.sqrt(length)
            shrink = bound / length if length > bound else 1.0
            for c in range(dim):
                force[j, c] *= shrink if c else 1.0
                change = force[j, c] - old[c]
                if change != 0.0:
                    for k in range(ends[j * dim + c], ends[j * dim + c + 1]):
                        motion[columns[k]] += values[k] * change
    return sweeps, False
