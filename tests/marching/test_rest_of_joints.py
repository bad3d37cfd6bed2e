"""A start at rest of what joints hold: against statics by hand, and it stays there."""

import numpy as np
import pytest
from moving_scenes import alone, differences, stopping
from scipy.optimize import brentq

import impactfem

G = 9.81
DOOR = {"kind": "rigid", "name": "door", "mass": 20.0,
        "shape": {"kind": "block", "size": [0.8, 0.04], "corner": [0.0, -0.02]}}  # fmt: skip
LEAF = {"kind": "rigid", "name": "leaf", "mass": 5.0,
        "shape": {"kind": "block", "size": [0.4, 0.04], "corner": [0.8, -0.02]}}  # fmt: skip
HINGE = {"kind": "revolute", "between": ["ground", "door"], "point": [0.0, 0.0]}
BETWEEN = {"kind": "revolute", "between": ["door", "leaf"], "point": [0.8, 0.0]}
STRIP = {"kind": "beam", "name": "strip", "length": 1.0, "height": 0.02, "width": 0.05,
         "center": [0.5, 0.0], "density": 2700.0, "youngs_modulus": 7e9}  # fmt: skip
BLOCK = {"kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.05,
         "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
         "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.6, -0.12]}}  # fmt: skip
UNDER = BLOCK | {"supports": [{"surface": "bottom", "kind": "fixed"}]}


def scene(bodies, joints, duration=0.02, gravity=(0.0, -G), **more):
    table = {"title": "rest", "duration": duration, "gravity": list(gravity), "start": "static",
             "body": bodies, "joint": [{"name": f"j{k}"} | j for k, j in enumerate(joints)],
             "solve": {"estimate": False, "dt": 2e-3}, "output": {"fields": []}}  # fmt: skip
    return impactfem.Scene.from_dict(table | more)


def run(*given, **more):
    """The history, in which nothing moves."""
    result = impactfem.solve(scene(*given, **more))
    assert result.summary["status"] == "completed"
    energy = result.history["total_energy"].values
    assert np.ptp(energy) < 1e-8 * abs(energy[0]) + 1e-12
    return result.history


def first(history, name):
    return float(history[name].values[0])


def test_a_door_on_a_spring():
    history = run([DOOR], [HINGE | {"stiffness": 400.0}])
    angle = brentq(lambda q: 400.0 * q + 20.0 * G * 0.4 * np.cos(q), -1.0, 0.0)
    assert first(history, "j0.q") == pytest.approx(angle, rel=1e-10)
    assert first(history, "j0.force") == pytest.approx(20.0 * G, rel=1e-10)
    assert np.ptp(history["j0.q"].values) < 1e-11


def test_a_door_on_its_stop_and_one_that_friction_holds():
    stopped = run([DOOR], [HINGE | {"limits": [-0.5, 0.5]}])
    assert first(stopped, "j0.q") == pytest.approx(-0.5, rel=1e-12)
    assert first(stopped, "j0.moment") == pytest.approx(20.0 * G * 0.4 * np.cos(0.5), rel=1e-9)
    rubbed = run([DOOR], [HINGE | {"friction": 80.0}])
    assert abs(rubbed["j0.q"].values).max() < 1e-14
    slid = run([DOOR], [HINGE | {"friction": 60.0}])  # as far as 60 N m hold it
    assert first(slid, "j0.q") == pytest.approx(-np.arccos(60.0 / (20.0 * G * 0.4)), rel=1e-9)


def test_pendulums_hang():
    history = run([DOOR, LEAF], [HINGE, BETWEEN])
    assert first(history, "j0.q") == pytest.approx(-0.5 * np.pi, abs=1e-5)
    assert abs(first(history, "j1.q")) < 1e-5
    assert first(history, "j0.force") == pytest.approx(25.0 * G, rel=1e-8)
    assert first(history, "j1.force") == pytest.approx(5.0 * G, rel=1e-8)


def test_motors_and_springs_of_a_linkage():
    drive = BETWEEN | {"motor": "5 - 20*q"}
    history = run([DOOR, LEAF], [HINGE | {"stiffness": 300.0}, drive])
    q, p = first(history, "j0.q"), first(history, "j1.q")
    lever = 5.0 * G * 0.2 * np.cos(q + p)
    assert 5.0 - 20.0 * p == pytest.approx(lever, rel=1e-9)
    whole = 20.0 * G * 0.4 * np.cos(q) + 5.0 * G * 0.8 * np.cos(q) + lever
    assert -300.0 * q == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize(("strain", "friction"), [("small", 0.0), ("finite", 0.3)])
def test_a_door_lies_on_a_soft_block(strain, friction):
    """The moments of weight and contact about the hinge balance; the block presses by its width."""
    law = {"between": ["door", "block"], "friction_coefficient": friction}
    history = run([UNDER | {"strain": strain}, DOOR], [HINGE], contact=[law])
    force = first(history, "contact_force")
    assert force == pytest.approx(20.0 * G * 0.4 / 0.65, rel=0.02)
    assert first(history, "j0.force") == pytest.approx(20.0 * G - force, rel=1e-2)
    assert -5e-4 < first(history, "j0.q") < -1e-4


def test_a_beam_between_joints_and_on_a_floor():
    weight = 2700.0 * 0.02 * 0.05 * G
    hinge = HINGE | {"between": ["ground", "strip"]}
    rope = {"kind": "distance", "between": ["ground", "strip"], "points": [[1.0, 2.0], [1.0, 0.0]]}
    hung = run([STRIP], [hinge, rope])
    clamped = run([STRIP], [hinge | {"kind": "fixed"}])
    floor = {"kind": "half_space", "name": "floor", "normal": [0.0, 1.0], "point": [0.0, -0.05]}
    lying = run([STRIP], [hinge], obstacle=[floor])
    for name, history in (("j0.force", hung), ("j1.force", hung), ("contact_force", lying)):
        assert first(history, name) == pytest.approx(0.5 * weight, rel=1e-8)
    bending = 7e9 * 0.05 * 0.02**3 / 12.0
    assert first(clamped, "j0.moment") == pytest.approx(0.5 * weight, rel=1e-8)
    assert first(clamped, "strip.y") == pytest.approx(-weight / (20.0 * bending), rel=1e-5)


def test_solids_rest_by_their_surfaces():
    lid = {"kind": "rigid", "name": "lid", "mass": 5.0,
           "shape": {"kind": "block", "size": [0.1, 0.02], "corner": [0.6, -0.02]}}  # fmt: skip
    weld = {"kind": "fixed", "between": ["block/top", "lid"], "point": [0.65, -0.02]}
    history = run([UNDER, lid], [weld])
    assert first(history, "j0.force") == pytest.approx(5.0 * G, rel=1e-8)
    hinge = HINGE | {"between": ["ground", "block/left"], "point": [0.6, -0.07]}
    history = run([BLOCK], [hinge | {"stiffness": 1e3}])
    assert first(history, "j0.force") == pytest.approx(10.0 * G, rel=1e-8)
    assert first(history, "j0.q") == pytest.approx(-10.0 * G * 0.05 / 1e3, rel=1e-8)


def test_a_ball_in_space_hangs_where_it_swings_to():
    bob = {"kind": "rigid", "name": "bob", "mass": 2.0,
           "shape": {"kind": "sphere", "radius": 0.1, "center": [0.3, 0.4, 0.0]}}  # fmt: skip
    joint = {"kind": "ball", "between": ["ground", "bob"], "point": [0.0, 0.0, 0.0]}
    history = run([bob], [joint], gravity=(0.0, 0.0, -G))
    assert first(history, "bob.z") == pytest.approx(-0.5, rel=1e-9)
    assert first(history, "j0.force") == pytest.approx(2.0 * G, rel=1e-9)


def test_what_nothing_holds_is_refused():
    with pytest.raises(impactfem.SceneError, match="nothing holds body door and leaf"):
        impactfem.solve(scene([DOOR, LEAF], [BETWEEN]))


def released(friction=0.2, **more):
    """A door that springs and a block hold is shaken."""
    law = {"between": ["door", "block"], "friction_coefficient": friction}
    gravity = [[0.0, [0.0, -G]], [0.01, [0.0, -0.5 * G]]]
    joints = [HINGE | {"stiffness": 100.0, "friction": 1.0}]
    return scene([UNDER, DOOR], joints, 0.06, gravity, contact=[law],
                 output={"fields": [], "every": 2, "checkpoint": 5} | more)  # fmt: skip


def test_restarts_go_on_to_the_bit(tmp_path, monkeypatch):
    whole = impactfem.solve(released())
    assert np.ptp(whole.history["j0.q"].values) > 1e-6
    with stopping(monkeypatch, 18):
        impactfem.solve(released(), checkpoints=tmp_path)
    again = impactfem.solve(released(), checkpoints=tmp_path, restart=tmp_path)
    assert differences(whole, again) == {}


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    made = released(friction=0.0)  # whose forces are found to a share that is larger
    both = impactfem.solve(made)
    with alone(monkeypatch):
        one = impactfem.solve(made)
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )


def test_a_surface_that_joints_take_whole_is_named():
    """As the likely cause where nothing holds a body that seems to stand on a floor."""
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, -0.12], "normal": [0.0, 1.0]}
    mass = {"name": "m", "body": "block", "surface": "bottom", "mass": 0.1}
    with pytest.raises(impactfem.SceneError, match="hold all of block/bottom, whose nodes then"):
        run([BLOCK], [], obstacle=[floor], point_mass=[mass])
