"""The table of the demo is chaotic: only what its mean says is held."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "wobbling_table"


@pytest.mark.slow
def test_motions_part_but_carry_the_weight():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    runs = []
    for dt in (1e-3, 5e-4):
        settings = {"output.fields": [], "solve.dt": dt, "duration": 5.0}
        history = impactfem.solve(scene.with_settings(settings), estimate=False).history
        # Momentum: impulses of floor and gravity, from any time to any other.
        force = np.nan_to_num(history["contact_force"].values)
        up = (history["contact_impulse"].values + dt * force)[1:].sum()
        gained = 15.0 * np.ptp(history["table.vz"].values[[0, -1]])
        assert up == pytest.approx(15.0 * 9.81 * 5.0, abs=gained + 1.0)
        rate = np.hypot(history["table.wx"].values, history["table.wy"].values)
        runs.append((np.sqrt((rate**2).mean()), history["table.x"].values[-1]))
    (first, ended), (second, other) = runs
    assert first == pytest.approx(second, rel=0.2)
    assert abs(ended - other) > 1e-3
