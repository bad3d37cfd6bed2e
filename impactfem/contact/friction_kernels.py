"""Compiled sweeps for contact forces in their cones, one contact after the other."""

import numpy as np

from impactfem.compiled import compiled

_SECULAR = 60


@compiled
def sweep_cones(matrix, offset, bound, force, sweeps, tolerance):
    """Block Gauss-Seidel for y >= 0 and |tau| <= bound, both given: a convex problem.

    It minimises x.A x / 2 + x.o over a product of half lines and discs, so that it converges for
    every positive definite A.

    Args:
        matrix: A, shape (pairs dim, pairs dim).
        offset: o, shape (pairs, dim), the normal component first.
        bound: Radius of each disc [N], shape (pairs,).
        force: x to begin with, shape (pairs, dim); changed.
        sweeps: Limit.
        tolerance: Ends when no component changes by more [N].

    Returns:
        Sweeps made; forces are not finite where a diagonal entry of A is 0.
    """
    pairs, dim = offset.shape
    flat = force.ravel()
    for sweep in range(sweeps):
        largest = 0.0
        for j in range(pairs):
            first = j * dim
            answer = offset[j].copy()
            for c in range(dim):
                for i in range(pairs * dim):
                    answer[c] += matrix[first + c, i] * flat[i]
            pushed = max(0.0, force[j, 0] - answer[0] / matrix[first, first])
            change = pushed - force[j, 0]
            force[j, 0] = pushed
            largest = max(largest, abs(change))
            block = matrix[first + 1 : first + dim, first + 1 : first + dim]
            for c in range(1, dim):
                answer[c] += matrix[first + c, first] * change
                for i in range(1, dim):
                    answer[c] -= matrix[first + c, first + i] * force[j, i]
            new = _in_disc(block, answer[1:], bound[j])
            for c in range(1, dim):
                largest = max(largest, abs(new[c - 1] - force[j, c]))
                force[j, c] = new[c - 1]
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
