"""Motion along closed constraints, solved so that light bodies may carry heavy ones."""

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from impactfem.arrays import Floats

_REFINEMENTS = 3


def constrained(
    mass: Floats, normals: Floats, applied: Floats, rest: Floats
) -> tuple[Floats, Floats]:
    """Acceleration and contact forces of M a = f + G^T lambda, G a + c = 0, for several (f, c).

    Both are unknowns of one system, solved with refinement: G M^-1 G^T would lose the digits of
    the forces where a light body carries a heavy one.

    Args:
        mass: M (d, d).
        normals: G (S, d), linearly independent rows.
        applied: f (d, columns).
        rest: c (S, columns).
    """
    d, n = mass.shape[0], len(normals)
    if n == 1:
        return _one(mass, normals, applied, rest)
    # Powers of two, so that scaling itself does not round.
    root = np.exp2(-np.round(0.5 * np.log2(np.diag(mass))))
    row = np.exp2(-np.round(np.log2(np.linalg.norm(normals * root, axis=1))))
    scale = np.concatenate([root, row])
    matrix = np.block([[mass, -normals.T], [normals, np.zeros((n, n))]])
    right = np.concatenate([applied, -rest])
    factors = lu_factor(scale[:, None] * matrix * scale)
    found = np.zeros((d + n, right.shape[1]))
    for _ in range(_REFINEMENTS):
        left = right - matrix @ found
        found += scale[:, None] * lu_solve(factors, scale[:, None] * left)
    return found[:d], found[d:]


def _one(mass: Floats, normals: Floats, applied: Floats, rest: Floats) -> tuple[Floats, Floats]:
    """The same for one constraint, by its scalar Schur complement."""
    found = np.linalg.solve(mass, np.concatenate([applied, normals.T], axis=1))
    acceleration, answer = found[:, :-1], found[:, -1:]
    response = float(normals[0] @ answer[:, 0])
    force = np.zeros((1, applied.shape[1]))
    for _ in range(2):
        change = -(normals @ acceleration + rest) / response
        force += change
        acceleration = acceleration + answer @ change
    return acceleration, force
