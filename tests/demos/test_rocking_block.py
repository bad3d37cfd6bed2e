"""The rocking block of the demo loses at each change of corner what Housner says."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "rocking_block"
ALPHA, SQUARE = 0.2, 0.75 * 9.81  # slenderness, 3 g / (4 R)


def quarter(largest):
    """Time from rest at an angle to the upright block [s]."""

    def slowness(x):  # with angle = largest - x^2, which has no singularity
        angle = largest - x * x
        return (
            2.0
            * x
            / np.sqrt(2.0 * SQUARE * (np.cos(ALPHA - largest) - np.cos(ALPHA - angle)) + 1e-300)
        )

    return quad(slowness, 0.0, np.sqrt(largest), limit=200)[0]


@pytest.mark.slow
def test_swings_shorten_as_housner_has_it():
    """Impacts are not located: the error is of first order in the step."""
    kept = (1.0 - 1.5 * np.sin(ALPHA) ** 2) ** 2
    swing, upright = 0.1, [quarter(0.1)]
    for _ in range(2):
        left = np.cos(ALPHA) + kept * (np.cos(ALPHA - swing) - np.cos(ALPHA))
        swing = ALPHA - np.arccos(left)
        upright.append(upright[-1] + 2.0 * quarter(swing))
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    missed = []
    for dt in (1e-3, 5e-4):
        settings = {"output.fields": [], "solve.dt": dt}
        history = impactfem.solve(scene.with_settings(settings), estimate=False).history
        angle, time = history["block.angle"].values, history["time"].values
        crossing = np.flatnonzero(angle[:-1] * angle[1:] < 0.0)
        assert time[crossing[0]] == pytest.approx(upright[0], abs=2.0 * dt)
        assert time[crossing[2]] == pytest.approx(upright[2], abs=15.0 * dt)
        second = np.abs(angle[crossing[1] : crossing[2]]).max()
        missed.append(abs(second / swing - 1.0))
    assert missed[1] < 0.013
    assert missed[0] / missed[1] == pytest.approx(2.0, abs=0.5)


def test_located_events_have_five_swings_of_housner():
    """The angle of the scene is its amplitude to 1e-12, the block of the scene is one to 1e-11."""
    kept = (1.0 - 1.5 * np.sin(ALPHA) ** 2) ** 2
    swings, upright = [0.1], [quarter(0.1)]
    for _ in range(5):
        left = np.cos(ALPHA) + kept * (np.cos(ALPHA - swings[-1]) - np.cos(ALPHA))
        swings.append(ALPHA - np.arccos(left))
        upright.append(upright[-1] + 2.0 * quarter(swings[-1]))
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml").with_settings({
        "output.fields": [], "solve.method": "event_driven", "solve.estimate": False,
        "duration": 1.01 * upright[-1], "solve.dt": 1.01 * upright[-1] / 20_000,
    })  # fmt: skip
    result = impactfem.solve(scene)
    changes = result.summary["details"]["friction_changes"]
    times = [t for t, _, what in changes if what == "opens" and t > 0.1]
    assert times == pytest.approx(upright, rel=1e-8)
    angle, time = np.abs(result.history["block.angle"].values), result.history["time"].values
    largest = [angle[(time > a) & (time < b)].max() for a, b in itertools.pairwise(upright)]
    assert largest == pytest.approx(swings[1:], rel=1e-6)
