"""Blocks with nu = 0 that strike each other are bars: against the exact collisions of bars."""

import numpy as np
import pytest
from solid_pairs import EXPLICIT, block, scene, velocity

import impactfem

SPEED = 0.1
# r = Z2 / Z1, transit times alike; velocities after the contact over that before.
CASES = {
    "equal": (1.0, {}, (0.0, 1.0)),
    "twice the impedance": (1.0, {"density": 2.0, "youngs_modulus": 2.0}, (-1 / 3, 2 / 3)),
    "half the impedance": (1.0, {"density": 0.5, "youngs_modulus": 0.5}, (1 / 3, 4 / 3)),
    "faster and longer": (2.0, {"youngs_modulus": 4.0}, (-1 / 3, 2 / 3)),
}


def settings(method, size):
    """The step with which a method disperses waves of speed 1 least."""
    if method in EXPLICIT:
        return {"method": method, "courant": 1.0}
    return {"method": method, "dt": np.sqrt(0.5) * size}


def collide(lengths, method, size, other, duration):
    """The left bar strikes the right one, which rests; its elements are as fast to cross."""
    width, gap = 2.0 * size, 0.01
    first = block("first", [0, 0], [lengths[0], width], size, velocity=[SPEED, 0.0])
    speed = np.sqrt(other.get("youngs_modulus", 1.0) / other.get("density", 1.0))
    second = block("second", [lengths[0] + gap, 0], [lengths[1], width], size * speed) | other
    bodies = [body | {"cells": "hexahedron"} for body in (first, second)]
    return impactfem.solve(scene(bodies, duration=duration, **settings(method, size)))


def pulse(result, height):
    """Impulse of the contact force, and how long it is above half the height of its pulse."""
    times, force = result.history["time"].values, result.history["contact_force"].values
    above = times[np.flatnonzero(force > 0.5 * height)]
    return np.sum(force[1:] * np.diff(times)), above[-1] - above[0] + times[1]


def after(result):
    """Velocities along the bars over the speed of the impact."""
    return velocity(result, "first")[0] / SPEED, velocity(result, "second")[0] / SPEED


@pytest.mark.parametrize(
    ("case", "method"),
    [
        *((case, method) for case in CASES for method in ("massless", "conserving", "explicit")),
        ("twice the impedance", "moreau_jean"),
    ],
)
def test_bars_of_equal_transit_times(case, method):
    length, other, expected = CASES[case]
    # Velocities depend on where in a layer the bars meet, by half a per cent on this mesh.
    size = 1 / 80 if method != "moreau_jean" else 1 / 160
    result = collide((1.0, length), method, size, other, 3.0)
    np.testing.assert_allclose(after(result), expected, atol=0.01)
    height = expected[1] * SPEED * size * other.get("density", 1.0) * length
    impulse, duration = pulse(result, height)
    mass = 2.0 * size * length * other.get("density", 1.0)
    assert impulse == pytest.approx(expected[1] * SPEED * mass, rel=0.01)
    assert duration == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize("method", ["massless", "conserving", "explicit"])
def test_short_bar_stops_at_a_long_one(method):
    size = 1 / 160
    result = collide((0.5, 1.0), method, size, {}, 1.9)
    np.testing.assert_allclose(after(result), (0.0, 0.5), atol=0.01)
    assert pulse(result, SPEED * size)[1] == pytest.approx(1.0, rel=0.01)


def test_long_bar_strikes_a_short_one():
    # The same seen from the long bar.
    result = collide((1.0, 0.5), "massless", 1 / 80, {}, 1.9)
    np.testing.assert_allclose(after(result), (0.5, 1.0), atol=0.01)


def test_momentum_and_energy_of_bars():
    result = collide((1.0, 1.0), "conserving", 1 / 20, {}, 3.0)
    energy = result.history["total_energy"].values
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    momentum = result.history["first.vx"].values + result.history["second.vx"].values
    np.testing.assert_allclose(momentum, SPEED, rtol=1e-10)
    # No pulling, no penetration.
    assert result.history["contact_force"].values.min() >= 0.0
    assert result.history["gap"].values.min() >= -1e-12


@pytest.mark.parametrize("ratio", [1.0, 0.5])
def test_heavy_block_on_a_clamped_bar(ratio):
    # Short, dense and stiff, as if rigid. a = bar / mass; the force jumps at 2 L / c, contact ends
    # at 3.068 L / c (a = 1), 4.708 L / c (a = 1/2).
    size = 1 / 120
    width, gap = 2.0 * size, 0.01
    length = 4.0 * size
    bar = block(
        "bar", [0, 0], [1.0, width], size, cells="hexahedron",
        supports=[{"surface": "left", "kind": "fixed"}],
    )  # fmt: skip
    mass = block(
        "mass", [1.0 + gap, 0], [length, width], size, cells="hexahedron",
        density=1.0 / (ratio * length), youngs_modulus=1e4, velocity=[-SPEED, 0.0],
    )  # fmt: skip
    end = {1.0: 3.068, 0.5: 4.708}[ratio]
    result = impactfem.solve(
        scene([bar, mass], duration=end + 1.0, method="massless", dt=np.sqrt(0.5) * size)
    )
    times, force = result.history["time"].values, result.history["contact_force"].values / width
    touching = times[np.flatnonzero(force)]
    start = gap / SPEED
    assert touching[-1] - start == pytest.approx(end, rel=0.02)
    # With g the wave that leaves the contact, F = v + 2 g(t - 2), mass v' = -F, for t < 4:
    time = times - start
    first, second = (time > 0.2) & (time < 1.8), (time > 2.2) & (time < min(end, 4.0) - 0.2)
    falls = np.exp(-ratio * time)
    late = np.exp(-ratio * (time - 2.0)) * (2.0 + np.exp(-2.0 * ratio) - 2.0 * ratio * (time - 2.0))
    for window, exact in ((first, falls), (second, late)):
        assert np.mean(force[window]) == pytest.approx(SPEED * np.mean(exact[window]), rel=0.02)
