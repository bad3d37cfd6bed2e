"""Bodies on several ranks are those on one."""

import numpy as np
import pytest
from pytest_mpi import parallel_assert
from solids import system_on
from structured import block

from impactfem.errors import ImpactError
from impactfem.fem import MPI, gather
from impactfem.scene.solids import Solid
from impactfem.system.finite_strain import FiniteStrain
from impactfem.system.spectrum import largest_eigenvalue

SCENE = {
    "gravity": (1.0, -2.0),
    "velocity": ["x*y", "1"],
    "angular_velocity": 0.4,
    "displacement": ["0.1*x", "sin(y)"],
    "rayleigh_stiffness": 0.1,
    "supports": [
        {"surface": "s0-", "kind": "symmetry"},
        {"surface": "s1+", "kind": "motion", "value": ["", "t**2"]},
    ],
    "tractions": [{"surface": "s0+", "value": ["x*t", "1"]}],
    "pressures": [{"surface": "s1-", "value": "sin(x + t)"}],
}


def bent(s):
    return s + 0.1 * np.sin(3 * s[:, ::-1])


def straight_top(s):
    """Bent below, with faces along the axes where supports need them."""
    x = np.add(s, [1.0, 0.0])
    x[:, 1] += 0.1 * np.sin(3 * s[:, 0]) * (1 - s[:, 1])
    return x


def answers(comm, cell, degree, **given):
    """Fields by canonical number, and sums, of a body on some ranks."""
    body = system_on(block(cell, degree, (5, 4), straight_top, comm), **(SCENE | given))
    total = body.nodes.space.dofmap.index_map.size_global

    def by_number(field, width):
        found = np.full((total, width), np.nan)
        found[gather(comm, body.numbers)] = gather(comm, field.reshape(-1, width))
        return found

    start = np.sin(1.0 + 7.0 * body.numbers[:, None] + np.arange(2)).ravel()
    fields = {
        "displacement": by_number(body.displacement, 2),
        "velocity": by_number(body.velocity, 2),
        "load": by_number(body.load(0.7), 2),
        "constrained": by_number(body.constrained.astype(float), 2),
        "node mass": by_number(body.node_mass, 1),
        "stress": by_number(body.fields.at(start)["von_mises"], 1),
    }
    for name, matrix in (("K", body.stiffness), ("M", body.mass)):
        x, y = matrix.createVecs()
        x.array_w[:] = start
        matrix.mult(x, y)
        fields[name] = by_number(y.array_r, 2)
    sums = [body.total_mass, *body.center_of_mass, *body.momentum(body.velocity),
            body.elastic_energy(start), body.kinetic_energy(start)]  # fmt: skip
    if body.lumped is not None:
        inverse = np.divide(1.0, body.lumped, where=body.lumped > 0, out=np.zeros(len(start)))
        sums.append(largest_eigenvalue(body.stiffness, inverse, body.numbers))
    fields["sums"] = np.array(sums)
    body.destroy()
    return fields


def agree(cell, degree, **given):
    together = answers(MPI.COMM_WORLD, cell, degree, **given)
    alone = answers(MPI.COMM_SELF, cell, degree, **given)
    for name, expected in alone.items():
        error = np.abs(together[name] - expected).max() / np.abs(expected).max()
        # Rounding of the eigenvalue grows with the Lanczos vectors' loss of orthogonality.
        parallel_assert(error <= (1e-9 if name == "sums" else 1e-12), msg=f"{name}: {error}")


@pytest.mark.parallel([2, 4])
@pytest.mark.parametrize(
    ("cell", "degree"),
    [("triangle", 1), ("triangle", 2), ("quadrilateral", 1), ("quadrilateral", 2)],
)
def test_bodies_agree_on_several_ranks(cell, degree):
    agree(cell, degree)


@pytest.mark.parallel([2, 4])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_mean_dilatation_agrees_on_several_ranks(cell):
    agree(cell, 2, poisson_ratio=0.4999, model="axisymmetric", angular_velocity=0.0)


@pytest.mark.parallel([2])
@pytest.mark.parametrize(
    "given",
    [
        {"pressures": [{"surface": "s0+", "value": "log(0.2 - y)"}]},
        {"velocity": ["1/(y - 1)", 0]},
        {"supports": [{"surface": "s0-", "kind": "fixed"},
                      {"surface": "s1-", "kind": "motion", "value": ["t", ""]}]},
        {"supports": [{"surface": "s1-", "kind": "symmetry"}]},
        {"tractions": [{"surface": "rim", "value": [1, 0]}]},
    ],
)  # fmt: skip
def test_all_ranks_raise_the_same_error(given):
    mesh = block("triangle", 1, (4, 4), bent)
    message = ""
    try:
        system_on(mesh, **given)
    except ImpactError as error:
        message = str(error)
    messages = MPI.COMM_WORLD.allgather(message)
    parallel_assert(messages[0] != "" and len(set(messages)) == 1, msg=str(messages))


@pytest.mark.parallel([1, 3])
def test_a_tangent_that_is_assembled_again_is_one_that_is_made_anew():
    body = system_on(block("triangle", 1, (5, 4), bent, MPI.COMM_WORLD))
    rubber = Solid(
        model="plane_strain", mesh="structured.msh", density=2.0, youngs_modulus=10.0,
        poisson_ratio=0.3, material="neo_hookean",
    )  # fmt: skip
    held = np.repeat(body.numbers % 4 == 0, 2)
    mass = body.mass.matMult(body.mass)  # couples nodes that share no cell
    strain = FiniteStrain(body.nodes, rubber, body.following)
    steps = strain.step_solver(mass, held, 1.0, (0.3, 0.0), "mumps", None)
    for size, step in ((0.03, 1.0), (0.01, 0.05)):
        after = size * np.sin(1.0 + 7.0 * body.numbers[:, None] + np.arange(2)).ravel()
        strain.put(0.5 * after, after)
        solver = steps.renew(step)
        anew = strain.tangent(0.5 * after, after)
        anew.axpy(2.0 / step**2 + 0.3 / step, mass)
        first = anew.getOwnershipRange()[0]
        anew.zeroRowsColumns((np.flatnonzero(held) + first).astype(np.int32), diag=1.0)
        rights = np.stack([after, np.cos(after)])
        for right, found in zip(rights, solver.solve_all(rights), strict=True):
            source, image = anew.createVecs()
            source.setArray(found)
            anew.mult(source, image)
            parallel_assert(np.abs(image.getArray() - right).max() <= 1e-11)
    steps.destroy()
