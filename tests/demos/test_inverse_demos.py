"""Demos of identification and optimisation find what they say."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMOS = Path(__file__).resolve().parents[2] / "demos"


@pytest.mark.slow
def test_drag_and_restitution_of_the_thrown_ball():
    found = impactfem.identify(DEMOS / "thrown_ball" / "scene.toml")
    assert found.trusted
    for name, true in (("c", 0.0015), ("e", 0.75)):
        each = found.parameters[name]
        assert abs(each.value - true) < 3.0 * each.sigma
    c, e = found.parameters["c"], found.parameters["e"]
    assert (c.value, e.value) == (pytest.approx(0.00143, rel=2e-3), pytest.approx(0.7478, rel=1e-4))


def test_the_bar_is_caught():
    found = impactfem.optimise(DEMOS / "caught_bar" / "scene.toml")
    pieces = [each["value"] for each in found.parameters.values()]
    np.testing.assert_allclose(pieces, np.repeat([0.25, -0.25], 4), atol=1e-8)
    assert found.objective["initial"] == pytest.approx(0.125, abs=1e-12)
    assert abs(found.objective["final"]) < 1e-16
    assert found.trusted


@pytest.mark.slow
def test_the_front_of_the_heavy_tail():
    found = impactfem.optimise(DEMOS / "heavy_tail" / "scene.toml")
    assert found.objective["initial"] == pytest.approx(0.0464285714, abs=1e-9)
    assert found.objective["final"] < 1e-11
    parts = np.array([each["value"] for each in found.parameters.values()]).reshape(4, 5)
    assert np.ptp(parts, axis=1).max() < 1e-3  # four parts, each as long as the tail
    assert found.constraints[0] <= 1.4 + 1e-8
    assert found.trusted


@pytest.mark.slow
def test_a_strip_lands_softly(tmp_path):
    """The demo's search, with one element and a shorter run."""
    data = impactfem.Scene.from_toml(DEMOS / "soft_landing" / "scene.toml").to_dict()
    times = 4.5e-6 + 1e-7 * np.arange(25)
    rest = np.column_stack([times, np.full_like(times, -1e-6)])
    np.savetxt(tmp_path / "rest.csv", rest, delimiter=",")
    data["body"][0]["elements"], data["duration"] = 1, 7e-6
    data["objective"]["tolerance"] = 1e-2
    data["output"] = {"report": False, "pictures": False, "fields": []}
    found = impactfem.optimise(impactfem.Scene.from_dict(data, base=tmp_path))
    assert found.trusted
    assert found.objective["final"] < 1e-4 * found.objective["initial"]
    off, on = (each["value"] for each in found.parameters.values())
    assert (off, on) == (pytest.approx(2.907e-6, rel=5e-3), pytest.approx(3.861e-6, rel=5e-3))
