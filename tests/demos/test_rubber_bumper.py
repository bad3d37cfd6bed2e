"""The rubber bumper rebounds as its page says, and keeps its energy."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "rubber_bumper"


@pytest.mark.slow
def test_the_bumper_rebounds_as_its_page_says():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    coarse = {"body.0.mesh_size": 0.008, "solve.estimate": False, "output.fields": []}
    result = impactfem.solve(scene.with_settings(coarse))
    history, contact = result.history, result.summary["contact"]
    assert np.ptp(history["total_energy"].values) < 1e-9 * history["total_energy"].values[0]
    assert history["bumper.vy"].values[-1] == pytest.approx(3.949, rel=0.03)
    assert history["core.uy"].values.min() == pytest.approx(-5.863e-3, rel=0.03)
    assert contact["impulse"] == pytest.approx(9.369, rel=0.02)
    lost = 4.0**2 - history["bumper.vy"].values[-1] ** 2
    assert 0.0 < lost < 0.08 * 4.0**2
    assert not [f for f in result.summary["verdict"]["findings"] if f["code"] == "unresolved"]
