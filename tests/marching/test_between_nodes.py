"""Obstacles that come to lie in a solid between its nodes, where no gap holds them off."""

import math

import numpy as np
import pytest
from moving_scenes import check_restart
from surfaces import box, write_stl

import impactfem
from impactfem import Scene, SceneError

TIP = {"kind": "box", "center": [0.375, -0.02 - math.sqrt(0.5)], "size": [1.0, 1.0],
       "angle": math.pi / 4}  # fmt: skip
CHAIN = {"kind": "polyline", "points": [[-0.625, -1.02], [0.375, -0.02], [1.375, -1.02]]}
PIN = {"kind": "sphere", "center": [0.375, -0.04], "radius": 0.02}


def unit_square(obstacle, way, **more):
    """A square of 4 x 4 elements, with an obstacle that moves up by a formula."""
    block = {
        "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.25,
        "shape": {"kind": "block", "size": [1.0, 1.0]},
        "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
    }  # fmt: skip
    moved = obstacle | {"name": "table", "motion": ["0.0", way]}
    return Scene.from_dict(
        {"title": "between nodes", "duration": 0.01, "body": [block], "obstacle": [moved],
         "output": {"fields": []}, "solve": {"estimate": False, "dt": 5e-4}} | more
    )  # fmt: skip


def found(scene):
    """Penetrations that a run tells, and how it is judged."""
    verdict = impactfem.solve(scene).summary["verdict"]
    return [each for each in verdict["findings"] if each["code"] == "penetration"], verdict["level"]


@pytest.mark.parametrize("obstacle", [TIP, CHAIN])
def test_a_corner_between_nodes_is_measured(obstacle):
    (each,), level = found(unit_square(obstacle, "7*t"))
    assert each["value"] == pytest.approx(0.05 / math.sqrt(2.0), rel=1e-9)
    assert (each["severity"], level) == ("warning", "care")
    assert "table lies up to 0.05 m in block between its nodes" in each["text"]
    assert "smaller elements where block meets table" in each["remedy"]


@pytest.mark.parametrize(
    "obstacle",
    [
        {"kind": "box", "center": [-0.3, -0.52], "size": [1.4, 1.0]},
        {"kind": "polyline", "points": [[-1.0, -0.02], [0.4, -0.02], [0.4, -1.0]]},
        {"kind": "sphere", "center": [0.4, -0.52], "radius": 0.5},
    ],
)
def test_faces_on_a_table_that_ends_between_nodes_are_trusted(obstacle):
    """Where nodes hold them, and chords of what is round."""
    assert found(unit_square(obstacle, "2.2*t"))[0] == []


@pytest.mark.parametrize("obstacle", [PIN, TIP | {"center": [0.4, -0.02], "size": [0.02, 0.02]}])
@pytest.mark.parametrize("speed", [50.0, 800.0])
def test_what_comes_to_lie_wholly_in_a_body_is_no_contact(obstacle, speed):
    """At the higher speed, 0.4 a step, it is in the body at two levels and behind it at last."""
    (each,), level = found(unit_square(obstacle, f"{speed}*t"))
    assert each["value"] > 0.1
    assert (each["severity"], level) == ("fault", "do_not_trust")


def test_what_was_seen_outlives_a_stop(tmp_path, monkeypatch):
    """The corner leaves before the run goes on."""
    output = {"fields": [], "checkpoint": 5}
    scene = unit_square(TIP, "0.07*sin(pi*t/0.01)", output=output)
    whole, other = check_restart(scene, 18, tmp_path, monkeypatch)
    assert "penetration" in {each["code"] for each in whole.summary["verdict"]["findings"]}
    assert whole.summary["verdict"] == other.summary["verdict"]


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((0.33, 0.33, 0.33), (0.36, 0.36, 0.36)),
        ((0.33, 0.33, -1.0), (0.36, 0.36, 2.0)),
        ((-1.0, 0.33, 0.33), (0.4, 0.36, 0.36)),
        ((-1.0, -1.0, -1.0), (2.0, 2.0, 2.0)),
        ((-1.0, -1.0, -1.0), (2.0, 2.0, -0.01)),
    ],
)
def test_surfaces_of_files_lie_in_no_body_at_first(tmp_path, low, high):
    """Within it, through it, into it, around it; the last one is beside it."""
    write_stl(tmp_path / "part.stl", box(np.subtract(high, low), low))
    cube = {
        "kind": "solid", "name": "cube", "model": "3d", "mesh_size": 0.25,
        "shape": {"kind": "block", "size": [1.0, 1.0, 1.0]},
        "density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
    }  # fmt: skip
    part = {"kind": "mesh", "name": "part", "mesh": str(tmp_path / "part.stl")}
    scene = Scene.from_dict(
        {"title": "part", "duration": 1e-4, "body": [cube], "obstacle": [part],
         "output": {"fields": []}, "solve": {"estimate": False}}
    )  # fmt: skip
    if high[2] < 0.0:
        assert found(scene)[0] == []
    else:
        with pytest.raises(SceneError, match=r"lie in each other|inside obstacle 'part'"):
            impactfem.solve(scene)
