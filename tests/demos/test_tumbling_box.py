"""The box of the demo flips in flight when Euler's equations say, and lands."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "tumbling_box"


def test_it_flips_as_euler_has_it_then_lands():
    a, b, c = 0.3, 0.2, 0.1
    inertia = np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    flips = solve_ivp(
        lambda _, w: np.cross(inertia * w, w) / inertia, (0.0, 2.2), (0.2, 20.0, 0.2),
        rtol=1e-11, atol=1e-12, events=lambda _, w: w[1],
    ).t_events[0]  # fmt: skip
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    history = impactfem.solve(scene.with_settings({"output.fields": []}), estimate=False).history
    time, energy = history["time"].values, history["total_energy"].values
    spin = np.array([history[f"box.w{x}"].values for x in "xyz"]).T
    turned = Rotation.from_quat(np.array([history[f"box.q{x}"].values for x in "xyzw"]).T)
    about = turned.inv().apply(spin)[:, 1]
    free = time < 2.2
    at = np.flatnonzero(free[1:] & (about[:-1] * about[1:] < 0.0))
    found = time[at] + (time[at + 1] - time[at]) * about[at] / (about[at] - about[at + 1])
    # Of second order in the step of 1 ms.
    assert found == pytest.approx(flips, abs=3e-4)
    assert np.abs(energy[free] / energy[0] - 1.0).max() < 1e-12
    assert np.diff(energy).max() < 1e-9 * energy[0]
    assert energy[-1] < 0.1 * energy[0]
