"""Bodies of any kinds in one march: points, rods, beams and solids, obstacles, friction."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from moving_scenes import check_restart

import impactfem
from impactfem import SceneError

BODIES = {
    "point": {"kind": "point", "mass": 0.5, "radius": 0.02},
    "rod": {"kind": "rod", "mass": 0.5, "length": 0.2, "radius": 0.01, "inclination": 0.2},
    "beam": {
        "kind": "beam", "length": 0.2, "height": 0.01, "width": 1.0, "density": 500.0,
        "youngs_modulus": 1e8, "elements": 4, "inclination": 0.02,
    },
    "solid": {
        "kind": "solid", "model": "plane_strain", "density": 500.0, "youngs_modulus": 1e7,
        "poisson_ratio": 0.3, "mesh_size": 0.025, "contact_surfaces": None,
    },
}  # fmt: skip
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}


def body(kind, name, height, speed):
    """A body whose lowest place is about at a height, that moves upwards with a speed."""
    found = {"name": name, **BODIES[kind], "velocity": [0.0, speed]}
    found.pop("contact_surfaces", None)
    if kind == "solid":
        corner = [-0.05, height - 0.025]
        found["shape"] = {"kind": "block", "size": [0.1, 0.05], "corner": corner}
    else:
        found["position" if kind == "point" else "center"] = [0.01, height]
    return found


def mixed(bodies, duration, obstacles=(), contacts=(), gravity=(0.0, 0.0), **solve):
    return impactfem.Scene.from_dict(
        {
            "title": "mixed",
            "duration": duration,
            "gravity": list(gravity),
            "body": bodies,
            "obstacle": list(obstacles),
            "contact": list(contacts),
            "solve": {"estimate": False} | solve,
            "output": {"fields": []},
        }
    )


def momentum(result):
    """Linear momentum by the masses and velocities of the columns [kg m/s], (rows, 2)."""
    found = 0.0
    for name, figures in result.summary["bodies"].items():
        columns = [result.history[f"{name}.v{axis}"].values for axis in "xy"]
        found = found + figures["mass"] * np.stack(columns, axis=1)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("one", "two"), list(combinations_with_replacement(BODIES, 2)))
def test_every_pair_of_kinds_keeps_momentum_and_gains_no_energy(one, two):
    bodies = [body(one, "low", 0.0, 0.0), body(two, "high", 0.08, -2.0)]
    contacts = [{"between": ["low", "high"], "restitution": 0.0 if "solid" in {one, two} else 0.5}]
    result = impactfem.solve(mixed(bodies, 0.05, contacts=contacts, dt=5e-5))
    given = momentum(result)
    assert np.abs(given - given[0]).max() <= 1e-12 * np.abs(given).max() * len(given)
    struck = result.summary["contact"]["impulse"]
    assert struck > 0.1 * np.abs(given).max()
    energy = result.history["total_energy"].values
    # On solids closest places slide over faces: right to first order, as for pairs that follow.
    assert energy.max() <= energy[0] * (1.0 + (5e-4 if "solid" in {one, two} else 1e-12))


@pytest.mark.parametrize("mu", [0.3, 5.0])
def test_the_force_on_an_end_that_turns_where_it_stays_is_smooth(mu):
    """After the impact of a rod that spins, its end slides or sticks, whatever the step."""

    def roughness(step):
        rod = body("rod", "rod", 0.0, -0.5) | {"inclination": 0.6, "angular_velocity": 3.0}
        rod["center"] = [0.0, 0.1 * np.sin(0.6) + 0.0101]
        law = [{"between": ["rod", "floor"], "friction_coefficient": mu}]
        result = impactfem.solve(mixed([rod], 0.03, [FLOOR], law, (0.0, -9.81), dt=step))
        force, energy = (result.history[name].values for name in ("contact_force", "total_energy"))
        resting = np.flatnonzero(force > 0.0)[2:]
        assert len(resting) > 50
        return np.abs(np.diff(force[resting], 2)).max() / force.max(), np.diff(energy).max()

    (coarse, _), (fine, gained) = roughness(2e-4), roughness(1e-4)
    assert coarse < 0.01  # 0.3 whatever the step, with speeds by the place amid the layer
    assert fine < 0.9 * coarse
    assert gained < 1e-9


def test_a_body_beside_a_cut_one_is_told_as_it_is_computed():
    """A plane cuts the block, not the point: nothing may be told twice."""
    block = body("solid", "block", 0.0, 0.0)
    block["shape"] = {"kind": "block", "size": [0.1, 0.05], "corner": [0.0, 0.0]}
    block["supports"] = [{"surface": "left", "kind": "symmetry"}]
    point = body("point", "point", 0.08, -2.0)
    given = mixed([block, point], 0.01, dt=5e-5)
    (finding,) = [f for f in impactfem.plan(given).findings if "not cut" in f.text]
    assert finding.severity == "warning"
    result = impactfem.solve(given)
    assert result.history["kinetic_energy"].values[0] == pytest.approx(0.5 * 0.5 * 2.0**2)
    assert result.history["momentum.y"].values[0] == pytest.approx(-0.5 * 2.0)
    whole = impactfem.plan(mixed([{**block, "supports": []}, point], 0.01, dt=5e-5))
    assert not [f for f in whole.findings if "not cut" in f.text]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["point", "rod"])
def test_a_sliding_body_stops_where_coulomb_says(kind):
    """Way v0^2 / (2 mu g) and time v0 / (mu g): the step divides it, so that both are exact."""
    mu, g, speed = 0.25, 10.0, 2.0
    moving = {"kind": kind, "name": "body", "mass": 3.0, "velocity": [speed, 0.0]}
    if kind == "point":
        moving["position"] = [0.0, 0.0]
    else:
        moving |= {"length": 0.5, "radius": 0.0, "center": [0.0, 0.0]}
    contacts = [{"between": ["body", "floor"], "friction_coefficient": mu}]
    result = impactfem.solve(mixed([moving], 1.0, [FLOOR], contacts, (0.0, -g), dt=1e-3))
    x, v = result.history["body.x"].values, result.history["body.vx"].values
    time = result.history["time"].values
    assert x[-1] == pytest.approx(speed**2 / (2.0 * mu * g), rel=1e-9)
    assert time[np.flatnonzero(v > 1e-12)[-1] + 1] == pytest.approx(speed / (mu * g), rel=1e-9)
    assert result.summary["energy"]["taken"]["friction"] == pytest.approx(6.0, rel=1e-9)
    assert abs(result.summary["energy"]["unexplained"]) <= 1e-12
    assert result.summary["contact"]["max_force"] == pytest.approx(30.0, rel=1e-9)
    codes = [found["code"] for found in result.summary["verdict"]["findings"]]
    # How a rod shares friction among its ends nobody can say.
    assert codes == ["no_estimate"] + ["overconstrained"] * (kind == "rod")
    assert result.summary["contact"]["intervals"] == [[0.0, pytest.approx(1.0, rel=1e-9)]]


@pytest.mark.parametrize(("slope", "moves"), [(0.2, False), (0.4, True)])
def test_a_point_on_a_slope_sticks_or_slides(slope, moves):
    normal = [-np.sin(slope), np.cos(slope)]
    plane = FLOOR | {"normal": normal}
    mu, g = 0.3, 10.0
    point = {"kind": "point", "name": "p", "mass": 1.0, "position": [0.0, 0.0]}
    contacts = [{"between": ["p", "floor"], "friction_coefficient": mu}]
    result = impactfem.solve(mixed([point], 0.5, [plane], contacts, (0.0, -g), dt=1e-3))
    along = np.array([np.cos(slope), np.sin(slope)])
    way = result.history["p.x"].values[-1] * along[0] + result.history["p.y"].values[-1] * along[1]
    wanted = 0.5 * g * (np.sin(slope) - mu * np.cos(slope)) * 0.25 if moves else 0.0
    assert -way == pytest.approx(wanted, rel=1e-9, abs=1e-12)


def test_an_impact_with_friction_follows_moreau():
    """A point that strikes aslant slips all the way, or sticks."""
    for mu, rest in ((0.1, False), (2.0, True)):
        point = {"kind": "point", "name": "p", "mass": 2.0, "position": [0.0, 0.1],
                 "velocity": [1.0, -1.0]}  # fmt: skip
        law = {"between": ["p", "floor"], "friction_coefficient": mu, "restitution": 0.5}
        result = impactfem.solve(mixed([point], 0.2, [FLOOR], [law], dt=1e-3))
        assert result.history["p.vy"].values[-1] == pytest.approx(0.5, rel=1e-12)
        wanted = 0.0 if rest else 1.0 - mu * 1.5
        assert result.history["p.vx"].values[-1] == pytest.approx(wanted, abs=1e-12)
        assert result.summary["contact"]["max_impulse"] == pytest.approx(3.0, rel=1e-12)
        assert any(f["code"] == "impact_law" for f in result.summary["verdict"]["findings"])


def test_a_moving_sphere_strikes_a_point():
    """Elastically, a heavy sphere of speed w sends a point at rest away with 2 w."""
    sphere = {"kind": "sphere", "name": "s", "center": [-0.3, 0.0], "radius": 0.2,
              "motion": ["0.5*t", "0"]}  # fmt: skip
    point = {"kind": "point", "name": "p", "mass": 1.0, "radius": 0.05, "position": [0.0, 0.0]}
    law = {"between": ["p", "s"], "restitution": 1.0}
    result = impactfem.solve(mixed([point], 0.3, [sphere], [law], dt=1e-3))
    assert result.history["p.vx"].values[-1] == pytest.approx(1.0, rel=1e-9)
    assert abs(result.summary["energy"]["unexplained"]) <= 1e-9


def test_a_ball_rests_in_a_corner_and_on_a_box():
    """The forces carry the weight; a box has corners, which other methods refuse."""
    box = {"kind": "box", "name": "box", "center": [0.0, 0.0], "size": [1.0, 0.4]}
    wall = {"kind": "half_space", "name": "wall", "point": [-0.3, 0.0], "normal": [1.0, 0.0]}
    ball = {"kind": "point", "name": "ball", "mass": 2.0, "radius": 0.1, "position": [-0.15, 0.35],
            "velocity": [-0.5, 0.0]}  # fmt: skip
    result = impactfem.solve(mixed([ball], 1.5, [box, wall], (), (0.0, -10.0), dt=1e-3))
    assert result.history["contact_force"].values[-1] == pytest.approx(20.0, rel=1e-9)
    assert result.history["ball.y"].values[-1] == pytest.approx(0.3, abs=2e-3)
    assert result.history["ball.x"].values[-1] == pytest.approx(-0.2, abs=1e-3)


@pytest.mark.slow
def test_a_point_in_a_groove_of_a_polyline_stays():
    groove = {"kind": "polyline", "name": "groove", "points": [[-1.0, 1.0], [0.0, 0.0], [1.0, 1.0]]}
    ball = {"kind": "point", "name": "ball", "mass": 1.0, "radius": 0.1, "position": [0.3, 0.8]}
    scene = mixed([ball], 3.0, [groove], (), (0.0, -10.0), dt=2e-3)
    result = impactfem.solve(scene)
    assert result.history["ball.x"].values[-1] == pytest.approx(0.0, abs=5e-3)
    assert result.history["ball.y"].values[-1] == pytest.approx(0.1 * np.sqrt(2.0), abs=5e-3)
    energy = result.history["total_energy"].values
    assert np.diff(energy).max() <= 1e-9 * abs(energy).max()


def test_a_mass_strikes_a_column_as_the_theory_of_bars_says():
    """F = rho c A v exp(-rho c A t / m) until the wave is back (nu = 0, one element wide)."""
    density, modulus, width, length, mass, speed = 1000.0, 1e8, 0.01, 0.5, 5.0, 1.0
    column = {
        "kind": "solid", "name": "column", "model": "plane_strain", "cells": "hexahedron",
        "shape": {"kind": "block", "size": [width, length], "corner": [-0.5 * width, 0.0]},
        "mesh_size": width, "density": density, "youngs_modulus": modulus, "poisson_ratio": 0.0,
        "supports": [{"surface": "bottom", "kind": "fixed"}],
    }  # fmt: skip
    # A little off its middle: there rounding alone decides to which side the column gives way.
    point = {"kind": "point", "name": "m", "mass": mass, "position": [1e-4, length],
             "velocity": [0.0, -speed]}  # fmt: skip
    wave = np.sqrt(modulus / density)
    result = impactfem.solve(mixed([point, column], 1.8 * length / wave, method="conserving"))
    time = result.history["time"].values
    load = density * wave * width * speed
    decay = density * wave * width / mass
    impulse = np.append(0.0, np.cumsum(result.history["contact_force"].values[1:])) * time[1]
    exact = load / decay * (1.0 - np.exp(-decay * time))
    assert np.abs(impulse - exact).max() <= 0.02 * exact[-1]
    # The face tilts under the point, and its normal follows: of first order, not exact (1.1e-5).
    assert abs(result.summary["energy"]["max_relative_drift"]) <= 1.5e-5


@pytest.mark.slow
def test_a_rod_on_a_plane_falls_as_its_own_method_says():
    """The same scene by two ways of the program: friction 0 on a box top, and half spaces."""
    rod = {"kind": "rod", "name": "rod", "mass": 1.0, "length": 0.4, "center": [0.0, 0.3],
           "inclination": 0.5}  # fmt: skip
    box = {"kind": "box", "name": "floor", "center": [0.0, -1.0], "size": [10.0, 2.0]}
    law = [{"between": ["rod", "floor"], "restitution": 0.3}]
    one = impactfem.solve(mixed([rod], 0.5, [box], law, (0.0, -10.0), dt=1e-4))
    other = impactfem.solve(
        mixed([rod], 0.5, [FLOOR], law, (0.0, -10.0), method="event_driven", dt=1e-3)
    )
    y, x = (np.interp(other.history["time"].values, one.history["time"].values,
                      one.history[f"rod.{axis}"].values) for axis in "yx")  # fmt: skip
    assert np.abs(y - other.history["rod.y"].values).max() <= 2e-3
    assert np.abs(x - other.history["rod.x"].values).max() <= 1e-9


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"restitution": 0.5}, "contact\\[0\\].restitution = 0.5.*own elasticity"),
        ({"between": ["p", "nobody"]}, 'there is no "nobody"'),
        ({"between": ["p/top", "s"]}, "no surface"),
    ],
)
def test_contradictions_are_refused(change, text):
    bodies = [body("solid", "s", 0.0, 0.0), body("point", "p", 0.2, 0.0)]
    with pytest.raises(SceneError, match=text):
        mixed(bodies, 0.1, contacts=[{"between": ["p", "s"], **change}])


def test_settings_that_the_march_does_not_know_are_refused():
    bodies = [body("rod", "r", 0.0, 0.0), body("point", "p", 0.2, 0.0)]
    with pytest.raises(SceneError, match=r"event_driven.*does not solve bodies of different kinds"):
        mixed(bodies, 0.1, method="event_driven")
    inside = [body("solid", "s", 0.0, 0.0), body("point", "p", 0.0, 0.0)]
    with pytest.raises(SceneError, match=r"bodies s and p overlap|bodies p and s overlap"):
        impactfem.solve(mixed(inside, 0.1))
    line = [{"kind": "point", "name": "a", "mass": 1.0, "position": [0.0]}]
    law = [{"between": ["a", "floor"], "friction_coefficient": 0.1}]
    with pytest.raises(SceneError, match="on a line nothing slides"):
        mixed(line, 1.0, [FLOOR | {"point": [0.0], "normal": [1.0]}], law, gravity=[0.0])


def test_a_point_load_is_told():
    bodies = [body("solid", "s", 0.0, 0.0), body("point", "p", 0.2, -2.0) | {"radius": 0.0}]
    plan = impactfem.plan(mixed(bodies, 0.1))
    assert any(f.code == "contact_single_node" and "p.s" in f.subject for f in plan.findings)
    large = body("point", "p", 0.3, 0.0) | {"radius": 0.2}
    plan = impactfem.plan(mixed([bodies[0], large], 0.1))
    assert not any(f.code == "contact_single_node" for f in plan.findings)


@pytest.mark.parallel([1, 2])
@pytest.mark.slow
def test_a_continued_run_equals_the_whole_one(tmp_path, monkeypatch):
    """With all kinds of bodies, friction and restitution: to the last bit."""
    bodies = [body("solid", "s", 0.03, 0.0), body("beam", "b", 0.08, -1.0),
              body("rod", "r", 0.12, -2.0), body("point", "p", 0.18, -2.0)]  # fmt: skip
    contacts = [
        {"between": ["s", "floor"], "friction_coefficient": 0.2},
        {"between": ["b", "s"], "friction_coefficient": 0.3},
        {"between": ["r", "b"], "restitution": 0.4, "friction_coefficient": 0.3},
        {"between": ["p", "r"], "restitution": 0.5},
    ]
    scene = mixed(bodies, 0.06, [FLOOR], contacts, (0.3, -9.81), dt=5e-4)
    scene = scene.with_settings({"output.fields": ["vtkhdf"], "output.checkpoint": 16})
    whole, again = check_restart(scene, 52, tmp_path, monkeypatch)
    assert again.summary["energy"] == whole.summary["energy"]
    assert whole.summary["contact"]["impulse"] > 0.0
    if whole.fields is not None:  # on rank 0
        assert set(whole.fields.layout.names) == {"s", "b", "r", "p"}


@pytest.mark.slow
def test_forces_of_pairs_sum_up():
    bodies = [body("rod", "r", 0.05, 0.0), body("point", "p", 0.2, -1.0)]
    scene = mixed(bodies, 0.4, [FLOOR], (), (0.0, -9.81), dt=2e-4)
    history = impactfem.solve(scene).history
    for total, each in (("contact_force", "force"), ("contact_impulse", "impulse")):
        names = [name for name in history if name.startswith(f"{each}.")]
        assert len(names) == 3
        summed = sum(history[name].values for name in names)
        scale = np.abs(history[total].values).max()
        np.testing.assert_allclose(summed, history[total].values, rtol=0, atol=1e-12 * scale)
        assert scale > 0.0
    spin = np.gradient(history["r.angle"].values, history["time"].values)
    assert np.median(np.abs(spin - history["r.spin"].values)) <= 1e-2 * np.abs(spin).max()


def test_probes_of_bodies_without_meshes():
    bodies = [body("rod", "r", 0.05, 1.0), body("point", "p", 0.5, -1.0)]
    probes = [
        {"name": "end", "body": "r", "point": [0.01 + 0.1 * np.cos(0.2), 0.05 + 0.1 * np.sin(0.2)]},
        {"name": "ball", "body": "p", "point": [0.01, 0.5], "quantities": ["velocity"]},
    ]
    data = mixed(bodies, 0.1, dt=1e-3).to_dict()
    history = impactfem.solve(impactfem.Scene.from_dict(data | {"probe": probes})).history
    assert history["end.uy"].values[-1] == pytest.approx(0.1, rel=1e-9)
    assert history["ball.vy"].values == pytest.approx(-1.0, rel=1e-9)
    probes[1]["point"] = [0.5, 0.5]
    scene = impactfem.Scene.from_dict(data | {"probe": probes})
    with pytest.raises(SceneError, match="outside the body"):
        impactfem.solve(scene)


@pytest.mark.parametrize(("spin", "level"), [(0.5, "care"), (8.0, "do_not_trust")])
def test_a_beam_that_turns_is_told(spin, level):
    """Its model is linear about t = 0: .05 rad pass, .8 rad do not."""
    beam = body("beam", "b", 0.5, 0.0) | {"angular_velocity": spin}
    box = {"kind": "box", "name": "box", "center": [0.0, -1.0], "size": [1.0, 1.0]}
    result = impactfem.solve(mixed([beam], 0.1, [box], dt=1e-3))
    assert result.summary["verdict"]["level"] == level
    assert result.summary["bodies"]["b"]["rotation_max"] == pytest.approx(0.1 * spin, rel=1e-6)
    codes = {found["code"] for found in result.summary["verdict"]["findings"]}
    assert ("model_rotation" in codes) == (level == "do_not_trust")


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "restitution", "mu"), [(0.3, 0.6, 0.4), (1.3, 0.0, 0.5)])
def test_a_tumbling_rod_comes_to_rest(tilt, restitution, mu):
    """Lying, both ends rub in one direction: forces along the rod depend on each other."""
    rod = {"kind": "rod", "name": "r", "mass": 1.0, "length": 0.3, "radius": 0.02,
           "center": [0.0, 0.5], "inclination": tilt, "velocity": [0.5, 0.0],
           "angular_velocity": 3.0}  # fmt: skip
    law = {"between": ["r", "floor"], "friction_coefficient": mu, "restitution": restitution}
    result = impactfem.solve(mixed([rod], 2.5, [FLOOR], [law], (0.0, -9.81), dt=2e-3))
    assert result.summary["status"] == "completed"
    assert result.history["contact_force"].values[-1] == pytest.approx(9.81, rel=1e-3)
    assert abs(result.history["r.vx"].values[-1]) + abs(result.history["r.spin"].values[-1]) < 1e-3
    energy = result.history["total_energy"].values
    assert np.diff(energy).max() <= 1e-5 * abs(energy).max()


@pytest.mark.parametrize(("x", "told"), [(0.45, True), (0.0, False)])
def test_a_corner_that_passes_through_a_rod_is_told(x, told):
    """Only the ends of a rod touch obstacles: it falls across the corner of a box, or flat."""
    rod = {"kind": "rod", "name": "r", "mass": 1.0, "length": 0.4, "radius": 0.01,
           "center": [x, 0.25]}  # fmt: skip
    box = {"kind": "box", "name": "box", "center": [0.0, 0.0], "size": [1.0, 0.2]}
    result = impactfem.solve(mixed([rod], 0.4, [box], (), (0.0, -9.81), dt=1e-3))
    found = [f for f in result.summary["verdict"]["findings"] if "axis of r" in f["text"]]
    assert bool(found) == told
    assert result.summary["verdict"]["level"] == ("do_not_trust" if told else "care")


@pytest.mark.parametrize(("dt", "told"), [(4e-3, True), (2e-4, False)])
def test_steps_longer_than_a_thickness_are_told(dt, told):
    bodies = [body("rod", "r", 0.0, 0.0), body("point", "p", 0.3, -10.0)]
    result = impactfem.solve(mixed(bodies, 0.04, dt=dt))
    codes = [found["code"] for found in result.summary["verdict"]["findings"]]
    assert ("contact_unresolved" in codes) == told
