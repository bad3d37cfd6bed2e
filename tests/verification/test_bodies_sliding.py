"""Large sliding without friction: a block and a disc across many faces of a plane of finite length.

Nothing pulls along the plane. Elements differ, and nodes pass nodes: the force has to stay smooth.
"""

import numpy as np
import pytest
from solid_pairs import block, disc, scene

import impactfem

GRAVITY, SPEED = 0.5, 0.3


def slide(top, size, degree, damping=0.05, **more):
    """A body on a clamped plane, which it crosses by twelve faces or more."""
    elastic = {"youngs_modulus": 100.0, "poisson_ratio": 0.3, "degree": degree}
    elastic["rayleigh_stiffness"] = damping
    plane = block("plane", [0.0, -0.3], [4.5, 0.3], 1.37 * size,
                  supports=[{"surface": "bottom", "kind": "fixed"}])  # fmt: skip
    case = scene(
        [top | elastic, plane | elastic], duration=8.0, gravity=[0.0, -GRAVITY],
        method="massless", normals="updated", dt=0.02, **more,
    )  # fmt: skip
    return impactfem.solve(case).history


def late(history, weight):
    """Second half of the force over the weight."""
    force = history["contact_force"].values / weight
    return force[len(force) // 2 :]


def test_block_slides_without_spikes():
    size = 0.1
    top = block("top", [0.213, 0.0], [1.0, 0.5], size, velocity=[SPEED, 0.0])
    history = slide(top, size, 1)
    force = late(history, 0.5 * GRAVITY)
    travel = history["top.x"].values[-1] - history["top.x"].values[0]
    assert travel == pytest.approx(8.0 * SPEED, rel=2e-3)
    assert np.abs(force - 1.0).max() <= 2e-3
    assert np.abs(np.diff(force)).sum() <= 0.1
    assert history["top.vx"].values[-1] == pytest.approx(SPEED, rel=2e-3)
    assert history["gap"].values.min() >= -1e-10


def test_disc_of_curved_elements_slides_without_spikes():
    """And what slows it is the damping of what it presses."""
    # The contact is as wide as one element. A disc of degree 1 is a polygon: it bounces on its
    # corners, whose height above the sides is half of the depth of the contact.
    top = disc("top", [0.7, 0.5], 0.5, 0.1, velocity=[SPEED, 0.0])
    history = slide(top, 0.1, 2)
    force = late(history, np.pi / 4 * GRAVITY)
    assert np.mean(force) == pytest.approx(1.0, abs=2e-3)
    assert np.abs(force - 1.0).max() <= 0.03
    assert np.abs(np.diff(force)).sum() <= 0.3
    little = slide(top, 0.1, 2, 0.004)
    losses = [1.0 - each["top.vx"].values[-1] / SPEED for each in (history, little)]
    assert 0.0 < losses[0] <= 0.0375
    assert abs(losses[1]) <= 2e-3
