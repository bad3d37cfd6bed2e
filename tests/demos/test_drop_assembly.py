"""The board of the dropped assembly feels what its page says; momentum is what the floor gave."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import impactfem
from impactfem.report.marks import Marks
from impactfem.report.skin import Skin

DEMO = Path(__file__).resolve().parents[2] / "demos" / "drop_assembly"


@pytest.mark.slow
def test_the_board_feels_what_the_page_says():
    spec = importlib.util.spec_from_file_location("drop_assembly", DEMO / "script.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    result = impactfem.solve(impactfem.Scene.from_toml(DEMO / "scene.toml"), estimate=False)
    history = result.history
    assert np.abs(history["middle.ay"].values).max() / 9.81 == pytest.approx(2540.0, rel=0.03)
    found = result.spectrum("middle.ay", q=10.0)
    shock = np.asarray(found.shock)[np.asarray(found.shock_frequencies) <= script.PASSED]
    assert shock.max() / 9.81 == pytest.approx(5109.0, rel=0.04)
    assert np.abs(script.strain(result)).max() == pytest.approx(1.549e-3, rel=0.04)
    # Ties and joints pass on all of it: floor and gravity alone change the momentum.
    momentum = np.stack([history["momentum.x"].values, history["momentum.y"].values], axis=1)
    mass = np.hypot(*momentum[0]) / np.sqrt(2.0 * 9.81)
    given = (history["force.housing.floor"].values[1:] * np.diff(history["time"].values)).sum()
    change = (momentum[-1] - momentum[0]) @ np.array([0.02, 0.9998])
    assert change == pytest.approx(given - mass * 9.81 * 0.002, rel=1e-5)
    # A joint on a surface of a solid is drawn where its surface has gone.
    skin = Skin.of(result.fields)
    pins = Marks.of(result.scene, skin).pins
    assert len(pins) == 2
    last = skin.snapshot(len(result.fields) - 1)
    for pin in pins:
        assert pin.at(last)[1] - pin.at(skin.snapshot(0))[1] > 1e-3
