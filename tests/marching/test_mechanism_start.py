"""Mechanisms at rest at t = 0: closed forms, marches that stay so, joints that nothing holds."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from moving_scenes import check_restart

pytest.importorskip("pinocchio")

from scipy.linalg import null_space
from scipy.optimize import brentq, fsolve
from test_jointed_links import hinge, hung
from test_jointed_links import link as beam
from test_jointed_links import scene as tree
from test_mechanism import DOUBLE, SWING, WALL, G, joint, link, robot, scene, slider

import impactfem
from impactfem import SceneError
from impactfem.report.page.bodies_in_words import body_in_words

PRESSED = {
    "joints": {"hinge": {"position": 0.3, "motor": "-20*(q + 1.2)"}},
    "obstacles": [WALL | {"point": [0.3, 0.0, 0.0]}], "contacts": [{"between": ["arm", "wall"]}],
}  # fmt: skip
EDGES = [("ixx", 0.01), ("iyy", 0.01), ("izz", 0.01), ("ixy", 0), ("ixz", 0), ("iyz", 0)]
CART = robot(
    '<link name="box"><inertial><mass value="1"/><inertia '
    + " ".join(f'{name}="{value}"' for name, value in EDGES)
    + '/></inertial><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>',
    link("bob", at="0 0 -0.05", mass=0.3),
    joint("hinge", "continuous", "box", "bob", "0 1 0", '<origin xyz="0 0 0.2"/>'),
)


def rest(folder, file, *, joints=None, duration=0.2, **more):
    made = scene(folder, file, duration, 2e-3, joints=joints, **more)
    return replace(made, start="static")


def columns(made):
    found = impactfem.solve(made)
    return {name: found.history[name].values for name in found.history.data_vars}, found


def stays(found, *joints):
    """100 steps at rest."""
    assert len(found["total_energy"]) == 101
    size = np.abs(found["total_energy"]).max() + 1.0
    assert np.ptp(found["total_energy"]) < 1e-12 * size
    for name in joints:
        assert np.ptp(found[f"arm.{name}.q"]) < 1e-11


def test_a_pendulum_on_a_spring_stands_where_its_moment_bears_the_weight(tmp_path):
    motor = {"hinge": {"motor": "-20*(q - 1.2) - 3*v"}}
    found, result = columns(rest(tmp_path, SWING, joints=motor))
    angle = brentq(lambda q: 20.0 * (1.2 - q) - G * np.sin(q), 0.0, 1.2, xtol=1e-15)
    np.testing.assert_allclose(found["arm.hinge.q"], angle, rtol=1e-12)
    stays(found, "hinge")
    details = result.summary["details"]["start"]
    assert details["residual"] < 1e-12
    assert not [f for f in result.summary["verdict"]["findings"] if f["code"] == "setting"]


def test_two_links_on_springs(tmp_path):
    motors = {"top": {"motor": "-60*(q - 1)"}, "knee": {"motor": "-15*(q + 0.5)"}}
    found, _ = columns(rest(tmp_path, DOUBLE, joints=motors))

    def moments(q):
        low = G * np.sin(q[0] + q[1])
        return [60.0 * (1.0 - q[0]) - 2.0 * G * np.sin(q[0]) - low, -15.0 * (q[1] + 0.5) - low]

    exact = fsolve(moments, [1.0, -0.5], xtol=1e-14)
    for name, angle in zip(("top", "knee"), exact, strict=True):
        assert found[f"arm.{name}.q"][0] == pytest.approx(angle, rel=1e-10)
    stays(found, "top", "knee")


@pytest.mark.parametrize("angle", [0.5 * np.pi, 3.1, -2.0])
def test_what_swings_comes_to_hang_and_the_run_says_so(tmp_path, angle):
    made = rest(tmp_path, SWING, joints={"hinge": {"position": angle}})
    found, result = columns(made)
    assert np.abs(found["arm.hinge.q"]).max() < 1e-11
    stays(found, "hinge")
    (told,) = [f for f in result.summary["verdict"]["findings"] if f["code"] == "setting"]
    assert 'start = "static" has moved arm' in told["text"]


def test_a_constant_motor_turns_it_to_where_the_weight_holds_it(tmp_path):
    found, _ = columns(rest(tmp_path, SWING, joints={"hinge": {"motor": "9.8 + t"}}))
    assert found["arm.hinge.q"][0] == pytest.approx(np.arcsin(9.8 / G), rel=1e-9)


def test_limits_friction_and_what_is_driven_hold_joints(tmp_path):
    pull = {"gravity": (3.0, 0.0, 0.0)}  # 6 N on 2 kg
    spring = {"x": {"motor": "-20*q"}}
    cases = [
        (0.0, {}, 1.0), (7.0, {}, 0.0), (5.0, {}, 1.0), (5.0, spring, 0.05), (0.0, spring, 0.3),
    ]  # fmt: skip
    for friction, joints, exact in cases:
        made = rest(tmp_path, slider(friction=friction), joints=joints, duration=0.2, **pull)
        found, _ = columns(made)
        assert found["arm.x.q"][0] == pytest.approx(exact, abs=1e-14)
        stays(found, "x")
    led = {"top": {"position": "0.5 + 0.1*t**2"}, "knee": {"position": 1.0}}
    found, _ = columns(rest(tmp_path, DOUBLE, joints=led, duration=0.01))
    assert found["arm.top.q"][0] == 0.5
    assert found["arm.knee.q"][0] == pytest.approx(-0.5, abs=1e-12)


def test_a_ball_that_a_motor_presses_on_a_wall(tmp_path):
    found, _ = columns(rest(tmp_path, SWING, **PRESSED))
    angle = -np.arcsin(0.2)  # the ball of 0.1 m is at x = -sin(q)
    moment = -20.0 * (angle + 1.2) - G * np.sin(angle)
    assert found["arm.hinge.q"][0] == pytest.approx(angle, rel=1e-10)
    assert found["contact_force"][0] == pytest.approx(-moment / np.cos(angle), rel=1e-10)
    # Forces act by places of the step without them: it is right to the square of a step.
    np.testing.assert_allclose(found["contact_force"], found["contact_force"][0], rtol=1e-5)
    assert np.ptp(found["arm.hinge.q"]) < 2e-7


def test_a_cart_rests_on_a_slope_with_its_bob_hanging(tmp_path):
    slope, up = 0.2, np.array([-np.sin(0.2), 0.0, np.cos(0.2)])
    floor = {"kind": "half_space", "name": "floor", "point": [0.0] * 3, "normal": up.tolist()}
    lies = {
        "base": "free", "position": (0.1 * up).tolist(), "obstacles": [floor],
        "orientation": {"axis": [0.0, 1.0, 0.0], "angle": -slope},
        "contacts": [{"between": ["arm", "floor"], "friction_coefficient": 0.4}],
    }  # fmt: skip
    found, _ = columns(rest(tmp_path, CART, joints={"hinge": {"position": 0.6}}, **lies))
    assert found["arm.hinge.q"][0] == pytest.approx(slope, abs=1e-9)
    np.testing.assert_allclose(found["contact_force"], 1.3 * G * np.cos(slope), rtol=1e-9)
    stays(found, "hinge")
    lies["contacts"] = [{"between": ["arm", "floor"]}]
    with pytest.raises(SceneError, match="nothing holds body arm against its translation in joint"):
        impactfem.solve(rest(tmp_path, CART, **lies))


def test_the_error_and_the_report_are_those_of_its_rest(tmp_path):
    made = rest(tmp_path, SWING, duration=0.02, **PRESSED)
    found = impactfem.solve(made.with_settings({"solve.estimate": True}))
    moved = found.summary["details"]["start"]["moved"]["arm"]
    ways = [np.sin(0.2013579207903308) - np.sin(-0.3), 0.0, np.cos(0.3) - np.sqrt(0.96)]
    np.testing.assert_allclose(moved, ways, atol=1e-9)
    assert found.summary["error"]["displacement_max"] < 1e-6
    assert found.summary["verdict"]["level"] == "trust"
    text = body_in_words(made, made.bodies[0])
    assert "The joint hinge begins at 0.3 and has the motor" in text
    assert "It starts in the nearest equilibrium" in text


def test_joints_that_nothing_holds_are_named(tmp_path):
    says = 'start = "static": nothing holds body arm against its turning in joint hinge, driven by '
    with pytest.raises(SceneError, match=re.escape(says + "10 N m")):
        impactfem.solve(rest(tmp_path, SWING, joints={"hinge": {"motor": "10"}}))


def test_links_that_joints_hold(tmp_path):
    made = replace(hung(tmp_path, 2e-3), duration=0.2, start="static")
    found, _ = columns(made)
    assert found["arm.top.q"][0] == pytest.approx(-0.5 * np.pi, abs=1e-10)
    assert found["box.x"][0] == pytest.approx(0.0, abs=1e-10)
    assert found["box.z"][0] == pytest.approx(-1.2, abs=1e-10)
    stays(found, "top")
    names, parts = ["base", "one", "two", "three"], []
    for before, name in pairwise(names):
        parts += [beam(name, 0.5, 1.0, 0.02), hinge(name, before, name, float(before != "base"))]
    angles = np.array([-1.2, 1.0, -0.6])
    along = np.cumsum(angles)
    pin = {
        "name": "pin", "kind": "revolute", "between": ["arm/three", "ground"],
        "point": [np.cos(along).sum(), 0.0, np.sin(along).sum()], "axis": [0.0, -1.0, 0.0],
    }  # fmt: skip
    each = dict(zip(names[1:], angles, strict=True))
    made = tree(tmp_path, parts, each, [], [pin], 2e-3, 0.2)
    found, _ = columns(replace(made, start="static"))
    stays(found, *names[1:])
    ends = np.cumsum([found[f"arm.{name}.q"][0] for name in names[1:]])
    assert np.cos(ends).sum() == pytest.approx(pin["point"][0], abs=1e-10)
    assert np.sin(ends).sum() == pytest.approx(pin["point"][2], abs=1e-10)
    loop = np.array([np.sin(ends), np.cos(ends)])  # ways of the tip by the angles
    free = null_space(loop)[:, 0]
    weights = np.array([2.5, 1.5, 0.5]) * np.cos(ends)
    assert float(free @ weights) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parallel([1, 2])
def test_a_restart_is_equal(tmp_path, monkeypatch):
    made = rest(tmp_path, SWING, duration=0.04, **PRESSED)
    made = replace(made, output=replace(made.output, checkpoint=5))
    check_restart(made, 13, tmp_path, monkeypatch)
