"""The superball of the demo comes back from under the table, as Garwin has it."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "superball"


def test_three_bounces_throw_it_back():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    history = impactfem.solve(scene.with_settings({"output.fields": []}), estimate=False).history
    along = history["ball.vx"].values
    struck = np.flatnonzero(np.abs(np.diff(along)) > 1e-9)
    # A ball with inertia 2/5 m R^2: floor, ceiling, floor (Garwin, Am. J. Phys. 37 (1969) 88-92).
    assert along[struck + 1] / along[0] == pytest.approx([3 / 7, -31 / 49, -333 / 343], abs=1e-12)
    assert history["ball.x"].values[-1] < history["ball.x"].values[0]
    energy = history["total_energy"].values
    assert np.abs(energy - energy[0]).max() < 1e-11 * energy[0]
