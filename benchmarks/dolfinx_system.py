"""Mass and stiffness of a bar by DOLFINx, as SciPy matrices."""

import numpy as np
import ufl
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from impactfem.fem import MPI, dolfinx


def assembled(
    length: float, elements: int, speed: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], csr_matrix]:
    """Positions [m], lumped mass [m] and stiffness [m/s^2], nodes ordered from the wall."""
    mesh = dolfinx.mesh.create_interval(MPI.COMM_SELF, elements, (0.0, length))
    space = dolfinx.fem.functionspace(mesh, ("Lagrange", 1))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    # A constant, so that another speed compiles nothing.
    c = dolfinx.fem.Constant(mesh, speed)
    stiffness = dolfinx.fem.assemble_matrix(
        dolfinx.fem.form(c**2 * ufl.inner(u.dx(0), v.dx(0)) * ufl.dx)
    ).to_scipy()
    mass = dolfinx.fem.assemble_matrix(dolfinx.fem.form(u * v * ufl.dx)).to_scipy()
    x = space.tabulate_dof_coordinates()[:, 0]
    order = np.argsort(x)
    lumped = np.asarray(mass.sum(axis=1)).ravel()
    return x[order], lumped[order], stiffness.tocsr()[order][:, order]
