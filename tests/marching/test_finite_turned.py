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
