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
from impactfem.contact.cone_kernels import few_cones, stuck_forces
from impactfem.contact.friction_solutions import MOST_PAIRS
from impactfem.contact.rooted_kernels import (
    gathered_roots,
    islands_among,
    own_of,
    swept_forces,
)
from impactfem.contact.sparse_kernels import across_rows, directed_rows, times_rows
from impactfem.contact.speed_kernels import approaching, closing, jamming, prepared, vectors_of

NOTHING, FOUND, HARD, SMOOTH = 0, 1, 2, 3
"""What has become of forces: no gap takes part, found, to be found by others, without friction."""

_SLOW = 1e-6  # share of the largest speed that counts as no slip where friction may jam


@compiled
def opened(weights, roots, size, nodes, gaps, law, times, solving):
    """Which gaps take part in a layer, the law between them, and its forces.

    Args:
        weights, roots, gaps, law: See above.
        size: Number of coordinates.
        nodes: Displacements at the end without contact forces and at the start [m], velocities at
            the start and at the end [m/s], (nodes, 4 dim).
        times: As `approaching` has them.
        solving: (whether answers are kept by roots, how many pairs are few, limit of linear
            systems, residual that is asked for or 0, two arguments of `few_cones`).

    Returns:
        What has become of forces; what `approaching` tells, of that first the rows; relative
        values of the gaps; what `prepared` tells; answers of the rows along their directions as
        sparse rows of roots; forces (rows, dim), linear systems solved, and the largest error that
        was left of what is asked for; which rows act; whether friction jams, or may.
    """
    normals, gap, before, pushed, tangential, shift = gaps
    lively, slides, friction = law
    rooted, few, limit, _, shares, most = solving
    dim, tolerance = normals.shape[1], times[0]
    relative = times_rows(weights[0], weights[1], weights[2], nodes)
    told = approaching(relative, shift, normals, gap, before, pushed, lively, slides, times)
    rows, halfway, struck = told[0], told[1], told[6]
    count = len(rows)
    acts, mu, rubs = np.empty(count, dtype=np.bool_), friction[rows], False
    for i in range(count):
        acts[i] = struck[rows[i]] or gap[rows[i]] <= tolerance
        rubs = rubs or (acts[i] and mu[i] > 0.0)
    ready = prepared(rows, halfway, normals, tangential, pushed, relative, shift, _SLOW * told[7])
    directions, way, near, slip = ready
    values, columns, ends = directed_rows(*weights, rows, directions, *roots)
    force, systems, left, jams = np.zeros((count, dim)), 0, 0.0, False
    state = NOTHING if not count else FOUND if rubs else SMOOTH
    if state == FOUND:
        own = own_of(ends, columns, values, count, dim)
        jams = jamming(own, mu, slip).any() or (
            dim == 2 and count <= MOST_PAIRS and _may_jam(own, mu)
        )
        at = np.flatnonzero(acts)
        some = values, columns, ends
        if len(at) < count:
            some = directed_rows(*weights, rows[at], directions[at], *roots)
            own = own_of(some[2], some[1], some[0], len(at), dim)
        offset, bounds, begin = way[at], mu[at], near[at]
        if not rooted and len(at) <= few:
            none, whole = np.zeros(len(at)), full_of(some[2], some[1], some[0], size)
            fine, found, systems = few_cones(
                whole, offset, bounds, none, begin, tolerance, limit, shares, most
            )
        elif rooted:
            fine, found, left = _of_many(some, size, own, offset, bounds, begin, tolerance, solving)
            systems = 1
        else:
            fine, found = False, begin
        state = FOUND if fine else HARD
        force[at] = found
    solved = force, systems, left
    return state, told, relative, ready, (ends, columns, values), solved, acts, jams


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
def full_of(ends, columns, values, size):
    """R R^T of sparse rows, (rows, rows)."""
    count, spread = len(ends) - 1, np.zeros(size)
    found = np.empty((count, count))
    for i in range(count):
        for k in range(ends[i], ends[i + 1]):
            spread[columns[k]] = values[k]
        for j in range(i + 1):
            total = 0.0
            for k in range(ends[j], ends[j + 1]):
                total += spread[columns[k]] * values[k]
            found[i, j] = found[j, i] = total
        for k in range(ends[i], ends[i + 1]):
            spread[columns[k]] = 0.0
    return found


@compiled
def _of_many(rows, size, own, offset, friction, start, tolerance, solving):
    """Whether sweeps find forces of pairs whose answers are kept by roots, these, and the error."""
    values, columns, ends = rows
    _, few, _, asked, shares, most = solving
    pairs, dim = offset.shape
    scale, largest, least = np.empty((pairs, 2)), 0.0, np.inf
    for j in range(pairs):
        across = 0.0
        for c in range(dim):
            largest, least = max(largest, own[j, c, c]), min(least, own[j, c, c])
            across += own[j, c, c] if c else 0.0
        scale[j, 0], scale[j, 1] = own[j, 0, 0], across / (dim - 1)
    if least <= shares[3] * largest:
        return False, start, 0.0
    force, wide, whole = np.zeros((pairs, 3)), np.zeros((pairs, 3)), np.zeros((pairs, 3, 3))
    force[:, :dim], wide[:, :dim], whole[:, :dim, :dim] = start, offset, own
    if pairs <= few:  # forces that depend on each other do not hang on how they came
        matrix, island = (
            full_of(ends, columns, values, size),
            islands_among(ends, columns, pairs, dim, size),
        )
        for number in range(island.max() + 1):
            chosen = np.flatnonzero(island == number)
            if len(chosen) == 1:
                continue
            at = (dim * chosen.reshape(-1, 1) + np.arange(dim)).reshape(-1)
            part, scales = np.empty((len(at), len(at))), np.empty((len(chosen), dim))
            for i in range(len(at)):
                for k in range(len(at)):
                    part[i, k] = matrix[at[i], at[k]]
            for i in range(len(chosen)):
                scales[i] = scale[chosen[i], 1]
                scales[i, 0] = scale[chosen[i], 0]
            law = part, offset[chosen], friction[chosen], scales
            fine, found = stuck_forces(*law, (shares[0], shares[1], shares[2]), most)
            if fine:
                force[chosen, :dim] = found
    gathered = gathered_roots(ends, columns, values, pairs, dim)
    none = np.zeros(pairs)
    wrong, left = swept_forces(
        gathered, size, whole, wide, friction, none, scale, force, tolerance, asked
    )
    return not wrong.any(), np.ascontiguousarray(force[:, :dim]), left


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
    moving = across_rows(*roots, nodal.reshape(-1, 1), size)
    moved = times_rows(*weights, times_rows(*roots, moving).reshape(-1, dim))
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
