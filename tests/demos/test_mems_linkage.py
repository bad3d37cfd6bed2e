"""The switch of the demo is pressed as a beam on a stop would be, by the lever of its motor."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "mems_linkage"
LENGTH, HEIGHT, WIDTH, MODULUS, PLACE, ROOM = 200e-6, 4e-6, 20e-6, 160e9, 150e-6, 1.5e-6
CRANK, ROD, TORQUE = 10e-6, 60e-6, 3e-10


@pytest.mark.slow
def test_lasting_forces_are_those_of_the_lever_and_of_beam_theory():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    settings = {"output.fields": [], "duration": 40e-6}
    history = impactfem.solve(scene.with_settings(settings), estimate=False).history
    at = int(np.argmin(np.abs(history["time"].values - 39e-6)))
    angle, eye, pad = (
        float(history[name].values[at]) for name in ("shaft.q", "eye.force", "contact_force")
    )
    pin = CRANK * np.array([np.cos(angle), np.sin(angle)])
    lean = (CRANK - pin[0]) / ROD
    pulled = TORQUE / (pin[0] * np.sqrt(1.0 - lean**2) - pin[1] * lean)
    assert eye == pytest.approx(pulled, rel=1e-3)
    stiffness = MODULUS * WIDTH * HEIGHT**3 / 12.0
    sunk = pulled * PLACE**2 * (3.0 * LENGTH - PLACE) / (6.0 * stiffness)
    pressed = (sunk - ROOM) * 3.0 * stiffness / PLACE**3
    assert pad == pytest.approx(pressed, rel=1e-2)
    page = (DEMO / "README.md").read_text(encoding="utf-8")
    for force, told in ((eye, 30.94), (pulled, 30.94), (pad, 23.64), (pressed, 23.65)):
        assert force * 1e6 == pytest.approx(told, rel=2e-3)  # on any mesh
        assert f"{told} µN" in page
