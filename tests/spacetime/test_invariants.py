"""What holds for every bar, whatever its data: physics and scaling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import impactfem

numbers = st.floats(0.1, 1.0)


def throw(length=1.0, density=1.0, modulus=1.0, area=1.0, gap=0.5, speed=0.5, pull=0.0, n=12):
    """A thrown bar; duration of one contact whatever the units."""
    c = np.sqrt(modulus / density)
    scene = impactfem.Scene(
        title="thrown",
        duration=gap / speed + 3.0 * length / c,
        gravity=pull,
        bodies=[
            impactfem.Bar(
                length=length,
                density=density,
                youngs_modulus=modulus,
                area=area,
                gap=gap,
                velocity=-speed,
            )
        ],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="galerkin", elements=n, courant=1.0),
    )
    return impactfem.solve(scene)


@settings(max_examples=20, deadline=None)
@given(numbers, numbers, numbers, numbers, st.floats(0.0, 0.3))
def test_no_penetration_no_pulling_no_energy_growth(length, modulus, gap, speed, pull):
    result = throw(length=length, modulus=modulus, gap=gap, speed=speed, pull=pull)
    history, summary = result.history, result.summary
    assert summary["status"] == "completed"
    scale = float(np.abs(result.fields.displacement).max())
    assert summary["contact"]["max_penetration"] <= 1e-9 * scale
    force = history["contact_force"].values
    assert force.min() >= -1e-9 * force.max()
    # Complementarity: the wall pushes in (t_{m-1}, t_m] only if it is touched at t_m.
    gaps = history["gap"].values
    assert np.abs(force * gaps).max() <= 1e-8 * max(force.max(), 1e-300) * scale
    assert summary["active_set"]["iterations"] <= 8
    energy = history["total_energy"].values
    moving = float(np.abs(history["kinetic_energy"].values).max())
    # Row 0 is the initial state itself, from which layer 1 differs by p^2 dt^2 / 8 per mass.
    assert (energy[1:] - energy[1]).max() <= 1e-9 * moving
    # Momentum balance with the wall's impulse and gravity's.
    dt = np.diff(history["time"].values)
    momentum = history["momentum"].values
    mass = length  # density and area are 1
    gained = np.sum(force[1:] * dt) - pull * mass * (history["time"].values[-1] - 0.5 * dt[-1])
    assert momentum[-1] - momentum[0] == pytest.approx(gained, abs=0.6 * force.max() * dt[-1])


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e3])
@pytest.mark.parametrize("density", [1e-6, 1e4])
def test_the_units_do_not_change_the_answer(unit, density):
    """Lengths scaled by `unit` at equal wave speed, any density: the same dimensionless numbers."""
    reference = throw(gap=0.47)
    scaled = throw(
        length=unit, density=density, modulus=density, area=unit**2, gap=0.47 * unit, speed=0.5
    )
    expected = reference.fields.displacement
    assert scaled.fields.displacement / unit == pytest.approx(expected, abs=1e-10)
    force = reference.history["contact_force"].values
    scaled_force = scaled.history["contact_force"].values / (density * unit**2)
    assert scaled_force == pytest.approx(force, abs=1e-10)


@pytest.mark.parametrize("gamma", [1e-9, 1e-3, 1.0, 1e3, 1e9])
def test_the_merit_constant_does_not_change_the_answer(gamma):
    scene = impactfem.Scene(
        title="gamma",
        duration=4.0,
        bodies=[
            impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.52, velocity=-0.5)
        ],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="galerkin", window="all", elements=20, gamma=gamma),
    )
    result = impactfem.solve(scene)
    reference = impactfem.solve(scene, gamma=1.0)
    assert result.summary["status"] == "completed"
    assert result.fields.displacement == pytest.approx(reference.fields.displacement, abs=1e-9)


def test_a_bar_that_never_touches_falls_freely():
    scene = impactfem.Scene(
        title="free",
        duration=1.0,
        gravity=-2.0,
        bodies=[impactfem.Bar(length=1.0, density=2.0, youngs_modulus=2.0, gap=1.0, velocity=0.25)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="galerkin", elements=16),
    )
    result = impactfem.solve(scene)
    t = result.history["time"].values
    assert result.summary["contact"]["intervals"] == []
    assert result.summary["contact"]["max_force"] == 0.0
    # The load of the corner nodes at t = 0 depends on the diagonals: an error of order h^2.
    assert result.history["gap"].values == pytest.approx(1.0 + 0.25 * t + t**2, abs=2.0 / 16**2)


def test_courant_below_one_is_said_to_ring_and_marked_when_it_fails():
    scene = impactfem.Scene(
        title="rings",
        duration=5.0,
        bodies=[impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.5, velocity=-0.5)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="galerkin", elements=20, courant=0.5),
    )
    plan = impactfem.plan(scene)
    assert any("rings" in warning for warning in plan.warnings)
    # Layer by layer every set is found, and energy does not grow; one loop for all layers needs
    # many more iterations than the plan expects.
    swept = impactfem.solve(scene)
    assert swept.summary["status"] == "completed"
    energy = swept.history["total_energy"].values
    assert energy.max() <= energy[0] * (1 + 1e-12)
    assert swept.summary["contact"]["max_force_raw"] > 1.2  # 0.5 would be exact: it rings
    whole = impactfem.solve(scene, method="monolithic", max_iterations=20)
    assert whole.summary["status"] == "not_converged"
    assert not whole.summary["active_set"]["converged"]
