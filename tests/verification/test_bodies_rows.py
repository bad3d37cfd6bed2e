"""Several blocks at once: the wave cradle, and a stack that falls and comes to rest."""

import numpy as np
import pytest
from solid_pairs import block, scene, velocity

import impactfem


@pytest.mark.parametrize("method", ["explicit", "massless"])
def test_last_of_a_row_leaves_alone(method):
    # Five equal bars at rest that touch, struck by a sixth. nu = 0: they are bars.
    size = 1 / 40
    bodies = [
        block(f"bar{k}", [k - 0.02 * (k == 0), 0.0], [1.0, 2 * size], size, cells="hexahedron",
              velocity=[0.1 * (k == 0), 0.0])
        for k in range(6)
    ]  # fmt: skip
    step = {"courant": 1.0} if method == "explicit" else {"dt": np.sqrt(0.5) * size}
    result = impactfem.solve(scene(bodies, duration=8.0, method=method, **step))
    speeds = np.array([velocity(result, f"bar{k}")[0] for k in range(6)]) / 0.1
    np.testing.assert_allclose(speeds[5], 1.0, atol=0.02)
    np.testing.assert_allclose(speeds[:4], 0.0, atol=0.02)
    # What disperses on the way arrives late and stays in the last but one.
    np.testing.assert_allclose(speeds[4], 0.0, atol=0.05)
    np.testing.assert_allclose(speeds.sum(), 1.0, atol=1e-9)


def stack(method, **solve):
    """Four blocks, each with other elements than its neighbours, fall on a floor."""
    bodies = [
        block(f"block{k}", [0.0, 0.02 + 1.01 * k], [1.0, 1.0], 0.25 if k % 2 else 0.2,
              youngs_modulus=100.0, poisson_ratio=0.3, rayleigh_mass=1.0, rayleigh_stiffness=0.01)
        for k in range(4)
    ]  # fmt: skip
    floor = {"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    return impactfem.solve(
        scene(bodies, duration=35.0, gravity=[0.0, -0.1], obstacles=[floor], method=method, **solve)
    )


def test_stack_falls_and_rests():
    result = stack("massless", dt=0.05)
    history = result.history
    # The history has the sum of all contacts: each carries what is above it.
    weights = 0.1 * np.arange(1, 5).sum()
    force = history["contact_force"].values
    assert force[-1] == pytest.approx(weights, rel=1e-6)
    assert np.ptp(force[-100:]) <= 1e-6 * weights
    for k in range(4):
        places = history[f"block{k}.x"].values
        assert np.abs(places - places[0]).max() <= 1e-3
        assert np.ptp(places[-100:]) <= 1e-8
        assert np.abs(history[f"block{k}.vy"].values[-100:]).max() <= 1e-6
    assert history["gap"].values.min() >= -1e-10
