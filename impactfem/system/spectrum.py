"""The largest eigenvalue of M^-1 K, which limits the time step of explicit schemes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh_tridiagonal

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.fem import MPI

_STEPS = 1000
_TOLERANCE = 1e-2
_SHARP = 1e-10
_SHARP_WORK = 5e6  # dofs times iterations that are spent on more than the tolerance


def largest_eigenvalue(
    stiffness: Any,
    inverse_mass: Floats,
    numbers: NDArray[np.int64],
    *,
    tolerance: float = _TOLERANCE,
    steps: int = _STEPS,
) -> float:
    """Bound the largest eigenvalue of M^-1 K for a lumped mass M from above (collective).

    Lanczos iterations on M^-1/2 K M^-1/2; the bound is the largest Ritz value plus the norm of
    its residual. Source: Y. Zhou, R.-C. Li, Linear Algebra Appl. 435 (2011) 480-493. It fails only
    if the start vector has next to no share in the highest mode; this one is scrambled, and the
    same on any number of ranks.

    Args:
        stiffness: Symmetric PETSc matrix K [N/m].
        inverse_mass: Inverse of the owned masses [1/kg]; 0 for what is held, shape (owned dofs,).
        numbers: Canonical numbers of the owned nodes, shape (owned nodes,).
        tolerance: Share of the eigenvalue that the residual may reach.
        steps: Largest number of iterations.

    Returns:
        The bound [1/s^2]; 0 when nothing can move.

    Raises:
        ConvergenceError: The iterations meet a value that is not finite, or no positive one.
    """
    comm = stiffness.comm.tompi4py()
    root = np.sqrt(inverse_mass)
    spare = min(steps, int(_SHARP_WORK / max(1, comm.allreduce(len(root), op=MPI.SUM))))
    source, image = stiffness.createVecs()

    def norm(x: Floats) -> float:
        return float(np.sqrt(comm.allreduce(float(x @ x), op=MPI.SUM)))

    vector = np.where(root > 0.0, _scrambled(numbers, len(root)), 0.0)
    size = norm(vector)
    if size == 0.0:
        return 0.0
    vector /= size
    before = np.zeros_like(vector)
    diagonal: list[float] = []
    beside: list[float] = []
    bound = 0.0
    for step in range(steps):
        source.array_w[:] = root * vector
        stiffness.mult(source, image)
        following = root * image.array_r
        if beside:
            following -= beside[-1] * before
        diagonal.append(float(comm.allreduce(float(following @ vector), op=MPI.SUM)))
        if np.isfinite(diagonal[-1]):
            following -= diagonal[-1] * vector
        length = norm(following)
        if not np.isfinite(length + diagonal[-1]):
            raise ConvergenceError(
                "the largest eigenvalue of the body cannot be found: its stiffness or mass holds "
                "values that are not finite; check the material's data and the mesh"
            )
        ritz, residual = _largest(np.array(diagonal), np.array(beside), length)
        bound = ritz + residual
        if residual <= (min(_SHARP, tolerance) if step < spare else tolerance) * abs(ritz):
            break
        beside.append(length)
        before, vector = vector, following / length
    source.destroy()
    image.destroy()
    if bound < 0.0:
        raise ConvergenceError(
            f"the stiffness of the body is not positive (largest eigenvalue {bound:g} 1/s^2): "
            "check the material's data and the mesh"
        )
    return bound


def _largest(diagonal: Floats, beside: Floats, length: float) -> tuple[float, float]:
    """Largest Ritz value, and the norm of the residual of its vector."""
    last = len(diagonal) - 1
    values, vectors = eigh_tridiagonal(diagonal, beside, select="i", select_range=(last, last))
    return float(values[0]), length * abs(float(vectors[-1, 0]))


def _scrambled(numbers: NDArray[np.int64], dofs: int) -> Floats:
    """Values between -1 and 1 that follow from each dof's canonical number only."""
    dim = dofs // max(len(numbers), 1)
    index = (dim * numbers[:, None] + np.arange(dim)).ravel().astype(np.uint64)
    # Bits mixed as by SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014).
    index = (index + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    index = (index ^ (index >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    index = (index ^ (index >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    index ^= index >> np.uint64(31)
    return np.asarray(2.0 * (index >> np.uint64(11)).astype(np.float64) * 2.0**-53 - 1.0)
