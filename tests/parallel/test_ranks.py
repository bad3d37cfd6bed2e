"""The same answers on one rank and on several."""

import numpy as np
import pytest

import impactfem


def histories(method, **bar):
    """History on all ranks together, and on this rank alone."""
    from impactfem.fem import MPI
    from impactfem.mesh.spacetime import layered_mesh
    from impactfem.result.bar_row_motion import RowMotion, row_fields, row_history
    from impactfem.spacetime.galerkin import GalerkinSettings, solve_galerkin

    body = impactfem.Bar(length=2.0, density=3.0, youngs_modulus=12.0, **bar)
    gravity = impactfem.bodies.PiecewiseConstant((0.0, 1.3), (0.1, -0.05))
    answers = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        space = layered_mesh(comm, 20, 100, 1.0)
        solution = solve_galerkin(space, body, gravity, GalerkinSettings(active_set=method))
        motion = RowMotion.of_one(solution, body, "wall")
        answers.append((row_history(motion, [body]), row_fields(motion, (body.name,))))
    return answers


def agree(method, **bar):
    (together, fields), (alone, own) = histories(method, **bar)
    assert together["contact_force"].values.max() > 0.1
    for name in alone.data_vars:
        expected = alone[name].values
        scale = max(1.0, np.abs(expected).max())
        assert np.abs(together[name].values - expected).max() <= 1e-10 * scale, name
    assert np.abs(fields.displacement - own.displacement).max() <= 1e-10


@pytest.mark.parallel([2, 4])
def test_active_set_agrees_on_several_ranks():
    agree("pdas", gap=0.55, velocity=-0.5)


@pytest.mark.parallel([2, 4])
def test_clamped_bar_agrees_on_several_ranks():
    agree("pdas", gap=0.0, far_end="clamped", displacement="0.3*(2 - x)*(1 + 0.2*sin(3*x))")


@pytest.mark.parallel([2, 4])
def test_driven_bar_agrees_on_several_ranks():
    agree("pdas", gap=0.55, velocity=-0.5, far_end_force="where(t < 1.3, 0.3*sin(4*t), -0.2)")


@pytest.mark.parallel([2])
def test_gradients_agree_on_two_ranks():
    from impactfem.fem import MPI

    scene = impactfem.Scene.from_dict({
        "title": "slopes", "duration": 2.5,
        "body": [{"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
                  "gap": 0.25, "velocity": -0.5}],
        "obstacle": [{"kind": "wall"}],
        "control": [{"name": "push", "acts": "body.bar.far_end_force", "pieces": 2, "from": 0.5}],
        "objective": {"minimise": [{"term": "terminal_energy"}]},
        "solve": {"method": "monolithic", "elements": 20},
    })  # fmt: skip
    found = list(impactfem.gradient(scene).gradient.values())
    assert found == pytest.approx([-0.5, 0.5], abs=1e-8)
    assert MPI.COMM_WORLD.allgather(found) == [found, found]


@pytest.mark.parallel([2])
def test_variational_inequality_agrees_on_two_ranks():
    agree("snes_vi", gap=0.55, velocity=-0.5)


@pytest.mark.parallel([2])
def test_solve_gives_every_rank_the_same_result():
    from impactfem.fem import MPI

    scene = impactfem.Scene(
        title="ranks",
        duration=5.0,
        bodies=[impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.5, velocity=-0.5)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(elements=20),
    )
    result = impactfem.solve(scene)
    assert result.summary["ranks"] == MPI.COMM_WORLD.size
    assert result.summary["error"]["displacement_max"] <= 1e-11
    gaps = MPI.COMM_WORLD.allgather(result.history["gap"].values)
    assert np.array_equal(gaps[0], gaps[1])


@pytest.mark.parallel([2])
def test_a_broken_mesh_is_an_error_on_every_rank(tmp_path):
    from impactfem.fem import MPI

    folder = MPI.COMM_WORLD.bcast(str(tmp_path), root=0)
    scene = impactfem.Scene(
        title="broken",
        duration=5.0,
        bodies=[impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.5, velocity=-0.5)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="monolithic", mesh="absent.msh"),
        folder=folder,
    )
    with pytest.raises(impactfem.errors.MeshError, match=r"absent\.msh"):
        impactfem.solve(scene)
