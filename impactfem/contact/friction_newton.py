"""Contact forces that obey Signorini's and Coulomb's law at once: a semismooth Newton method.

Find forces x_j = (y_j, tau_j) of the pairs j with

    0 <= y _|_ w >= 0,   tau = P_b(tau - s / a),   b = mu (base + y),   (w, s) = o + A x,

where w is the normal and s the tangential part of each pair, P_b the projection on the disc (in
the plane: the interval) of radius b, and a > 0 any number: the law does not depend on it. Here
a is the mean diagonal of A in the pair's tangential plane, which no rotation of its axes changes.

Newton's step takes the derivative of these functions where they have one (Alart, Curnier, Comput.
Methods Appl. Mech. Eng. 92 (1991) 353-375; Hueeber, Stadler, Wohlmuth, SIAM J. Sci. Comput. 30
(2008) 572-596). With q = tau - s / a, n = q / |q|:

    no force:  y = 0;             push:  w = 0,
    stick |q| <= b:  s = 0,       slip:  tau - b n = 0,  d(b n) = n mu dy + (b / |q|)(1 - n n) dq.

In slip b / |q| < 1, so that the step exists far from a solution too. Should it not settle, the
bounds b are frozen: then the problem is convex, sweeps solve it for any A, and a fixed point in b,
damped, leads Newton's method to where it converges. This fixed point contracts if mu times the
coupling of tangential forces and gaps is small; solutions exist for all mu, but need not be
unique (Haslinger, Math. Methods Appl. Sci. 5 (1983) 422-437). Of random dense problems with up to
19 pairs all were solved up to mu = 1, all but about 1 in 1000 at mu = 3 and 1 in 70 at mu = 10.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.friction_kernels import sweep_cones
from impactfem.errors import ConvergenceError

Floats = NDArray[np.float64]

_ROUNDING = 1e-13  # share of the largest displacement that counts as zero
_STEPS = 25  # of Newton from one start; the method needs 3 to 8 where it converges
# Frozen bounds before each further attempt, and the share of a new bound that is taken.
_ATTEMPTS = ((5, 0.5), (20, 0.5), (80, 0.25), (320, 0.1))
_SWEEPS = 200
_HELD = 1e-12  # share of the largest compliance below which a direction does not yield
_DEPENDENT = 1e-6  # least eigenvalue of the matrix with unit diagonal
_COMPLIANCES = (1e-10, 1e-8, 1e-6)
"""Where forces depend on each other, as those along a rod at both of its ends, Newton's systems
are singular or nearly so: a little compliance of each tells them apart."""


@dataclass(frozen=True)
class ConeProblem:
    """Data of the coupled law above.

    Attributes:
        matrix: A [m/N], symmetric positive definite, shape (pairs dim, pairs dim), the components
            of a pair one after the other, the normal one first.
        offset: o [m], shape (pairs, dim).
        friction: mu, shape (pairs,), >= 0.
        base: Part of the bound's normal force that is given [N], shape (pairs,), >= 0.
    """

    matrix: Floats
    offset: Floats
    friction: Floats
    base: Floats

    def answers(self, force: Floats) -> Floats:
        """(w, s) for forces of shape (pairs, dim)."""
        return self.offset + (self.matrix @ force.ravel()).reshape(force.shape)

    def softened(self, share: float) -> "ConeProblem":
        """The same with a compliance of each force by itself, a share of what it has."""
        return replace(self, matrix=self.matrix + np.diag(share * np.diag(self.matrix)))

    def bound(self, force: Floats) -> Floats:
        """Largest tangential force of each pair [N]."""
        return self.friction * (self.base + np.maximum(force[:, 0], 0.0))


def solve_cones(
    problem: ConeProblem, start: Floats, tolerance: float, max_iterations: int
) -> tuple[Floats, int]:
    """Find the forces.

    Args:
        problem: The coupled law.
        start: Forces to begin with, shape (pairs, dim).
        tolerance: Rounding level of displacements [m].
        max_iterations: Limit of linear systems.

    Returns:
        Forces x [N], shape (pairs, dim), and the number of linear systems solved.

    Raises:
        ConvergenceError: Neither Newton's method nor the fixed point has found them.
    """
    problem, start = _yielding(problem, start)
    force, missed, total = _newton(problem, start, tolerance, max_iterations)
    given, shares = problem, iter(_COMPLIANCES if missed > 1.0 and _is_singular(problem) else ())
    while missed > 1.0 and (share := next(shares, None)) is not None:
        given = problem.softened(share)
        force, missed, steps = _newton(given, start, tolerance, max_iterations)
        total += steps
    for outer, share in _ATTEMPTS:
        if missed <= 1.0 or total >= max_iterations:
            break
        near = _with_frozen_bounds(given, start, outer, share)
        force, missed, steps = _newton(given, near, tolerance, max_iterations - total)
        total += steps
        start = near
    if missed > 1.0:
        raise ConvergenceError(
            f"contact: stick and slip of {len(start)} pairs were not found in {total} linear "
            f"systems; the largest friction_coefficient is {problem.friction.max():g}: use a "
            "smaller one, or a smaller solve.dt"
        )
    return _without_traces(given, force), total


def _yielding(problem: ConeProblem, start: Floats) -> tuple[ConeProblem, Floats]:
    """The same where directions that supports hold, as across an axis, get no force."""
    matrix, diagonal = problem.matrix, np.diag(problem.matrix)
    largest = diagonal.max(initial=0.0)
    fixed = diagonal <= _HELD * largest
    if not fixed.any():
        return problem, start
    held = fixed.reshape(start.shape)
    own = np.where(fixed, largest or 1.0, 0.0)
    offset = np.where(held, 0.0, problem.offset)
    matrix = np.where(fixed[:, None] | fixed, 0.0, matrix) + np.diag(own)
    return replace(problem, matrix=matrix, offset=offset), np.where(held, 0.0, start)


def _is_singular(problem: ConeProblem) -> bool:
    """Whether forces depend on each other, but for rounding and small angles."""
    root = 1.0 / np.sqrt(np.maximum(np.diag(problem.matrix), np.finfo(float).tiny))
    least = np.linalg.eigvalsh(root[:, None] * problem.matrix * root)[0]
    return bool(least < _DEPENDENT)


def _without_traces(problem: ConeProblem, force: Floats) -> Floats:
    """No force, not even by rounding, where a pair is open."""
    first = np.diag(problem.matrix)[:: force.shape[1]]
    is_open = force[:, 0] <= problem.answers(force)[:, 0] / first
    force = force.copy()
    force[is_open, 0] = 0.0
    force[is_open & (problem.base <= 0.0), 1:] = 0.0
    return force


def _newton(
    problem: ConeProblem, start: Floats, tolerance: float, limit: int
) -> tuple[Floats, float, int]:
    """Newton's steps; also the error in units of the tolerance, and linear systems solved."""
    pairs, dim = start.shape
    diagonal = np.diag(problem.matrix).reshape(pairs, dim)
    scale = np.repeat(diagonal[:, 1:].mean(axis=1)[:, None], dim, axis=1)
    scale[:, 0] = diagonal[:, 0]
    force, best, least = start, start, np.inf
    for step in range(min(_STEPS, limit) + 1):
        answer = problem.answers(force)
        error, jacobian = _linearised(problem, force, answer, scale)
        spread = max(
            np.abs(problem.offset).max(initial=0.0), np.abs(scale * force).max(initial=0.0)
        )
        missed = float(np.abs(error * scale).max(initial=0.0))
        missed /= max(tolerance, _ROUNDING * spread, np.finfo(float).tiny)
        if not np.isfinite(missed):
            break
        # Below the tolerance steps go on while they gain: the energy asks for the last digit.
        if least <= 1.0 and missed > 0.5 * least:
            return best, least, step
        if missed < least:
            best, least = force, missed
        if missed == 0.0 or step == min(_STEPS, limit):
            break
        force = force - _solved(jacobian, error.ravel()).reshape(pairs, dim)
        force[:, 0] = np.where(force[:, 0] > 0.0, force[:, 0], 0.0)
    return best, least, step


def _linearised(
    problem: ConeProblem, force: Floats, answer: Floats, scale: Floats
) -> tuple[Floats, Floats]:
    """Errors of the law [N], shape (pairs, dim), and their derivative."""
    pairs, dim = force.shape
    blocks = problem.matrix.reshape(pairs, dim, pairs, dim)
    mine = np.arange(pairs)
    error = np.empty_like(force)
    jacobian = np.zeros((pairs, dim, pairs, dim))
    normal, tangential = force[:, 0], force[:, 1:]

    pushed = normal - answer[:, 0] / scale[:, 0] > 0.0
    error[:, 0] = np.where(pushed, answer[:, 0] / scale[:, 0], normal)
    jacobian[pushed, 0] = blocks[pushed, 0] / scale[pushed, 0, None, None]
    jacobian[~pushed, 0, mine[~pushed], 0] = 1.0

    trial = tangential - answer[:, 1:] / scale[:, 1:]
    length = np.sqrt(np.einsum("ij,ij->i", trial, trial))
    bound = problem.bound(force)
    stick = length <= bound
    stick &= bound > 0.0
    error[stick, 1:] = answer[stick, 1:] / scale[stick, 1:]
    jacobian[stick, 1:] = blocks[stick, 1:] / scale[stick, 1:, None, None]
    slip = np.flatnonzero(~stick)
    if len(slip):
        along = trial[slip] / np.where(length[slip] > 0.0, length[slip], 1.0)[:, None]
        error[slip, 1:] = tangential[slip] - bound[slip, None] * along
        turn = np.eye(dim - 1) - np.einsum("ij,ik->ijk", along, along)
        turn *= (bound[slip] / np.where(length[slip] > 0.0, length[slip], 1.0))[:, None, None]
        part = np.einsum("ijk,iklm->ijlm", turn, blocks[slip, 1:] / scale[slip, 1:, None, None])
        part[np.arange(len(slip)), :, slip, 1:] += np.eye(dim - 1) - turn
        part[np.arange(len(slip)), :, slip, 0] -= problem.friction[slip, None] * along
        jacobian[slip, 1:] = part
    return error, jacobian.reshape(pairs * dim, pairs * dim)


def _solved(matrix: Floats, right: Floats) -> Floats:
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:  # dependent pairs
        found: Floats = np.linalg.lstsq(matrix, right)[0]
        return found


def _with_frozen_bounds(problem: ConeProblem, start: Floats, outer: int, share: float) -> Floats:
    """Approach a solution by convex problems with given bounds.

    Args:
        problem: The coupled law.
        start: Forces to begin with, shape (pairs, dim).
        outer: Limit of convex problems.
        share: Part of each new bound that is taken; the rest is kept of the last one.
    """
    force = start.copy()
    bound = problem.bound(force)
    matrix = np.ascontiguousarray(problem.matrix)
    size = float(np.abs(problem.offset.ravel() / np.diag(matrix)).max(initial=0.0))
    for _ in range(outer):
        sweep_cones(matrix, problem.offset, bound, force, _SWEEPS, 1e-10 * size)
        wanted = problem.bound(force)
        if np.abs(wanted - bound).max(initial=0.0) <= 1e-10 * size:
            break
        bound = (1.0 - share) * bound + share * wanted
    return force
