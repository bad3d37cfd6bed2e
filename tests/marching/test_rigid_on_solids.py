"""Friction of rigid balls with elastic solids and bars: stiff ones are as a rigid floor."""

import numpy as np
import pytest
from moving_scenes import alone, check_restart
from pytest_mpi import parallel_assert

import impactfem
from impactfem import Scene

G = 9.81


def scene(dim=2, modulus=1e11, mu=0.2, velocity=(0.3, 0.0), spin=0.0, gravity=(0.0, -G), gap=0.0,
          held=True, duration=0.08, dt=1e-3, mesh=0.1, **solve):  # fmt: skip
    still = [0.0] * (dim - 2)
    block = {
        "kind": "solid", "name": "s", "density": 1000.0, "youngs_modulus": modulus,
        "poisson_ratio": 0.0, "mesh_size": mesh, "strain": "small",
        "model": "plane_strain" if dim == 2 else "3d",
        "shape": {"kind": "block", "size": [0.4, 0.2, 0.3][:dim],
                  "corner": [-0.2, -0.2, -0.15][:dim]},
    }  # fmt: skip
    if held:
        block["supports"] = [{"surface": "bottom", "kind": "fixed"}]
    ball = {
        "kind": "rigid", "name": "b", "mass": 1.0, "velocity": [*velocity, *still],
        "angular_velocity": spin if dim == 2 else [0.0, 0.0, spin],
        "shape": {"kind": "disc" if dim == 2 else "sphere", "radius": 0.1,
                  "center": [-0.1, 0.1 + gap, *still]},
    }  # fmt: skip
    return Scene.from_dict(
        {
            "title": "rolling", "duration": duration, "gravity": [*gravity, *still],
            "body": [block, ball], "contact": [{"between": ["s", "b"], "friction_coefficient": mu}],
            "solve": {"dt": dt, "estimate": False, **solve}, "output": {"fields": []},
        }
    )  # fmt: skip


def column(result, *names):
    return np.stack([result.history[name].values for name in names], axis=1).squeeze()


@pytest.mark.parametrize(
    ("dim", "share", "mesh"), [(2, 2 / 3, 0.1), (2, 2 / 3, 0.04), (3, 5 / 7, 0.1)]
)
def test_what_slides_on_a_stiff_block_comes_to_roll(dim, share, mesh):
    result = impactfem.solve(scene(dim, mesh=mesh))
    v, time = column(result, "b.vx"), column(result, "time")
    turned = column(result, "b.spin" if dim == 2 else "b.wz")
    rolls = (1.0 - share) * 0.3 / (0.2 * G)  # 0.05097, 0.04369: as 3 m/s at ten times as much
    sliding = time < 0.9 * rolls
    np.testing.assert_allclose(v[sliding], 0.3 - 0.2 * G * time[sliding], atol=2e-3 * 0.3)
    assert v[-1] == pytest.approx(share * 0.3, rel=1e-3)
    assert -0.1 * turned[-1] == pytest.approx(share * 0.3, rel=2e-3)
    energy = result.summary["energy"]
    assert energy["taken"]["friction"] == pytest.approx(0.5 * 0.3**2 * (1 - share), rel=1e-4)
    assert abs(energy["unexplained"]) < 1e-5


@pytest.mark.parametrize("mu", [0.3, 0.05])
def test_a_disc_on_a_steep_block_rolls_or_slides(mu):
    slope = np.radians(20.0)
    down = G * np.sin(slope), -G * np.cos(slope)
    result = impactfem.solve(scene(mu=mu, velocity=(0.0, 0.0), gravity=down))
    rolls = mu >= np.tan(slope) / 3
    pull = 2 / 3 * down[0] if rolls else down[0] + mu * down[1]
    turn = pull if rolls else -2 * mu * down[1]
    assert column(result, "b.vx")[-1] == pytest.approx(0.08 * pull, rel=5e-3)
    assert -0.1 * column(result, "b.spin")[-1] == pytest.approx(0.08 * turn, rel=5e-3)


@pytest.mark.parametrize("dim", [2, 3])
def test_what_spins_onto_a_free_block_keeps_the_momenta(dim):
    free = {"held": False, "gravity": (0.0, 0.0), "gap": 1e-3, "dt": 1e-4, "duration": 0.01}
    thrown = {"velocity": (0.3, -1.0), "spin": 20.0, "modulus": 1e9, "method": "moreau_jean"}
    result = impactfem.solve(scene(dim, mu=0.3, **free, **thrown))
    axes = "xyz"[:dim]
    momentum = column(result, *(f"momentum.{axis}" for axis in axes))
    assert np.abs(momentum - momentum[0]).max() < 1e-11
    name = "angular_momentum" if dim == 2 else "angular_momentum.z"
    spun = column(result, name)
    # Arms of small strain are those of t = 0.
    assert np.abs(spun - spun[0]).max() < 1e-3 * abs(spun[0])
    assert column(result, "b.vx")[-1] < 0.1  # of 0.3
    assert result.summary["energy"]["taken"]["friction"] > 0.1


@pytest.mark.parametrize(("mu", "rolls"), [(0.1, False), (5.0, True)])
def test_a_spinning_disc_strikes_the_end_of_a_bar(mu, rolls):
    bar = {
        "kind": "bar", "name": "bar", "length": 0.3, "density": 7800.0, "youngs_modulus": 210e9,
        "area": 1e-4, "far_end": "clamped", "point": [0.1001, 0.0], "axis": [1.0, 0.0],
    }  # fmt: skip
    disc = {
        "kind": "rigid", "name": "b", "mass": 0.2, "velocity": [2.0, 0.0],
        "angular_velocity": -30.0, "shape": {"kind": "disc", "radius": 0.1},
    }  # fmt: skip
    law = {"between": ["b", "bar"], "friction_coefficient": mu}
    result = impactfem.solve(
        Scene.from_dict(
            {"title": "bar", "duration": 4e-4, "body": [bar, disc], "contact": [law],
             "solve": {"estimate": False, "elements": 50}, "output": {"fields": []}}
        )
    )  # fmt: skip
    vx, vy, spin = (column(result, f"b.{name}")[-1] for name in ("vx", "vy", "spin"))
    assert vx < -1.0
    # The normal leans by what the disc has gone aside meanwhile, a few thousandths.
    assert 0.5 * 0.1 * (spin + 30.0) == pytest.approx(vy, rel=5e-3)
    assert vy == pytest.approx(1.0 if rolls else mu * (2.0 - vx), rel=5e-3)


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    made = scene(modulus=1e7, duration=0.03).with_settings({"output.checkpoint": 10})
    whole, _ = check_restart(made, 17, tmp_path, monkeypatch)
    assert whole.summary["energy"]["taken"]["friction"] > 0.0


@pytest.mark.parallel(2)
@pytest.mark.parametrize("dim", [2, 3])
def test_ranks_agree(dim, monkeypatch):
    made = scene(dim, modulus=1e9, duration=0.02)
    with alone(monkeypatch):
        one = impactfem.solve(made)
    several = impactfem.solve(made)
    parallel_assert(one.summary["energy"]["taken"]["friction"] > 0.0)
    bad = {}
    for name in one.history.data_vars:
        a, b = one.history[name].values, several.history[name].values
        if not (np.isnan(a) | (np.abs(a - b) <= 1e-10 * max(np.nanmax(np.abs(a)), 0.1))).all():
            bad[name] = np.nanmax(np.abs(a - b))
    parallel_assert(not bad, participating=True, msg=str(bad))
