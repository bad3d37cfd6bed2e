"""The arm of the demo presses on its wall as its page says, and as statics has it."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

pytest.importorskip("pinocchio")

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "urdf_arm"
PAGE = (DEMO / "README.md").read_text(encoding="utf-8")


def equilibrium():
    """Angles [rad] and force [N] of the arm at rest on the wall, by hand."""
    upper, lower, reach, g = 0.5, 0.4, 0.75 - 0.05, 9.81
    masses = ((2.0, 0.25, 0.0), (1.0, upper, 0.2), (0.2, upper, lower))

    def missing(unknown):
        one, two, force = unknown
        both = one + two
        # A rotation about y by q puts x at cos q, z at -sin q.
        heights = np.array([
            [-m * (a * np.cos(one) + b * np.cos(both)), -m * b * np.cos(both)]
            for m, a, b in masses
        ]).sum(axis=0)  # fmt: skip
        ahead = -lower * np.sin(both)
        pushed = force * np.array([-upper * np.sin(one) + ahead, ahead])
        motors = [-60.0 * (one + 0.7), -40.0 * (two - 0.5)]
        there = upper * np.cos(one) + lower * np.cos(both) - reach
        return [*(motors - g * heights - pushed), there]

    return fsolve(missing, [-1.0, 1.0, 50.0], xtol=1e-13)


@pytest.mark.slow
def test_the_arm_presses_as_statics_has_it():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    scene = scene.with_settings({"solve.estimate": False, "output.fields": []})
    history = impactfem.solve(scene).history
    names = ("arm.shoulder.q", "arm.elbow.q", "force.arm_hand.wall")
    got = np.array([history[name].values[-1] for name in names])
    exact = equilibrium()
    np.testing.assert_allclose(got, exact, rtol=3e-4)
    rows = re.findall(r"\| (-?[\d.]+) (?:rad|N) \| (-?[\d.]+) (?:rad|N) \|", PAGE)
    said = np.array(rows, dtype=float)
    np.testing.assert_allclose(said[:, 0], got, rtol=1e-4)
    np.testing.assert_allclose(said[:, 1], exact, rtol=2e-5)
    struck = history["contact_impulse"].values
    assert np.count_nonzero(struck) == 7
    assert history["time"].values[struck > 0.0][0] == pytest.approx(0.129, abs=1e-3)
    assert struck.max() == pytest.approx(4.00, abs=0.01)
