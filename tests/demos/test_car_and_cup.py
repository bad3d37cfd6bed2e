"""The car of the demo climbs its step and rolls on; the cup keeps its ball."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMOS = Path(__file__).resolve().parents[2] / "demos"
WHEELS = [f"{end}_{side}" for end in ("front", "rear") for side in ("left", "right")]


def solved(name):
    scene = impactfem.Scene.from_toml(DEMOS / name / "scene.toml")
    return impactfem.solve(scene.with_settings({"output.fields": []}), estimate=False).history


@pytest.mark.slow
def test_the_car_rolls_on_behind_the_step():
    history = solved("car_over_step")
    for wheel in WHEELS:
        assert history[f"{wheel}.z"].values[40] == pytest.approx(0.07, abs=1e-5)
        assert history[f"{wheel}.z"].values[-1] == pytest.approx(0.10, abs=1e-3)
        # Of four wheels without springs three carry, and roll; the fourth hardly touches.
        speed, carries = (history[p].values[-1] for p in (f"{wheel}.vx", f"force.{wheel}.road"))
        rim = 0.07 * history[f"{wheel}.wy"].values[-1]
        assert rim == pytest.approx(speed, rel=1e-6 if carries > 5.0 else 0.05)
    # Of its energy the height is left, and what impacts did not take: the wheels roll.
    energy = 0.5 * 6.0 * speed**2 + 5.0 * 9.81 * 0.03
    assert history["total_energy"].values[-1] == pytest.approx(energy, rel=5e-3)
    assert np.diff(history["total_energy"].values).max() < 1e-3


def test_the_cup_keeps_the_ball():
    history = solved("caught_ball")
    ball, cup = ([history[f"{name}.{axis}"].values for axis in "xyz"] for name in ("ball", "cup"))
    away, late = np.hypot(ball[0] - cup[0], ball[1] - cup[1]), history["time"].values > 0.46
    assert away[late].max() < 0.05 - 0.015
    assert ball[2][late].max() < 0.1
    assert ball[2][late].min() > 0.006 + 0.02 - 2e-4
    assert np.hypot(cup[0], cup[1]).max() < 1e-4
    assert np.diff(history["total_energy"].values).max() < 1e-8
