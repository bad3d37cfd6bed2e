"""Spheres that strike each other, and a large block, against Hertz.

As for the rigid plane the theory's own error is of the order of the contact radius over that of the
body: .032 here, 1.4 % in the force.
"""

import math

import numpy as np
import pytest
from solid_pairs import disc, scene, velocity

import impactfem

NU = 0.3
STIFF = 1.0 / (1.0 - NU**2)
MASS = 4.0 / 3.0 * math.pi
SPEED = 1e-4


def hertz(stiff, mass, speed):
    """Duration, largest force and contact radius of a sphere of radius 1 on a plane."""
    time = 2.86827 * (mass**2 / (stiff**2 * speed)) ** 0.2
    force = 1.28269 * stiff**0.4 * mass**0.6 * speed**1.2
    return time, force, (0.75 * force / stiff) ** (1 / 3)


def sphere(name, side, gap, radius, fine, **more):
    """A sphere above (1) or below (-1) the plane y = 0, fine near it."""
    near = {"point": [0.0, side * gap], "radius": 1.1 * radius, "size": fine}
    return disc(name, [0.0, side * (1.0 + gap)], 1.0, 0.1, refine=[near], **ROUND | more)


ROUND = {"model": "axisymmetric", "poisson_ratio": NU, "degree": 2}


def over_theory(result, time, force, momentum):
    """Duration, largest force and impulse over theirs, energy over that at t = 0."""
    history = result.history
    forces, dt = history["contact_force"].values, history["time"].values[1]
    touching = np.flatnonzero(forces)
    energy = history["total_energy"].values
    return (
        (touching[-1] - touching[0] + 1) * dt / time,
        forces.max() / force,
        forces.sum() * dt / momentum,
        energy / energy[0],
        np.abs(np.diff(forces)).sum() / forces.max(),
    )


@pytest.mark.parametrize(
    ("method", "normals"), [("massless", "fixed"), ("conserving", "fixed"), ("massless", "updated")]
)
def test_two_equal_spheres(method, normals):
    # By symmetry each is a sphere on a rigid plane. Elements differ, so that nothing is matched.
    time, force, radius = hertz(STIFF, MASS, SPEED)
    dt = time / 300
    gap, near = 0.5 * SPEED * dt, radius / 4
    upper = sphere("upper", 1, gap, radius, near, velocity=[0.0, -SPEED])
    lower = sphere("lower", -1, gap, radius, near / 1.3, velocity=[0.0, SPEED])
    case = scene([upper, lower], duration=1.06 * time, method=method, dt=dt, normals=normals)
    duration, peak, impulse, energy, variation = over_theory(
        impactfem.solve(case), time, force, 2.0 * MASS * SPEED
    )
    assert duration == pytest.approx(1.0, abs=0.015)
    assert peak == pytest.approx(1.0, abs=0.025)
    assert impulse == pytest.approx(1.0, abs=1e-3)
    assert variation == pytest.approx(2.0, abs=1e-3)  # up once, down once
    # Following the bodies keeps the energy to the order of elements and step only.
    within = {"fixed": 1e-9 if method == "conserving" else 1e-4, "updated": 2e-3}[normals]
    assert np.abs(energy - 1.0).max() <= within


def test_sphere_on_a_large_block():
    # Both are elastic: half the stiffness. The block is eight radii wide and deep, and free.
    stiff = STIFF / 2.0
    time, force, radius = hertz(stiff, MASS, SPEED)
    dt = time / 200
    gap, near = 0.5 * SPEED * dt, radius / 4
    ball = sphere("ball", 1, gap, radius, near, velocity=[0.0, -SPEED])
    block = {
        "name": "block", "mesh_size": 0.6,
        "shape": {"kind": "block", "size": [8.0, 8.0], "corner": [0.0, -8.0]},
        "refine": [{"point": [0.0, 0.0], "radius": 1.2 * radius, "size": near / 1.3}],
    } | ROUND  # fmt: skip
    result = impactfem.solve(scene([ball, block], duration=1.1 * time, method="massless", dt=dt))
    duration, peak, _, energy, variation = over_theory(result, time, force, 1.0)
    assert duration == pytest.approx(1.0, abs=0.01)
    assert peak == pytest.approx(1.0, abs=0.01)
    assert variation == pytest.approx(2.0, abs=1e-3)
    assert energy.max() <= 1.0 + 1e-12
    away = velocity(result, "ball")[1] - velocity(result, "block")[1]
    assert 0.99 <= away / SPEED <= 1.0  # waves that stay in the block
