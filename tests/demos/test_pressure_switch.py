"""The diaphragm of the demo touches its stop when the modes of a clamped disc say so."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import iv, jv

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "pressure_switch"
RADIUS, THICK, DENSITY, MODULUS, NU, PRESSURE, GAP = 5e-4, 1e-5, 2330.0, 160e9, 0.22, 4e4, 2e-6


def axial_modes(count=8):
    """Frequencies [rad/s] of a clamped disc and their shares [m] in the way of its middle."""
    rigidity = MODULUS * THICK**3 / (12.0 * (1.0 - NU**2))

    def edge(k):
        return jv(0, k) * iv(1, k) + iv(0, k) * jv(1, k)

    grid = np.linspace(2.0, 3.2 * count + 1.0, 40 * count)
    roots = [brentq(edge, a, b) for a, b in pairwise(grid) if edge(a) * edge(b) < 0.0][:count]
    rates, shares = [], []
    for k in roots:

        def mode(r, k=k):
            return jv(0, k * r) - jv(0, k) / iv(0, k) * iv(0, k * r)

        load, weight = (quad(lambda r, m=m: mode(r) ** m * r, 0.0, 1.0)[0] for m in (1, 2))
        rates.append((k / RADIUS) ** 2 * np.sqrt(rigidity / (DENSITY * THICK)))
        shares.append(mode(0.0) * load / weight * PRESSURE / (DENSITY * THICK * rates[-1] ** 2))
    rates, shares = np.array(rates), np.array(shares)
    assert shares.sum() == pytest.approx(PRESSURE * RADIUS**4 / (64.0 * rigidity), rel=1e-4)
    return rates, shares


def test_it_touches_when_its_modes_say():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    settings = {"output.fields": [], "duration": 1.4e-6}
    history = impactfem.solve(scene.with_settings(settings), estimate=False).history
    pressed = np.flatnonzero(history["contact_force"].values > 0.0)
    rates, shares = axial_modes()
    time = brentq(lambda t: shares @ (1.0 - np.cos(rates * t)) - GAP, 1e-7, 2e-6)
    speed = shares @ (rates * np.sin(rates * time))
    assert 0.0 <= history["time"].values[pressed[0]] - time < 1.5e-8  # within its step
    free = slice(0, pressed[0] - 1)
    exact = (1.0 - np.cos(np.outer(history["time"].values[free], rates))) @ shares
    assert history["middle.uz"].values[free] == pytest.approx(-exact, abs=0.01 * GAP)
    page = (DEMO / "README.md").read_text(encoding="utf-8")
    assert f"{1e6 * time:.3f} µs" in page
    assert f"{speed:.2f} m/s" in page
