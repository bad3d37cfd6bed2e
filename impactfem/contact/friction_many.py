"""Contact forces in their cones of many bodies, whose answers are kept by roots.

Sweeps over the contacts (nonlinear Gauss-Seidel) from the forces of the layer before come near; a
residual that is asked for is often reached by them. Where it is not, proximal steps lead Newton's
method, as in `impactfem.contact.friction_solver`, with sparse matrices.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from impactfem.arrays import Floats
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.rooted import Rooted
from impactfem.contact.rooted_kernels import gathered_roots, motion_of, sweep_roots, swept_forces
from impactfem.contact.sparse_rows import rows_of

_ROUNDING = 1e-13  # share of the largest displacement that counts as zero
_LAST = 5000  # sweeps after Newton's method
_STEPS = 12  # of Newton in a proximal step
_FIRST, _MOST, _FALLS, _GROWS = 1e-3, 10.0, 0.1, 5.0  # compliances, as in `friction_solver`
_PROXIMAL, _IN_VAIN = 25, 6  # proximal steps, and those one after the other that find nothing
_DEPENDENT = 1e-9  # compliance that makes dependent forces unique within a step of Newton
_SHORTER = (1.0, 0.5, 0.25)  # shares of a step, of which the best is taken


@dataclass
class Accuracy:
    """How right forces of many contacts are.

    Attributes:
        asked: Largest error of the law in a force, as a share of the largest force; None: to
            rounding where that is found, else to `RESIDUAL`.
        reached: The largest one that was left, where it is not rounding.
    """

    asked: float | None = None
    reached: float = 0.0

    @property
    def share(self) -> float:
        """What is asked of many contacts that move each other."""
        return RESIDUAL if self.asked is None else self.asked


RESIDUAL = 1e-10
WORST = 1e-4
"""Residual up to which a run goes on and says it."""


class Many:
    """A problem of many contacts, and how far forces are from its solution.

    Attributes:
        problem: The law.
        matrix: Its answers.
        own: Answers of pairs to their own forces, (pairs, dim, dim).
    """

    def __init__(self, problem: ConeProblem, tolerance: float) -> None:
        """Take a problem without moments.

        Args:
            problem: The law.
            tolerance: Rounding level of displacements [m].

        Raises:
            TypeError: Its answers are not kept by roots.
        """
        if not isinstance(problem.matrix, Rooted):
            raise TypeError("the compliance of many contacts is kept by its factor")
        self.problem, self.matrix, self._tolerance = problem, problem.matrix, tolerance
        self.own = problem.own()
        self._scale = problem.scales()
        self._gathered: Any = None  # roots pair by pair, where sweeps ask for them

    def missed(self, force: Floats) -> tuple[Floats, Floats]:
        """Errors of the law [N], (pairs, dim), and what of each pair is rounding [N], (pairs,)."""
        answer = self.problem.answers(force)
        error = _law(self.problem, self._scale, force, answer)[-1]
        spread = max(np.abs(answer).max(initial=0.0), np.abs(self._scale * force).max(initial=0.0))
        spread = max(float(spread), float(np.abs(self.problem.offset).max(initial=0.0)))
        least = max(self._tolerance, _ROUNDING * spread) / self._scale.min(axis=1)
        return error, least

    def swept(self, start: Floats, accuracy: Accuracy) -> tuple[Floats, NDArray[np.bool_]]:
        """Forces by sweeps from some forces, and of which pairs they are not found."""
        gathered, size, own, offset, law, scale, force = self._spread(start)
        found = size, own, offset, *law, scale, force, self._tolerance, accuracy.asked or 0.0
        wrong, left = swept_forces(gathered, *found)
        if accuracy.asked is not None:
            accuracy.reached = max(accuracy.reached, min(float(left), accuracy.asked))
        return force[:, : start.shape[1]].copy(), wrong

    def _last(self, start: Floats) -> Floats:
        """Forces after many sweeps."""
        gathered, size, own, offset, law, scale, force = self._spread(start)
        least = 0.1 * self._tolerance / scale.min(axis=1)
        motion = motion_of(gathered, force, size)
        sweep_roots(*gathered, own, offset, *law, force, motion, _LAST, 0.0, least)
        return np.asarray(force[:, : start.shape[1]]).copy()

    def _spread(self, start: Floats) -> tuple[Any, ...]:
        """The problem as kernels take it: three components of each pair."""
        problem, (pairs, dim) = self.problem, start.shape
        own, offset, force = np.zeros((pairs, 3, 3)), np.zeros((pairs, 3)), np.zeros((pairs, 3))
        own[:, :dim, :dim], offset[:, :dim], force[:, :dim] = self.own, problem.offset, start
        if self._gathered is None:
            self._gathered = gathered_roots(*rows_of(self.matrix.roots), pairs, dim)
        scale = np.ascontiguousarray(self._scale[:, :2])
        law = problem.friction, problem.base
        size = self.matrix.roots.shape[1]
        return self._gathered, size, own, offset, law, scale, force

    def residual(self, force: Floats) -> float:
        """Largest error of the law in a force, as a share of the largest force."""
        largest = float(np.abs(force).max(initial=0.0)) or 1.0
        return float(np.abs(self.missed(force)[0]).max(initial=0.0)) / largest

    def polished(self, start: Floats, share: float, limit: int) -> tuple[Floats, float, int]:
        """Forces by proximal steps, their residual, and linear systems solved."""
        problem, whole, diagonal = self.problem, self.matrix.sparse(), self.matrix.diagonal()
        force = best = start
        least, compliance, total, vain = self.residual(start), _FIRST, 0, 0
        for _ in range(_PROXIMAL):
            if least <= share or total >= limit or vain > _IN_VAIN:
                break
            own = compliance * diagonal
            offset = problem.offset - (own * force.ravel()).reshape(force.shape)
            nearer = replace(problem, matrix=Rooted.none(len(own)), offset=offset)
            found, left, steps = _newton(nearer, csr_matrix(whole + diags(own)), force, 0.1 * share)
            total += max(1, steps)
            if left > share:
                compliance, vain = min(compliance * _GROWS, _MOST), vain + 1
                continue
            force, compliance, vain = found, compliance * _FALLS, 0
            missed = self.residual(force)
            if missed < least:
                best, least = force, missed
        if least > share:
            swept = self._last(best)
            missed = self.residual(swept)
            best, least = (swept, missed) if missed < least else (best, least)
        return best, least, total


def _law(problem: ConeProblem, scale: Floats, force: Floats, answer: Floats) -> tuple[Floats, ...]:
    """Trial forces, their tangential size, its bound, and errors [N]; see `friction_newton`."""
    trial = force - answer / scale
    length = np.linalg.norm(trial[:, 1:], axis=1)
    bound = problem.friction * (problem.base + np.maximum(force[:, 0], 0.0))
    share = np.where(length > bound, bound / np.where(length > 0.0, length, 1.0), 1.0)
    error = force.copy()
    error[:, 0] -= np.maximum(trial[:, 0], 0.0)
    error[:, 1:] -= share[:, None] * trial[:, 1:]
    return trial, length, bound, error


def _newton(
    problem: ConeProblem, matrix: csr_matrix, start: Floats, share: float
) -> tuple[Floats, float, int]:
    """Newton's steps for another matrix than that of a problem: forces, residual, steps."""
    diagonal = matrix.diagonal().reshape(start.shape)
    scale = np.repeat(diagonal[:, 1:].mean(axis=1)[:, None], start.shape[1], axis=1)
    scale[:, 0] = diagonal[:, 0]
    held = csr_matrix(matrix + _DEPENDENT * diags(diagonal.ravel()))

    def look(force: Floats) -> tuple[float, tuple[Floats, ...]]:
        answer = problem.offset + (matrix @ force.ravel()).reshape(force.shape)
        found = _law(problem, scale, force, answer)
        return float(np.abs(found[-1]).max()), found

    force, (missed, state), step = start, look(start), 0
    for step in range(_STEPS):
        if missed <= share * float(np.abs(force).max()):
            break
        try:
            factored = splu((_derivative(problem, scale, force, state, held)).tocsc())
        except RuntimeError:  # singular
            return force, np.inf, step
        way, found = factored.solve(state[-1].ravel()).reshape(force.shape), np.inf
        for part in _SHORTER:
            trial = force - part * way
            trial[:, 0] = np.maximum(trial[:, 0], 0.0)
            amount, after = look(trial)
            if amount < found:
                found, best, further = amount, trial, after
            if found < missed:
                break
        if not np.isfinite(found):
            return force, np.inf, step
        force, missed, state = best, found, further
    return force, missed / (float(np.abs(force).max()) or 1.0), step


def _derivative(
    problem: ConeProblem, scale: Floats, force: Floats, state: tuple[Floats, ...],
    matrix: csr_matrix,
) -> csr_matrix:  # fmt: skip
    """Of the errors by the forces; see `impactfem.contact.cone_kernels`."""
    trial, length, bound, _ = state
    pairs, dim = force.shape
    moved, kept = np.zeros((2, pairs, dim, dim))
    pushed, sticks = trial[:, 0] > 0.0, (length <= bound) & (bound > 0.0)
    moved[:, 0, 0], kept[:, 0, 0] = pushed / scale[:, 0], ~pushed
    along = trial[:, 1:] / np.where(length > 0.0, length, 1.0)[:, None]
    turn = np.eye(dim - 1) - along[:, :, None] * along[:, None]
    turn *= (bound / np.where(length > 0.0, length, 1.0))[:, None, None]
    turn[sticks] = np.eye(dim - 1)
    moved[:, 1:, 1:] = turn / scale[:, 1:, None]
    kept[:, 1:, 1:] = np.eye(dim - 1) - turn
    slides = ~sticks & (force[:, 0] > 0.0)
    kept[:, 1:, 0] = -np.where(slides, problem.friction, 0.0)[:, None] * along
    places = np.arange(pairs), np.arange(pairs + 1)
    return csr_matrix(bsr_matrix((moved, *places)) @ matrix + bsr_matrix((kept, *places)))
