"""Cheaper models are offered where they give the same motion, and only there."""

import re

import numpy as np
import pytest
from solid_scenes import DISC, FLOOR, FLOOR_3D, solid_scene

import impactfem
from impactfem.planning.offers import offers

BLOCK = {"kind": "block", "size": [0.5, 1.0], "corner": [0.0, 0.02]}
FLAT = BLOCK | {"size": [1.0, 0.5]}
ROD = {"kind": "cylinder", "radius": 0.5, "height": 1.0, "center": [0, 0.1, 0]}
BRICK = {"kind": "block", "size": [0.5, 1.0, 0.4], "corner": [0.0, 0.02, 0.0]}
BALL = {"kind": "sphere", "radius": 0.5, "center": [0.1, 0.52, 0.3]}
BLOCKED = [{"surface": "left", "kind": "symmetry"}, {"surface": "right", "kind": "symmetry"}]
SLAB = [{"surface": "back", "kind": "symmetry"}, {"surface": "front", "kind": "symmetry"}]
DOWN = [0.0, -0.1, 0.0]
TILTED = FLOOR | {"normal": [0.1, 1.0]}
HOLLOW = {"kind": "sphere", "center": [0.0, -2.0], "radius": 2.0}


HILL = {"kind": "sphere", "radius": 1.0}
STEP = {"kind": "box", "center": [0.2, -1.0, 0.2]}


def blocked(**keys):
    return solid_scene(**({"shape": BLOCK, "supports": BLOCKED} | keys))


def free(**keys):
    return solid_scene(**({"shape": BLOCK, "poisson_ratio": 0.0} | keys))


def ball(**keys):
    common = {"shape": BALL, "model": "3d", "velocity": DOWN, "obstacles": (FLOOR_3D,)}
    return solid_scene(**(common | keys))


def slab(**keys):
    common = {"shape": BRICK, "model": "3d", "velocity": DOWN, "obstacles": (FLOOR_3D,)}
    return solid_scene(**(common | {"supports": SLAB} | keys))


@pytest.mark.parametrize(
    "scene",
    [
        blocked(),
        blocked(gravity=[0.0, -1.0]),
        blocked(velocity=[0.0, "-0.1 + 0.01*y"]),
        blocked(model="plane_stress"),
        blocked(supports=[*BLOCKED, {"surface": "top", "kind": "fixed"}]),
        blocked(shape=BLOCK | {"symmetry": ["x"]}, supports=BLOCKED[1:]),
        blocked(model="axisymmetric", supports=BLOCKED[1:]),
        blocked(  # a wall at its right, near end "right"
            supports=[{"surface": s, "kind": "symmetry"} for s in ("bottom", "top")],
            obstacles=({"kind": "half_space", "point": [1.0, 0.0], "normal": [-1.0, 0.0]},),
            velocity=[0.1, 0.0],
        ),
        slab(supports=SLAB + BLOCKED),
        free(),
        free(supports=BLOCKED[:1]),
    ],
)
def test_a_block_that_moves_as_a_bar_is_offered_as_one(scene):
    assert "bar" in offers(scene)


@pytest.mark.parametrize(
    "scene",
    [
        blocked(supports=BLOCKED[:1]),  # a free side: it widens
        blocked(supports=[*BLOCKED, {"surface": "bottom", "kind": "fixed"}]),  # held in front
        blocked(velocity=[0.0, "-0.1 + 0.01*x"]),
        blocked(velocity=[0.01, -0.1]),
        blocked(gravity=[0.1, -1.0]),
        blocked(displacement=[0.0, "0.001*x*y"]),
        blocked(obstacles=(TILTED,)),
        blocked(obstacles=(HOLLOW,)),
        blocked(obstacles=(FLOOR | {"motion": ["0", "0.01*sin(t)"]},)),
        blocked(pressures=[{"surface": "top", "value": 1.0}]),
        blocked(contact_surfaces=["top"]),
        blocked(rayleigh_mass=0.1),
        blocked(supports=[{"surface": s, "kind": "fixed"} for s in ("left", "right")]),
        free(poisson_ratio=0.1),
        free(angular_velocity=0.1),
        free(shape=BLOCK | {"angle": 0.1, "corner": [0.0, 0.2]}),
        free(supports=[{"surface": "left", "kind": "fixed"}]),
        solid_scene(poisson_ratio=0.0),  # a disc
        slab(supports=SLAB),  # the sides are free
    ],
)
def test_a_block_that_does_not_move_as_a_bar_is_not(scene):
    assert "bar" not in offers(scene)


@pytest.mark.parametrize(
    "scene",
    [
        blocked(gravity=[0.0, -0.02]),
        free(),
        blocked(model="plane_stress", thickness=0.3),
        blocked(shape=FLAT, model="axisymmetric", supports=BLOCKED[1:]),
    ],
)
def test_the_bar_offered_moves_as_the_block(scene):
    text = offers(scene)["bar"]
    keys = {
        key: float(re.search(rf"\b{key} = ([-+.e\d]*\d)", text)[1])
        for key in ("length", "density", "youngs_modulus", "area", "gap", "velocity")
    }
    assert keys["density"] * keys["length"] * keys["area"] == pytest.approx(scene.solid.mass)
    pull = -float(scene.vector_gravity.at(0.0)[1])
    bar = impactfem.Scene(
        title="as offered", duration=scene.duration, gravity=pull,
        bodies=[impactfem.Bar(**keys)], obstacles=[impactfem.Wall()],
    )  # fmt: skip
    exact = impactfem.solve(bar, method="exact").history
    fine = scene.with_settings({"body.body.mesh_size": 1 / 32})
    found = impactfem.solve(fine, method="massless", estimate=False).history
    found = found.sel(time=found["time"] <= scene.duration)
    way = found["body.y"].values - found["body.y"].values[0]
    times = found["time"].values
    wanted = np.interp(times, exact["time"], exact["bar.x"] - exact["bar.x"][0])
    # Measured with elements of 1/8, 1/16, 1/32: .051, .023, .0076 of the way at worst.
    assert np.abs(way - wanted).max() <= 0.01 * np.abs(wanted).max()
    pushed = np.sum(found["contact_force"].values[1:] * np.diff(times))
    t = exact["time"].values
    assert pushed == pytest.approx(np.sum(exact["contact_force"].values[1:] * np.diff(t)), rel=0.03)


@pytest.mark.parametrize(
    ("scene", "offered"),
    [
        (ball(), True),
        (ball(gravity=[0.0, -1.0, 0.0], velocity=[0, "-0.1*y", 0]), True),
        (ball(shape=ROD), True),
        (ball(obstacles=(HILL | {"center": [0.1, -1.0, 0.3]},)), True),
        (ball(obstacles=(HILL | {"center": [0.0, -1.0, 0.3]},)), False),
        (ball(obstacles=(FLOOR_3D | {"normal": [0.0, 1.0, 0.1]},)), False),
        (ball(obstacles=(FLOOR_3D | {"motion": ["sin(t)", "0", "0"]},)), False),
        (ball(velocity=[0.01, -0.1, 0.0]), False),
        (ball(velocity=[0, "-0.1 + 0.01*x", 0]), False),
        (ball(gravity=[0.1, -1.0, 0.0]), False),
        (ball(angular_velocity=[0.0, 1.0, 0.0]), False),
        (ball(shape=BRICK), False),
        (ball(tractions=[{"surface": "surface", "value": ["x", 0, 0]}]), False),
    ],
)  # fmt: skip
def test_round_bodies_in_round_surroundings_are_offered_as_axisymmetric(scene, offered):
    assert ("axisymmetric" in offers(scene)) is offered


@pytest.mark.parametrize(
    ("scene", "offered"),
    [
        (slab(), True),
        (slab(shape=BRICK | {"symmetry": ["z"]}, supports=SLAB[1:]), True),
        (slab(obstacles=(FLOOR_3D | {"normal": [0.1, 1.0, 0.0]},)), True),
        (slab(velocity=["0.1*x", -0.1, 0.0]), True),
        (slab(supports=SLAB[:1]), False),
        (slab(velocity=["0.1*z", -0.1, 0.0]), False),
        (slab(velocity=[0.0, -0.1, 0.1]), False),
        (slab(obstacles=(FLOOR_3D | {"normal": [0.0, 1.0, 0.1]},)), False),
        (slab(obstacles=(HILL | {"center": [0.2, -1.0, 0.2]},)), False),
        (slab(obstacles=(STEP | {"size": [1, 2, 0.4]},)), True),
        (slab(obstacles=(STEP | {"size": [1, 2, 0.3]},)), False),
    ],
)  # fmt: skip
def test_slabs_between_planes_of_symmetry_are_offered_as_plane_strain(scene, offered):
    assert ("plane_strain" in offers(scene)) is offered


NOTCH = {"kind": "polyline", "points": [[-1.0, 0.3], [0.0, -0.2], [1.0, 0.3]]}
CROOKED = NOTCH | {"points": [[-1.0, 0.3], [0.0, -0.2], [1.0, 0.2]]}
PAIR = tuple({"kind": "sphere", "center": [s * 0.6, -0.3], "radius": 0.4} for s in (-1, 1))
MIDDLE = BLOCK | {"corner": [-0.25, 0.02]}
TURNED = MIDDLE | {"angle": 0.1, "corner": [-0.25, 0.2]}
PULLED = [{"surface": "left", "value": ["y", 0]}, {"surface": "right", "value": ["-y", 0]}]
CLAMPS = [{"surface": name, "kind": "fixed"} for name in ("top", "left", "right")]


def middle(**keys):
    return solid_scene(shape=MIDDLE, **keys)


def brick(**keys):
    return solid_scene(model="3d", velocity=DOWN, obstacles=(FLOOR_3D,), **keys)


@pytest.mark.parametrize(
    ("scene", "axes"),
    [
        (solid_scene(), ["x"]),
        (solid_scene(obstacles=PAIR), ["x"]),
        (solid_scene(obstacles=(NOTCH,)), ["x"]),
        (solid_scene(velocity=["0.1*x", "-0.1 + x**2"]), ["x"]),
        (middle(supports=CLAMPS[:1]), ["x"]),
        (middle(supports=CLAMPS[1:]), ["x"]),
        (middle(pressures=[{"surface": "top", "value": "x**2*t"}]), ["x"]),
        (middle(tractions=PULLED), ["x"]),
        (brick(shape=BRICK), ["x", "z"]),
        (brick(shape=BRICK | {"symmetry": ["z"]}), ["x"]),
        (solid_scene(shape=DISC | {"symmetry": ["x"]}), []),
        (solid_scene(velocity=[0.01, -0.1]), []),
        (solid_scene(velocity=["0", "-0.1 + 0.01*x"]), []),
        (solid_scene(angular_velocity=0.01), []),
        (solid_scene(gravity=[0.1, -1.0]), []),
        (solid_scene(obstacles=(TILTED,)), []),
        (solid_scene(obstacles=PAIR[:1]), []),
        (solid_scene(obstacles=(FLOOR | {"motion": ["sin(t)", "0"]},)), []),
        (solid_scene(obstacles=(CROOKED,)), []),
        (middle(supports=CLAMPS[1:2]), []),
        (middle(tractions=PULLED[:1]), []),
        (middle(pressures=[{"surface": "top", "value": "x*t"}]), []),
        (middle(contact_surfaces=["bottom", "left"]), []),
        (solid_scene(shape=TURNED), []),
    ],
)
def test_symmetric_scenes_are_offered_as_their_part(scene, axes):
    text = offers(scene).get("symmetry", "")
    assert bool(text) is bool(axes)
    for axis in axes:
        assert f'"{axis}"' in text


def test_the_half_offered_moves_as_the_whole():
    # Far above what the meshes of a disc differ by, so that they are not compared.
    shape = DISC | {"center": [0.0, 0.52]}
    common = {"solve": {"method": "massless", "estimate": False}, "velocity": [0.0, -0.1]}
    case = solid_scene(shape=shape, **common)
    half = solid_scene(shape=shape | {"symmetry": ["x"]}, **common)
    whole, part = (impactfem.solve(scene).history for scene in (case, half))
    wanted = whole["body.y"].values - whole["body.y"].values[0]
    found = part["body.y"].values - part["body.y"].values[0]
    assert np.abs(found - wanted).max() <= 0.02 * np.abs(wanted).max()
    force, other = whole["contact_force"].values, part["contact_force"].values
    assert other.sum() == pytest.approx(force.sum(), rel=0.02)


def test_a_block_that_rocks_is_offered_located_impacts():
    """Steps lose 2 to 4 % of its amplitude; a method that is named is not argued with."""
    block = {"kind": "block", "size": [0.2, 0.8], "corner": [-0.1, 0.0]}
    data = {
        "title": "rocks", "duration": 1.0, "gravity": [0.0, -9.81],
        "body": [{"kind": "rigid", "name": "b", "density": 500.0, "shape": block,
                  "angular_velocity": 0.4}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0, 0], "normal": [0, 1]}],
        "contact": [{"between": ["b", "floor"], "friction_coefficient": 0.7}],
    }  # fmt: skip
    offer = impactfem.plan(impactfem.Scene.from_dict(data)).reasons["offer method"]
    assert 'solve.method = "event_driven"' in offer
    named = impactfem.Scene.from_dict(data | {"solve": {"method": "moreau_jean"}})
    assert "offer method" not in impactfem.plan(named).reasons
