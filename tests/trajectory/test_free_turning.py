"""What flies and turns freely in space, in trajectories: closed forms of its motion and cost."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from impactfem import Scene, SceneError
from impactfem.trajectory.rotations import quaternion_rates, turned
from impactfem.trajectory.scenes import trajectory

pytest.importorskip("casadi")

AXIS = np.array([1.0, 2.0, 0.5]) / np.linalg.norm([1.0, 2.0, 0.5])
BEGUN = Rotation.from_rotvec(0.7 * AXIS)


def box(controls, end, spin=(0.0, 0.0, 0.0), moments=(0.04, 0.04, 0.07), **asked):
    """A box that is thrown, turned askew."""
    return {
        "title": "box", "duration": 1.0, "gravity": [0.0, 0.0, -9.81],
        "body": [{
            "kind": "rigid", "name": "box", "mass": 2.0, "inertia": np.diag(moments).tolist(),
            "shape": {"kind": "block", "size": [0.2, 0.3, 0.4], "corner": [-0.1, -0.15, -0.2]},
            "orientation": {"axis": AXIS.tolist(), "angle": 0.7}, "velocity": [1.0, 0.0, 4.905],
            "angular_velocity": list(spin), "moment": ["0"] * 3, "force": ["0"] * 3,
        }],
        "control": [{"name": each.replace(".", "_"), "acts": f"body.box.{each}"}
                    for each in controls],
        "trajectory": {"end": end, "nodes": 8} | asked,
    }  # fmt: skip


def columns(planned, *names):
    table = planned.table(planned.found.times, planned.found.at_nodes)
    return np.array([table[name] for name in names]).T


def quaternions(rotation):
    """W first."""
    return np.roll(rotation.as_quat(), 1, axis=-1)


def ended(turn):
    """Columns of a box that ends turned so from its start, and may spin."""
    numbers = quaternions(BEGUN * Rotation.from_rotvec(turn)).tolist()
    spins = dict.fromkeys(("box.wx", "box.wy", "box.wz"), "free")
    return dict(zip(("box.qw", "box.qx", "box.qy", "box.qz"), numbers, strict=True)) | spins


@pytest.mark.slow
def test_a_box_lands_turned_as_asked():
    """About a principal axis by an angle in the time of its flight: J = 3 I^2 angle^2 / T^3."""
    end = ended([0.0, 0.0, 1.2]) | {"box.z": 0.0, "box.vz": "free"}
    moments = [f"moment.{axis}" for axis in "xyz"]
    tables = box(moments, end, duration=[0.5, 2.0])
    planned = trajectory(Scene.from_dict(tables))
    assert planned.found.trusted
    assert planned.found.duration == pytest.approx(1.0, rel=1e-9)
    assert planned.found.cost == pytest.approx(3.0 * 0.07**2 * 1.2**2, rel=1e-4)
    last = columns(planned, "box.qw", "box.qx", "box.qy", "box.qz")[-1]
    wanted = quaternions(BEGUN * Rotation.from_rotvec([0.0, 0.0, 1.2]))
    assert np.abs(last - wanted).max() < 1e-8
    assert np.abs(np.linalg.norm(planned.found.at_nodes[:, 3:7], axis=1) - 1.0).max() < 1e-5


@pytest.mark.slow
def test_a_top_tumbles_as_poinsot_says():
    """Pushed at its centre it turns as if it were not: about L by |L|/I and about its own axis."""
    spin = np.array([0.6, -1.0, 4.0])
    asked = box(["force.x"], {"box.vx": 2.0}, spin.tolist(), nodes=30)
    planned = trajectory(Scene.from_dict(asked))
    own, t = BEGUN.inv().apply(spin), planned.found.times[:, None]
    about = BEGUN.apply(own * [0.04, 0.04, 0.07]) / 0.04
    axis = np.array([0.0, 0.0, own[2] * (1.0 - 0.07 / 0.04)])
    wanted = quaternions(Rotation.from_rotvec(about * t) * BEGUN * Rotation.from_rotvec(axis * t))
    found = columns(planned, "box.qw", "box.qx", "box.qy", "box.qz")
    wanted *= np.sign(np.sum(wanted * found, axis=1))[:, None]
    assert planned.found.cost == pytest.approx(4.0, rel=1e-9)
    assert np.abs(found - wanted).max() < 1e-6
    followed = planned.table(*planned.fine)
    last = [followed[f"box.q{letter}"][-1] for letter in "wxyz"]
    assert np.abs(last - wanted[-1]).max() < 1e-10


def test_signs_of_a_quaternion_tell_full_turns():
    """A search begins on the way that was asked: the longer one, and about the spin."""
    start, spin = quaternions(BEGUN), np.array([0.0, 0.0, 2.0])
    way = turned(start, -start, spin)
    about = Rotation.from_quat(np.roll(way[16], -1)) * BEGUN.inv()  # a quarter of it
    assert np.abs(about.as_rotvec() - [0.0, 0.0, np.pi / 2]).max() < 1e-12
    assert np.abs(way[-1] + start).max() < 1e-12
    far = -quaternions(Rotation.from_rotvec([0.0, 0.4, 0.0]))
    way = turned(np.array([1.0, 0.0, 0.0, 0.0]), far, spin)
    assert way[32] == pytest.approx(
        quaternions(Rotation.from_rotvec([0.0, 0.2 - np.pi, 0.0])), abs=1e-12
    )


def test_rates_of_quaternions_are_those_of_spins():
    spin, h = np.array([0.3, -1.1, 0.7]), 1e-5
    ahead, behind = (quaternions(Rotation.from_rotvec(sign * h * spin) * BEGUN) for sign in (1, -1))
    found = quaternion_rates(quaternions(BEGUN), spin)
    assert found == pytest.approx((ahead - behind) / (2.0 * h), abs=1e-9)


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ({"end": dict.fromkeys(("box.qw", "box.qx", "box.qy", "box.qz"), 1.0)},
         r"trajectory\.end\.box\.qw to \.qz = .*length is 2; give one, as \[0\.5, 0\.5"),
        ({"start": {"box.qw": 1.0}}, r"trajectory\.start\.box\.qw: .* give its orientation"),
        ({"start": {"box.wx": 1.0}}, r"trajectory\.start\.box\.wx: .* give its orientation"),
    ],
)  # fmt: skip
def test_rotations_that_cannot_be_are_refused(key, told):
    tables = box(["moment.z"], {"box.x": 1.0})
    tables["trajectory"] |= key
    with pytest.raises(SceneError, match=told):
        trajectory(Scene.from_dict(tables))
