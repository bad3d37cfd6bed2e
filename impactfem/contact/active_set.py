"""Primal-dual active set: a semismooth Newton method for 0 <= gap _|_ multiplier <= 0."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Booleans, Floats

LinearSolve = Callable[[Booleans], tuple[Floats, Floats]]


@dataclass(frozen=True)
class ActiveSetResult:
    """Where contact is active, and how the iteration went.

    Attributes:
        active: Active pairs of the last iterate, shape (pairs,).
        gap: Gap of the last iterate [m], shape (pairs,).
        multiplier: Multiplier of the last iterate, <= 0 in contact, shape (pairs,).
        iterations: Number of linear systems solved.
        set_changes: Pairs that changed after each of them; the last is 0 when converged.
        converged: True if the sets stood still.
        message: How the iteration ended, in words.
        iterates: Gap and multiplier after each linear solve, if they were to be kept.
    """

    active: Booleans
    gap: Floats
    multiplier: Floats
    iterations: int
    set_changes: tuple[int, ...]
    converged: bool
    message: str
    iterates: tuple[tuple[Floats, Floats], ...] = ()


def primal_dual_active_set(
    solve: LinearSolve,
    pairs: int,
    *,
    gamma: float,
    tolerance: float,
    max_iterations: int,
    observe: Callable[[int, int], None] | None = None,
    start: Booleans | None = None,
    keep: int = 0,
) -> ActiveSetResult:
    """Find the active set by A = {gamma * multiplier + gap < 0}.

    For a fixed set the problem is linear: ``gap = 0`` on A and ``multiplier = 0`` elsewhere. The
    update is Newton's step for min(gap, -gamma * multiplier) = 0 (Hintermueller, Ito, Kunisch,
    SIAM J. Optim. 13 (2002) 865-888).

    Args:
        solve: Solves the linear problem of a set; returns (gap, multiplier), each (pairs,).
        pairs: Number of complementarity pairs.
        gamma: Merit constant > 0: [m] per unit of the multiplier.
        tolerance: Rounding level of the gap [m], >= 0; an inactive pair stays so above its minus.
        max_iterations: Limit of linear solves.
        observe: Called after each solve with (iteration, set changes).
        start: Set to begin with, shape (pairs,); empty if None.
        keep: Keep the iterates, unless they are more numbers than this.

    Returns:
        The last iterate. Whether it is a solution says ``converged``.
    """
    active: Booleans = np.zeros(pairs, dtype=bool) if start is None else start
    seen = {active.tobytes(): 0}
    changes: list[int] = []
    iterates: list[tuple[Floats, Floats]] = []

    def result(message: str, *, converged: bool = False) -> ActiveSetResult:
        told = tuple(iterates) if 2 * pairs * len(changes) <= keep else ()
        return ActiveSetResult(
            active, gap, multiplier, len(changes), tuple(changes), converged, message, told
        )

    for iteration in range(1, max_iterations + 1):
        gap, multiplier = solve(active)
        if 2 * pairs * iteration <= keep:
            iterates.append((gap.copy(), multiplier.copy()))
        if not (np.isfinite(gap).all() and np.isfinite(multiplier).all()):
            changes.append(pairs)
            return result("the iterates are no longer finite")
        # A pair joins if its gap is negative beyond rounding, and stays as long as it is pressed:
        # one threshold for both would let nearly degenerate pairs alternate.
        update = gamma * multiplier + gap < np.where(active, 0.0, -tolerance)
        changes.append(int(np.count_nonzero(update != active)))
        if observe is not None:
            observe(iteration, changes[-1])
        if changes[-1] == 0:
            return result("the sets stand still", converged=True)
        earlier = seen.setdefault(update.tobytes(), iteration)
        if earlier != iteration:
            length = iteration - earlier
            return result(f"the sets cycle with period {length}")
        active = update
    return result(f"the sets still change after {max_iterations} iterations")
