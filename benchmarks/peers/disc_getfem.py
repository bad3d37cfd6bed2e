"""A neo-Hookean disc that strikes a floor, by GetFEM's bricks for finite strain.

    python disc_getfem.py CASE.npz STIFFNESS DT STEPS

Plane strain, linear triangles, consistent mass; Newmark's scheme (1/4, 1/2) and penalised contact
with the floor y = 0, both by bricks. CASE.npz has points, cells and the body's constants. Prints
JSON: velocity of the centre of mass [m/s], forces of steps [N/m], seconds. It needs nothing but
GetFEM and NumPy, and may run with another interpreter than the one that starts it.
"""

import json
import sys
import time

import getfem as gf
import numpy as np

FLOOR = 1


def run(path: str, stiffness: float, dt: float, steps: int) -> dict:
    """Motion and times of a run."""
    begin = time.process_time()
    case = np.load(path)
    young, poisson, density, velocity = case["body"]
    mesh = gf.Mesh("empty", 2)
    corners = case["points"][case["cells"]]  # (cells, 3, 2)
    mesh.add_convex(gf.GeoTrans("GT_PK(2,1)"), np.transpose(corners, (2, 1, 0)))
    mesh.set_region(FLOOR, mesh.outer_faces())
    vectors, scalars = gf.MeshFem(mesh, 2), gf.MeshFem(mesh, 1)
    for field in (vectors, scalars):
        field.set_classical_fem(1)
    rule = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(4)"))
    shear = young / (2.0 * (1.0 + poisson))
    lame = 2.0 * shear * poisson / (1.0 - 2.0 * poisson)

    model = gf.Model("real")
    model.add_fem_variable("u", vectors)
    model.add_initialized_data("law", [lame, shear])
    model.add_initialized_data("rho", [density])
    model.add_initialized_data("r", [stiffness])
    height = scalars.basic_dof_nodes()[1]
    model.add_initialized_fem_data("floor", scalars, height)
    model.add_finite_strain_elasticity_brick(rule, "Compressible Neo Hookean Bonet", "u", "law")
    model.add_penalized_contact_with_rigid_obstacle_brick(rule, "u", "floor", "r", FLOOR)
    model.add_Newmark_scheme("u", 0.25, 0.5)
    model.add_mass_brick(rule, "Dot2_u", "rho")
    model.set_time_step(dt)
    ups = np.arange(1, vectors.nbdof(), 2)  # y after x at each node
    start = np.zeros(vectors.nbdof())
    start[ups] = velocity
    model.set_variable("Previous_Dot_u", start)
    model.perform_init_time_derivative(dt / 100.0)
    model.solve("max_res", 1e-8, "lsolver", "mumps")
    mass = gf.asm_mass_matrix(rule, vectors)
    weight = mass.mult(np.ones(vectors.nbdof()))[ups]
    forces, iterates = [], 0
    prepared = time.process_time()
    for _ in range(steps):
        # Newton's method begins where the last velocity leads.
        model.set_variable(
            "u", model.variable("Previous_u") + dt * model.variable("Previous_Dot_u")
        )
        done = model.solve("max_res", 1e-8, "max_iter", 50, "lsolver", "mumps")
        if not done[1]:
            raise RuntimeError(f"step {len(forces)} did not converge")
        iterates += int(done[0])
        # Nothing but the floor pushes: mass times mean acceleration.
        forces.append(float(density * weight @ model.variable("Dot2_u")[ups]))
        model.shift_variables_for_time_integration()
    seconds = time.process_time() - prepared
    speed = model.variable("Dot_u")[ups]
    return {
        "rebound": float(weight @ speed / weight.sum()), "forces": forces, "loop": seconds,
        "preparation": prepared - begin, "iterates": iterates / steps,
    }  # fmt: skip


if __name__ == "__main__":
    gf.util_trace_level(0)
    gf.util_warning_level(0)
    print(json.dumps(run(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4]))))
