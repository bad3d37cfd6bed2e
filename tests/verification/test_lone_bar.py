"""A bar that meets nothing vibrates as its modes say."""

import numpy as np
import pytest

import impactfem
from impactfem.scene import Scene


@pytest.mark.parametrize("method", ["exact", "galerkin", "conserving"])
@pytest.mark.parametrize(("far_end", "wave"), [("free", 1.0), ("clamped", 0.5)])
def test_a_mode_of_a_bar_without_a_wall(method, far_end, wave):
    """Of length 3 m and speed 2 m/s: u = a cos(k x) cos(k c t), k = pi/L free, pi/2L clamped."""
    found = impactfem.solve(Scene.from_dict({
        "title": "mode", "duration": 7.0,
        "body": [{"kind": "bar", "name": "bar", "length": 3.0, "density": 2.0, "area": 0.5,
                  "youngs_modulus": 8.0, "far_end": far_end,
                  "displacement": f"0.01*cos({wave}*pi*x/3)"}],
        "probe": [{"name": "near", "body": "bar", "point": [0.75]}],
        "solve": {"method": method}, "output": {"report": False, "pictures": False},
    }))  # fmt: skip
    times = np.asarray(found.history["time"])
    k = wave * np.pi / 3.0
    right = 0.01 * np.cos(0.75 * k) * np.cos(2.0 * k * times)
    wrong = np.abs(np.asarray(found.history["near.ux"]) - right).max() / 0.01
    summary = found.summary
    assert summary["verdict"]["level"] == "trust"
    assert summary["contact"]["intervals"] == []
    assert wrong < summary["error"]["displacement_max"] < 1e-5  # that of the worst node
    assert not [name for name in found.history if name.startswith("force.")]


def test_a_bar_that_only_flies_is_told():
    found = impactfem.solve(Scene.from_dict({
        "title": "thrown", "duration": 1.0,
        "body": [{"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0,
                  "youngs_modulus": 1.0, "velocity": -0.5}],
        "output": {"report": False, "pictures": False},
    }))  # fmt: skip
    (finding,) = found.summary["verdict"]["findings"]
    assert (finding["code"], finding["severity"]) == ("meets_nothing", "warning")
    assert float(found.history["bar.x"][-1]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("time", [0.7, 0.7123])
def test_the_slope_of_a_lone_bar(time):
    """d/dE of u(0, t) = a cos(pi c t) for E = rho = L = 1: -a sin(pi t) pi t/2.

    The first time lies on the end of a piece of the start, where slopes jump: no kink.
    """
    found = impactfem.gradient(Scene.from_dict({
        "title": "slope", "duration": 1.5,
        "body": [{"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0,
                  "youngs_modulus": 1.0, "displacement": "0.01*cos(pi*x)"}],
        "probe": [{"name": "near", "body": "bar", "point": [0.0]}],
        "parameter": [{"name": "E", "key": "body.bar.youngs_modulus", "bounds": [0.5, 2.0]}],
        "measure": [{"name": "u", "of": "near.ux", "value": 0.0, "at": time}],
        "objective": {"minimise": [{"term": "value", "of": "u"}]},
        "solve": {"method": "exact"}, "output": {"report": False, "pictures": False},
    }))  # fmt: skip
    right = -0.01 * np.sin(np.pi * time) * np.pi * time / 2.0
    wrong = abs(found.gradient["E"] - right)
    assert wrong < 3e-3 * abs(right)
    assert wrong < 3.0 * found.error["E"]
    assert found.trusted
