"""The demo of friction: its scene is the shipped one, slides and tips as its page says."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import impactfem
from impactfem.shipped import shipped_scenes

DEMO = Path(__file__).resolve().parents[2] / "demos/sliding_block"
PAGE = (DEMO / "README.md").read_text(encoding="utf-8")


def test_scene_of_the_demo_is_the_shipped_one():
    mine = (DEMO / "scene.toml").read_text(encoding="utf-8")
    assert mine == shipped_scenes()["sliding_block"].read_text(encoding="utf-8")


@pytest.mark.slow
def test_block_slides_upright_and_stops():
    scene = impactfem.Scene.from_toml(shipped_scenes()["sliding_block"])
    result = impactfem.solve(scene.with_settings({"output.fields": []}))
    history = result.history
    way = history["block.x"].values - history["block.x"].values[0]
    assert way[-1] == pytest.approx(0.25**2 / (2.0 * 0.3 * 9.81), rel=0.01)
    (said,) = re.findall(r"stops after ([\d.]+) mm", PAGE)
    assert 1e3 * way[-1] == pytest.approx(float(said), abs=0.05)
    # It never tips: its centre stays within the indentation and the vibrations of the weight.
    assert np.ptp(history["block.y"].values) < 2e-5
    # At rest the floor bears the weight.
    weight = 1100.0 * 0.05 * 0.1 * 9.81
    assert history["contact_force"].values[-50:].mean() == pytest.approx(weight, rel=2e-3)
    assert not result.summary["energy"]["grows"]


@pytest.mark.slow
def test_block_tips_with_more_friction():
    script = runpy.run_path(str(DEMO / "script.py"))
    times, tilt = script["tilt"](script["solved"](0.8))
    (said, rigid) = re.findall(r"tips by ([\d.]+) rad", PAGE)
    assert tilt.max() == pytest.approx(float(said), rel=0.02)
    assert script["rigid_tilt"](0.8) == pytest.approx(float(rigid), abs=6e-4)
    assert tilt.max() == pytest.approx(script["rigid_tilt"](0.8), rel=0.15)
    assert 0.04 < times[tilt.argmax()] < 0.06
