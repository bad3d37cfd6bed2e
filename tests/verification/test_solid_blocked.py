"""Blocks whose sides cannot move are bars of waves of pressure: p = rho c_p v0 for 2 L / c_p."""

import numpy as np
import pytest
from solid_blocks import column, pulse, step

import impactfem

POISSON, SPEED = 0.3, 0.1
WAVE = float(np.sqrt((1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))))  # of rho = E = 1
LASTS = 2.0 / WAVE


def blocked(model, elements, method, cells):
    sides = ("left", "right") if model == "plane_strain" else ("left", "right", "front", "back")
    scene, area = column(
        model, elements, speed=SPEED, gap=0.25 * SPEED, duration=0.25 + 2.6 / WAVE, cells=cells,
        poisson_ratio=POISSON, supports=[{"surface": s, "kind": "symmetry"} for s in sides],
        solve=step(method, elements, wave_speed=WAVE),
    )  # fmt: skip
    result = impactfem.solve(scene)
    times, force = result.history["time"].values, result.history["contact_force"].values / area
    inside = (times > 0.25 + 0.3 * LASTS) & (times < 0.25 + 0.7 * LASTS)
    return result, area, float(force[inside].mean()) / (WAVE * SPEED)


@pytest.mark.parametrize("cells", ["hexahedron", "simplex"])
@pytest.mark.parametrize("model", ["plane_strain", "3d"])
@pytest.mark.parametrize("method", ["massless", "conserving", "explicit", "moreau_jean"])
def test_pressure_and_contact_time_are_right_to_1_percent(model, method, cells):
    """Measured at 64 elements: pressure to 1e-4 in the plane, 7e-4 on tetrahedra."""
    result, area, pressure = blocked(model, 64, method, cells)
    assert pressure == pytest.approx(1.0, rel=1e-3)
    impulse, lasted = pulse(result, area)
    assert impulse == pytest.approx(2.0 * SPEED, rel=0.01)
    assert lasted == pytest.approx(LASTS, rel=0.01)
    (interval,) = result.summary["contact"]["intervals"]
    assert interval[0] == pytest.approx(0.25, abs=2e-4)
    assert interval[1] - interval[0] == pytest.approx(LASTS, rel=0.01)


@pytest.mark.parametrize("model", ["plane_strain", "3d"])
def test_galerkin_is_exact_at_courant_1(model):
    elements, dt = 32, 1.0 / (32 * WAVE)
    sides = ("left", "right") if model == "plane_strain" else ("left", "right", "front", "back")
    scene, area = column(
        model, elements, speed=SPEED, gap=8 * dt * SPEED, duration=100 * dt,
        poisson_ratio=POISSON, supports=[{"surface": s, "kind": "symmetry"} for s in sides],
        solve=step("galerkin", elements, wave_speed=WAVE),
    )  # fmt: skip
    result = impactfem.solve(scene)
    force = result.history["contact_force"].values / area
    expected = np.zeros(101)
    expected[9:73] = WAVE * SPEED
    assert np.abs(force - expected).max() <= 1e-11
    assert result.summary["contact"]["intervals"][0] == pytest.approx([8 * dt, 72 * dt], abs=1e-9)
