"""Points and beams that meet nothing: their vibration is that of the closed form."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene

POINT = {"kind": "point", "name": "p", "mass": 2.0, "position": [0.1], "velocity": [0.3]}
BEAM = {
    "kind": "beam", "name": "b", "length": 1.0, "height": 0.01, "width": 0.01, "density": 7800.0,
    "youngs_modulus": 2.1e11, "center": [0.5, 0.0],
    "supports": [{"end": "first", "kind": "clamped"}],
}  # fmt: skip


def alone(body, duration, **more):
    return Scene.from_dict({"title": "free", "duration": duration, "body": [body], **more})


def test_an_oscillator_needs_no_stop():
    scene = alone(POINT | {"force": ["-8*x"]}, 5.0)
    result = impactfem.solve(scene)
    time = result.history["time"].values
    exact = 0.1 * np.cos(2.0 * time) + 0.15 * np.sin(2.0 * time)
    assert np.abs(result.history["p.x"].values - exact).max() < 1e-5
    assert "meets_nothing" not in [finding.code for finding in impactfem.plan(scene).findings]


def test_a_cantilever_under_sudden_weight_vibrates_at_its_first_frequency():
    scene = alone(BEAM, 0.5, gravity=[0.0, -9.81], solve={"dt": 1e-4, "estimate": False})
    time, height = (impactfem.solve(scene).history[name].values for name in ("time", "b.y"))
    frequency = 1.875104068711961**2 * np.sqrt(2.1e11 * 0.01**2 / 12.0 / 7800.0)
    lowest = [
        np.dot(time[part], weight := np.maximum(0.95 * height.min() - height[part], 0.0))
        / weight.sum()
        for k in range(4)
        if (part := np.abs(time * frequency / np.pi - (2 * k + 1)) < 0.9).any()
    ]
    assert np.diff(lowest) == pytest.approx(2.0 * np.pi / frequency, rel=0.01)


@pytest.mark.parametrize("body", [POINT, BEAM | {"supports": [], "velocity": [0.0, 1.0]}])
def test_what_only_flies_is_told_to_meet_nothing(body):
    plan = impactfem.plan(alone(body, 1.0))
    assert [finding.code for finding in plan.findings].count("meets_nothing") == 1
    held = impactfem.plan(alone(BEAM, 0.5, gravity=[0.0, -9.81]))
    assert "meets_nothing" not in [finding.code for finding in held.findings]
