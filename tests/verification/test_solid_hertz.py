"""Elastic spheres and discs on a rigid plane against Hertz.

The theory takes the body for a half-space: its error is of the order of the contact radius over
that of the body, a / R ~ (v / c)^(2/5), and is what remains when the mesh is fine. Waves in the
body matter less. So v / c is small here, and the order of the difference is a test of its own.
"""

import math

import numpy as np
import pytest

import impactfem

NU = 0.3
STIFF = 1.0 / (1.0 - NU**2)  # E*, for E = 1; also R = 1 and rho = 1
MASS = 4.0 / 3.0 * math.pi


def contact_radius(speed):
    """Largest contact radius of an impact."""
    force = 1.28269 * STIFF**0.4 * MASS**0.6 * speed**1.2
    return (0.75 * force / STIFF) ** (1 / 3)


class Impact:
    """A sphere that strikes a plane: what is found over what Hertz says."""

    def __init__(
        self, model, speed, degree, per_radius, *, size=0.1, layers=300, method="massless"
    ):
        time = 2.86827 * (MASS**2 / (STIFF**2 * speed)) ** 0.2
        force = 1.28269 * STIFF**0.4 * MASS**0.6 * speed**1.2
        radius, dt = contact_radius(speed), time / layers
        gap = 0.5 * speed * dt
        deep = model == "3d"
        rest = [0.0] if deep else []
        shape = {"kind": "sphere" if deep else "disc", "radius": 1.0}
        shape["center"] = [0.0, 1.0 + gap, *rest]
        if deep:
            shape["symmetry"] = ["x", "z"]
        body = {
            "name": "ball", "kind": "solid", "model": model, "shape": shape, "mesh_size": size,
            "refine": [
                {"point": [0.0, gap, *rest], "radius": 1.1 * radius, "size": radius / per_radius}
            ],
            "degree": degree, "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": NU,
            "velocity": [0.0, -speed, *rest],
        }  # fmt: skip
        floor = {"name": "floor", "kind": "half_space"}
        floor |= {"point": [0.0, 0.0, *rest], "normal": [0.0, 1.0, *rest]}
        result = impactfem.solve(
            impactfem.Scene.from_dict(
                {
                    "title": "Hertz", "duration": 1.06 * time, "body": [body], "obstacle": [floor],
                    "solve": {"method": method, "dt": dt, "estimate": False},
                    "output": {"fields": ["vtkhdf"], "every": layers // 2},
                }
            )
        )  # fmt: skip
        history = result.history
        self.forces = history["contact_force"].values
        touching = np.flatnonzero(self.forces)
        self.time = (touching[-1] - touching[0] + 1) * dt / time
        self.force = self.forces.max() / force
        self.impulse = self.forces.sum() * dt / (2.0 * MASS * speed)
        self.energy = history["total_energy"].values / history["total_energy"].values[0]
        self.variation = np.abs(np.diff(self.forces)).sum() / self.forces.max()
        # In the middle of the contact: places over the contact radius, pressure over the largest.
        fields, now = result.fields.read(1, "contact_pressure"), self.forces[layers // 2]
        radius = (0.75 * now / STIFF) ** (1 / 3)
        self.places = np.linalg.norm(result.fields.points[:, ::2], axis=1) / radius
        self.pressure = fields["contact_pressure"] / (1.5 * now / (math.pi * radius**2))
        self.pressure[result.fields.points[:, 1] > 0.5] = np.nan

    def worst_pressure(self, within):
        """Largest difference from sqrt(1 - (r / a)^2)."""
        on = (self.pressure > 0.0) & (self.places < within)
        assert np.count_nonzero(on) > 4
        return np.abs(self.pressure[on] - np.sqrt(1.0 - self.places[on] ** 2)).max()


@pytest.mark.parametrize("method", ["massless", "conserving"])
def test_axisymmetric_sphere(method):
    # a / R = .032; the theory itself is 1.4 % off in the force, .7 % in the time.
    found = Impact("axisymmetric", 1e-4, 2, 4, method=method)
    assert found.time == pytest.approx(1.0, abs=0.01)
    assert found.force == pytest.approx(1.0, abs=0.016)
    assert found.impulse == pytest.approx(1.0, abs=1e-3)
    # Up once, down once: it does not ring. Energy that is kept to rounding stays in waves, too.
    assert found.variation == pytest.approx(2.0, abs=1e-6 if method == "massless" else 1e-3)
    assert found.energy.max() <= 1.0 + (1e-9 if method == "conserving" else 1e-12)
    assert found.energy.min() >= 1.0 - (1e-9 if method == "conserving" else 1e-4)
    assert found.worst_pressure(0.9) <= 0.02


def test_difference_from_hertz_falls_with_the_contact_radius():
    slow, fast = (Impact("axisymmetric", speed, 2, 8).force - 1.0 for speed in (1e-5, 1e-3))
    assert 0.0 < slow <= 0.007
    # (v / c)^(2/5): 6.3 for two decades.
    assert fast / slow == pytest.approx(10**0.8, rel=0.15)


def test_axisymmetric_sphere_of_degree_one():
    found = Impact("axisymmetric", 1e-5, 1, 16, size=0.05)
    assert found.time == pytest.approx(1.0, abs=0.015)
    assert found.force == pytest.approx(1.0, abs=0.02)
    assert found.variation == pytest.approx(2.0, abs=1e-6)
    assert found.worst_pressure(0.9) <= 0.03


@pytest.mark.slow
def test_quarter_of_a_sphere():
    found = Impact("3d", 1e-4, 2, 3, size=0.3)
    assert found.time == pytest.approx(1.0, abs=0.015)
    assert found.force == pytest.approx(1.0, abs=0.02)
    assert found.impulse == pytest.approx(1.0, abs=1e-3)
    assert found.variation == pytest.approx(2.0, abs=1e-6)
    # Three elements on the radius: the pressure at corners is a mean over the elements there.
    assert found.worst_pressure(0.75) <= 0.05


def line_contact(degree, per_width, *, width=0.05):
    """Half a disc at rest under its weight: history, places / a and pressure / p0."""
    load = math.pi * STIFF * width**2 / 4.0  # a = sqrt(4 F R / (pi E*))
    body = {
        "name": "disc", "kind": "solid", "model": "plane_strain", "mesh_size": 0.1,
        "shape": {"kind": "disc", "radius": 1.0, "center": [0.0, 1.0], "symmetry": ["x"]},
        "refine": [{"point": [0.0, 0.0], "radius": 1.2 * width, "size": width / per_width}],
        "degree": degree, "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": NU,
        "rayleigh_mass": 0.8,
    }  # fmt: skip
    floor = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    result = impactfem.solve(
        impactfem.Scene.from_dict(
            {
                "title": "line contact", "duration": 60.0, "gravity": [0.0, -load / math.pi],
                "body": [body], "obstacle": [floor],
                "solve": {"method": "massless", "dt": 0.2, "estimate": False},
                "output": {"fields": ["vtkhdf"], "every": 300},
            }
        )
    )  # fmt: skip
    force = float(result.history["contact_force"][-1])
    width, peak = math.sqrt(4 * force / (math.pi * STIFF)), math.sqrt(force * STIFF / math.pi)
    fields, points = result.fields.read(-1, "contact_pressure", "gap"), result.fields.points
    on = np.isfinite(fields["gap"])
    return force / load, points[on, 0] / width, fields["contact_pressure"][on] / peak


@pytest.mark.parametrize(("degree", "per_width", "tolerance"), [(1, 8, 0.015), (2, 4, 0.01)])
def test_pressure_of_line_contact_at_rest(degree, per_width, tolerance):
    force, x, pressure = line_contact(degree, per_width)
    # The disc of degree 1 is a polygon: it weighs less.
    assert force == pytest.approx(1.0, abs=2e-3 if degree == 1 else 1e-4)
    inner = x < 0.8
    assert np.count_nonzero(inner) == 7
    np.testing.assert_allclose(pressure[inner], np.sqrt(1.0 - x[inner] ** 2), rtol=tolerance)
    assert pressure[x > 1.0 + 1.0 / per_width].max() == 0.0
