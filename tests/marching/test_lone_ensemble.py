"""Ensembles of one rigid body: members are single runs, and closed forms hold for all of them."""

import dataclasses

import numpy as np
import pytest

from impactfem import Scene, solve
from impactfem.errors import ConvergenceError, ImpactWarning, SceneError
from impactfem.studies import solve_ensemble

G = 9.81
SHAPES = {
    "block": {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, 0.1]},
    "capsule": {"kind": "capsule", "radius": 0.05, "length": 0.2, "center": [0.0, 0.15]},
    "dice": {"kind": "block", "size": [0.1, 0.1, 0.1], "corner": [-0.05, 0.1, -0.05]},
    "coin": {"kind": "cylinder", "radius": 0.1, "height": 0.03, "center": [0.0, 0.15, 0.0]},
    "ball": {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.15, 0.0]},
}


def thrown(shape, duration=0.35, gravity=-G, **law):
    dim = len(SHAPES[shape].get("center", SHAPES[shape].get("corner")))
    more = [0.0] * (dim - 2)
    planes = [("floor", [0.0, 0.0, *more], [0.0, 1.0, *more]),
              ("wall", [0.35, 0.0, *more], [-1.0, 0.1, *more])]  # fmt: skip
    return Scene.from_dict(
        {
            "title": "thrown", "duration": duration, "gravity": [0.3, gravity, *more],
            "body": [{"kind": "rigid", "name": "b", "shape": SHAPES[shape], "density": 1e3}],
            "obstacle": [
                {"kind": "half_space", "name": name, "point": point, "normal": normal}
                for name, point, normal in planes
            ],
            "contact": [{"between": ["b", name], **law} for name, *_ in planes],
            "solve": {"dt": 1e-3, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


LAW = {"friction_coefficient": 0.3, "restitution": 0.3}


@pytest.mark.parametrize(
    ("shape", "law"),
    [
        ("block", LAW), ("dice", LAW), ("coin", LAW), ("capsule", {"restitution": 0.5}),
        ("ball", {**LAW, "tangential_restitution": 0.4}),
    ],
)  # fmt: skip
def test_members_are_single_runs(shape, law):
    # Until a face lies and slides: how its corners share the force then is left to rounding.
    scene = thrown(shape, duration={"dice": 0.266, "coin": 0.217}.get(shape, 0.35), **law)
    body, rng = scene.bodies[0], np.random.default_rng(1)
    dim, turns = body.dim, body.turns
    velocity = rng.normal(size=(2, dim)) - np.eye(dim)[1]
    spin = 4.0 * rng.normal(size=(2, turns))
    restitution = np.array([[0.3, 0.5], [0.1, 0.2]])
    found = solve_ensemble(
        scene, velocity=velocity, angular_velocity=spin[:, 0] if dim == 2 else spin,
        restitution=restitution, every=7, threads=2,
    )  # fmt: skip
    for k in range(2):
        start = {
            "velocity": velocity[k].tolist(),
            "angular_velocity": float(spin[k, 0]) if dim == 2 else spin[k].tolist(),
        }
        laws = [
            dataclasses.replace(each, restitution=float(e))
            for each, e in zip(scene.contacts, restitution[k], strict=True)
        ]
        one = dataclasses.replace(
            scene, bodies=(dataclasses.replace(body, **start),), contacts=tuple(laws)
        )
        history = solve(one).history
        turn = ["angle"] if dim == 2 else ["qw", "qx", "qy", "qz"]
        rates = ["spin"] if dim == 2 else ["wx", "wy", "wz"]
        axes = ["x", "y", "z"][:dim]
        place = np.stack([history[f"b.{c}"].values for c in [*axes, *turn]], 1)[::7]
        rate = np.stack([history[f"b.{c}"].values for c in [*(f"v{a}" for a in axes), *rates]], 1)
        same = np.sign((place[:, dim:] * found.position[k, :, dim:]).sum(axis=1, keepdims=True))
        place[:, dim:] *= same if dim == 3 else 1.0
        # Rounding is 1e-15; an impact lets it grow by the share that it turns the body.
        assert found.position[k] == pytest.approx(place, abs=1e-11)
        assert found.velocity[k] == pytest.approx(rate[::7], abs=1e-9)
        assert found.impulse[k, -1].max() > 0.0
    assert found.times == pytest.approx(history["time"].values[::7])


def test_balls_come_to_roll_with_five_sevenths():
    speeds, count = np.linspace(0.1, 1.0, 50), 50
    scene = thrown("ball", duration=1.2, friction_coefficient=0.2)
    plane = dataclasses.replace(scene, gravity=(0.0, -G, 0.0), obstacles=scene.obstacles[:1],
                                contacts=scene.contacts[:1])  # fmt: skip
    found = solve_ensemble(
        plane, position=np.tile([0.0, 0.1, 0.0], (count, 1)),
        velocity=np.stack([speeds, 0.0 * speeds, 0.0 * speeds], 1),
        friction_coefficient=np.linspace(0.05, 0.5, count), dt=4e-3,
    )  # fmt: skip
    assert found.velocity[:, -1, 0] == pytest.approx(5.0 / 7.0 * speeds, rel=1e-12)
    assert found.velocity[:, -1, 5] == pytest.approx(-50.0 / 7.0 * speeds, rel=1e-12)
    assert found.impulse[:, -1, 0] == pytest.approx(4.0 / 3.0 * np.pi * 1.2 * G, rel=1e-12)


def test_superballs_leave_as_garwin_says():
    rng = np.random.default_rng(2)
    speed, spin = rng.normal(size=200), 10.0 * rng.normal(size=200)  # R w of the size of v
    law = {"friction_coefficient": 1e6, "restitution": 1.0, "tangential_restitution": 1.0}
    none = np.zeros(200)
    scene = thrown("ball", duration=0.1, gravity=0.0, **law)
    plane = dataclasses.replace(scene, gravity=(0.0, 0.0, 0.0), obstacles=scene.obstacles[:1],
                                contacts=scene.contacts[:1])  # fmt: skip
    found = solve_ensemble(
        plane, velocity=np.stack([speed, none - 1.0, none], 1),
        angular_velocity=np.stack([none, none, spin], 1),
    )  # fmt: skip
    # With the surface going by v + R w on the floor; R = 0.1 m.
    assert found.velocity[:, -1, 0] == pytest.approx((3 * speed - 4 * 0.1 * spin) / 7, abs=1e-12)
    assert found.velocity[:, -1, 5] == pytest.approx((-100 * speed - 3 * spin) / 7, abs=1e-11)
    assert found.velocity[:, -1, 1] == pytest.approx(1.0 + none)


def test_blocks_fall_to_the_side_of_their_centre():
    tilt = np.linspace(0.02, 0.5 * np.pi - 0.02, 40)
    rise = 0.5 * (0.2 * np.sin(tilt) + 0.1 * np.cos(tilt))  # of the centre, on the corner
    found = solve_ensemble(
        dataclasses.replace(thrown("block", duration=1.6, friction_coefficient=1.0),
                            gravity=(0.0, -G)),
        position=np.stack([0.0 * tilt - 1.0, rise], 1), angle=tilt, dt=2e-3,
    )  # fmt: skip
    # Corners lie in the floor by a step's way, 2e-3 s of up to 1 m/s: 0.02 rad of 0.1 m.
    settled, falls = found.position[:, -1, 2], tilt > np.arctan(2.0)
    assert settled == pytest.approx(np.where(falls, 0.5 * np.pi, 0.0), abs=2e-2)
    assert np.abs(found.velocity[:, -1]).max() < 1e-2


def test_what_cannot_be_is_named():
    scene, still = thrown("dice"), np.zeros((3, 3))
    low = np.array([[0.0, 0.2, 0.0], [0.0, 0.01, 0.0]])
    with pytest.raises(SceneError, match=r"member 1: it is 0\.04 m inside a plane"):
        solve_ensemble(scene, position=low)
    with pytest.raises(
        SceneError, match=r"restitution has shape \(2,\); .* \(n,\) or \(n, 2\), wi"
    ):
        solve_ensemble(scene, velocity=still, restitution=[0.1, 0.2])
    with pytest.raises(SceneError, match=r"member 2: restitution = \[1\.5\]; give numbers from 0"):
        solve_ensemble(scene, velocity=still, restitution=[0.1, 0.2, 1.5])
    with pytest.raises(SceneError, match="angle: a body with 3 coordinates has none; give orient"):
        solve_ensemble(scene, angle=[0.1])
    with pytest.raises(SceneError, match="nothing differs"):
        solve_ensemble(scene)
    stiff = dataclasses.replace(
        scene, contacts=tuple(
            dataclasses.replace(c, friction_coefficient=0.1, static_friction_coefficient=0.2)
            for c in scene.contacts
        ),
    )  # fmt: skip
    with pytest.raises(SceneError, match="contact of floor has static_friction_coefficient: use"):
        solve_ensemble(stiff, velocity=still)


def test_members_that_stop_early_are_told():
    scene, fast = thrown("dice", duration=0.1), [[0.0, 0.0, 0.0], [0.0, 9e3, 0.0]]
    with pytest.warns(ImpactWarning, match="1 of 2 members stopped early, the first is member 1"):
        found = solve_ensemble(scene, angular_velocity=fast, every=50)
    assert list(found.details["failed"]) == [1]
    assert np.isfinite(found.position[0]).all()
    assert np.isfinite(found.position[1, 0]).all()
    assert np.isnan(found.position[1, 1:]).all()
    with pytest.raises(ConvergenceError, match=r"1 of 1 members.* t = 0 s: it turns too far in a"):
        solve_ensemble(scene, angular_velocity=fast[1:])
