"""Of which part of a whole a scene is: cuts and symmetry supports against guides."""

import numpy as np
import pytest
from solid_scenes import FLOOR, solid_scene

import impactfem
from impactfem.studies.hard.meshes import square

BLOCK = {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 0.1]}
BRICK = {"kind": "block", "size": [1.0, 0.5, 0.5], "corner": [0.0, 0.1, 0.0]}
SPACE = {
    "model": "3d", "velocity": [0.0, -0.1, 0.0], "mesh_size": 0.5,
    "obstacles": ({"kind": "half_space", "point": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]},),
}  # fmt: skip
WALL = {"kind": "half_space", "point": [1.5, 0.0], "normal": [-1.0, 0.0]}
SLOPE = {"kind": "half_space", "point": [0.0, 0.0], "normal": [0.1, 1.0]}


def held(*surfaces):
    return [{"surface": surface, "kind": "symmetry"} for surface in surfaces]


@pytest.mark.parametrize(
    ("keys", "planes"),
    [
        ({}, {}),
        ({"shape": BLOCK | {"symmetry": ["x"]}}, {"x": 0.5}),
        ({"shape": BRICK | {"symmetry": ["x", "z"]}, **SPACE}, {"x": 0.5, "z": 0.25}),
        # The plane of a half, said by a support.
        ({"shape": BLOCK, "supports": held("left")}, {"x": 0.0}),
        ({"shape": BLOCK, "supports": held("right")}, {"x": 1.0}),
        ({"shape": BRICK, "supports": held("left", "front"), **SPACE}, {"x": 0.0, "z": 0.5}),
        # Guides.
        ({"shape": BLOCK, "supports": held("left", "right")}, {}),
        ({"shape": BLOCK | {"symmetry": ["x"]}, "supports": held("right")}, {"x": 0.5}),
        ({"shape": BRICK, "supports": held("left", "back", "front"), **SPACE}, {"x": 0.0}),
        ({"shape": BLOCK, "supports": held("bottom"), "obstacles": (WALL,),
          "gravity": [0.0, -1.0]}, {}),
        ({"shape": BLOCK, "supports": held("left"), "obstacles": (WALL,)}, {}),
        ({"shape": BLOCK, "supports": held("left"), "obstacles": (SLOPE,)}, {}),
        ({"shape": BLOCK, "supports": held("left"),
          "obstacles": (FLOOR | {"motion": ["0.1*t", "0"]},)}, {}),
        ({"shape": BLOCK, "supports": held("left"),
          "obstacles": (FLOOR | {"motion": ["0", "0.1*t"]},)}, {"x": 0.0}),
        ({"shape": BLOCK, "supports": [{"surface": "left", "kind": "motion", "value": ["0", ""]}]},
         {}),
        ({"model": "axisymmetric",
          "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.6]}}, {}),
    ],
)  # fmt: skip
def test_planes_that_cut_a_body(keys, planes):
    plan = impactfem.plan(solid_scene(**keys))
    assert dict(plan.whole.planes) == pytest.approx(planes)
    assert plan.whole.factor == 2 ** len(planes)
    assert ("those of the whole" in plan.reasons.get("symmetry", "")) is bool(planes)


def test_half_of_a_mesh_file_is_told_of_as_the_whole(tmp_path):
    path = tmp_path / "square.msh"
    path.write_text(square(0.02), encoding="ascii")
    common = {"mesh": str(path), "mesh_size": None, "shape": None, "solve": {"dt": 0.05}}
    thrown = {"velocity": [0.0, -0.1], "duration": 1.0}
    half = impactfem.solve(solid_scene(**common, supports=held("left"), **thrown))
    assert half.summary["details"]["symmetry_factor"] == 2
    assert half.summary["details"]["symmetry_planes"] == {"x": -0.5}
    velocity = half.history["body.vy"].values
    assert half.history["kinetic_energy"].values[0] == pytest.approx(2 * 0.5 * velocity[0] ** 2)
    assert half.history["momentum"].values[0] == pytest.approx(2 * velocity[0])
    impulse = half.summary["contact"]["impulse"]
    assert impulse > 0.1
    assert impulse == pytest.approx(float(half.history["momentum"][-1]) - 2 * velocity[0], rel=1e-6)


@pytest.mark.parametrize(("other", "factor"), [(["x"], 2), ([], 1)])
def test_several_bodies_need_the_same_cuts(other, factor):
    block = {
        "kind": "solid", "model": "plane_strain", "mesh_size": 0.5, "density": 1.0,
        "youngs_modulus": 1.0, "poisson_ratio": 0.3,
    }  # fmt: skip
    low = {"kind": "block", "size": [1.0, 0.5], "corner": [-0.5, 0.0], "symmetry": ["x"]}
    high = low | {"corner": [-0.5, 0.51], "symmetry": other}
    scene = impactfem.Scene.from_dict(
        {
            "title": "two blocks", "duration": 0.2,
            "body": [block | {"name": "low", "shape": low},
                     block | {"name": "high", "shape": high, "velocity": [0.0, -0.1]}],
            "contact": [{"between": ["low", "high"]}],
        }
    )  # fmt: skip
    result = impactfem.solve(scene)
    assert result.summary["details"]["symmetry_factor"] == factor
    assert result.history["kinetic_energy"].values[0] == pytest.approx(0.5 * 0.5 * 0.01)
    text = result.summary["plan"]["reasons"]["symmetry"]
    assert ("not all bodies" in text) is (factor == 1)


def test_half_of_an_element_whose_mass_lies_on_a_line_does_not_turn():
    """Nodes that touch have no mass: of eight there are two left that move across the cut."""
    scene = solid_scene(
        model="3d", strain="finite", degree=1, cells="hexahedron", mesh_size=0.5,
        shape=BRICK | {"size": [0.5, 0.5, 0.5]}, velocity=[0.0, -0.5, 0.0], supports=held("left"),
        obstacles=SPACE["obstacles"], duration=1.0, contact_surfaces=["bottom"],
    )  # fmt: skip
    result = impactfem.solve(scene)
    assert result.history["contact_force"].values.max() > 0.0
    turned = [result.history[f"body.{n}"].values for n in ("qx", "qy", "qz", "wx", "wy", "wz")]
    assert abs(np.array(turned)).max() < 1e-9
