"""Mechanisms of robot files in trajectories."""

from unittest.mock import patch

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from impactfem import Scene, SceneError
from impactfem.system.mechanism_file import read_mechanism
from impactfem.trajectory.bodies import symbolic
from impactfem.trajectory.building import sizes_of
from impactfem.trajectory.nlp import Program
from impactfem.trajectory.rotations import quaternion_rates
from impactfem.trajectory.scenes import _Asked, trajectory
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.transcribing import begin
from impactfem.trajectory.tree import turning_of

pin = pytest.importorskip("pinocchio")

CART = """<mujoco><compiler angle="radian"/><worldbody>
 <body name="cart" pos="0 0 1"><joint name="slide" type="slide" axis="1 0 0" range="-2 2"
   limited="true" armature="0.5"/><inertial mass="1" pos="0 0 0" diaginertia=".1 .1 .1"/>
  <body name="pole"><joint name="hinge" type="hinge" axis="0 1 0" damping="0.01"/>
   <inertial mass=".3" pos=".1 0 -.5" diaginertia=".001 .002 .003"/></body></body>
</worldbody></mujoco>"""

CRAFT = """<mujoco><compiler angle="radian"/><worldbody>
 <body name="hull" pos="0 0 1"><freejoint name="base"/>
  <inertial mass="3" pos="0 0 0" diaginertia=".3 .4 .5"/>
  <body name="disc" pos="0 0 .2"><joint name="wheel" type="hinge" axis="0 0 1"/>
   <inertial mass="1" pos="0 0 0" diaginertia=".05 .05 .1"/></body></body>
</worldbody></mujoco>"""


def cart(folder, joints=None, **asked):
    (folder / "cart.xml").write_text(CART)
    body = {
        "kind": "mechanism", "name": "m", "file": "cart.xml", "position": [0.1, 0.2, 0.3],
        "orientation": {"axis": [0.3, 1.0, 0.2], "angle": 0.4},
        "joints": joints or {"slide": {"motor": "-3*q"}, "hinge": {"position": 0.4}},
    }  # fmt: skip
    return Scene.from_dict({
        "title": "cart", "duration": 1.0, "gravity": [0.0, 0.0, -9.81], "body": [body],
        "control": [{"name": "u", "acts": "body.m.joints.slide.motor"}],
        "trajectory": {"end": {"m.slide.q": 1.0}, "nodes": 10} | asked,
    }, base=folder)  # fmt: skip


def test_accelerations_are_those_of_pinocchio(tmp_path):
    """M(q) v' = tau - h(q, v), with motors, dampers and a rotor, at states of no symmetry."""
    scene = cart(tmp_path)
    known = symbolic(scene)
    tree = known.tree
    rate = loaded().Function("rate", [tree.t, tree.q, tree.v, known.controls], [known.rate])
    robot = read_mechanism(scene.bodies[0], scene.folder).tree
    assert known.limits["m.slide.q"] == (-2.0, 2.0)
    for q, v in (([0.7, -1.9], [1.3, 2.2]), ([-1.2, 2.6], [-0.4, -3.1])):
        at = robot.neutral()
        for name, value in zip(("slide", "hinge"), q, strict=True):
            robot.put(at, name, value)
        push = np.array([1.7 - 3.0 * q[0], 0.0]) - np.array([0.0, 0.01]) * v
        data = robot.model.createData()
        held = push - pin.nonLinearEffects(robot.model, data, at, np.array(v))
        wanted = np.linalg.solve(robot.inertia(at), held)
        assert np.abs(np.asarray(rate(0.0, q, v, [1.7])).ravel() - wanted).max() < 1e-11


def craft(folder, end):
    """A hull that flies, turned askew, with a wheel off its centre."""
    (folder / "craft.xml").write_text(CRAFT)
    body = {
        "kind": "mechanism", "name": "m", "file": "craft.xml", "velocity": [1.0, 0.0, 2.0],
        "orientation": {"axis": [1.0, 2.0, 0.5], "angle": 0.7},
        "joints": {"wheel": {"motor": "0"}},
    }  # fmt: skip
    return Scene.from_dict({
        "title": "craft", "duration": 1.0, "gravity": [0.0, 0.0, -9.81], "body": [body],
        "control": [{"name": "u", "acts": "body.m.joints.wheel.motor"}],
        "trajectory": {"end": end, "nodes": 6},
    }, base=folder)  # fmt: skip


def test_accelerations_of_a_free_base_are_those_of_pinocchio(tmp_path):
    """At a state of no symmetry, at which the quaternion is longer than 1."""
    scene = craft(tmp_path, {"m.wheel.q": 1.0})
    known = symbolic(scene)
    tree = known.tree
    told = loaded().Function("rate", [tree.t, tree.q, tree.v, known.controls], [known.rate])
    robot = read_mechanism(scene.bodies[0], scene.folder).tree
    turn = np.array([0.5, -0.7, 0.1, 0.5])  # of length 1
    place, speed, spin = np.array([[0.3, -0.2, 1.1], [0.4, 1.3, -0.6], [1.2, -0.8, 2.1]])
    joints, rates = np.array([0.6]), np.array([-1.7])
    v = np.concatenate([speed, 1.5 * quaternion_rates(turn, spin), rates])
    q = np.concatenate([place, 1.5 * turn, joints])
    found = np.asarray(told(0.0, q, v, [0.9])).ravel()
    at = np.concatenate([place, np.roll(turn, -1), joints])
    base = robot.base(at)
    own = np.concatenate([base.T @ speed, base.T @ spin, rates])
    push = np.concatenate([np.zeros(6), [0.9]])
    data = robot.model.createData()
    wanted = pin.aba(robot.model, data, at, own, push)
    linear = base @ (wanted[:3] + np.cross(own[3:6], own[:3]))
    spins = np.asarray(loaded().evalf(turning_of(q[3:7]))) @ found[3:7]
    assert found[:3] == pytest.approx(linear, abs=1e-11)
    assert spins == pytest.approx(base @ wanted[3:6], abs=1e-11)
    assert found[7:] == pytest.approx(wanted[6:], abs=1e-11)
    assert q[3:7] @ found[3:7] == pytest.approx(-v[3:7] @ v[3:7], abs=1e-11)  # its length stays


@pytest.mark.slow
def test_a_wheel_turns_the_hull_back(tmp_path):
    """By the share of its inertia, about the axis of both; 12 I^2 q^2 / T^3, I reduced."""
    planned = trajectory(craft(tmp_path, {"m.wheel.q": 3.0}))
    found, own, hull = planned.found, 0.1, 0.5
    assert found.trusted
    assert found.cost == pytest.approx(12.0 * (own * hull / (own + hull)) ** 2 * 9.0, rel=1e-9)
    table = planned.table(*planned.fine)  # what follows
    last = np.array([table[f"m.base.q{letter}"][-1] for letter in "xyzw"])
    axis = np.array([1.0, 2.0, 0.5]) / np.linalg.norm([1.0, 2.0, 0.5])
    begun = Rotation.from_rotvec(0.7 * axis)
    turn = (begun.inv() * Rotation.from_quat(last)).as_rotvec()
    assert turn == pytest.approx([0.0, 0.0, -3.0 * own / (own + hull)], abs=1e-9)
    still = np.array([table[f"m.base.w{axis}"][-1] for axis in "xyz"])
    assert np.abs(still).max() < 1e-9


def test_a_wheel_of_which_nothing_is_said_has_a_size(tmp_path):
    """What it does to the hull's turn is 0 but for rounding, which once told 1e15 rad/s."""
    scene = craft(tmp_path, {"m.base.qz": 0.1})
    problem = _Asked(scene, scene.trajectory, symbolic(scene)).problem()
    sizes = dict(zip(problem.states, sizes_of(problem, begin(problem, {})).states, strict=True))
    assert sizes["m.wheel.q"] == 1.0
    assert 0.1 < sizes["m.wheel.v"] < 10.0


def test_a_motion_starts_and_ends_as_asked(tmp_path):
    found = trajectory(cart(tmp_path, transcription="trapezoid")).found
    assert found.trusted
    assert found.states["m.hinge.q"][0] == pytest.approx(0.4)
    assert found.states["m.slide.q"][-1] == pytest.approx(1.0)
    assert found.states["m.slide.v"][-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_a_turn_that_a_wheel_cannot_make_is_told_soon(tmp_path):
    """About another axis than its own: the search for a shortest duration does not go on for ever.

    What cannot be is found in 14 iterations; in 1000 more no duration would be.
    """
    about = Rotation.from_rotvec(0.7 * np.array([1.0, 2.0, 0.5]) / np.linalg.norm([1.0, 2.0, 0.5]))
    turned = np.roll((about * Rotation.from_rotvec([0.5, 0.2, 0.0])).as_quat(), 1).tolist()
    end = {f"m.base.q{letter}": value for letter, value in zip("wxyz", turned, strict=True)}
    answers = []

    def counted(program, *given, solve=Program.solve):
        answers.append(solve(program, *given))
        return answers[-1]

    with patch.object(Program, "solve", counted):
        found = trajectory(craft(tmp_path, end)).found
    assert found.status == "infeasible"
    assert "that is left at the end" in found.message
    assert sum(each.iterations for each in answers) < 200


def test_what_has_no_such_form_is_refused(tmp_path):
    driven = {"slide": {"motor": "0"}, "hinge": {"position": "sin(t)"}}
    with pytest.raises(SceneError, match=r"body\.m\.joints\.hinge\.position: a formula drives"):
        trajectory(cart(tmp_path, joints=driven))
    with pytest.raises(SceneError, match=r"did you mean|there is no such column"):
        trajectory(cart(tmp_path, end={"m.slid.q": 1.0}))


def test_dry_friction_of_a_file(tmp_path):
    """Where the rate keeps its sign: as a push that is less by it."""
    kept = {"m.slide.v": [0.0, 9.0]}
    rates = []
    for rubs, push in (("", 1.0), (' frictionloss="2"', 3.0)):
        with patch(f"{__name__}.CART", CART.replace(" armature=", f"{rubs} armature=")):
            known = symbolic(cart(tmp_path, bounds=kept))
            tree = known.tree
            rate = loaded().Function("rate", [tree.t, tree.q, tree.v, known.controls], [known.rate])
            rates.append(np.asarray(rate(0.0, [0.3, 0.7], [0.4, -0.6], [push])).ravel())
            if rubs:
                told = r"body\.m\.file: dry friction of joint slide = 2: turns with the sign of m"
                with pytest.raises(SceneError, match=told):
                    trajectory(cart(tmp_path))
    assert rates[1] == pytest.approx(rates[0], rel=1e-12)
