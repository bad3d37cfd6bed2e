"""Compiled sweeps for contact forces in their cones, one contact after the other."""

import numpy as np

from impactfem.compiled import compiled

_SECULAR = 60
_LOCAL = 30  # alternations between the normal and the tangential force of a contact
_SAME = 1e-15


@compiled
def sweep_cones(
    matrix, offset, friction, master, spinning, base, bound, force, follow, sweeps, tolerance
):
    """Block Gauss-Seidel for y >= 0 and |tau| <= bound, the bounds given or those of the forces.

    With given bounds it minimises x.A x / 2 + x.o over a product of half lines and discs, so that
    it converges for every positive definite A.

    Args:
        matrix: A, shape (pairs dim, pairs dim).
        offset: o, shape (pairs, dim), the normal component first.
        friction, master, spinning, base: See `impactfem.contact.friction_newton.ConeProblem`.
        bound: Normal forces that bound the others [N], shape (pairs,); changed if they follow.
        force: x to begin with, shape (pairs, dim); changed.
        follow: Whether bounds are those of the present forces.
        sweeps: Limit.
        tolerance: Ends when no component changes by more [N].

    Returns:
        Sweeps made; forces are not finite where a diagonal entry of A is 0.
    """
    pairs, dim = offset.shape
    flat = force.ravel()
    answer, old = np.zeros(dim), np.zeros(dim)
    for sweep in range(sweeps):
        largest = 0.0
        for j in range(pairs):
            first = j * dim
            for c in range(dim):
                total = offset[j, c]
                for i in range(pairs * dim):
                    total += matrix[first + c, i] * flat[i]
                answer[c] = total
                old[c] = force[j, c]
            block = matrix[first : first + dim, first : first + dim]
            rub = block[1:, 1:]
            own = master[j] == j
            alternations = _LOCAL if own and follow else 1
            if follow and not own:
                bound[j] = base[j] + max(force[master[j], 0], 0.0)
            for _ in range(alternations):
                # The normal force, or the moment that resists spinning.
                if own:
                    pushed = max(0.0, force[j, 0] - answer[0] / block[0, 0])
                else:
                    most = spinning[j] * bound[j]
                    pushed = min(max(force[j, 0] - answer[0] / block[0, 0], -most), most)
                change = pushed - force[j, 0]
                force[j, 0] = pushed
                moved = abs(change)
                for c in range(dim):
                    answer[c] += block[c, 0] * change
                if own and follow:
                    bound[j] = base[j] + pushed
                slip = answer[1:].copy()
                for c in range(dim - 1):
                    for i in range(dim - 1):
                        slip[c] -= rub[c, i] * force[j, 1 + i]
                new = _in_disc(rub, slip, friction[j] * bound[j])
                for c in range(dim - 1):
                    change = new[c] - force[j, 1 + c]
                    force[j, 1 + c] = new[c]
                    moved = max(moved, abs(change))
                    for i in range(dim):
                        answer[i] += block[i, 1 + c] * change
                if moved <= _SAME * (abs(force[j, 0]) + tolerance):
                    break
            for c in range(dim):
                largest = max(largest, abs(force[j, c] - old[c]))
        if largest <= tolerance:
            return sweep + 1
    return sweeps


@compiled
def _in_disc(block, slip, radius):
    """Minimise t.B t / 2 + t.s over |t| <= radius, shape (1,) or (2,).

    Outside the disc (B + a I) t = -s with |t| = radius: Newton's method for 1 / |t| = 1 / radius,
    which converges from a = 0 without overshooting.
    """
    size = len(slip)
    if radius <= 0.0:
        return np.zeros(size)
    if size == 1:
        return np.array([min(max(-slip[0] / block[0, 0], -radius), radius)])
    extra = 0.0
    found = np.zeros(size)
    for _ in range(_SECULAR):
        p, q, c = block[0, 0] + extra, block[1, 1] + extra, block[0, 1]
        det = p * q - c * c
        found[0] = (c * slip[1] - q * slip[0]) / det
        found[1] = (c * slip[0] - p * slip[1]) / det
        length = np.sqrt(found[0] ** 2 + found[1] ** 2)
        if length <= radius * (1.0 + 1e-14):
            break
        bend = (q * found[0] ** 2 + p * found[1] ** 2 - 2.0 * c * found[0] * found[1]) / det
        extra += length**2 / bend * (length - radius) / radius
    if length > radius:
        found *= radius / length
    return found


@compiled
def islands_of(matrix, master, dim):
    """Numbers of the islands of pairs that move each other or bound each other's forces, (pairs,).

    Args:
        matrix: A, shape (pairs dim, pairs dim).
        master: See `impactfem.contact.friction_newton.ConeProblem`.
        dim: Components of a pair.
    """
    pairs = len(master)
    linked = np.zeros((pairs, pairs), dtype=np.bool_)
    for i in range(pairs * dim):
        for j in range(pairs * dim):
            if matrix[i, j] != 0.0:
                linked[i // dim, j // dim] = linked[j // dim, i // dim] = True
    for j in range(pairs):
        linked[j, master[j]] = linked[master[j], j] = True
    island, waiting, count = np.full(pairs, -1), np.empty(pairs, dtype=np.int64), 0
    for first in range(pairs):
        if island[first] >= 0:
            continue
        island[first], waiting[0], left = count, first, 1
        while left:
            left -= 1
            own = waiting[left]
            for j in range(pairs):
                if linked[own, j] and island[j] < 0:
                    island[j], waiting[left] = count, j
                    left += 1
        count += 1
    return island
