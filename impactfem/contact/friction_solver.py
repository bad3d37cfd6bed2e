"""Contact forces that obey their law from any start.

Without friction they are those of a complementarity problem. Springs in gaps are found by their
tangents, each a compliance more. With friction forces lie in cones, and are found by islands, then
Newton's method and what leads it:

Pairs that do not move each other are solved apart. Of each island, in this order until the law is
obeyed to rounding:

1. Newton's method (`impactfem.contact.friction_newton`) from the given start.
2. Where forces depend on each other, or Newton's method jumps for ever, proximal steps: each
   solves the law with a compliance of every force by itself, in which the forces of the step before
   leave nothing. It is large at first, falls where Newton's method succeeds and grows where it does
   not; at the end it has nothing to do, and is no error.
3. The same from forces that sweeps over the contacts have led closer (nonlinear Gauss-Seidel), and
   from those of convex problems with frozen bounds, of which a damped fixed point follows.

Solutions exist for all mu where contacts can open all at once, but need not be unique (Haslinger,
Math. Methods Appl. Sci. 5 (1983) 422-437). What is not found is said with the least residual.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.complementarity import Solver, solve_by_active_set
from impactfem.contact.cone_kernels import few_cones, without_traces
from impactfem.contact.friction_kernels import sweep_cones
from impactfem.contact.friction_many import WORST, Accuracy, Many
from impactfem.contact.friction_newton import ConeProblem, newton, proximal, residual
from impactfem.contact.friction_solutions import STICK, stuck
from impactfem.contact.rooted import Rooted, full
from impactfem.errors import ConvergenceError

_FEW = 60  # pairs up to which an island has an array of answers
_HELD = 1e-12  # share of the largest compliance below which a direction does not yield
_DEPENDENT = 1e-9  # least eigenvalue of the matrix with unit diagonal
_SWEEPS = ((100, 0.0), (5, 0.5), (1000, 0.0), (80, 0.25))
"""Sweeps with bounds that follow (share 0), or problems with frozen ones and the damping."""
_FROZEN = 200
_GROWING = (0.05, 0.1, 0.2, 0.4, 0.7)  # shares of the friction
_STICK = (*STICK[0], _HELD), STICK[1]  # as `few_cones` has it


@dataclass(frozen=True)
class Solving:
    """How problems are solved.

    Attributes:
        normal: Solver of those without friction.
        tolerance: Rounding level of displacements [m].
        most: Limit of linear systems with friction.
        accuracy: Of many pairs whose answers are kept by roots; it learns what was reached.
    """

    normal: Solver
    tolerance: float
    most: int = 1000
    accuracy: Accuracy | None = None

    @classmethod
    def to(cls, tolerance: float, most: int = 1000, accuracy: Accuracy | None = None) -> "Solving":
        """By the primal-dual active set, to some tolerance."""
        return cls(solve_by_active_set(tolerance, most), tolerance, most, accuracy)


def solve(problem: ConeProblem, start: Floats, how: Solving) -> tuple[Floats, int]:
    """Find the forces that obey a law.

    Args:
        problem: The law.
        start: Forces to begin with [N], (pairs, ways): one way without friction, else as many as
            dimensions.
        how: How it is solved.

    Returns:
        Forces [N], (pairs, ways), and the number of linear systems solved.

    Raises:
        ConvergenceError: They were not found.
    """
    springs, rubs, first = problem.springs, problem.has_friction, slice(None, None, start.shape[1])
    if springs is None:
        return _rigid(problem, start, how)
    if not rubs and springs.rest(problem.offset[:, 0]):
        return np.zeros_like(start), 0
    matrix = full(problem.matrix)

    def obey(give: Floats, rest: Floats) -> tuple[Floats, Floats, int]:
        nonlocal start
        softer = replace(problem, matrix=matrix.copy(), offset=problem.offset.copy())
        full(softer.matrix)[first, first] += np.diag(give)
        softer.offset[:, 0] += rest
        start, count = _rigid(softer, start, how)
        return start[:, 0], problem.answers(start)[:, 0], count

    own, tolerance = matrix.diagonal()[first], how.tolerance if rubs else 0.0
    count = springs.solve(obey, problem.offset[:, 0], own, tolerance)
    return start, count


def _rigid(problem: ConeProblem, start: Floats, how: Solving) -> tuple[Floats, int]:
    """The same without springs."""
    if problem.has_friction:
        return solve_cones(problem, start, how.tolerance, how.most, how.accuracy)
    matrix, ways, offset = full(problem.matrix), start.shape[1], problem.offset[:, 0]
    if ways > 1:
        matrix = np.ascontiguousarray(matrix[::ways, ::ways])
    found = np.zeros_like(start)
    found[:, 0], count = how.normal(matrix, np.ascontiguousarray(offset), start[:, 0] > 0.0)
    return found, count


def solve_cones(
    problem: ConeProblem,
    start: Floats,
    tolerance: float,
    max_iterations: int,
    accuracy: Accuracy | None = None,
) -> tuple[Floats, int]:
    """Find the forces.

    Args:
        problem: The coupled law.
        start: Forces to begin with, shape (pairs, dim).
        tolerance: Rounding level of displacements [m].
        max_iterations: Limit of linear systems.
        accuracy: Of many pairs whose answers are kept by roots; it learns what was reached.

    Returns:
        Forces x [N], shape (pairs, dim), and the number of linear systems solved.

    Raises:
        ConvergenceError: They were not found.
    """
    if problem.is_plain and 0 < len(start) <= _FEW:
        # Of another layout the kernel would be compiled once more (3.5 s).
        base = np.ascontiguousarray(problem.base)
        law = full(problem.matrix), problem.offset, problem.friction, base
        fine, force, total = few_cones(*law, start, tolerance, max_iterations, *_STICK)
        if fine:
            return np.asarray(force), int(total)
    problem, start = _yielding(problem, start)
    force, total, accuracy = np.zeros_like(start), 0, accuracy or Accuracy()
    wrong = np.ones(len(start), dtype=bool)
    islands = problem.islands() if len(start) <= _FEW else None
    if islands is not None:
        start = _canonical(problem, start, islands)
    if isinstance(problem.matrix, Rooted):
        many = Many(problem, tolerance)
        force, wrong = many.swept(start, accuracy)
        start, total = force.copy(), 1
    for pairs in (islands or problem.islands()) if wrong.any() else ():
        if not wrong[pairs].any():
            continue
        whole = len(pairs) == len(start)
        part = problem if whole else problem.part(pairs)
        if isinstance(part.matrix, Rooted) and len(pairs) > _FEW:
            found, systems = _solve_many(part, start[pairs], tolerance, max_iterations, accuracy)
        else:
            if isinstance(part.matrix, Rooted):
                part = replace(part, matrix=part.matrix.full())
            found, systems = _solve(part, start[pairs], tolerance, max_iterations)
        force[pairs] = found
        total = max(total, systems)
    return force, total


def _canonical(problem: ConeProblem, start: Floats, islands: Sequence[Integers]) -> Floats:
    """Forces to begin with: those of stick where forces depend on each other.

    Where these obey the law it is at once solved; else what slips does not hang on how forces came.
    """
    found = start.copy()
    for pairs in islands:
        if len(pairs) == 1:
            continue
        part = problem if len(pairs) == len(start) else problem.part(pairs)
        if (force := stuck(part)) is not None:
            found[pairs] = force
    return found


def _solve_many(
    problem: ConeProblem, start: Floats, tolerance: float, limit: int, accuracy: Accuracy
) -> tuple[Floats, int]:
    """Forces of an island of many pairs."""
    many = Many(problem, tolerance)
    best, left, total = many.polished(start, accuracy.share, limit)
    if left > max(WORST, accuracy.share):
        raise _not_found(problem, len(start), total, left)
    accuracy.reached = max(accuracy.reached, left)
    return best, total


def _solve(problem: ConeProblem, start: Floats, tolerance: float, limit: int) -> tuple[Floats, int]:
    """Forces of one island."""
    best, missed, total = newton(problem, start, tolerance, limit)
    for near in _starts(problem, start, tolerance, limit):
        if missed <= 1.0 or total >= limit:
            break
        force, error, systems = proximal(problem, near, tolerance, limit - total)
        total += systems
        if error < missed:
            best, missed = force, error
    if missed > 1.0:
        raise _not_found(problem, len(start), total, residual(problem, best))
    law = problem.matrix, problem.offset, problem.masters, problem.base
    return np.asarray(without_traces(*law, best)), total


def _not_found(problem: ConeProblem, pairs: int, total: int, left: float) -> ConvergenceError:
    return ConvergenceError(
        f"contact: no forces of {pairs} pairs were found that obey friction, in {total} "
        f"linear systems; the least residual is {left:.2g} of the largest force, the largest "
        f"friction_coefficient is {problem.friction[problem.pushes].max():g}: use a smaller "
        "one, or a smaller solve.dt"
    )


def _starts(problem: ConeProblem, start: Floats, tolerance: float, limit: int) -> Iterator[Floats]:
    """Forces from which it is worth to begin, one set after the other."""
    yield start
    yield np.zeros_like(start)
    for sweeps, damped in _SWEEPS:
        yield _swept(problem, start, sweeps, damped)
    near = np.zeros_like(start)
    for share in _GROWING:
        part = replace(problem, friction=share * problem.friction)
        near = proximal(part, near, tolerance, limit)[0]
    yield near


def _yielding(problem: ConeProblem, start: Floats) -> tuple[ConeProblem, Floats]:
    """The same where directions that supports hold, as across an axis, get no force."""
    diagonal = problem.matrix.diagonal()
    largest = diagonal.max(initial=0.0)
    fixed = diagonal <= _HELD * largest
    if not fixed.any():
        return problem, start
    matrix, held = full(problem.matrix), fixed.reshape(start.shape)
    own = np.where(fixed, largest or 1.0, 0.0)
    offset = np.where(held, 0.0, problem.offset)
    matrix = np.where(fixed[:, None] | fixed, 0.0, matrix) + np.diag(own)
    return replace(problem, matrix=matrix, offset=offset), np.where(held, 0.0, start)


def _swept(problem: ConeProblem, start: Floats, sweeps: int, damped: float) -> Floats:
    """Approach a solution by sweeps over the contacts.

    Args:
        problem: The coupled law.
        start: Forces to begin with, shape (pairs, dim).
        sweeps: Limit: of sweeps with bounds that follow the forces, or of convex problems.
        damped: Part of each new bound that is taken by convex problems; 0: bounds follow.
    """
    force = start.copy()
    pressing = problem.pressing(force)
    matrix = np.ascontiguousarray(full(problem.matrix))
    size = float(np.abs(problem.offset.ravel() / matrix.diagonal()).max(initial=0.0))
    law = problem.friction, problem.masters, problem.spins, problem.base
    for _ in range(sweeps if damped else 1):
        rest = (_FROZEN, 1e-10 * size) if damped else (sweeps, 1e-15 * size)
        sweep_cones(matrix, problem.offset, *law, pressing, force, not damped, *rest)
        wanted = problem.pressing(force)
        if np.abs(wanted - pressing).max(initial=0.0) <= 1e-10 * size:
            break
        pressing = (1.0 - damped) * pressing + damped * wanted
    return force
