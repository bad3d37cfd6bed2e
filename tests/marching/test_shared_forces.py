"""Contact forces that the motion does not determine: who slips does not hang on chance."""

import numpy as np
import pytest

from impactfem import Scene, solve
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solutions import stuck

RADIUS = 0.1
FOUR = [(-0.2, -0.2), (-0.2, 0.2), (0.2, -0.2), (0.2, 0.2)]
THREE = [(-0.2, -0.2), (-0.2, 0.2), (0.2, 0.0)]


def cart(wheels, gravity, dt=1e-3, *, duration=0.03, turned=False, motor=None):
    """A chassis of 10 kg on wheels of 1 kg; the order of bodies, and a motor in the rear axles."""
    block = {"kind": "block", "size": [0.5, 0.1, 0.3], "corner": [-0.25, 0.12, -0.15]}
    bodies, joints = [{"kind": "rigid", "name": "chassis", "shape": block, "mass": 10.0}], []
    for k, (x, z) in enumerate(wheels):
        shape = {"kind": "cylinder", "radius": RADIUS, "height": 0.06}
        shape["center"] = [x, 0.07, z]
        bodies.append(
            {"kind": "rigid", "name": f"wheel{k}", "shape": shape, "mass": 1.0}
            | {"orientation": {"axis": [1.0, 0.0, 0.0], "angle": np.pi / 2}}
        )
        joints.append(
            {"name": f"axle{k}", "kind": "revolute", "between": ["chassis", f"wheel{k}"]}
            | {"point": [x, RADIUS, z], "axis": [0.0, 0.0, 1.0]}
            | ({"motor": motor} if motor and x < 0.0 else {})
        )
    if turned:
        bodies, joints = bodies[::-1], joints[::-1]
    road = {"kind": "half_space", "name": "road", "point": [0.0] * 3, "normal": [0.0, 1.0, 0.0]}
    contact = {"between": ["wheel*", "road"], "friction_coefficient": 0.9}
    case = {
        "title": "cart", "duration": duration, "gravity": gravity, "body": bodies,
        "joint": joints, "obstacle": [road], "contact": [contact], "output": {"fields": []},
        "solve": {"dt": dt, "estimate": False},
    }  # fmt: skip
    return solve(Scene.from_dict(case))


def rolls(result, wheels, speed):
    """Whether all wheels roll at a speed."""
    history = result.history
    assert result.summary["status"] == "completed"
    assert history["chassis.vx"].values[-1] == pytest.approx(speed, rel=1e-5)
    for k in range(len(wheels)):
        assert -RADIUS * history[f"wheel{k}.wz"].values[-1] == pytest.approx(speed, rel=1e-5)
    return history


def told(result):
    (found,) = (
        f["text"] for f in result.summary["verdict"]["findings"] if f["code"] == "overconstrained"
    )
    return found


@pytest.mark.slow
def test_wheels_roll_whatever_the_step_and_the_order():
    """Of four wheels one may carry next to nothing, and then slips: it is taken to share."""
    gravity = [2.0, -9.6, 0.0]
    speed = 28.0 / 16.0 * 0.03  # wheels weigh half as much again by turning
    one = cart(FOUR, gravity)
    history = rolls(one, FOUR, speed)
    other = rolls(cart(FOUR, gravity, turned=True), FOUR, speed)
    for name in ("chassis.vx", "chassis.y", "wheel0.wz", "wheel3.wz"):
        largest = np.abs(history[name].values).max()
        assert np.abs(history[name].values - other[name].values).max() < 1e-9 * largest
    rolls(cart(FOUR, gravity, dt=5e-4), FOUR, speed)
    # Alike wheels push alike.
    forces = [history[f"force.wheel{k}.road"].values for k in range(4)]
    assert np.abs(forces[0] - forces[1]).max() < 1e-6 * np.abs(forces).max()
    assert "other shares of them let something slip" in told(one)
    assert not one.summary["details"]["overconstrained"]["motion_determined"]
    # Of three wheels each has its share.
    three = cart(THREE, gravity)
    rolls(three, THREE, 26.0 / 14.5 * 0.03)
    assert "motions are determined" in told(three)


@pytest.mark.slow
def test_a_driven_cart_goes_as_its_motors_drive_it():
    """Rear wheels that need nearly all of their friction: least forces alone would slip."""
    speed = 10.0 / RADIUS / 16.0 * 0.03
    rolls(cart(FOUR, [0.0, -9.81, 0.0], motor="-5"), FOUR, speed)


def test_forces_that_stick_are_the_least_within_their_cones():
    """Two contacts of one ledge: what one cannot hold the other one does."""
    # Only sums of forces move it; the first one presses with 1, the second one with 3.
    matrix = np.kron(np.ones((2, 2)), np.eye(2))
    matrix[0, 2] = matrix[2, 0] = 0.0  # normal forces are determined
    for pull, expected in ((0.5, [0.25, 0.25]), (1.6, [0.4, 1.2])):
        offset = np.array([[-1.0, -pull], [-3.0, -pull]])
        problem = ConeProblem(matrix, offset, np.array([0.4, 0.6]), np.zeros(2))
        found = stuck(problem)
        assert found[:, 0] == pytest.approx([1.0, 3.0], rel=1e-12)
        assert found[:, 1] == pytest.approx(expected, rel=2e-3)
        assert np.abs(problem.answers(found)).max() < 1e-12
        assert (np.abs(found[:, 1]) <= problem.friction * found[:, 0]).all()
        other = ConeProblem(matrix, offset[::-1], problem.friction[::-1], np.zeros(2))
        assert stuck(other) == pytest.approx(found[::-1], abs=1e-12)
    # More than both hold: it is not found, and one contact alone has its force anyhow.
    offset[:, 1] = -3.0
    assert stuck(ConeProblem(matrix, offset, np.array([0.4, 0.6]), np.zeros(2))) is None
    assert stuck(problem.part(np.array([0]))) is None
