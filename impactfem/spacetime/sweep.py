"""Compiled sweeps through the triangles, in the order in which a wave passes them."""

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.compiled import compiled

DECIDE = -1
"""Mark of a wall edge for which the sweep itself decides whether contact is active."""


@compiled
def causal_order(upstream: Integers) -> Integers:
    """Order the cells so that each comes after those upstream of it (Kahn's algorithm).

    Straight characteristics pass any triangulation in such an order.

    Args:
        upstream: Cells upstream of each cell, -1 for none, shape (cells, 3).

    Returns:
        The cells in order, shape (cells,); shorter if there is a cycle.
    """
    cells = len(upstream)
    waiting = np.zeros(cells, dtype=np.int64)
    after = np.full((cells, 3), -1, dtype=np.int64)
    counts = np.zeros(cells, dtype=np.int64)
    for cell in range(cells):
        for k in range(3):
            before = upstream[cell, k]
            if before >= 0:
                waiting[cell] += 1
                after[before, counts[before]] = cell
                counts[before] += 1
    order = np.empty(cells, dtype=np.int64)
    found = 0
    for cell in range(cells):
        if waiting[cell] == 0:
            order[found] = cell
            found += 1
    done = 0
    while done < found:
        cell = order[done]
        done += 1
        for k in range(counts[cell]):
            follower = after[cell, k]
            waiting[follower] -= 1
            if waiting[follower] == 0:
                order[found] = follower
                found += 1
    return order[:found]


@compiled
def sweep(  # noqa: C901  (a compiled loop is one function)
    order: Integers, upstream: Integers, transfer: Floats, load: Floats, first: Floats,
    horizon: float, tolerance: float, dirty: Booleans, changed: Booleans, wave: Floats,
) -> None:  # fmt: skip
    """Update a wave in the cells that begin before the horizon and whose data have changed.

    Args:
        order: Cells, shape (cells,).
        upstream: Shape (cells, 3).
        transfer: Inverse of a cell's own block times its upstream blocks, (cells, 3, dofs, dofs).
        load: Inverse of a cell's own block times its load, shape (cells, dofs).
        first: Earliest time of each cell.
        horizon: Cells that begin later are left for later.
        tolerance: Changes up to this size are not passed on.
        dirty: Whether a cell is to be computed; reset for those that are.
        changed: Work space, shape (cells,).
        wave: Updated in place, shape (cells, dofs).
    """
    dofs = load.shape[1]
    new = np.empty(dofs)
    for position in range(len(order)):
        cell = order[position]
        changed[cell] = False
        for k in range(3):
            before = upstream[cell, k]
            if before >= 0 and changed[before]:
                dirty[cell] = True
        if first[cell] >= horizon or not dirty[cell]:
            continue
        dirty[cell] = False
        for i in range(dofs):
            new[i] = load[cell, i]
        for k in range(3):
            before = upstream[cell, k]
            if before >= 0:
                for i in range(dofs):
                    for j in range(dofs):
                        new[i] -= transfer[cell, k, i, j] * wave[before, j]
        for i in range(dofs):
            if not abs(new[i] - wave[cell, i]) <= tolerance:
                changed[cell] = True
            wave[cell, i] = new[i]


@compiled
def contact(
    arriving: Floats, widths: Floats, gap: float, marks: NDArray[np.int8], tolerance: float,
    gaps: Floats, speeds: Floats, active: Booleans,
) -> None:  # fmt: skip
    """Decide contact edge by edge from the wave that arrives; fills gaps, speeds and active.

    With R the integral of r over an edge and u the gap at its begin, free motion (S = 0) ends at
    u + R and active contact ends at 0 with the mean multiplier (u + R) / width: the state that
    satisfies 0 <= gap _|_ multiplier <= 0 at the end of the edge always exists and is unique.

    Args:
        arriving: R of each edge, shape (edges,).
        widths: Shape (edges,).
        gap: At t = 0.
        marks: 1 active, 0 inactive, or DECIDE, shape (edges,).
        tolerance: Gaps above -tolerance count as open.
        gaps: Gap at the end of each edge.
        speeds: Velocity of the near end on active edges: it closes what is left of the gap.
        active: Decision.
    """
    u = gap
    for k in range(len(arriving)):
        free = u + arriving[k]
        active[k] = free < -tolerance if marks[k] == DECIDE else marks[k] == 1
        # What is left by rounding is dropped: closing it would send a pulse, and over many
        # contacts such pulses grow (7-fold from one to the next for the bounces of Doyen et al.).
        speeds[k] = -u / widths[k] if active[k] and abs(u) > tolerance else 0.0
        u = 0.0 if active[k] else free
        gaps[k] = u
