"""A neo-Hookean disc that strikes a floor, as one would write it in DOLFINx.

Plane strain, linear triangles, consistent mass. Implicit midpoint rule; the floor y = 0 pushes with
a pressure of `stiffness` times the penetration at the middle of the step (`at` = 1/2) or at its end
(1). SNES with line search, MUMPS.
"""

import time
from types import SimpleNamespace
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import NonlinearProblem
from mpi4py import MPI
from numpy.typing import NDArray

OPTIONS = {
    "snes_type": "newtonls", "snes_linesearch_type": "bt", "snes_rtol": 1e-8, "snes_atol": 1e-8,
    "snes_stol": 0.0, "snes_error_if_not_converged": True, "ksp_type": "preonly", "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
}  # fmt: skip


def run(
    points: NDArray[np.float64], cells: NDArray[np.int64], body: SimpleNamespace, stiffness: float,
    dt: float, steps: int, at: float = 0.5, degree: int = 1,
) -> dict[str, list[float] | float]:  # fmt: skip
    """Velocity of the centre of mass [m/s], forces of steps [N/m], energies [J/m], seconds."""
    begin = time.process_time()
    domain = mesh.create_mesh(
        MPI.COMM_SELF, cells, basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)), points
    )
    space = fem.functionspace(domain, ("Lagrange", degree, (2,)))
    u, before, v = (fem.Function(space) for _ in range(3))
    w = ufl.TestFunction(space)
    x = ufl.SpatialCoordinate(domain)
    shear = body.young / (2.0 * (1.0 + body.poisson))
    lame = 2.0 * shear * body.poisson / (1.0 - 2.0 * body.poisson)
    inside = ufl.dx(metadata={"quadrature_degree": 2 * degree})
    once = ufl.dx(metadata={"quadrature_degree": 4 * (degree - 1)})  # of constants in each cell
    outside = ufl.ds(metadata={"quadrature_degree": 4})
    # What changes from run to run is no literal of the form, which would be compiled anew.
    step, spring = (fem.Constant(domain, value) for value in (dt, stiffness))

    def energy(of: Any) -> tuple[Any, Any]:  # of UFL
        gradient = ufl.variable(ufl.Identity(2) + ufl.grad(of))
        log = ufl.ln(ufl.det(gradient))
        stored = shear / 2.0 * (ufl.inner(gradient, gradient) - 2.0) - shear * log
        return gradient, stored + lame / 2.0 * log**2

    middle = 0.5 * (u + before)
    touching = at * u + (1.0 - at) * before
    gradient, stored = energy(middle)
    depth = ufl.max_value(-(x[1] + touching[1]), 0.0)
    residual = (
        body.density * 2.0 / step**2 * ufl.inner(u - before - step * v, w) * inside
        + ufl.inner(ufl.diff(stored, gradient), ufl.grad(w)) * once
        - spring * depth * w[1] * outside
    )
    problem = NonlinearProblem(residual, u, petsc_options_prefix="disc_", petsc_options=OPTIONS)
    push = fem.form(spring * depth * outside)
    depth_now = ufl.max_value(-(x[1] + u[1]), 0.0)
    total = fem.form(
        body.density / 2.0 * ufl.inner(v, v) * inside + energy(u)[1] * once
        + spring / 2.0 * depth_now**2 * outside
    )  # fmt: skip
    mass = fem.assemble_vector(fem.form(body.density * (w[0] + w[1]) * inside)).array[1::2].copy()
    v.x.array[1::2] = body.velocity
    forces, iterates, old = [], 0, np.zeros_like(u.x.array)
    energies = [fem.assemble_scalar(total)]
    prepared = time.process_time()
    for _ in range(steps):
        old[:] = before.x.array
        u.x.array[:] += dt * v.x.array  # where Newton's method begins
        problem.solve()
        iterates += problem.solver.getIterationNumber()
        forces.append(fem.assemble_scalar(push))
        v.x.array[:] = 2.0 / dt * (u.x.array - old) - v.x.array
        before.x.array[:] = u.x.array
    seconds = time.process_time() - prepared
    energies.append(fem.assemble_scalar(total))
    return {
        "rebound": float(mass @ v.x.array[1::2] / mass.sum()), "forces": forces,
        "energies": energies, "loop": seconds, "preparation": prepared - begin,
        "iterates": iterates / steps,
    }  # fmt: skip
