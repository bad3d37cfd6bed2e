"""Raibert's controller: against a hopper integrated here, through contact, and refused."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError
from impactfem.runs.hopping import Hopping

DEMO = Path(__file__).parents[2] / "demos/running_hopper/scene.toml"


def hopper(duration=6.4, *, dt=None, drop=None, **changed):
    """The demo's scene, without its push; its foot starts so far above the ground, falling."""
    data = tomllib.loads(DEMO.read_text(encoding="utf-8"))
    data |= {"duration": duration, "output": {"fields": []}}
    data["body"][0].pop("force")
    hip = data["controller"][0]["hip"] | changed.pop("hip", {})
    data["controller"][0] |= {"hip": hip} | changed
    data["solve"]["dt"] = data["controller"][0]["sample"] = dt or 4e-3
    if drop is not None:
        data["obstacle"][0]["point"] = [0.0, 0.2 - drop]
        for body in data["body"]:
            body["velocity"] = [1.0, -2.0]
    return data


class Plain:
    """A body on a spring and damper without mass, which the hip swings in flight."""

    mass, inertia, k, c, leg_inertia, g, radius = 1.04, 0.2, 400.0, 2.0, 0.02, 9.81, 0.05

    def __init__(self, scene, h):
        own = scene.controllers[0]
        self.laws = [(part, Hopping.of(scene, own)) for part in own.parts]
        self.state, self.h, self.foot = np.array([0.0, 1.25, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), h, None
        self.apexes, self.outputs = [], (0.0, 0.0)

    def leg(self, s):
        """Length, its rate, angle, its rate."""
        if self.foot is None:
            return 1.0, 0.0, s[6], s[7]
        x, z = self.foot - s[0], -s[1]
        r = math.hypot(x, z)
        return (r, -(x * s[3] + z * s[4]) / r, math.atan2(x, -z), (z * s[3] - x * s[4]) / r**2)

    def pushes(self, s):
        r, rate, _, _ = self.leg(s)
        return self.k * (1.0 - r) - self.c * rate + self.outputs[0]

    def rate(self, s):
        moment = self.outputs[1]
        spun = -moment / self.inertia
        if self.foot is None:
            return np.array([*s[3:6], 0.0, -self.g, spun, s[7], moment / self.leg_inertia])
        r, _, angle, _ = self.leg(s)
        along, across = self.pushes(s) / self.mass, moment / (r * self.mass)
        up, side = math.cos(angle), math.sin(angle)
        return np.array([*s[3:6], -along * side - across * up, along * up - across * side - self.g,
                         spun, 0.0, 0.0])  # fmt: skip

    def sample(self, time):
        s, (r, rate, angle, turn) = self.state, self.leg(self.state)
        way, swing = np.array([math.sin(angle), -math.cos(angle)]), turn * r
        foot = s[:2] + r * way
        moved = s[3:5] + rate * way + swing * np.array([-way[1], way[0]])
        force = 0.0 if self.foot is None else max(1e-9, self.pushes(s))
        seen = np.array([*s[:2], *s[3:5], s[2], s[5], *foot, *moved, r - 1.0, rate])
        found = [law.output(part, time, seen, force) for part, law in self.laws]
        self.outputs = found[0] if self.foot is not None else 0.0, found[1]

    def step(self):
        s, h = self.state, self.h
        one = self.rate(s)
        two = self.rate(s + 0.5 * h * one)
        three = self.rate(s + 0.5 * h * two)
        new = s + h / 6.0 * (one + 2.0 * two + 2.0 * three + self.rate(s + h * three))
        if self.foot is None:
            if s[4] > 0.0 >= new[4]:
                self.apexes.append((new[1], new[3]))
            if new[4] < 0.0 and new[1] < math.cos(new[6]):
                self.foot = new[0] + math.sin(new[6])
        elif self.pushes(new) < 0.0 and new[4] > 0.0:
            _, _, new[6], new[7] = self.leg(new)
            self.foot = None
        self.state = new


def test_hops_are_held_and_pushes_forgotten():
    """Ten hops from a start 4 % too low, then 10 % more speed, and ten hops: within 1 %."""
    h = 2e-3
    plain, time = Plain(Scene.from_dict(hopper(target=1.3)), h), 0.0
    for pushed in (0.0, 0.1):
        plain.state[3] += pushed
        plain.apexes.clear()
        while len(plain.apexes) < 10:
            plain.sample(time)
            plain.step()
            time += h
            assert time < 30.0
        heights, speeds = np.array(plain.apexes).T
        assert heights[-1] == pytest.approx(1.3, rel=0.01)
        assert speeds[-1] == pytest.approx(1.0, rel=0.01)
    assert abs(plain.state[2]) < 0.02


def landing():
    """Stance and thrust within .3 s, the joints and the leg's axis the other way round."""
    data = hopper(0.3, drop=0.02, delay=4e-3)
    for joint in data["joint"]:
        joint["between"] = joint["between"][::-1]
    data["joint"][1]["axis"] = [0.0, 1.0]
    data["output"]["checkpoint"] = 8
    return Scene.from_dict(data)


def test_signs_of_joints_and_restart(tmp_path, monkeypatch):
    check_restart(landing(), 57, tmp_path, monkeypatch)
    found = [impactfem.solve(scene) for scene in (landing(), Scene.from_dict(
        hopper(0.3, drop=0.02, delay=4e-3)
    ))]  # fmt: skip
    for name in ("body.y", "body.vx", "body.angle"):
        one, other = (result.history[name].values for result in found)
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())
    one, other = (result.history["run.u"].values for result in found)
    assert other.min() < -5.0  # it falls from higher than it shall hop, and is held back
    assert other.max() == 0.0  # also where its leg, drawn in, touches again
    np.testing.assert_allclose(one, other, atol=1e-7)  # q is of the second body against the first
    hips = [result.history["run_hip.u"].values for result in found]
    np.testing.assert_allclose(hips[0], -hips[1], atol=1e-7)
    way = np.diff(found[1].history["leg.q"].values)
    work = found[1].summary["controllers"]["run"]["work"]
    assert work == pytest.approx(float(other[1:] @ way), rel=1e-9)
    assert Scene.from_dict(landing().to_dict()).to_dict() == landing().to_dict()


@pytest.mark.slow
def test_ten_hops_through_contact():
    """The demo's hopper by impacts with friction, feet and legs of mass: within 1 %."""
    history = impactfem.solve(Scene.from_dict(hopper(7.2, dt=2e-3))).history
    height, speed = (history[name].values for name in ("body.y", "body.vx"))
    apexes = 1 + np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:]))
    assert len(apexes) > 10
    assert height[apexes[10]] == pytest.approx(1.3, rel=0.01)
    assert speed[apexes[10]] == pytest.approx(1.0, rel=0.01)


@pytest.mark.parallel([2])
def test_ranks_agree(monkeypatch):
    check_ranks(landing, monkeypatch)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"body": "bodi"}, 'body = "bodi" is no rigid body in the plane: give one of body, sleeve'),
        ({"foot": "sleeve"}, 'foot = "sleeve" is to meet an obstacle'),
        ({"foot": None}, "foot is missing"),
        ({"acts": "joint.hip.motor"}, "acts = .* is no motor of a prismatic joint: give joint.leg"),
        ({"hip": {"acts": "joint.knee.motor"}}, "hip.acts = .*knee"),
        ({"hip": {"limits": [2.0, 1.0]}}, "hip.limits = .*smaller number first"),
        ({"noise": {"sigma": 1e-3}}, "noise of a raibert controller"),
        ({"kp": 1.0}, "kp is given, but a raibert controller has none"),
    ],
)
def test_what_is_refused(changed, said):
    data = hopper(0.1, **changed)
    data["controller"][0] = {n: v for n, v in data["controller"][0].items() if v is not None}
    with pytest.raises(SceneError, match=r"controller\[0\]\." + said):
        Scene.from_dict(data)


def test_what_a_scene_needs():
    data = hopper(0.1)
    with pytest.raises(SceneError, match=r"gravity = .*hops along y"):
        Scene.from_dict(data | {"gravity": [0.0, 0.0]})
    data["joint"][1].pop("stiffness")
    with pytest.raises(SceneError, match=r"hip.stance is missing: leg has no stiffness"):
        Scene.from_dict(data)
