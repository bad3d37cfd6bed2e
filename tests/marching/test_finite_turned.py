"""Finite strain in scenes that small strains get wrong, and in the same scene said turned."""

import numpy as np
import pytest

import impactfem

RUBBER = {
    "name": "body", "kind": "solid", "material": "neo_hookean", "density": 1100.0,
    "youngs_modulus": 1e6, "poisson_ratio": 0.4,
}  # fmt: skip


def solved(body, obstacle, duration, dt, **more):
    return impactfem.solve(
        impactfem.Scene.from_dict(
            {
                "title": "turned", "duration": duration, "body": [RUBBER | body],
                "obstacle": [obstacle | {"name": "wall"}], "output": {"fields": []},
                "solve": {"dt": dt, "estimate": False, "method": "conserving"},
            } | more
        )
    )  # fmt: skip


def thrown(dim, angle):
    """A pressed, spinning block that is thrown aslant at a plane, all turned about z."""
    c, s = np.cos(angle), np.sin(angle)

    def vector(x, y):
        return [c * x - s * y, s * x + c * y, 0.0][:dim]

    # In space two cells thick, so that what has mass lies in one plane: its moments do not fit.
    size = np.array([0.06, 0.1, 0.05][:dim])
    corner = np.array(vector(0.1, 0.0502)) - 0.5 * size
    body = {
        "model": "plane_strain" if dim == 2 else "3d",
        "cells": "simplex" if dim == 2 else "hexahedron",
        "mesh_size": 0.0125 if dim == 2 else 0.025,
        "shape": {"kind": "block", "size": size.tolist(), "corner": corner.tolist(),
                  "angle": angle},
        "velocity": vector(0.3, -2.0),
        "angular_velocity": 30.0 if dim == 2 else [0.0, 0.0, 30.0],
        "pressures": [{"surface": "top", "value": 2e3}],
    }  # fmt: skip
    plane = {"kind": "half_space", "point": [0.0] * dim, "normal": vector(0.0, 1.0)}
    rows = solved(body, plane, 4e-3, 1e-4, gravity=vector(0.5, -10.0)).history
    places = np.stack([rows["body.x"].values, rows["body.y"].values])
    back = np.array([[c, s], [-s, c]]) @ places
    return [back, rows["contact_force"].values, rows["total_energy"].values]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_scene_that_is_turned_has_the_same_answer(dim):
    straight = thrown(dim, 0.0)
    assert straight[1].max() > 0.0
    for one, other in zip(straight, thrown(dim, 0.7), strict=True):
        assert np.abs(other - one).max() <= 1e-10 * np.abs(one).max()


BEAM = {"kind": "block", "size": [0.2, 0.05], "corner": [-0.1, 0.06], "angle": 0.5236}
UPRIGHT = {"kind": "block", "size": [0.05, 0.2], "corner": [0.0, -0.1]}
FLOOR = {"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
PIN = {"kind": "cylinder", "radius": 0.03, "center": [-0.032, 0.07]}


@pytest.mark.parametrize(
    ("shape", "velocity", "obstacle"),
    [(BEAM, [0.0, -1.0], FLOOR), (UPRIGHT, [-1.5, 0.0], PIN)],
    ids=["beam dropped at 30 degrees", "block struck off its centre"],
)
def test_what_turned_beyond_small_strains_keeps_its_energy(shape, velocity, obstacle):
    body = {"model": "plane_strain", "mesh_size": 0.0125, "shape": shape, "velocity": velocity}
    result = solved(body, obstacle, 0.08, 4e-4)
    energy = result.history["total_energy"].values
    assert np.ptp(energy) <= 1e-10 * energy[0]
    assert result.summary["bodies"]["body"]["rotation_max"] > 0.3
    assert result.summary["status"] == "completed"


CUBE = {"size": [0.1, 0.1, 0.1], "corner": [0.001, 0.001, 0.001]}
BOX = {"size": [0.12, 0.06, 0.03], "corner": [0.0, 0.0, 1.0]}


@pytest.mark.slow
def test_a_cube_on_its_corner_is_thrown_straight_back():
    body = {"model": "3d", "cells": "hexahedron", "mesh_size": 1 / 30, "velocity": [-0.8] * 3,
            "shape": CUBE | {"kind": "block"}}  # fmt: skip
    result = solved(body, FLOOR | {"point": [0.0] * 3, "normal": [3**-0.5] * 3}, 0.03, 1e-3)
    rows = result.history
    energy = rows["total_energy"].values
    speeds = np.array([rows[f"body.v{axis}"].values[-1] for axis in "xyz"])
    assert np.ptp(energy) <= 1e-10 * energy[0]
    assert rows["contact_force"].values[-1] == 0.0
    assert 0.3 < speeds[0] < 0.8  # the rest is vibration
    assert np.ptp(speeds) < 1e-9
    turned = [rows[f"angular_momentum.{axis}"].values for axis in "xyz"]
    assert np.abs(turned).max() < 1e-11 * abs(rows["momentum"].values[0])


@pytest.mark.slow
def test_a_box_that_spins_about_its_middle_axis_keeps_its_angular_momentum():
    body = {"model": "3d", "cells": "hexahedron", "mesh_size": 0.015,
            "shape": BOX | {"kind": "block"}, "angular_velocity": [0.3, 30.0, 0.0]}  # fmt: skip
    result = solved(body, FLOOR | {"point": [0.0] * 3, "normal": [0.0, 0.0, 1.0]}, 0.1, 2e-3)
    rows = result.history
    energy = rows["total_energy"].values
    assert np.ptp(energy) <= 1e-10 * energy[0]
    turned = np.array([rows[f"angular_momentum.{axis}"].values for axis in "xyz"])
    assert np.ptp(turned, axis=1).max() <= 1e-10 * turned[1, 0]
    assert result.summary["bodies"]["body"]["rotation_max"] > 2.0
