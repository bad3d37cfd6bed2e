"""Rows of bars by their waves: energy and momentum to rounding, errors below those of galerkin."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import impactfem
from impactfem import Bar, Scene, Wall
from impactfem.marching.bar_row import march_row


def bar(name, gap, velocity=0.0, length=1.0, **more):
    return Bar(**{
        "name": name, "gap": gap, "velocity": velocity, "length": length, "density": 1.0,
        "youngs_modulus": 1.0, **more,
    })  # fmt: skip


def solved(bars, duration, method, elements=40, obstacles=()):
    scene = Scene(title="row", duration=duration, bodies=bars, obstacles=obstacles)
    return impactfem.solve(scene, method=method, elements=elements).summary


BETWEEN = [bar("a", 0.25, -1.0, length=0.5), bar("b", 1.0, far_end="clamped")]


def test_rounding_does_not_grow_over_many_collisions():
    """A bar to and fro between a wall and a held bar, all events on layers, 240 contacts."""
    found = solved(BETWEEN, 400.0, "conserving", obstacles=[Wall()])
    assert found["plan"]["on_layers"]
    assert found["error"]["displacement_max"] <= 1e-11
    assert found["error"]["force_l1"] <= 1e-11
    assert found["energy"]["max_relative_drift"] <= 1e-13
    assert solved(BETWEEN, 400.0, "galerkin", obstacles=[Wall()])["error"]["displacement_max"] > 0.1


def test_error_is_below_that_of_galerkin_in_rows_without_a_common_measure():
    rng = np.random.default_rng(3)
    errors = {"galerkin": 0.0, "conserving": 0.0}
    for count in (2, 3, 4, 2):
        bars, place = [], 0.0
        for k in range(count):
            length, place = rng.uniform(0.3, 2.0), place + rng.uniform(0.01, 0.3)
            data = {"area": rng.uniform(0.3, 2.0), "youngs_modulus": rng.uniform(0.5, 3.0)}
            bars.append(bar(f"bar{k}", place, 0.5 - k + rng.uniform(-1, 1), length, **data))
            place += length
        for method in errors:
            found = solved(bars, 8.0, method, obstacles=[Wall()] if count == 2 else ())
            errors[method] += found["error"]["displacement_max"]
        assert found["energy"]["max_relative_drift"] <= 1e-13
    assert errors["conserving"] <= 0.5 * errors["galerkin"]


numbers = st.floats(-1.0, 1.0).map(lambda x: round(x, 6))
sizes = st.floats(0.2, 3.0).map(lambda x: round(x, 6))


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(sizes, sizes, sizes, numbers, numbers), min_size=2, max_size=4),
    st.booleans(), st.booleans(), st.floats(0.02, 1.0),
)  # fmt: skip
def test_balances_hold_in_every_layer_and_pair(data, has_wall, clamped, share):
    bars, place = [], 0.0
    for k, (length, area, modulus, speed, bend) in enumerate(data):
        place += 0.1 * abs(bend)
        held = {"far_end": "clamped"} if clamped and k == len(data) - 1 else {}
        state = {
            "velocity": f"{speed}*({length} - x)" if held else f"{speed} + {bend}*sin(5*x)",
            "displacement": f"0.01*{bend}*x*({length} - x)",
        }
        bars.append(bar(f"b{k}", place, length=length, area=area, youngs_modulus=modulus,
                        **state, **held))  # fmt: skip
        place += length
    dt = share * min(b.transit_time for b in bars)
    layers = min(500, math.ceil(10.0 / dt))
    found = march_row(bars, [3] * len(bars), dt, layers, wall="w" * has_wall or None,
                      method="conserving")  # fmt: skip
    energy = (found.kinetic + found.elastic).sum(axis=1)
    assert np.abs(energy - energy[0]).max() <= 1e-12 * energy[0] + 1e-25
    assert found.gap.min() >= 0.0
    assert found.force.min() >= 0.0
    masses = np.array([b.mass for b in bars])
    speed = np.sqrt(2.0 * energy[0] * masses.sum()) + 1e-15
    pushes = dt * found.force
    first = 0 if has_wall else 1
    for k, mass in enumerate(masses[: len(bars) - clamped]):
        push = np.zeros(layers)
        if k >= first:
            push += pushes[:, k - first]
        if k + 1 < len(bars):
            push -= pushes[:, k + 1 - first]
        gained = mass * np.diff(found.mean_velocity[:, k])
        assert np.abs(gained - push).max() <= 1e-12 * speed
    if clamped:
        assert np.ptp(found.displacement[-1][:, -1]) <= 1e-12
    # Gaps and displacements are followed apart from each other.
    for pair in range(found.gap.shape[1]):
        b = pair + first
        before = found.displacement[b - 1][:, -1] + bars[b - 1].length if b else 0.0
        apart = found.displacement[b][:, 0] - before
        assert apart == pytest.approx(found.gap[:, pair], abs=1e-11)
