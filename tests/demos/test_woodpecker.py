"""The woodpecker of the demo pecks as three coordinates and Moreau's time stepping have it."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "woodpecker"
SLEEVE, BIRD, SPRING, G, MU, BEAK = (3e-4, 5e-9), (4.5e-3, 7e-7), 5.6e-3, 9.81, 0.3, 0.5
ARM, LEVER = 0.01, 0.015  # from the axis of the rod to the spring, from there to the bird [m]
ROD, INNER, HALF, BEAK_AT = 0.0025, 0.0031, 0.0058, (0.015 - 0.0201, 0.02)


def balance(q, u, small):
    """Mass matrix and forces of height, angle of the sleeve and angle of the bird (Lagrange)."""
    wound = SPRING * (q[2] - q[1])
    (_, a, b), (_, va, vb) = 0.0 * q if small else q, u
    mass, moment = SLEEVE[0] + BIRD[0], BIRD[0] * ARM * LEVER
    first, second = BIRD[0] * ARM, BIRD[0] * LEVER
    matrix = np.array(
        [
            [mass, first * np.cos(a), second * np.cos(b)],
            [first * np.cos(a), SLEEVE[1] + first * ARM, moment * np.cos(a - b)],
            [second * np.cos(b), moment * np.cos(a - b), BIRD[1] + second * LEVER],
        ]
    )
    turning = moment * np.sin(a - b)
    force = [
        -mass * G + first * np.sin(a) * va**2 + second * np.sin(b) * vb**2,
        wound - first * G * np.cos(a) - turning * vb**2,
        -wound - second * G * np.cos(b) + turning * va**2,
    ]
    return matrix, np.array(force)


def contacts(q, small):
    """Gaps, and gradients of places across and along the rod, of both ends and the beak."""
    _, a, b = 0.0 * q if small else q
    rows = []
    for (x, y), angle, column, arm in (
        ((INNER, -HALF), a, 1, 0.0), ((INNER, HALF), a, 1, 0.0), (BEAK_AT, b, 2, ARM),
    ):  # fmt: skip
        cos, sin = np.cos(angle), np.sin(angle)
        across, along = np.zeros(3), np.array([1.0, 0.0, 0.0])
        across[1], along[1] = -arm * np.sin(a), arm * np.cos(a)
        across[column] -= x * sin + y * cos
        along[column] += x * cos - y * sin
        rows.append((arm * np.cos(a) + x * cos - y * sin - ROD, across, along))
    gaps, across, along = (np.array(part) for part in zip(*rows, strict=True))
    return gaps + across @ q if small else gaps, across, along


def pecking(q, u, duration, dt, small=False):
    """Times, heights and angles of the bird by Moreau's time stepping.

    ``small``: angles count to first order, as Glocker's equations have them.
    """
    q, u, rows = np.array(q), np.array(u), []
    for step in range(round(duration / dt)):
        middle = q + 0.5 * dt * u
        matrix, force = balance(middle, u, small)
        gaps, across, along = contacts(middle, small)
        near = np.flatnonzero(gaps <= 0.0)
        free = u + dt * np.linalg.solve(matrix, force)
        if near.size:
            ways = np.vstack([across[near], along[near]])
            inverse = np.linalg.solve(matrix, ways.T)
            answer, slips = ways @ inverse, ways @ free
            slips[: near.size] += np.where(near == 2, BEAK, 0.0) * (across[near] @ u)
            impulse = np.zeros(2 * near.size)
            for _ in range(1000):  # Gauss and Seidel, projected
                before = impulse.copy()
                for i in range(near.size):
                    for j in (i, near.size + i):
                        impulse[j] -= (slips[j] + answer[j] @ impulse) / answer[j, j]
                        low = 0.0 if j == i else -MU * impulse[i]
                        high = np.inf if j == i else MU * impulse[i]
                        impulse[j] = min(max(impulse[j], low), high)
                if np.abs(impulse - before).max() <= 1e-12 * np.abs(impulse).max():
                    break
            free = free + inverse @ impulse
        u = free
        q = middle + 0.5 * dt * u
        rows.append(((step + 1) * dt, q[0], q[2]))
    return np.array(rows).T


def pecks(time, height, angle):
    """Times between passages of the bird downwards through -0.2 rad, and falls meanwhile."""
    above = angle + 0.2
    at = np.flatnonzero((above[:-1] > 0.0) & (above[1:] <= 0.0))
    share = above[at] / (above[at] - above[at + 1])
    return np.diff(time[at] + share * (time[at + 1] - time[at])), np.diff(height[at])


@pytest.mark.slow
def test_published_equations_have_the_published_period():
    """0.1452 s: Leine, Glocker and van Campen, ASME DETC 2001/VIB-21608, from their start."""
    start = (0.0, -0.1036, -0.2788), (-0.3411, 0.0, -7.4583)
    periods, falls = pecks(*pecking(*start, 0.6, 1e-4, small=True))
    assert periods.mean() == pytest.approx(0.1452, rel=0.01)
    assert falls.mean() == pytest.approx(-0.0195, rel=0.02)


@pytest.mark.slow
def test_it_pecks_as_three_coordinates_do():
    """Impacts are not located: periods scatter by some steps."""
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    settings = {"output.fields": [], "duration": 0.4}
    history = impactfem.solve(scene.with_settings(settings), estimate=False).history
    found = [history[name].values for name in ("time", "guide.y", "bird.angle")]
    alone = pecking((0.0, -0.1, -0.28), (-0.34, 0.0, -7.5), 0.4, 1e-4)
    for one, other in zip(pecks(*found), pecks(*alone), strict=True):
        assert one == pytest.approx(other, rel=0.02)
    for end in (np.min, np.max):
        assert end(found[2]) == pytest.approx(end(alone[2]), abs=2e-3)
    assert np.diff(history["total_energy"].values).max() < 1e-8
    assert np.abs(history["guide.x"].values).max() < 1e-12
