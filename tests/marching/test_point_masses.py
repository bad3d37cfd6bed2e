"""Masses that bodies carry, held to closed forms and to bodies of the same mass."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart
from scipy.optimize import brentq, least_squares

from impactfem import Scene, solve
from impactfem.errors import SceneError
from impactfem.planning import plan

FLOOR = {"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
BLOCK = {
    "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.025,
    "shape": {"kind": "block", "size": [0.1, 0.05], "corner": [0.0, 1e-4]}, "density": 1000.0,
    "youngs_modulus": 1e7, "poisson_ratio": 0.3, "velocity": [0.1, -1.0], "strain": "small",
}  # fmt: skip
BOX = {
    "kind": "rigid", "name": "box", "mass": 2.0, "velocity": [1.0, 0.5], "angular_velocity": 3.0,
    "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, -0.05]}, "inertia": 0.01,
}  # fmt: skip
LENGTH, HEIGHT, WIDTH, MODULUS, DENSITY, WEIGHT = 0.1, 0.002, 0.01, 70e9, 2700.0, 9.81
STIFF, LINE = MODULUS * WIDTH * HEIGHT**3 / 12.0, DENSITY * WIDTH * HEIGHT
BEAM = {
    "kind": "beam", "name": "beam", "center": [LENGTH / 2, 0.0], "length": LENGTH,
    "height": HEIGHT, "width": WIDTH, "theory": "euler_bernoulli", "elements": 8,
    "density": DENSITY, "youngs_modulus": MODULUS, "poisson_ratio": 0.0,
    "supports": [{"end": "first", "kind": "clamped"}],
}  # fmt: skip


def scene(body, duration, dt, mass=None, **more):
    masses = [{"name": "m", "body": body["name"]} | each for each in mass or ()]
    return Scene.from_dict(
        {
            "title": "masses", "duration": duration, "body": [body], "point_mass": masses,
            "solve": {"dt": dt, "estimate": False, "method": "conserving"},
            "output": {"fields": []},
        } | more
    )  # fmt: skip


def drift(values):
    return np.abs(values - values[0]).max()


def test_cantilever_with_a_tip_mass_has_its_frequency_and_sag():
    share = 0.5
    mass = share * LINE * LENGTH

    def off(a):  # Euler and Bernoulli
        bent = np.cos(a) * np.sinh(a) - np.sin(a) * np.cosh(a)
        return 1.0 + np.cos(a) * np.cosh(a) + share * a * bent

    rate = brentq(off, 0.5, 1.875) ** 2 * np.sqrt(STIFF / LINE) / LENGTH**2
    period, tip = 2.0 * np.pi / rate, [{"point": [LENGTH, 0.0], "mass": mass}]
    keys = {"gravity": [0.0, -WEIGHT], "solve": {"dt": period / 250, "estimate": False}}
    history = solve(scene(BEAM, 2 * period, None, tip, **keys)).history
    time, y = history["time"].values, history["m.y"].values

    def misfit(p):
        return p[0] + p[1] * np.cos(p[2] * time) + p[3] * np.sin(p[2] * time) - y

    size = np.abs(y).max()
    found = least_squares(
        misfit, [-size / 2, size / 2, rate, 0.0], x_scale=[size, size, rate, size]
    )
    # The midpoint rule is slow by (rate dt)^2 / 12, 5e-5 here.
    assert found.x[2] * (1.0 + (rate * period / 250) ** 2 / 12.0) == pytest.approx(rate, rel=1e-4)
    assert drift(history["total_energy"].values) < 1e-9 * history["kinetic_energy"].values.max()
    history = solve(scene(BEAM, period / 250, None, tip, start="static", **keys)).history
    sag = WEIGHT * (mass * LENGTH**3 / 3.0 + LINE * LENGTH**4 / 8.0) / STIFF
    np.testing.assert_allclose(history["m.y"].values, -sag, rtol=1e-9)
    np.testing.assert_allclose(history["m.force"].values, mass * WEIGHT, rtol=1e-8)


def test_a_mass_at_rest_on_a_small_cantilever_is_trusted():
    """It does not move: that its joint is open by 1e-24 m is no share of its way."""
    small = BEAM | {"length": 1e-4, "height": 2e-6, "width": 1e-5, "center": [5e-5, 0.0]}
    masses = [{"point": [1e-4, 0.0], "mass": 1e-9}]
    more = {"start": "static", "gravity": [0.0, -WEIGHT], "solve": {"estimate": False},
            "probe": [{"name": "tip", "body": "beam", "point": [1e-4, 0.0]}]}  # fmt: skip
    result = solve(scene(small, 1e-5, None, masses, **more))
    assert "joint_open" not in str(result.summary["verdict"])
    inertia = 1e-5 * 2e-6**3 / 12.0
    by_mass, by_own = 1e-9 / 3.0, DENSITY * 1e-5 * 2e-6 * 1e-4 / 8.0
    sag = WEIGHT * (by_mass + by_own) * 1e-4**3 / (MODULUS * inertia)
    np.testing.assert_allclose(result.history["tip.uy"].values, -sag, rtol=1e-6)


def test_rigid_body_with_a_mass_is_the_body_of_both():
    arm, mass = np.array([0.1, 0.05]), 0.5
    whole, spin = 2.0 + mass, BOX["angular_velocity"]
    middle = mass / whole * arm
    speed = np.array(BOX["velocity"]) + spin * np.array([-middle[1], middle[0]])
    both = BOX | {
        "mass": whole, "center_of_mass": middle.tolist(), "velocity": speed.tolist(),
        "inertia": 0.01 + 2.0 * mass / whole * float(arm @ arm),
    }  # fmt: skip
    keys = {"gravity": [0.0, -WEIGHT]}
    one = solve(scene(BOX, 0.5, 5e-3, [{"point": arm.tolist(), "mass": mass}], **keys)).history
    other = solve(scene(both, 0.5, 5e-3, **keys)).history
    for name in ("momentum.y", "angular_momentum", "kinetic_energy"):
        size = np.abs(other[name].values).max()
        np.testing.assert_allclose(one[name].values, other[name].values, atol=1e-10 * size)
    # Joints take turns by Cayley's rotations: slow by (spin dt)^2 / 12.
    slow = (spin * 5e-3) ** 2 / 12.0
    np.testing.assert_allclose(one["box.angle"].values, other["box.angle"].values, rtol=1.1 * slow)


@pytest.mark.parametrize("place", [{"surface": "top"}, {"point": [0.03, 0.03]}])
def test_solid_that_carries_a_mass_strikes_with_both(place):
    made = scene(BLOCK, 3e-3, 3e-5, [place | {"mass": 3.0}], obstacle=[FLOOR])
    result = solve(made)
    history, energy = result.history, result.history["total_energy"].values
    assert history["momentum.x"].values[0] == pytest.approx((5.0 + 3.0) * 0.1, rel=1e-12)
    assert energy[0] == pytest.approx(0.5 * 8.0 * 1.01, rel=1e-12)
    assert drift(energy) < 1e-10 * energy[0]
    gained = history["momentum.y"].values[-1] - history["momentum.y"].values[0]
    assert gained == pytest.approx(result.summary["contact"]["impulse"], rel=1e-10)
    # It touches nothing, and asks for no law of impact.
    assert {each["code"] for each in result.summary["verdict"]["findings"]} <= {"no_estimate"}


def test_scene_says_masses_once():
    given = scene(BLOCK, 1e-3, 1e-4, [{"surface": "top", "mass": 3.0}])
    assert [body.name for body in given.bodies] == ["block", "m"]
    assert [len(given.to_dict()[name]) for name in ("body", "point_mass", "joint")] == [1, 1, 0]
    assert Scene.from_dict(given.to_dict()) == given
    assert given.bodies[1].position == (0.05, 0.05 + 1e-4)


@pytest.mark.parallel([1, 2])
def test_restart_equals_the_whole_run(tmp_path, monkeypatch):
    keys = {"obstacle": [FLOOR], "output": {"fields": [], "checkpoint": 4}}
    made = scene(BLOCK, 6e-4, 3e-5, [{"surface": "top", "mass": 3.0}], **keys)
    check_restart(made, 11, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    masses = [{"surface": "top", "mass": 3.0}, {"name": "n", "point": [0.03, 0.03], "mass": 1.0}]
    check_ranks(lambda: scene(BLOCK, 6e-4, 3e-5, masses, obstacle=[FLOOR]), monkeypatch)


@pytest.mark.parametrize(
    ("body", "mass", "words"),
    [
        (BLOCK, {"body": "blok", "point": [0.0, 0.0]}, 'did you mean "block"'),
        (BLOCK, {}, "point is missing, and so is surface"),
        (BLOCK, {"point": [1.0, 1.0]}, r"point = \[1\.0, 1\.0\] is outside of block"),
        (BLOCK, {"point": [0.0, 0.0, 0.0]}, "has 3 numbers"),
        (BLOCK, {"surface": "tip"}, "middle of block/tip is not known"),
        (BLOCK, {"surface": "top", "name": "block"}, "something else"),
        (BLOCK, {"surface": "top", "mass": 0.0}, "must be > 0"),
        (BOX, {"surface": "top"}, "give point instead"),
    ],
)
def test_bad_masses_are_refused(body, mass, words):
    with pytest.raises(SceneError, match=r"point_mass\[0\].*" + words):
        plan(scene(body, 1e-3, 1e-4, [{"mass": 1.0} | mass]))
