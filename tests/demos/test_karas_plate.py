"""The ball of the demo rebounds from its plate as the modal sum of Karas' problem has it."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "karas_plate"


def test_force_and_rebound_are_those_of_the_modal_sum():
    """On elements twice as large as those of the page, which has errors of 0.1 %."""
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    settings = {"output.fields": [], "duration": 8e-5, "body.plate.mesh_size": 0.005}
    history = impactfem.solve(scene.with_settings(settings), estimate=False).history
    force, dt = history["contact_force"].values, history["time"].values[1]
    assert force.max() == pytest.approx(1379.64, rel=1e-2)
    assert dt * (np.argmax(force) - 0.5) == pytest.approx(32.730e-6, abs=dt)
    assert dt * (np.flatnonzero(force)[-1]) == pytest.approx(73.040e-6, abs=2.0 * dt)
    assert history["ball.vz"].values[-1] == pytest.approx(0.66415, rel=5e-3)
