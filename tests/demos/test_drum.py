"""The drum of the demo sounds as a membrane does."""

from pathlib import Path

import numpy as np
import pytest
from scipy.special import jn_zeros

import impactfem
from impactfem.system.few_bodies import few_bodies
from impactfem.system.plate_tones import frequencies

DEMO = Path(__file__).resolve().parents[2] / "demos" / "drum"


def test_the_mallet_comes_back_and_the_head_sounds():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    settings = {"output.fields": [], "duration": 0.012, "body.head.mesh_size": 0.02}
    result = impactfem.solve(scene.with_settings(settings), estimate=False)
    history = result.history
    assert 0.6 < history["mallet.vz"].values[-1] / 0.5 < 1.0
    assert not [each for each in result.summary["verdict"]["findings"] if "model" in each["code"]]
    head = next(each for each in few_bodies(scene) if "head" in each.names)
    tones = frequencies(head.stiffness, head.weight, 4) / (2.0 * np.pi)
    speed = np.sqrt(8e6 / 1390.0) / (2.0 * np.pi * 0.15)
    known = np.array([jn_zeros(m, 1)[0] for m in (0, 1, 1, 2)]) * speed
    assert tones == pytest.approx(known, rel=8e-3)
