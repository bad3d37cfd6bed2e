"""How many forces obey friction: jamming contacts, all solutions of few pairs, dependent forces.

**Jamming** (Painleve). A contact that slips along s with lambda > 0 has tau = -mu lambda s, so that
its normal acceleration is b + (A_nn - mu A_nt s) lambda. Where the bracket is not positive, no
bounded force keeps it shut if b < 0 (an impact without a collision ends the slip), and two do if
b > 0: none, and one that presses it on.
"""

from itertools import product

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.contact.cone_kernels import stuck_forces
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.rooted import Matrix, full, own_blocks
from impactfem.contact.speed_kernels import jamming

MOST_PAIRS = 4  # of which all solutions are looked for
_ROUNDING = 1e-9
_RANK = 1e-9  # share of the largest singular value that counts as none
_INSIDE, _SEARCH = 1e-3, 400  # how far within cones stick is looked for, and how often
STICK = (_RANK, _ROUNDING, _INSIDE), _SEARCH  # as `cone_kernels.stuck_forces` has it


def jams(matrix: Matrix, friction: Floats, slip: Floats) -> Booleans:
    """Which contacts jam while they slip, (pairs,).

    Args:
        matrix: Answers to forces, (pairs dim, pairs dim), the normal component first.
        friction: Coefficients, (pairs,).
        slip: Along the tangents, 0 where there is none, (pairs, dim - 1).
    """
    return np.asarray(jamming(own_blocks(matrix, slip.shape[1] + 1), friction, slip))


def all_solutions(problem: ConeProblem) -> list[Floats]:
    """All forces in the plane that obey the law, of at most `MOST_PAIRS` pairs, (pairs, 2) each.

    Each pair is open, sticks or slips in one of two ways: as many linear systems.
    """
    pairs = len(problem.offset)
    if problem.offset.shape[1] != 2 or pairs > MOST_PAIRS:
        raise ValueError("all solutions are found of few pairs in the plane")
    found: list[Floats] = []
    scale = problem.scales()
    size = float(np.abs(problem.offset).max(initial=0.0)) or 1.0
    kinds: tuple[str | float, ...] = ("open", "stick", 1.0, -1.0)
    for modes in product(kinds, repeat=pairs):
        force = _in_modes(problem, modes)
        if force is None:
            continue
        answer = problem.answers(force)
        room = _ROUNDING * (size + float(np.abs(scale * force).max()))
        if all(
            _agrees(mode, f, w, a, mu, room)
            for mode, f, w, a, mu in zip(modes, force, answer, scale, problem.friction, strict=True)
        ) and not any(np.abs(scale * (force - other)).max() <= room for other in found):
            found.append(force)
    return found


def _in_modes(problem: ConeProblem, modes: tuple[str | float, ...]) -> Floats | None:
    pairs = len(modes)
    system, right, matrix = np.eye(2 * pairs), np.zeros(2 * pairs), full(problem.matrix)
    for j, mode in enumerate(modes):
        n, t = 2 * j, 2 * j + 1
        if mode == "open":
            continue
        system[n], right[n] = matrix[n], -problem.offset[j, 0]
        if mode == "stick":
            system[t], right[t] = matrix[t], -problem.offset[j, 1]
        else:
            system[t, n] = float(mode) * problem.friction[j]
    try:
        return np.linalg.solve(system, right).reshape(pairs, 2)
    except np.linalg.LinAlgError:
        return None


def _agrees(
    mode: str | float, force: Floats, answer: Floats, scale: Floats, mu: float, room: float
) -> bool:
    """Whether a pair is as its mode assumes."""
    if mode == "open":
        return bool(answer[0] >= -room)
    if scale[0] * force[0] < -room:
        return False
    if mode == "stick":
        return bool(scale[1] * (abs(force[1]) - mu * force[0]) <= room)
    return bool(float(mode) * answer[1] >= -room)


def dependent(problem: ConeProblem, force: Floats) -> Floats:
    """Changes of the forces that change no motion while stick and slip stay.

    Args:
        problem: The law.
        force: That obey it, (pairs, dim).

    Returns:
        An orthonormal basis of them, (pairs dim, dimension).
    """
    pairs, dim = force.shape
    each = [np.zeros((pairs * dim, 0))]
    own_answers = problem.matrix.diagonal().reshape(pairs, dim)
    for own in problem.islands():
        if len(own) == 1 and own_answers[own[0]].all():
            continue  # one contact answers to each part of its force by itself
        alone = _dependent(problem.part(own), force[own])
        each.append(np.zeros((pairs, dim, alone.shape[1])))
        each[-1][own] = alone.reshape(len(own), dim, -1)
    return np.hstack([found.reshape(pairs * dim, -1) for found in each])


def _dependent(problem: ConeProblem, force: Floats) -> Floats:
    """The same of pairs that move each other."""
    pairs, dim = force.shape
    bound = problem.friction * force[:, 0]
    pushes = force[:, 0] > 0.0
    sticks = pushes & (np.linalg.norm(force[:, 1:], axis=1) < (1.0 - _ROUNDING) * bound)
    free = np.repeat(sticks[:, None], dim, axis=1)
    free[:, 0] = pushes
    spread = np.eye(pairs * dim)
    # Where a pair slips its friction goes with what presses it.
    for j in np.flatnonzero(pushes & ~sticks):
        spread[j * dim : (j + 1) * dim, j * dim] = force[j] / force[j, 0]
    spread = spread[:, free.ravel()]
    root = np.sqrt(np.maximum(problem.matrix.diagonal(), np.finfo(float).tiny))
    answers = (problem.matrix @ spread) / root[:, None]
    size = np.linalg.norm(answers, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    # Of many rows the triangular factor has the same singular values, and the same ways.
    values, right = np.linalg.svd(np.linalg.qr(answers / size, mode="r"))[1:]
    rank = int((values > _RANK * values.max(initial=0.0)).sum())
    return np.asarray(np.linalg.qr(spread @ (right[rank:] / size).T)[0])


def stuck(problem: ConeProblem) -> Floats | None:
    """The least forces with which nothing slips, of pairs whose forces depend on each other.

    What would be pulled lets go. Forces are measured by the law's numbers a, so that neither order
    nor directions of the pairs matter, and pairs that are alike push alike.

    Args:
        problem: The law.

    Returns:
        Forces (pairs, dim); None where they do not depend on each other, where some are moments,
        or none were found well within their cones.
    """
    if len(problem.offset) < 2 or not problem.pushes.all() or problem.base.any():
        return None
    matrix = np.ascontiguousarray(full(problem.matrix))
    law = problem.offset, problem.friction, problem.scales()
    fine, found = stuck_forces(matrix, *law, *STICK)
    return np.asarray(found) if fine else None
