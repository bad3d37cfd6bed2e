"""Mechanisms of robot files in trajectories."""

import numpy as np
import pytest

from impactfem import Scene, SceneError
from impactfem.system.mechanism_file import read_mechanism
from impactfem.trajectory.bodies import symbolic
from impactfem.trajectory.scenes import trajectory
from impactfem.trajectory.symbols import loaded

pin = pytest.importorskip("pinocchio")

CART = """<mujoco><compiler angle="radian"/><worldbody>
 <body name="cart" pos="0 0 1"><joint name="slide" type="slide" axis="1 0 0" range="-2 2"
   limited="true" armature="0.5"/><inertial mass="1" pos="0 0 0" diaginertia=".1 .1 .1"/>
  <body name="pole"><joint name="hinge" type="hinge" axis="0 1 0" damping="0.01"/>
   <inertial mass=".3" pos=".1 0 -.5" diaginertia=".001 .002 .003"/></body></body>
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


def test_a_motion_starts_and_ends_as_asked(tmp_path):
    found = trajectory(cart(tmp_path, transcription="trapezoid")).found
    assert found.trusted
    assert found.states["m.hinge.q"][0] == pytest.approx(0.4)
    assert found.states["m.slide.q"][-1] == pytest.approx(1.0)
    assert found.states["m.slide.v"][-1] == pytest.approx(0.0, abs=1e-9)


def test_what_has_no_such_form_is_refused(tmp_path):
    driven = {"slide": {"motor": "0"}, "hinge": {"position": "sin(t)"}}
    with pytest.raises(SceneError, match=r"body\.m\.joints\.hinge\.position: a formula drives"):
        trajectory(cart(tmp_path, joints=driven))
    with pytest.raises(SceneError, match=r"did you mean|there is no such column"):
        trajectory(cart(tmp_path, end={"m.slid.q": 1.0}))
