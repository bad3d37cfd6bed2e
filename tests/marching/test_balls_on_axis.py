"""Rigid balls on the axis of axisymmetric solids: laws, refusals, restart and ranks."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

G = 9.81


def scene(mu=0.0, obstacle=False, duration=4e-3, dt=5e-5, gravity=None, contacts=True, **ball):
    block = {
        "kind": "solid", "name": "block", "model": "axisymmetric", "strain": "small",
        "density": 1e3, "youngs_modulus": 1e8, "poisson_ratio": 0.3, "mesh_size": 0.05,
        "degree": 2,
        "refine": [{"point": [0.0, 0.0], "radius": 0.04, "size": 0.005}],
        "shape": {"kind": "block", "size": [0.2, 0.2], "corner": [0.0, -0.2]},
        "supports": [{"surface": "bottom", "kind": "fixed"}],
    }  # fmt: skip
    point = {"kind": "point", "name": "ball", "mass": 2.0, "radius": 0.1,
             "position": [0.0, 0.1001], "velocity": [0.0, -1.0]} | ball  # fmt: skip
    led = {"kind": "sphere", "name": "ball", "radius": 0.1, "center": [0.0, 0.1001],
           "motion": ["0", "-t"]}  # fmt: skip
    law = {"between": ["ball", "block/top"], "friction_coefficient": mu}
    return Scene.from_dict(
        {"title": "axis", "duration": duration, "gravity": gravity,
         "body": [block] if obstacle else [block, point], "obstacle": [led] * obstacle,
         "contact": [law] * contacts, "output": {"fields": []},
         "solve": {"dt": dt, "estimate": False, "normals": "updated"}}
    )  # fmt: skip


@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_a_very_heavy_ball_is_as_a_sphere_that_is_led(mu):
    ball = impactfem.solve(scene(mu, mass=1e9))
    led = impactfem.solve(scene(mu, obstacle=True))
    one, two = (each.history["contact_force"].values for each in (ball, led))
    assert two.max() > 1e4
    np.testing.assert_allclose(one, two, atol=3e-3 * two.max())
    works = [each.summary["energy"]["taken"].get("friction", 0.0) for each in (ball, led)]
    assert works[0] == pytest.approx(works[1], rel=0.05)
    assert (works[0] > 0.0) == (mu > 0.0)


def test_a_ball_stays_on_the_axis_and_no_energy_is_made():
    history = impactfem.solve(scene(duration=0.02)).history
    assert (history["ball.vx"].values == 0.0).all()
    assert history["ball.vy"].values[-1] > 0.9
    energy = history["total_energy"].values
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-3


def test_a_ball_weighs_on_the_block():
    """It swings about where it rests, so that the impulse is that of its weight."""
    rest = {"velocity": [0.0, 0.0], "position": [0.0, 0.1], "force": ["0.0", "-100*vy"]}
    history = impactfem.solve(scene(duration=0.6, dt=1e-3, gravity=[0.0, -G], **rest)).history
    late = history["contact_force"].values[200:]
    assert late.mean() == pytest.approx(2.0 * G, rel=5e-3)


def test_a_ball_in_the_mouth_of_a_ring_leans_on_its_edge():
    made = scene(duration=0.4, dt=1e-3, gravity=[0.0, -G], force=["0.0", "-200*vy"]).to_dict()
    shape = {"kind": "block", "size": [0.06, 0.06], "corner": [0.06, -0.06]}
    made["body"][0] |= {"shape": shape, "mesh_size": 0.02, "refine": []}
    made["body"][1] |= {"position": [0.0, 0.08], "velocity": [0.0, 0.0]}
    history = impactfem.solve(Scene.from_dict(made)).history
    late = history["contact_force"].values[200:]
    assert late.mean() == pytest.approx(2.0 * G / 0.8, rel=5e-3)


def test_balls_on_the_axis_pass_momentum_on():
    """Of two equal balls the lower one strikes a block far below them, after the blow."""
    made = scene(duration=0.02, contacts=False, position=[0.0, 0.2]).to_dict()
    made["body"].append(made["body"][1] | {"name": "upper", "position": [0.0, 0.405]})
    made["body"][1]["velocity"] = [0.0, 0.0]
    made["contact"] = [{"between": ["ball", "upper"], "restitution": 1.0}]
    history = impactfem.solve(Scene.from_dict(made)).history
    assert history["ball.vy"].values[-1] == pytest.approx(-1.0, rel=1e-9)
    assert history["upper.vy"].values[-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("ball", "says"),
    [
        ({"position": [0.01, 0.2]}, r"body\[1\].position = \[0.01, 0.2\].*on the axis"),
        ({"velocity": [0.1, 0.0]}, r"body\[1\].velocity = \[0.1, 0.0\].*on the axis"),
        ({"force": ["t", "0"]}, r"body\[1\].force.*on the axis"),
        (
            {"springs": [{"anchor": [0.1, 1.0], "stiffness": 1.0}]},
            r"body\[1\].springs\[0\].anchor.*on the axis",
        ),
    ],
)
def test_what_leaves_the_axis_is_refused(ball, says):
    with pytest.raises(SceneError, match=says):
        scene(**ball)


def test_other_bodies_and_joints_are_refused():
    made = scene().to_dict()
    made["body"][1] = {"kind": "rigid", "name": "ball", "mass": 1.0,
                       "shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 0.2]}}  # fmt: skip
    with pytest.raises(SceneError, match=r"kind = .rigid.*give a point with a radius"):
        Scene.from_dict(made)
    made = scene().to_dict()
    made["joint"] = [{"kind": "prismatic", "name": "guide", "between": ["ball", "ground"],
                      "axis": [0.0, 1.0], "point": [0.0, 0.1001]}]  # fmt: skip
    with pytest.raises(SceneError, match=r"joint.*axisymmetric"):
        Scene.from_dict(made)


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    made = scene(mu=0.1).with_settings({"output.checkpoint": 20})
    check_restart(made, 47, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(lambda: scene(mu=0.1), monkeypatch)
