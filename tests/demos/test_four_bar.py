"""The four-bar linkage of the demo ends pressed on its stop, as virtual work has it."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "four_bar"
BASE, CRANK, COUPLER, ROCKER, ROUND = 0.4, 0.1, 0.35, 0.2, 0.01
STOP = np.array([0.384, 0.2003])


def knee(angle):
    """Places of the elbow and the wrist at an angle of the crank [m]."""
    elbow = CRANK * np.array([np.cos(angle), np.sin(angle)])
    way = np.array([BASE, 0.0]) - elbow
    far = np.linalg.norm(way)
    along = (COUPLER**2 - ROCKER**2 + far**2) / (2.0 * far)
    across = np.array([-way[1], way[0]]) / far
    return elbow, elbow + along * way / far + np.sqrt(COUPLER**2 - along**2) * across


def gap(angle):
    """Between the rocker and the stop [m]; it is met beside the axis of the rocker."""
    way = knee(angle)[1] - [BASE, 0.0]
    share = np.clip((STOP - [BASE, 0.0]) @ way / (way @ way), 0.0, 1.0)
    return np.linalg.norm(STOP - [BASE, 0.0] - share * way) - 2.0 * ROUND


def height(angle):
    """Weighted sum of the heights of the centres: the potential of gravity [J]."""
    elbow, wrist = knee(angle)
    lengths = np.array([CRANK, COUPLER, ROCKER])
    masses = 27.0 * (2.0 * ROUND * lengths + np.pi * ROUND**2)
    middles = [0.5 * elbow[1], 0.5 * (elbow[1] + wrist[1]), 0.5 * wrist[1]]
    return 9.81 * float(masses @ middles)


@pytest.mark.slow
def test_it_ends_pressed_on_its_stop():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    history = impactfem.solve(scene.with_settings({"output.fields": []}), estimate=False).history
    angle = 2.2 + history["shaft.q"].values[-1]
    closed = brentq(gap, angle - 0.05, angle + 0.05)
    assert angle == pytest.approx(closed, abs=2e-3)
    step = 1e-6
    rise, opening = (
        (law(angle + step) - law(angle - step)) / (2.0 * step) for law in (height, gap)
    )
    turn = (np.arctan2(*(knee(angle + s)[1] - [BASE, 0.0])[::-1]) for s in (step, -step))
    lever = abs(np.subtract(*turn)) / (2.0 * step)
    pressed = (0.4 - rise) / -opening
    # Friction in the hinge of the rocker may hold some of it.
    assert (
        abs(history["force.rocker.stop"].values[-1] - pressed) <= 0.002 * lever / -opening * 1.001
    )
    page = (DEMO / "README.md").read_text(encoding="utf-8")
    assert f"{history['force.rocker.stop'].values[-1]:.3f} N" in page
    assert f"{pressed:.3f} N" in page
