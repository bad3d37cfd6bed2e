"""Loops for massless nodes: conjugate gradients in blocks of three, and what nodes inside take."""

import numpy as np

from impactfem.compiled import fused


@fused
def inverted(blocks, places, out):
    """Fill the inverses of the diagonal blocks (nodes, 3, 3)."""
    for k in range(len(places)):
        out[k] = np.linalg.inv(blocks[places[k]])


@fused
def _freed(v, k, free, held, normal):
    """Part of the vector of a node along its free directions."""
    x, y, z = v[k, 0] * free[k, 0], v[k, 1] * free[k, 1], v[k, 2] * free[k, 2]
    if held[k]:
        away = x * normal[k, 0] + y * normal[k, 1] + z * normal[k, 2]
        x, y, z = x - away * normal[k, 0], y - away * normal[k, 1], z - away * normal[k, 2]
    return x, y, z


@fused
def conjugate_gradients(
    starts, columns, blocks, inverse, free, held, normal, right, share, most, x, r, z, p, q
):
    """Solve Q K Q x = Q b, Q what is free, preconditioned by the diagonal blocks.

    Args:
        starts, columns, blocks: K by rows of blocks, (nodes + 1,), (blocks,), (blocks, 3, 3).
        inverse: Of its diagonal blocks, (nodes, 3, 3).
        free: 1 along directions that no support holds, else 0, (nodes, 3).
        held: Nodes held along a normal, (nodes,).
        normal: Unit vectors, 0 where not free, (nodes, 3).
        right: b, (nodes, 3).
        share: Of the residual at which to stop.
        most: Iterations.
        x: Filled with the solution, (nodes, 3).
        r, z, p, q: Room for as much.

    Returns:
        Iterations.
    """
    n = len(right)
    product = size = 0.0
    x[:] = 0.0
    for i in range(n):
        a, b, c = _freed(right, i, free, held, normal)
        r[i, 0], r[i, 1], r[i, 2] = a, b, c
        size += a * a + b * b + c * c
    product = _preconditioned(inverse, free, held, normal, r, z)
    p[:] = z
    if not size > 0.0:
        return 0
    for iteration in range(1, most + 1):
        along = 0.0
        for i in range(n):
            a = b = c = 0.0
            for t in range(starts[i], starts[i + 1]):
                j, k = columns[t], blocks[t]
                u, v, w = p[j, 0], p[j, 1], p[j, 2]
                a += k[0, 0] * u + k[0, 1] * v + k[0, 2] * w
                b += k[1, 0] * u + k[1, 1] * v + k[1, 2] * w
                c += k[2, 0] * u + k[2, 1] * v + k[2, 2] * w
            q[i, 0], q[i, 1], q[i, 2] = a, b, c
            a, b, c = _freed(q, i, free, held, normal)
            q[i, 0], q[i, 1], q[i, 2] = a, b, c
            along += p[i, 0] * a + p[i, 1] * b + p[i, 2] * c
        if not along > 0.0:  # not positive: what there is must do
            return iteration
        step, left = product / along, 0.0
        for i in range(n):
            for c in range(3):
                x[i, c] += step * p[i, c]
                r[i, c] -= step * q[i, c]
                left += r[i, c] * r[i, c]
        if left <= share * share * size:
            return iteration
        following = _preconditioned(inverse, free, held, normal, r, z)
        ratio, product = following / product, following
        for i in range(n):
            for c in range(3):
                p[i, c] = z[i, c] + ratio * p[i, c]
    return most


@fused
def _preconditioned(inverse, free, held, normal, r, z):
    """Fill z with what is free of the diagonal's answers to r; returns r . z."""
    product = 0.0
    for i in range(len(r)):
        k = inverse[i]
        u, v, w = r[i, 0], r[i, 1], r[i, 2]
        z[i, 0] = k[0, 0] * u + k[0, 1] * v + k[0, 2] * w
        z[i, 1] = k[1, 0] * u + k[1, 1] * v + k[1, 2] * w
        z[i, 2] = k[2, 0] * u + k[2, 1] * v + k[2, 2] * w
        a, b, c = _freed(z, i, free, held, normal)
        z[i, 0], z[i, 1], z[i, 2] = a, b, c
        product += u * a + v * b + w * c
    return product


@fused
def moments(ring, places, masses, u, forces, middle, out):
    """Sum up masses and moments of some nodes, with their arms a from a place.

    Args:
        ring: The nodes, (ring,).
        places: Of these, undeformed [m], (ring, dim).
        masses: (ring,).
        u: Displacement of all nodes [m], (nodes, dim).
        forces: On all nodes, (nodes, dim).
        middle: The place, (dim,).
        out: Filled with sums of m a a^T, m a, a f^T and m, (2 dim + 2, dim).
    """
    dim = len(middle)
    out[:] = 0.0
    for k in range(len(ring)):
        node, mass = ring[k], masses[k]
        for i in range(dim):
            arm = places[k, i] + u[node, i] - middle[i]
            out[dim, i] += mass * arm
            for j in range(dim):
                out[i, j] += mass * arm * (places[k, j] + u[node, j] - middle[j])
                out[dim + 1 + i, j] += arm * forces[node, j]
            out[2 * dim + 1, i] += mass


@fused
def accelerate_turning(ring, places, masses, u, forces, centre, turn):
    """Add masses times accelerations A (x - centre) to forces; see `moments`."""
    dim = len(centre)
    for k in range(len(ring)):
        node = ring[k]
        for j in range(dim):
            arm = masses[k] * (places[k, j] + u[node, j] - centre[j])
            for i in range(dim):
                forces[node, i] += turn[i, j] * arm
