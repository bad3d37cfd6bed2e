"""Differences of two runs, against closed forms."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from solid_scenes import solid_scene

import impactfem
from impactfem.reference.bar import Errors
from impactfem.runs.error_estimate import ORDERS, SAFETY, extrapolated, resized
from impactfem.runs.tracks import Track, difference

DEMOS = Path(__file__).parents[2] / "demos"


def track(layers, height, force):
    """A parabola of the given height over [0, 1], and a force per layer."""
    times = np.linspace(0.0, 1.0, layers + 1)
    position = np.zeros((layers + 1, 3))
    position[:, 1] = 5.0 + height * 4.0 * times * (1.0 - times)
    return Track.of_centres(times, position, np.concatenate([[0.0], force(times[1:])]))


def test_of_a_run_with_itself_is_zero():
    one = track(8, 1.0, lambda t: t)
    found = difference(one, one, "itself")
    assert found.reference == "itself"
    assert (found.displacement_max, found.displacement_l2, found.force_l1) == (0.0, 0.0, 0.0)


def test_of_scaled_ways_is_the_scale():
    found = difference(track(8, 1.0, np.ones_like), track(4, 1.25, np.ones_like), "")
    assert found.displacement_max == pytest.approx(0.25, rel=1e-12)
    assert found.displacement_l2 == pytest.approx(0.25, rel=1e-12)
    assert found.force_l1 == pytest.approx(0.0, abs=1e-14)


def test_forces_are_compared_by_their_impulse_in_coarse_layers():
    # 0, 2, 0, 2 has the impulses of 1, 1 in two layers; 1.5, 0.5 differs by .25 + .25 of 1.
    fine = track(4, 1.0, lambda t: np.array([0.0, 2.0, 0.0, 2.0]) + 0.0 * t)
    same = difference(fine, track(2, 1.0, np.ones_like), "")
    assert same.force_l1 == pytest.approx(0.0, abs=1e-14)
    other = difference(fine, track(2, 1.0, lambda t: np.array([1.5, 0.5]) + 0.0 * t), "")
    assert other.force_l1 == pytest.approx(0.5, rel=1e-12)


def test_bodies_that_hardly_move_are_measured_by_others_or_by_their_extent():
    times = np.linspace(0.0, 1.0, 5)

    def pair(small, wrong):
        way = np.zeros((5, 6))
        way[:, 1], way[-1, 4] = times**2, small + wrong
        return Track.of_centres(times, way, np.zeros(5))

    # A tenth of the largest way, which is 3/4 in the frame of the first velocity of 1/4.
    found = difference(pair(1e-3, 0.0), pair(1e-3, 1e-4), "").displacement_max
    assert found == pytest.approx(1e-4 / (0.1 * 0.75), rel=1e-9)
    still = np.full((5, 3), 5.0)
    moved = still.copy()
    moved[-1] += 1e-14  # rounding, over 5 m of coordinates
    tracks = (Track.of_centres(times, each, np.zeros(5)) for each in (still, moved))
    assert 0.0 < difference(*tracks, "").displacement_max < 1e-14


def test_only_the_time_both_have_counts():
    fine = track(8, 1.0, np.ones_like)
    place = np.vstack([fine.parts[0].way, [[9.0, 9.0, 9.0]]])
    longer = Track.of_centres(np.append(fine.times, 2.0), place, np.append(fine.force, 100.0))
    assert difference(fine, longer, "").displacement_max == 0.0


def test_resized_scene_has_all_sizes_scaled():
    ball = {"point": [0.0, 0.0], "radius": 0.1, "size": 0.01}
    scene = solid_scene(refine=[ball], solve={"method": "massless", "dt": 0.01})
    with resized(scene, 2.0) as coarse:
        assert coarse.solid.mesh_size == 0.25
        assert coarse.solid.refine[0].size == 0.02
        assert coarse.solve.dt is None


def errors(displacement, force=0.1):
    return Errors("", displacement, displacement, force)


@pytest.mark.parametrize("order", [0.5, 0.7, 1.0, 1.5, 2.0, 3.0])
def test_errors_of_any_usual_order_are_told_within_half_and_ten_times(order):
    """With e = C h^p; two runs alone would tell .4 of the error of order 1/2.

    Ratios beyond those that are believed count as the last one.
    """
    near = 2.0**order - 1.0
    found, note = extrapolated(errors(near, near), errors(near * 2.0**order, near * 2.0**order))
    for told in (found.displacement_max, found.displacement_l2, found.force_l1):
        assert 0.65 <= told <= (3.0 if order <= 2.0 else 10.0)
        if 2.0**order > ORDERS[1]:
            assert told == pytest.approx(SAFETY * near / (ORDERS[1] - 1.0), rel=1e-12)
    assert "from coarser runs" in note["message"]


def test_runs_that_agree_by_chance_tell_no_small_error():
    """In numbers, so that the limits themselves are held, not only that there are some."""
    found, _ = extrapolated(errors(0.01), errors(1.0, 1.0))
    assert found.displacement_max == pytest.approx(1.25 * 0.01 / 2.0)
    slow, _ = extrapolated(errors(0.01), errors(0.0126))
    assert slow.displacement_max == pytest.approx(1.25 * 0.01 / 0.75)


def test_differences_that_do_not_fall_tell_no_error():
    found, note = extrapolated(errors(0.1), errors(0.124))
    assert found is None
    assert "what does not fall by 1.25 tells no error" in note["message"]
    assert extrapolated(errors(0.1), errors(0.126))[0] is not None
    assert extrapolated(errors(0.1), errors(math.nan))[0] is None
    close, _ = extrapolated(errors(0.03), errors(0.02))  # where all meshes nearly agree
    assert close.displacement_max == pytest.approx(0.06)
    same, _ = extrapolated(errors(1e-14), errors(1e-16))  # rounding
    assert same.displacement_max == 1e-14


@pytest.mark.parametrize("fails", [False, True])
def test_without_an_error_the_verdict_says_why_and_the_run_is_kept(monkeypatch, fails):
    """Where differences do not fall, or a further run ends with an error."""

    def failing(*_):
        raise FloatingPointError("lost")

    if fails:
        monkeypatch.setattr("impactfem.runs.error_estimate.rerun", failing)
    monkeypatch.setattr("impactfem.runs.error_estimate.FALL", 1e9)
    monkeypatch.setattr("impactfem.runs.error_estimate.SMALL", 0.0)
    summary = impactfem.solve(solid_scene(solve={"method": "explicit"})).summary
    assert summary["error"] is None
    assert summary["status"] == "completed"
    (found,) = (f for f in summary["verdict"]["findings"] if f["code"] == "no_estimate")
    assert found["severity"] == "warning"
    why = "twice" if fails else "what does not fall by 1e+09 tells no error"
    assert ("elements 2 times as large: lost" if fails else why) in found["text"]


def turned_by(angle):
    """What turns a vector of the plane."""
    c, s = math.cos(angle), math.sin(angle)
    return lambda v: [c * v[0] - s * v[1], s * v[0] + c * v[1]]


@pytest.mark.slow
def test_claims_do_not_depend_on_who_watches():
    """A block that strikes a corner of a ball, at rest, boosted, turned, shifted and in mm."""

    def claim(boost=(0.0, 0.0), shift=(0.0, 0.0), angle=0.0, metre=1.0):
        turn = turned_by(angle)
        place = lambda x, y: [metre * (a + b) for a, b in zip(turn([x, y]), shift, strict=True)]  # noqa: E731
        speed = lambda *v: [metre * (a + b) for a, b in zip(turn(v), boost, strict=True)]  # noqa: E731
        size = [0.4 * metre, 0.05 * metre]  # turned about its middle
        corner = [a - 0.5 * b for a, b in zip(place(0.2, 0.026), size, strict=True)]
        shape = {"kind": "block", "size": size, "corner": corner, "angle": angle}
        body = {
            "name": "s", "kind": "solid", "model": "plane_strain", "mesh_size": 0.008 * metre,
            "shape": shape, "density": 1000.0 / metre**3,
            "youngs_modulus": 1e6 / metre, "poisson_ratio": 0.3, "velocity": speed(0.0, -0.5),
            "cells": "hexahedron",
        }  # fmt: skip
        ball = {
            "name": "ball", "kind": "cylinder", "point": place(0.2, -0.02), "radius": 0.02 * metre,
            "motion": [f"{v * metre!r}*t" for v in boost],
        }  # fmt: skip
        scene = impactfem.Scene.from_dict({
            "title": "who watches", "duration": 0.02, "body": [body], "obstacle": [ball],
            "probe": [{"name": "q", "body": "s", "point": place(0.4, 0.026)}],
            "solve": {"method": "explicit", "normals": "fixed"}, "output": {"fields": []},
        })  # fmt: skip
        error = impactfem.solve(scene).summary["error"]
        return [error[name] for name in ("displacement_max", "displacement_l2", "force_l1")]

    first = claim()
    assert 0.005 < first[0] < 0.3
    # Before an obstacle that moves other nodes may touch, and have no mass.
    assert claim(boost=(5.0, 0.0)) == pytest.approx(first, rel=0.1)
    for other in ({"shift": (7.0, -3.0)}, {"angle": 0.5 * math.pi}, {"metre": 1e3}):
        assert claim(**other) == pytest.approx(first, rel=0.02), other


def test_deformation_counts_where_centres_rest_or_fly():
    """A ring that a pressure widens: its centre said 2e-15 in flight and 176 % at rest."""
    claims = []
    for speed in (0.0, 1.0):
        body = {
            "name": "d", "kind": "solid", "model": "plane_strain", "density": 1000.0,
            "shape": {"kind": "ring", "inner_radius": 0.05, "radius": 0.1, "center": [0.0, 0.0]},
            "mesh_size": 0.00625, "velocity": [speed, 0.0], "youngs_modulus": 1e6,
            "poisson_ratio": 0.3, "pressures": [{"surface": "inner", "value": "2e5*t"}],
        }  # fmt: skip
        floor = {"name": "lo", "kind": "half_space", "point": [0.0, -9.0], "normal": [0.0, 1.0]}
        scene = impactfem.Scene.from_dict({
            "title": "ring", "duration": 0.01, "body": [body], "obstacle": [floor],
            "probe": [{"name": "q", "body": "d", "point": [0.0501, 0.0]}], "output": {"fields": []},
        })  # fmt: skip
        result = impactfem.solve(scene)
        claims.append(result.summary["error"]["displacement_max"])
    assert claims[1] == pytest.approx(claims[0], rel=1e-6)
    true = 6.9e-3  # against elements of a quarter of the size, by the same measure
    assert 0.5 * true <= claims[0] <= 10.0 * true


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_several_bodies_tell_their_error(friction):
    blocks = [
        {
            "name": name, "kind": "solid", "model": "plane_strain", "mesh_size": 0.05,
            "shape": {"kind": "block", "size": [1.0, 0.4], "corner": [left, 0.0]},
            "cells": "hexahedron", "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.0,
            "velocity": [speed, 0.0],
        }
        for name, left, speed in (("left", 0.0, 0.1), ("right", 1.02, 0.0))
    ]  # fmt: skip
    contact = {"between": ["left", "right"], "friction_coefficient": friction}
    scene = impactfem.Scene.from_dict({
        "title": "blocks", "duration": 3.0, "body": blocks, "contact": [contact],
        "output": {"fields": []},
    })  # fmt: skip
    plan = impactfem.plan(scene)
    result = impactfem.solve(scene)
    assert plan.estimate
    assert result.scene.solve.estimate
    # d'Alembert: one pulse of 1/20 of the modulus, from .2 s to 2.2 s.
    mass, time = 0.4, result.history["time"].values
    gained = 0.02 * np.clip(time - 0.2, 0.0, 2.0) / mass
    way = np.concatenate([[0.0], np.cumsum(0.5 * (gained[1:] + gained[:-1]) * np.diff(time))])
    apart = result.history["right.x"].values - result.history["right.x"].values[0] - way
    true = np.abs(apart).max() * math.sqrt(2.0) / np.hypot(way, 0.1 * time - way).max()
    assert 0.5 <= result.summary["error"]["displacement_max"] / true <= 10.0


def test_turns_count_as_far_as_they_move_the_points_of_a_body():
    times = np.linspace(0.0, 1.0, 5)
    still = {f"a.{axis}": np.zeros(5) for axis in "xyz"}
    still |= {f"a.v{axis}": np.zeros(5) for axis in "xyz"}
    rows = {"time": times, "contact_force": np.zeros(5)} | still
    body = SimpleNamespace(name="a", turns_far=True, supports=())
    gravity = SimpleNamespace(values=[0.0])
    scene = SimpleNamespace(
        bodies=[body], obstacles=[], couplings=(), duration=1.0, gravity=gravity
    )

    def table(**columns):
        return {name: SimpleNamespace(values=values) for name, values in (rows | columns).items()}

    # A rod of length 2 about its middle, at .3 and .4 rad in the end: 2 r sin(half of it).
    rod = {"a": {"mass": 3.0, "inertia": 1.0}}
    tracks = [
        Track.of_history(table(**{"a.angle": end * times}), scene, None, rod) for end in (0.3, 0.4)
    ]
    found = difference(*tracks, "")
    assert found.displacement_max == pytest.approx(math.sin(0.05) / math.sin(0.15), rel=1e-12)

    # A ball in space about a diagonal, by the same angles.
    ball = {"a": {"mass": 1.0, "inertia": np.eye(3) * 0.4}}

    def turn(end):
        half = 0.5 * end * times
        axis = {f"a.q{letter}": np.sin(half) / math.sqrt(3.0) for letter in "xyz"}
        return table(**axis, **{"a.qw": np.cos(half)})

    tracks = [Track.of_history(turn(end), scene, None, ball) for end in (0.3, 0.4)]
    found = difference(*tracks, "")
    assert found.displacement_max == pytest.approx(math.sin(0.05) / math.sin(0.15), rel=1e-12)
    way = np.linalg.norm(tracks[0].way(times), axis=1)[-1]
    # Of a ball with mean square 0.6 of distance, 2/3 of it from the axis.
    assert way == pytest.approx(2.0 * math.sqrt(0.4) * math.sin(0.15), rel=1e-12)


@pytest.mark.slow
def test_the_estimate_of_a_block_that_tumbles_covers_its_error():
    # Elements of 1.25 mm and steps of 5e-5 s end at these places; at 2.5 mm the angle was 2.0881.
    height, angle = 0.14163, 2.0429
    scene = impactfem.Scene.from_toml(DEMOS / "tumbling_block" / "scene.toml")
    result = impactfem.solve(scene.with_settings(["output.fields=[]"]))
    rows, body = result.history, result.summary["bodies"]["block"]
    end = {name: rows[f"block.{name}"].values[-1] for name in ("y", "angle")}
    radius = math.sqrt(body["inertia"] / body["mass"])
    apart = math.hypot(end["y"] - height, 2.0 * radius * math.sin(0.5 * (end["angle"] - angle)))
    way = 0.15  # along the floor at 1 m/s
    told = result.summary["error"]["displacement_max"]
    assert apart / way <= told <= 5.0 * apart / way
