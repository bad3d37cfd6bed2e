"""Compiled layers whose law acts on speeds in all gaps, of bodies whose answers are kept by roots.

Arguments that functions share:

- weights: Of contact nodes in all gaps; roots: of answers A = R R^T of the nodes. Ends of rows,
  columns and values, as SciPy has sparse rows.
- gaps: (normals (gaps, dim), gaps at the end without contact forces and at the start [m], normal
  forces of the layer before [N], (gaps,), tangential ones (gaps, dim), what nodes face on obstacles
  as `impactfem.contact.speed_kernels.approaching` takes it).
- law: (restitution along normals and tangents, friction, (gaps,)).
"""

import numpy as np

from impactfem.compiled import compiled
from impactfem.contact.friction_solutions import MOST_PAIRS
from impactfem.contact.rooted_kernels import own_of
from impactfem.contact.sparse_kernels import across_rows, directed_rows, times_rows
from impactfem.contact.speed_kernels import approaching, closing, jamming, prepared, vectors_of

_SLOW = 1e-6  # share of the largest speed that counts as no slip where friction may jam


@compiled
def opened(weights, roots, nodes, gaps, law, times):
    """Which gaps take part in a layer, and the law between them.

    Args:
        weights, roots, gaps, law: See above.
        nodes: Displacements at the end without contact forces and at the start [m], velocities at
            the start and at the end [m/s], (nodes, dim) each.
        times: As `approaching` has them.

    Returns:
        Relative values of the gaps; what `approaching` tells, of that first the rows; what
        `prepared` tells; answers of the rows along their directions as sparse rows of roots; which
        rows act, and whether there is friction in one; whether friction jams, or may.
    """
    normals, gap, before, pushed, tangential, shift = gaps
    lively, slides, friction = law
    dim, tolerance = normals.shape[1], times[0]
    relative = _relative(weights, nodes)
    told = approaching(relative, shift, normals, gap, before, pushed, lively, slides, times)
    rows, halfway, struck = told[0], told[1], told[6]
    count = len(rows)
    acts, mu, rubs = np.empty(count, dtype=np.bool_), friction[rows], False
    for i in range(count):
        acts[i] = struck[rows[i]] or gap[rows[i]] <= tolerance
        rubs = rubs or (acts[i] and mu[i] > 0.0)
    ready = prepared(rows, halfway, normals, tangential, pushed, relative, shift, _SLOW * told[7])
    values, columns, ends = directed_rows(*weights, rows, ready[0], *roots)
    own = own_of(ends, columns, values, count, dim)
    jams = jamming(own, mu, ready[3]).any()
    jams = jams or (dim == 2 and count <= MOST_PAIRS and _may_jam(own, mu))
    return relative, told, ready, (ends, columns, values), acts, rubs, jams


@compiled
def _relative(weights, nodes):
    """Differences in all gaps of some values of the nodes (nodes, dim), (gaps, several dim)."""
    (ends, columns, values), dim = weights, nodes[0].shape[1]
    found = np.zeros((len(ends) - 1, len(nodes) * dim))
    for i in range(len(ends) - 1):
        for k in range(ends[i], ends[i + 1]):
            for q in range(len(nodes)):
                for c in range(dim):
                    found[i, q * dim + c] += values[k] * nodes[q][columns[k], c]
    return found


@compiled
def _moved(weights, roots, nodal, size):
    """Differences in all gaps of what forces on nodes (nodes, dim) do, (gaps, dim).

    Of many nodes few are pushed, and few have weights: no other one is looked at.
    """
    (ends, columns, values), (starts, places, shares), dim = weights, roots, nodal.shape[1]
    found, moving = np.zeros((len(ends) - 1, dim)), np.zeros(size)
    for node in range(len(nodal)):
        for c in range(dim):
            if nodal[node, c] != 0.0:
                for m in range(starts[node * dim + c], starts[node * dim + c + 1]):
                    moving[places[m]] += shares[m] * nodal[node, c]
    for i in range(len(ends) - 1):
        for k in range(ends[i], ends[i + 1]):
            for c in range(dim):
                way, row = 0.0, columns[k] * dim + c
                for m in range(starts[row], starts[row + 1]):
                    way += shares[m] * moving[places[m]]
                found[i, c] += values[k] * way
    return found


@compiled
def _may_jam(own, friction):
    """Whether friction of some pair can act as much along its normal as its pressure does."""
    for j in range(len(own)):
        square = 0.0
        for c in range(1, own.shape[1]):
            square += own[j, 0, c] * own[j, 0, c]
        if friction[j] * np.sqrt(square) >= own[j, 0, 0]:
            return True
    return False


@compiled
def ended(weights, roots, size, rows, directions, gaps, relative, answers, force, mu, within, told):
    """What the forces of a layer leave in the gaps; arguments as `opened` takes and tells them.

    Args:
        force: Along the directions [N], (rows, dim).
        mu: Friction of the rows, (rows,).
        within: Share of the largest tangential force up to which nothing slips.
        told: Numbers of rows that push, and whether they do and slip, as they were, (rows,).

    Returns:
        Forces on the contact nodes, (nodes, dim), what `closing` tells, and what ``told`` is now.
    """
    normals, gap, _, _, _, shift = gaps
    ends, columns, values = answers
    count, dim = len(gap), force.shape[1]
    flat = np.ascontiguousarray(force).reshape(-1, 1)
    answered = times_rows(ends, columns, values, across_rows(ends, columns, values, flat, size))
    whole = vectors_of(rows, directions, force, count)
    nodal = across_rows(*weights, whole, (len(roots[0]) - 1) // dim)
    moved = _moved(weights, roots, nodal, size)
    done = closing(
        rows, directions, normals, gap, relative, shift, force, answered.reshape(-1, dim), moved,
        whole, within * mu,
    )  # fmt: skip
    now = np.empty(len(rows), dtype=np.int64)
    for i in range(len(rows)):
        now[i] = 4 * rows[i] + (2 if force[i, 0] > 0.0 else 0) + (1 if done[4][rows[i]] else 0)
    same = len(now) == len(told)
    for i in range(len(now)):
        same = same and now[i] == told[i]
    return nodal, done, now, same
