"""Moving obstacles and supports against the same scene seen from them."""

import numpy as np
import pytest
from solid_blocks import METHODS, floor, rates, solid_scene

import impactfem

BLOCK = {
    "shape": {"kind": "block", "size": [0.5, 1.0], "corner": [-0.25, 0.02]},
    "mesh_size": 0.125,
    "poisson_ratio": 0.3,
}
# Rounding is amplified where the scheme gains energy: newmark, 100-fold here.
TOLERANCE = dict.fromkeys(METHODS, 1e-10) | {"newmark": 1e-2}


def largest(difference, scale):
    return float(np.abs(np.asarray(difference)).max() / np.abs(np.asarray(scale)).max())


@pytest.mark.parametrize("normals", ["fixed", "updated"])
@pytest.mark.parametrize("kind", ["speed", "acceleration"])
@pytest.mark.parametrize("method", METHODS)
def test_a_floor_that_rises_meets_a_body_at_rest_as_one_that_falls(method, kind, normals):
    """Steps are exact for motions up to the second degree, so that frames agree to rounding."""
    solve = {"method": method, "normals": normals, "dt": 0.02}
    given, gravity, motion = {"velocity": [0.0, -0.15]}, None, "0.15*t"
    if kind == "acceleration":
        given, gravity, motion = {}, [0.0, -0.2], "0.1*t**2"
    falls = impactfem.solve(
        solid_scene(BLOCK | given, [floor(2)], duration=2.0, gravity=gravity, **solve)
    )
    rises = impactfem.solve(
        solid_scene(BLOCK, [floor(2, motion=["0", motion])], duration=2.0, **solve)
    )
    one, other = falls.history, rises.history
    shift = {"speed": 0.15 * one["time"], "acceleration": 0.1 * one["time"] ** 2}[kind]
    tolerance = TOLERANCE[method]
    assert one["contact_force"].max() > 0.01
    assert largest(one["contact_force"] - other["contact_force"], one["contact_force"]) <= tolerance
    assert np.abs(one["gap"] - other["gap"]).max() <= tolerance
    assert np.abs(one["body.y"] + shift - other["body.y"]).max() <= tolerance
    if method == "conserving":  # the obstacle's work is counted as the scheme does it
        assert rises.summary["energy"]["max_relative_drift"] <= 1e-9
    if method == "explicit":
        # Row 0 apart, which lies half a layer from row 1: of order dt^2.
        energy = other["total_energy"].values[1:]
        assert np.ptp(energy) <= 1e-9 * other["kinetic_energy"].max()


@pytest.mark.parametrize("method", ["massless", "conserving", "explicit"])
def test_other_motions_agree_to_the_second_order(method):
    """Against gravity whose steps have the mean of the acceleration 0.3 sin(t)."""
    pieces = np.linspace(0.0, 2.0, 201)  # explicit layers take means over half steps, too
    means = 0.3 * np.diff(np.cos(pieces)) / np.diff(pieces)
    gravity = [[float(t), [0.0, float(g)]] for t, g in zip(pieces, means, strict=False)]
    found = []
    for dt in (0.08, 0.02):
        solve = {"method": method, "dt": dt}
        one = solid_scene(BLOCK, [floor(2)], duration=2.0, gravity=gravity, **solve)
        other = solid_scene(
            BLOCK, [floor(2, motion=["0", "0.3*(t - sin(t))"])], duration=2.0, **solve
        )
        one, other = impactfem.solve(one).history, impactfem.solve(other).history
        shift = 0.3 * (one["time"] - np.sin(one["time"]))
        found.append(float(np.abs(one["body.y"] + shift - other["body.y"]).max()))
    assert found[-1] <= 1e-5
    assert 0.5 * rates(np.array(found)).min() >= 1.8  # over two halvings


@pytest.mark.parametrize("method", METHODS)
def test_a_clamped_block_driven_down_as_a_floor_that_rises(method):
    """Impact of a clamped block: its top is held, or goes down with all of it."""
    solve = {"method": method, "dt": 0.02}
    driven = {"surface": "top", "kind": "motion", "value": ["0", "-0.15*t"]}
    falling = BLOCK | {"velocity": [0.0, -0.15], "supports": [driven]}
    moved = impactfem.solve(solid_scene(falling, [floor(2)], duration=2.0, **solve))
    clamped = BLOCK | {"supports": [{"surface": "top", "kind": "fixed"}]}
    rising = floor(2, motion=["0", "0.15*t"])
    held = impactfem.solve(solid_scene(clamped, [rising], duration=2.0, **solve))
    one, other = moved.history, held.history
    tolerance = TOLERANCE[method]
    assert one["contact_force"].max() > 0.05
    assert largest(one["contact_force"] - other["contact_force"], one["contact_force"]) <= tolerance
    assert np.abs(one["gap"] - other["gap"]).max() <= tolerance
    for result in (moved, held):
        if method in ("conserving", "explicit"):
            assert result.summary["energy"]["max_relative_drift"] <= 1e-11
        elif method != "newmark":
            assert result.summary["energy"]["max_relative_growth"] <= 1e-11


@pytest.mark.parametrize("method", ["massless", "explicit"])
def test_a_supported_block_slides_down_its_guide_as_half_of_a_symmetric_one(method):
    """A support that lets one side slide is the plane of symmetry of a block twice as wide."""
    half = BLOCK | {
        "shape": {"kind": "block", "size": [0.25, 1.0], "corner": [0.0, 0.02]},
        "supports": [{"surface": "left", "kind": "symmetry"}],
        "velocity": [0.0, -0.15],
    }
    solve = {"method": method, "dt": 0.02}
    one = impactfem.solve(solid_scene(half, [floor(2)], duration=2.0, **solve)).history
    whole = BLOCK | {"velocity": [0.0, -0.15]}
    other = impactfem.solve(solid_scene(whole, [floor(2)], duration=2.0, **solve)).history
    assert other["contact_force"].max() > 0.05
    assert largest(one["contact_force"] - other["contact_force"], other["contact_force"]) < 1e-10
    assert np.abs(one["gap"] - other["gap"]).max() <= 1e-12
    assert np.abs(one["body.y"] - other["body.y"]).max() <= 1e-12
