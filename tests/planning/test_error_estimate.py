"""Differences of two runs, against closed forms."""

import numpy as np
import pytest
from solid_scenes import solid_scene

from impactfem.planning import plan
from impactfem.runs.error_estimate import Track, difference, resized


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
    coarse = resized(scene, 2.0, plan(scene).degree)
    assert coarse.solid.mesh_size == 0.25
    assert coarse.solid.refine[0].size == 0.02
    assert coarse.solid.degree == 1
    assert coarse.solve.dt is None
