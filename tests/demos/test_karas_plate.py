"""The ball of the demo rebounds from its plate as the modal sum of Karas' problem has it."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "karas_plate"


@pytest.mark.slow
def test_force_and_rebound_are_those_of_the_modal_sum():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    settings = {"output.fields": [], "duration": 8e-5}
    history = impactfem.solve(scene.with_settings(settings), estimate=False).history
    force, dt = history["contact_force"].values, history["time"].values[1]
    assert force.max() == pytest.approx(1379.64, rel=2e-3)
    assert dt * (np.argmax(force) - 0.5) == pytest.approx(32.730e-6, abs=dt)
    assert dt * (np.flatnonzero(force)[-1]) == pytest.approx(73.040e-6, abs=dt)
    assert history["ball.vz"].values[-1] == pytest.approx(0.66415, rel=1e-3)
    page = (DEMO / "README.md").read_text(encoding="utf-8")
    assert "rises to 1381 N" in page
    assert f"{history['ball.vz'].values[-1]:.3f} m/s" in page
