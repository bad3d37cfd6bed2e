"""The paddle of the demo strikes its stop when the modes of beam and paddle say so."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "mems_pendulum"
LENGTH, HEIGHT, WIDTH, DENSITY, MODULUS = 5e-4, 1e-5, 5e-5, 2330.0, 169e9
PADDLE, THICK, NECK, SHOCK, GAP = 2e-4, 2e-5, 2.5e-8, 2e4, 4e-6
MASS = DENSITY * PADDLE * THICK * WIDTH
INERTIA = MASS * (PADDLE**2 + THICK**2) / 12.0


def first_impact(count=8):
    """Time [s] and speed [m/s] of the first impact without damping, by polynomials of a beam."""
    x, weights = np.polynomial.legendre.leggauss(40)
    x, weights = 0.5 * (x + 1.0), 0.5 * weights
    fields = [np.polynomial.Polynomial.basis(k + 2) for k in range(count)]
    values, bends = (np.array([f.deriv(m)(x) if m else f(x) for f in fields]) for m in (0, 2))
    line, bending = DENSITY * HEIGHT * WIDTH * LENGTH, MODULUS * WIDTH * HEIGHT**3 / 12.0
    mass, stiffness = np.zeros((2, count + 1, count + 1))
    mass[:count, :count] = line * values * weights @ values.T
    stiffness[:count, :count] = bending / LENGTH**3 * bends * weights @ bends.T
    tip, turn = np.array([1.0] * count + [0.0]), np.eye(count + 1)[-1]
    centre, end = tip + 0.5 * PADDLE * turn, tip + PADDLE * turn
    mass += MASS * np.outer(centre, centre) + INERTIA * np.outer(turn, turn)
    bent = turn - np.array([*(f.deriv()(1.0) / LENGTH for f in fields), 0.0])
    stiffness += NECK * np.outer(bent, bent)
    load = -SHOCK * (np.array([*(line * values @ weights), 0.0]) + MASS * centre)
    squares, modes = eigh(stiffness, mass)
    rates, shares = np.sqrt(squares), (end @ modes) * (modes.T @ load) / squares
    time = brentq(lambda t: shares @ (1.0 - np.cos(rates * t)) + GAP, 5e-6, 2e-5)
    return time, shares @ (rates * np.sin(rates * time))


def test_it_strikes_when_its_modes_say():
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    settings = {"output.fields": [], "solve.dt": 5e-8, "duration": 2e-5}
    history = impactfem.solve(scene.with_settings(settings), estimate=False).history
    impulses = history["contact_impulse"].values
    (struck,) = np.flatnonzero(impulses)
    time, speed = first_impact()
    assert history["time"].values[struck] == pytest.approx(time, abs=1e-7)
    # Of the end of the paddle just before, and what a free paddle would take at least.
    ways = history["gap.paddle.stop"].values[struck - 3 : struck]
    assert np.diff(ways).mean() / 5e-8 == pytest.approx(speed, rel=0.02)
    free = 1.5 * abs(speed) / (1.0 / MASS + (0.5 * PADDLE) ** 2 / INERTIA)
    assert free < impulses[struck] < 1.05 * free
    page = (DEMO / "README.md").read_text(encoding="utf-8")
    assert f"{1e6 * time:.2f} µs" in page
    assert f"{abs(speed):.3f} m/s" in page
    assert f"{free:.2e} N s" in page
