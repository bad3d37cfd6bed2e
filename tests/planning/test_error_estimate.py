"""Differences of two runs, against closed forms."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from solid_scenes import solid_scene

import impactfem
from impactfem.reference.bar import Errors
from impactfem.runs.error_estimate import Track, difference, extrapolated, resized

DEMOS = Path(__file__).parents[2] / "demos"


def track(layers, height, force):
    """A parabola of the given height over [0, 1], and a force per layer."""
    times = np.linspace(0.0, 1.0, layers + 1)
    position = np.zeros((layers + 1, 3))
    position[:, 1] = 5.0 + height * 4.0 * times * (1.0 - times)
    return Track(times, position, np.concatenate([[0.0], force(times[1:])]))


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


def test_only_the_time_both_have_counts():
    fine = track(8, 1.0, np.ones_like)
    longer = Track(
        np.append(fine.times, 2.0), np.vstack([fine.position, [[9.0, 9.0, 9.0]]]),
        np.append(fine.force, 100.0),
    )  # fmt: skip
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
    """With e = C h^p; two runs alone would tell .4 of the error of order 1/2."""
    near = 2.0**order - 1.0
    found, note = extrapolated(errors(near, near), errors(near * 2.0**order, near * 2.0**order))
    for told in (found.displacement_max, found.displacement_l2, found.force_l1):
        assert 0.8 <= told <= (3.0 if order <= 2.0 else 10.0)
    assert "from runs on larger elements" in note["message"]


def test_differences_that_do_not_fall_tell_no_error():
    found, note = extrapolated(errors(0.1), errors(0.124))
    assert found is None
    assert "what does not fall by 1.25 tells no error" in note["message"]
    assert extrapolated(errors(0.1), errors(0.126))[0] is not None
    assert extrapolated(errors(0.1), errors(math.nan))[0] is None
    same, _ = extrapolated(errors(1e-14), errors(1e-16))  # rounding
    assert same.displacement_max == 1e-14


def test_an_irregular_motion_has_no_error_and_the_verdict_says_why():
    """A square that bounces: on coarse elements each rebound falls otherwise."""
    scene = solid_scene(
        duration=15.0, gravity=[0.0, -0.02], velocity=[0.0, 0.0],
        shape={"kind": "block", "size": [1.0, 1.0], "corner": [-0.5, 0.1]},
        solve={"method": "explicit", "normals": "fixed"},
    )  # fmt: skip
    summary = impactfem.solve(scene).summary
    assert summary["error"] is None
    (found,) = (f for f in summary["verdict"]["findings"] if f["code"] == "no_estimate")
    assert found["severity"] == "warning"
    assert "what does not fall by 1.25 tells no error" in found["text"]


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
    rows = {"time": times, "contact_force": np.zeros(5)} | still

    def table(**columns):
        return {name: SimpleNamespace(values=values) for name, values in (rows | columns).items()}

    # A rod of length 2 about its middle, at .3 and .4 rad in the end: 2 r sin(half of it).
    rod = {"a": {"mass": 3.0, "inertia": 1.0}}
    tracks = [
        Track.of_history(table(**{"a.angle": end * times}), ["a"], None, rod) for end in (0.3, 0.4)
    ]
    found = difference(*tracks, "")
    assert found.displacement_max == pytest.approx(math.sin(0.05) / math.sin(0.15), rel=1e-12)

    # A ball in space about a diagonal, by the same angles.
    ball = {"a": {"mass": 1.0, "inertia": np.eye(3) * 0.4}}

    def turn(end):
        half = 0.5 * end * times
        axis = {f"a.q{letter}": np.sin(half) / math.sqrt(3.0) for letter in "xyz"}
        return table(**axis, **{"a.qw": np.cos(half)})

    tracks = [Track.of_history(turn(end), ["a"], None, ball) for end in (0.3, 0.4)]
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
