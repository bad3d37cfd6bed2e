"""Waves kept as a line a layer: errors of galerkin or less, energy and momentum to rounding."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import impactfem
from impactfem.marching.march import Marching, march
from impactfem.marching.schemes import SCHEMES
from impactfem.marching.wave_kernels import SNAP
from impactfem.reference.bar import exact_bar

FALLS = ((0.39, 0.12, 0.25), (1.3, 0.8, 0.4), (0.2, 1.1, 1.7), (0.07, 0.4, 3.0))  # gap, v0, p


def fall(gap, speed, pull, duration, length=1.0, wave_speed=1.0):
    return impactfem.Scene(
        title="fall",
        duration=duration,
        gravity=pull,
        bodies=[
            impactfem.Bar(
                length=length, density=1.0, youngs_modulus=wave_speed**2, gap=gap, velocity=-speed
            )
        ],
        obstacles=[impactfem.Wall()],
        output=impactfem.Output(every=50),
    )


def test_error_is_below_that_of_galerkin_and_energy_stays():
    errors = {"galerkin": [], "conserving": []}
    for data in FALLS:
        scene = fall(*data, 15.0)
        contacts = len(exact_bar(scene).contacts)
        assert contacts > 1
        for method, found in errors.items():
            summary = impactfem.solve(scene, method=method, elements=200).summary
            found.append(summary["error"]["displacement_max"] * 200 / contacts)
        assert summary["energy"]["max_relative_drift"] <= 1e-13
    assert max(errors["conserving"]) <= 0.15
    assert sum(errors["conserving"]) <= 0.5 * sum(errors["galerkin"])


@pytest.mark.parametrize("gap", [0.5, 0.513, 0.5 + 2**0.5 / 100])
def test_single_impacts_are_reflected_without_overshoot(gap):
    scene = fall(gap, 0.5, 0.0, 5.0)
    for elements in (20, 40, 80, 160):
        summary = impactfem.solve(scene, method="conserving", elements=elements).summary
        assert summary["error"]["displacement_max"] <= 0.1 / elements
        assert summary["error"]["force_l1"] <= 0.6 / elements
        assert summary["contact"]["max_force"] <= 0.5 * (1 + 1e-12)


def test_rounding_does_not_move_events_off_their_layers():
    """300 contacts of Doyen's bounces, where galerkin loses all digits within 40."""
    scene = fall(5.0, 0.0, 10.0, 800.0, length=10.0, wave_speed=30.0)
    summary = impactfem.solve(scene, method="conserving", elements=40).summary
    assert summary["error"]["displacement_max"] <= 1e-11
    assert summary["energy"]["max_relative_drift"] <= 1e-12


numbers = st.floats(-2.0, 2.0).map(lambda x: round(x, 6))  # no squares that underflow


@st.composite
def motions(draw):
    """Any bar, gravity and step."""
    elements = draw(st.integers(2, 30))
    clamped = draw(st.booleans())
    length = draw(st.floats(0.2, 3.0))
    bend, tilt = 0.1 * abs(draw(numbers)), draw(numbers)
    keys = {
        "length": length,
        "density": 1.0,
        "youngs_modulus": draw(st.floats(0.2, 9.0)),
        "far_end": "clamped" if clamped else "free",
        "gap": 0.0 if clamped else draw(st.floats(0.0, 1.0)),
        "velocity": f"{tilt}*({length} - x)" if clamped else f"{tilt} + {draw(numbers)}*sin(3*x)",
        "displacement": f"{bend}*({length} - x)*(1 + 0.3*sin(4*x))",
    }
    steps = sorted({0.0, *draw(st.lists(st.floats(0.01, 5.0), max_size=2))})
    pulls = [draw(numbers) for _ in steps]
    return impactfem.Bar(**keys), tuple(steps), tuple(pulls), elements, draw(st.floats(0.05, 40.0))


SNAPPED = (
    impactfem.Bar(
        length=2.71875, density=1.0, youngs_modulus=1.0, far_end="clamped", gap=0.0,
        velocity="0.015*(2.71875 - x)",
    ),
    (0.0, 0.01171875, 2.046875), (0.5, -0.710938, 0.015), 30, 29.599609375,
)  # fmt: skip


@settings(max_examples=40, deadline=None)
@given(motions())
@example(SNAPPED)
@example((impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, velocity=-1.0), (0.0,), (1.0,), 3, 10.0))  # fmt: skip  # noqa: E501
def test_balances_hold_in_every_layer(motion):
    bar, steps, pulls, elements, courant = motion
    dt = courant * bar.transit_time / elements
    gravity = impactfem.bodies.PiecewiseConstant(steps, pulls)
    layers = min(600, max(1, int(12.0 * bar.transit_time / dt)))
    nodes = np.linspace(0.0, bar.length, elements + 1)
    found = march(bar, gravity, nodes, SCHEMES["conserving"], Marching(dt, layers))
    assert found.gap.min() >= 0.0
    assert found.multiplier.max() <= 0.0
    assert found.displacement[:, 0] == pytest.approx(found.gap, abs=1e-13)
    total = found.kinetic + found.elastic + found.potential
    loads = gravity.integral(found.times[:-1], found.times[1:])
    speed = np.abs(bar.initial_velocity(x=nodes)).max() + np.abs(found.mean_velocity).max()
    speed += bar.wave_speed * np.abs(np.diff(found.displacement[0])).max() / nodes[1]
    speed += np.abs(loads).max()
    # When a piece of gravity begins is known to rounding: so much of a pull may act or not.
    speed += np.finfo(float).eps * found.times[-1] * np.abs(pulls).max()
    # An impact so near to the end of a piece that it moves there loses the way that is left.
    impacts = 1 + np.count_nonzero(np.diff((found.multiplier < 0.0).astype(int)) > 0)
    snapped = impacts * SNAP * dt * speed
    assert np.abs(total - total[0]).max() <= 1e-12 * bar.length * speed**2 + snapped * speed
    if bar.far_end == "clamped":
        assert np.ptp(found.displacement[:, -1]) <= 1e-12 * bar.length * (1.0 + speed) + snapped
    else:
        expected = -found.multiplier * dt / bar.length - loads
        assert np.abs(np.diff(found.mean_velocity) - expected).max() <= 1e-12 * speed
