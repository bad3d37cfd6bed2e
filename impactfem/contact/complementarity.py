"""Complementarity problems of contact forces, 0 <= lambda _|_ offset + matrix lambda >= 0."""

from collections.abc import Callable

import numpy as np
from scipy.linalg.lapack import dposv

from impactfem.arrays import Booleans, Floats
from impactfem.contact.active_set import primal_dual_active_set
from impactfem.errors import ConvergenceError

Solver = Callable[[Floats, Floats, Booleans], tuple[Floats, int]]
"""Solves a complementarity problem (matrix, offset, start) for lambda; also counts iterations."""

_OPEN = 1e-6  # share of the largest gap that closed pairs may keep: far above rounding
_COMPLIANCE = 1e-12  # of each pair by itself, where active sets are singular


def solve_by_active_set(tolerance: float, max_iterations: int) -> Solver:
    """Make a solver that uses the primal-dual active set, and Murty's pivots should it cycle.

    Args:
        tolerance: Rounding level of gaps [m].
        max_iterations: Limit of linear systems.
    """

    def solver(matrix: Floats, offset: Floats, start: Booleans) -> tuple[Floats, int]:
        if not start.any() and offset.min(initial=0.0) >= -tolerance:
            return np.zeros(len(offset)), 0
        pairs = len(offset)
        gamma = float(np.abs(matrix).max(initial=0.0))

        def solve(active: Booleans) -> tuple[Floats, Floats]:
            force = _forces(matrix, offset, active)
            gap = offset + matrix @ force
            gap[active] = 0.0
            return gap, -force

        found = primal_dual_active_set(
            solve, pairs, gamma=gamma, tolerance=tolerance,
            max_iterations=max_iterations, start=start,
        )  # fmt: skip
        force = np.maximum(-found.multiplier, 0.0)
        if found.converged and _are_closed(matrix, offset, found.active, force):
            return force, found.iterations
        # A singular set may have passed for a solution, or pivots go round between such: a little
        # compliance, far below that of the body, gives each set one answer.
        soft = matrix + np.diag(_COMPLIANCE * np.diag(matrix))
        try:
            trial = soft if found.converged else matrix
            force, pivots = _murty(trial, offset, found.active, tolerance)
        except ConvergenceError:
            if found.converged:
                raise
            force, pivots = _murty(soft, offset, found.active, tolerance)
            # Where gaps contradict each other forces grow by it without end, and close none.
            if (offset + matrix @ force).min() < -_OPEN * np.abs(offset).max():
                raise
        return force, found.iterations + pivots

    return solver


def _are_closed(matrix: Floats, offset: Floats, active: Booleans, force: Floats) -> bool:
    """Whether forces do close the active gaps: the least squares of a singular set need not."""
    rows = np.flatnonzero(active)
    left = np.abs(offset[rows] + matrix[rows] @ force)
    return bool(left.max(initial=0.0) <= _OPEN * np.abs(offset).max(initial=0.0))


def _forces(matrix: Floats, offset: Floats, active: Booleans) -> Floats:
    """Forces that close the active gaps."""
    force = np.zeros(len(offset))
    rows = np.flatnonzero(active)
    if len(rows) == 1:
        force[rows] = -offset[rows] / matrix[rows[0], rows[0]]
    elif len(rows):
        block = matrix[rows[:, None], rows]
        # LAPACK's Cholesky at once: SciPy's wrappers would cost more than a small system.
        _, found, failed = dposv(block, -offset[rows], lower=True, overwrite_a=True)
        if failed:  # singular by rounding
            found = np.linalg.lstsq(matrix[rows[:, None], rows], -offset[rows])[0]
        force[rows] = found
    return force


def _murty(
    matrix: Floats, offset: Floats, active: Booleans, tolerance: float
) -> tuple[Floats, int]:
    """Flip the first pair that is wrong until none is; finite for positive definite matrices.

    Source: Murty, Note on a Bard-type scheme, Opsearch 11 (1974) 123-130.
    """
    active = active.copy()
    for pivot in range(1, 50 * len(offset) + 1):
        force = _forces(matrix, offset, active)
        gap = offset + matrix @ force
        wrong = np.where(active, force < 0.0, gap < -tolerance)
        if not wrong.any():
            return force, pivot
        first = int(np.argmax(wrong))
        active[first] = not active[first]
    raise ConvergenceError(
        f"contact: no active set was found for {len(offset)} pairs in {50 * len(offset)} pivots; "
        "use a smaller solve.dt or solve.courant"
    )
