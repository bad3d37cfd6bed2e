"""The standing disc by a plain SciPy loop, which our schemes are held against.

Newmark 1/4 with matrices of DOLFINx: consistent mass with that of the contact nodes given to their
neighbours inside, SciPy's sparse LU with an ordering for symmetric matrices kept for all steps, the
answers to unit forces on the contact nodes solved once, and in each step an active set on the dense
compliance that starts from the last one. Nothing of impactfem is used but the mesh.

    python benchmarks/scipy_disc.py [ELEMENTS [COURANT]]
"""

import sys

import numpy as np
import ufl
from disc_scene import (
    DURATION,
    GAP,
    POISSON,
    SPEED,
    YOUNG,
    Run,
    Samples,
    clock,
    load_references,
    scene,
)  # fmt: skip
from numpy.typing import NDArray
from scipy.linalg import solve as dense_solve
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu

from impactfem.fem import MPI, dolfinx
from impactfem.mesh.body import build_body_mesh
from impactfem.runs.tracks import Track

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def newmark(elements: int, courant: float = 0.5) -> Run:
    """March the disc with steps of ``courant`` elements."""
    begin = clock.now()
    body = build_body_mesh(MPI.COMM_SELF, scene(elements).solid, 1, None)
    meshed = clock.now()
    mass, stiffness, x = assembled(body.mesh)
    contact = lower_rim(x)
    moved = massless(mass, stiffness, contact)
    done = clock.now()

    steps = int(np.ceil(DURATION * elements / courant - 1e-9))
    dt = DURATION / steps
    weight = 4.0 / dt**2
    options = {"SymmetricMode": True}
    system = (stiffness + weight * moved).tocsc()
    factors = splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    below = 2 * contact + 1  # vertical dofs
    unit = np.zeros((len(x) * 2, len(contact)))
    unit[below, np.arange(len(contact))] = 1.0
    answers = factors.solve(unit)
    compliance = np.ascontiguousarray(answers[below])
    answers = np.ascontiguousarray(answers.T)
    height = x[contact, 1]
    total = mass @ np.tile([0.0, 1.0], len(x))  # weights of the vertical centre of mass
    ready = clock.now()

    u, v, a = np.zeros(2 * len(x)), np.tile([0.0, -SPEED], len(x)), np.zeros(2 * len(x))
    active = np.zeros(len(contact), dtype=bool)
    force, centre = np.zeros(steps + 1), np.zeros((steps + 1, 3))
    energy = np.zeros(steps + 1)
    body_mass = total.sum()
    for m in range(1, steps + 1):
        predicted = weight * u + (4.0 / dt) * v + a
        new = factors.solve(moved @ predicted)
        gap = height + new[below]
        if active.any() or gap.min() < 0.0:
            pressed, active = complementary(compliance, gap, active)
            new += pressed @ answers[active]
            force[m] = pressed.sum()
        ahead = weight * new - predicted
        v += (0.5 * dt) * (a + ahead)
        u, a = new, ahead
        centre[m, 1] = total @ u / body_mass
    loop = clock.now() - ready
    # Newmark's force at a level acts on the layers beside it with half its value each.
    force[1:-1] = 0.5 * (force[1:-1] + force[2:])
    energy[:] = np.nan
    energy[0] = 0.5 * SPEED**2 * body_mass
    energy[-1] = 0.5 * (v @ (moved @ v) + u @ (stiffness @ u))
    times = dt * np.arange(steps + 1)
    return Run(
        Track.of_centres(times, centre, force), energy[[0, -1]], 2 * len(x), steps,
        meshed - begin, done - meshed, ready - done, loop,
    )  # fmt: skip


def assembled(mesh: object) -> tuple[csr_matrix, csr_matrix, Floats]:
    """Consistent mass, stiffness, and places of the nodes."""
    space = dolfinx.fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    second = YOUNG / (2.0 * (1.0 + POISSON))
    first = 2.0 * second * POISSON / (1.0 - 2.0 * POISSON)
    strain = ufl.sym(ufl.grad(u))
    stress = first * ufl.tr(strain) * ufl.Identity(2) + 2.0 * second * strain
    forms = ufl.inner(u, v) * ufl.dx, ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx
    mass, stiffness = (
        dolfinx.fem.assemble_matrix(dolfinx.fem.form(form)).to_scipy().tocsr() for form in forms
    )
    return mass, stiffness, space.tabulate_dof_coordinates()[:, :2]


def lower_rim(x: Floats) -> Integers:
    """Nodes on the rim that can come down to the plane: those in the lower half."""
    radius = np.hypot(x[:, 0], x[:, 1] - (0.5 + GAP))
    found: Integers = np.flatnonzero((radius > 0.5 - 1e-9) & (x[:, 1] < 0.5 + GAP))
    return found


def massless(mass: csr_matrix, stiffness: csr_matrix, contact: Integers) -> csr_matrix:
    """P^T M P, where P gives contact nodes the mean velocity of their neighbours inside."""
    nodes = mass.shape[0] // 2
    inner = np.ones(nodes, dtype=bool)
    inner[contact] = False
    beside = coo_matrix(stiffness)
    pairs = np.unique(np.stack([beside.row // 2, beside.col // 2]), axis=1)
    pairs = pairs[:, ~inner[pairs[0]] & inner[pairs[1]]]
    share = 1.0 / np.bincount(pairs[0], minlength=nodes)[pairs[0]]
    kept = np.flatnonzero(inner)
    rows, columns = np.append(kept, pairs[0]), np.append(kept, pairs[1])
    values = np.append(np.ones(len(kept)), share)
    both = np.append(2 * rows, 2 * rows + 1), np.append(2 * columns, 2 * columns + 1)
    transfer = coo_matrix((np.tile(values, 2), both), shape=mass.shape).tocsr()
    return (transfer.T @ mass @ transfer).tocsr()


def complementary(
    compliance: Floats, gap: Floats, active: NDArray[np.bool_]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Forces on the active nodes, and which these are, from the free gaps and the last set."""
    for _ in range(50):
        block = compliance[np.ix_(active, active)]
        pressed = dense_solve(block, -gap[active], assume_a="pos", check_finite=False)
        closed = gap + pressed @ compliance[active]
        wanted = closed < -1e-14
        wanted[active] = pressed > 0.0
        if (wanted == active).all():
            return pressed, active
        active = wanted
    raise RuntimeError("the active set does not settle")


def main() -> None:
    """Print errors and times of one run."""
    elements = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    courant = float(sys.argv[2]) if len(sys.argv) > 2 else 0.5
    newmark(8)  # compiles the forms
    found = newmark(elements, courant)
    motion, _, force = Samples.of(found.track).error(next(iter(load_references().values())))
    print(f"{found.layers} steps: motion {motion:.2e}, force {force:.2e}, loop {found.loop:.3f} s, "
          f"total {found.total:.3f} s, energy {found.growth:.1e}")  # fmt: skip


if __name__ == "__main__":
    main()
