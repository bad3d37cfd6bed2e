"""Contact laws that name a surface of a solid against an obstacle."""

import numpy as np
import pytest

import impactfem
from impactfem import SceneError

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
WALL = {"kind": "half_space", "name": "wall", "point": [-0.01, 0.0], "normal": [1.0, 0.0]}


def block(contacts, obstacles=(FLOOR,), velocity=(0.0, -0.5)):
    return impactfem.Scene.from_dict(
        {
            "title": "block",
            "duration": 2e-3,
            "body": [
                {
                    "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.05,
                    "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 5e-4]},
                    "density": 1000.0, "youngs_modulus": 1e8, "poisson_ratio": 0.3,
                    "velocity": list(velocity),
                }
            ],
            "obstacle": list(obstacles),
            "contact": [{"between": list(between)} for between in contacts],
            "solve": {"estimate": False},
            "output": {"fields": []},
        }
    )  # fmt: skip


def test_only_the_named_surface_touches():
    struck = impactfem.solve(block([("block/bottom", "floor")]))
    alone = impactfem.solve(block([]))
    assert np.array_equal(struck.history["contact_force"], alone.history["contact_force"])
    assert struck.summary["contact"]["impulse"] > 0.0
    missed = impactfem.solve(block([("block/top", "floor")]))
    assert missed.summary["contact"]["impulse"] == 0.0
    codes = {found["code"]: found for found in missed.summary["verdict"]["findings"]}
    assert codes["outside_contact"]["severity"] != "note"  # what lay in the floor is told


def test_surfaces_that_differ_from_obstacle_to_obstacle_are_refused():
    laws = [("block/bottom", "floor"), ("block/left", "wall")]
    with pytest.raises(SceneError, match="name the same surfaces of block for all"):
        impactfem.plan(block(laws, (FLOOR, WALL)))
    impactfem.plan(block([("block", "floor"), ("block", "wall")], (FLOOR, WALL)))
