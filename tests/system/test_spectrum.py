"""The bound of the largest eigenvalue against closed forms and another eigensolver."""

import numpy as np
import pytest
from scipy.sparse import diags
from scipy.sparse.linalg import eigsh
from solids import system, to_scipy

from impactfem.errors import ConvergenceError
from impactfem.fem import MPI, PETSc
from impactfem.system.spectrum import largest_eigenvalue


def chain(n):
    """Stiffness of n unit masses between walls, coupled by unit springs."""
    matrix = PETSc.Mat().createAIJ((n, n), nnz=3, comm=MPI.COMM_SELF)
    for i in range(n):
        for j, value in ((i - 1, -1.0), (i, 2.0), (i + 1, -1.0)):
            if 0 <= j < n:
                matrix[i, j] = value
    matrix.assemble()
    return matrix


@pytest.mark.parametrize("n", [1, 2, 10, 400])
@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4])
def test_chain_of_masses_has_its_closed_form(n, tolerance):
    mass = 0.25
    bound = largest_eigenvalue(
        chain(n), np.full(n, 1 / mass), np.arange(n), tolerance=tolerance, steps=2000
    )
    exact = 4.0 * np.sin(n * np.pi / (2 * (n + 1))) ** 2 / mass
    assert exact * (1 - 1e-12) <= bound <= exact * (1 + tolerance) + 1e-12


def test_held_masses_do_not_count():
    inverse = np.ones(10)
    inverse[5:] = 0.0
    bound = largest_eigenvalue(chain(10), inverse, np.arange(10), tolerance=1e-10)
    assert bound == pytest.approx(4.0 * np.sin(5 * np.pi / 12) ** 2, rel=1e-9)
    assert largest_eigenvalue(chain(10), np.zeros(10), np.arange(10)) == 0.0


@pytest.mark.parametrize(("cell", "divisions"), [("triangle", (12, 9)), ("hexahedron", (5, 4, 3))])
def test_bodies_agree_with_another_eigensolver(cell, divisions):
    def graded(s):  # small elements at one side, whose modes are local
        return s**2 + 0.1 * s

    body = system(cell, 1, divisions, graded, supports=[{"surface": "s0-", "kind": "fixed"}])
    inverse = np.divide(1.0, body.lumped, where=body.lumped > 0, out=np.zeros_like(body.lumped))
    root = diags(np.sqrt(inverse))
    exact = eigsh(root @ to_scipy(body.stiffness) @ root, k=1, return_eigenvectors=False)[0]
    bound = largest_eigenvalue(body.stiffness, inverse, body.numbers)
    assert exact <= bound <= 1.011 * exact


def test_infinite_stiffness_is_refused():
    matrix = chain(4)
    matrix[0, 0] = np.inf
    matrix.assemble()
    with pytest.raises(ConvergenceError, match="not finite"):
        largest_eigenvalue(matrix, np.ones(4), np.arange(4))
