"""The discontinuous Galerkin method gives the same answers on one rank and on several."""

import numpy as np
import pytest

import impactfem


def agree(**settings):
    from impactfem.fem import MPI
    from impactfem.spacetime.discontinuous import DiscontinuousSettings, solve_discontinuous

    bar = impactfem.Bar(
        length=2.0, density=3.0, youngs_modulus=12.0, gap=0.55, velocity="-0.5 + 0.1*x"
    )
    gravity = impactfem.bodies.PiecewiseConstant((0.0, 1.3), (0.1, -0.05))
    answers = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        chosen = dict(settings)
        if chosen.pop("layered", False):
            from impactfem.mesh.spacetime import layered_mesh

            chosen["mesh"] = layered_mesh(comm, 10, 50, 1.0)
        answers.append(
            solve_discontinuous(comm, bar, gravity, 5.0, DiscontinuousSettings(**chosen))
        )
    (together, figures), (alone, own) = answers
    assert together.multiplier.min() < -0.1
    for name in ("times", "gap", "multiplier", "displacement", "velocity", "kinetic", "elastic"):
        difference = np.abs(getattr(together, name) - getattr(alone, name)).max()
        assert difference <= 1e-10, (name, difference)
    assert figures["triangles"] == own["triangles"]
    every = MPI.COMM_WORLD.allgather(together.displacement.tobytes())
    assert len(set(every)) == 1


@pytest.mark.parallel([2, 4])
def test_unstructured_triangles_agree_on_several_ranks():
    agree(degree=1, elements=12)


@pytest.mark.parallel([2])
def test_fitted_meshes_agree_on_two_ranks():
    agree(degree=1, elements=10, fitted=True)


@pytest.mark.parallel([2])
def test_refined_meshes_agree_on_two_ranks():
    agree(degree=2, elements=6, accuracy=3e-2)


@pytest.mark.parallel([2])
def test_a_distributed_mesh_is_gathered():
    agree(degree=2, layered=True)
