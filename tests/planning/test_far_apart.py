"""Nothing is said of contacts of bodies that are too far from each other to meet."""

import pytest

import impactfem
from impactfem import Scene

BLOCK = {
    "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.5,
    "shape": {"kind": "block", "size": [1.0, 1.0]},
    "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
}  # fmt: skip
POINT = {"kind": "point", "mass": 1.0}


def told(speed=1.0, x=-1000.0, y=0.5, bodies=(), **more):
    """Codes of a plan with points that are far from a block, one behind the other."""
    points = [
        POINT | {"name": "one", "position": [x, y], "velocity": [speed, 0.0]},
        POINT | {"name": "two", "position": [2.0 * x, y]},
    ]
    floor = {"kind": "half_space", "point": [0.0, -0.001], "normal": [0.0, 1.0]}
    scene = Scene.from_dict(
        {"title": "far", "duration": 0.01, "body": [BLOCK, *points, *bodies], "obstacle": [floor],
         "output": {"fields": []}, "solve": {"estimate": False}} | more
    )  # fmt: skip
    return {finding.code for finding in impactfem.plan(scene).findings}


def test_nothing_is_said_of_what_is_far():
    assert not told() & {"setting", "contact_single_node"}


@pytest.mark.parametrize("near", [{"x": -0.001}, {"speed": 2e5}, {"gravity": [1e8, 0.0]}])
def test_what_may_meet_is_told(near):
    """Where it is, by its speed, and by what gravity gives it; others may strike it on."""
    assert {"setting", "contact_single_node"} <= told(**near)


def test_points_near_the_floor_are_told_of_its_law_only():
    found = told(y=0.01)
    assert "setting" in found
    assert "contact_single_node" not in found


def test_what_moves_obstacles_may_meet_anything():
    moving = {"kind": "half_space", "point": [0.0, -0.001], "normal": [0.0, 1.0],
              "motion": ["0.0", "t"]}  # fmt: skip
    assert {"setting", "contact_single_node"} <= told(obstacle=[moving])
