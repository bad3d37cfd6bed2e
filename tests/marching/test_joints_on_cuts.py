"""Masses, springs and joints on planes of symmetry that cut a solid: as on the whole of it."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

from impactfem import Scene, solve
from impactfem.errors import SceneError
from impactfem.planning import plan

LOW = {"kind": "half_space", "name": "floor", "point": [0.0, -1e-4], "normal": [0.0, 1.0]}
TOP = {"name": "j", "between": ["block/top", "ground"], "point": [0.0, 0.1]}
MASS = {"name": "m", "body": "block", "mass": 3.0}
FALLS = {"velocity": ["0", "-1"]}


def scene(cuts, duration=2e-3, dt=1e-4, body=None, dim=2, **more):
    size, corner = [0.2, 0.1, 0.1][:dim], [-0.1, 0.0, -0.05][:dim]
    shape = {"kind": "block", "size": size, "corner": corner, "symmetry": list(cuts)}
    block = {
        "kind": "solid", "name": "block", "model": "3d" if dim == 3 else "plane_stress",
        "cells": "hexahedron", "mesh_size": 0.025, "density": 1000.0, "youngs_modulus": 1e7,
        "poisson_ratio": 0.3, "shape": shape,
    }  # fmt: skip
    floor = LOW | {"point": LOW["point"] + [0.0] * (dim - 2), "normal": [0.0, 1.0, 0.0][:dim]}
    return Scene.from_dict(
        {
            "title": "cut", "duration": duration, "obstacle": [floor],
            "solve": {"dt": dt, "estimate": False, "method": "conserving"},
            "body": [block | (body or {})], "output": {"fields": []},
        } | more
    )  # fmt: skip


LOADS = {
    "mass": {"body": FALLS, "point_mass": [MASS | {"point": [0.0, 0.1]}]},
    "mass on a surface": {"body": FALLS, "point_mass": [MASS | {"surface": "top"}]},
    "mass inside": {"body": FALLS, "point_mass": [MASS | {"point": [0.0, 0.06]}]},
    "spring": {
        "body": FALLS, "spring": [{"name": "s", "between": ["block/top", "ground"],
        "points": [[0, 0.1], [0, 0.3]], "stiffness": 1e5, "damping": 10.0}],
    },
    "spring of a surface": {
        "body": FALLS, "spring": [{"name": "s", "between": ["block/top", "ground"],
        "stiffness": [1e5, 2e5], "damping": 10.0}],
    },
    "slide": {
        "body": FALLS, "joint": [TOP | {"kind": "prismatic", "axis": [0, 1], "stiffness": 1e5,
        "damping": 20.0, "friction": 5.0, "motor": "-10 - 1e3*t - 2*v"}],
    },
    "moved": {"joint": [TOP | {"kind": "fixed", "motion": ["0", "-2e-4*sin(2e3*t)**2"]}]},
    "screw": {
        "joint": [TOP | {"kind": "fixed", "axis": [0, 1], "preload": 100.0}], "start": "static",
        "gravity": [0.0, -100.0],
    },
    "finite hinge": {
        "joint": [TOP | {"kind": "revolute"}], "gravity": [0.0, -500.0], "body": {
        "strain": "finite", "supports": [{"surface": "bottom", "kind": "fixed"}]},
    },
}  # fmt: skip
SPACE = {
    "screw": {
        "joint": [TOP | {"kind": "fixed", "axis": [0, 1, 0], "point": [0.0, 0.1, 0.0],
        "preload": 100.0}], "start": "static", "gravity": [0.0, -100.0, 0.0],
    },
    "mass": {
        "body": {"velocity": ["0", "-1", "0"]},
        "point_mass": [MASS | {"point": [0.0, 0.1, 0.0]}],
    },
    # A tip off the middle, which turns about the axis across the plane.
    "hinge": {
        "joint": [TOP | {"kind": "revolute", "axis": [0, 0, 1], "point": [0.05, 0.1, 0.0]}],
        "gravity": [0.0, -500.0, 0.0],
    },
    "finite mass": {
        "point_mass": [MASS | {"point": [0.05, 0.1, 0.0]}], "gravity": [0.0, -500.0, 0.0], "body": {
        "strain": "finite", "supports": [{"surface": "bottom", "kind": "fixed"}]},
    },
}  # fmt: skip


def alike(cuts, **more):
    """Histories of the part are those of the whole."""
    whole, part = (solve(scene(cut, **more)).history for cut in ((), cuts))
    length = {"x": 0.1, "y": 0.1, "z": 0.1, "q": 0.1, "gap": 0.1, "moment": 10.0}
    for name in whole.data_vars:
        if name != "active":  # nodes of what is computed
            known = whole[name].values
            size = max(np.abs(known).max(), length.get(name.split(".")[-1], 1.0))
            np.testing.assert_allclose(part[name].values, known, atol=1e-10 * size, err_msg=name)
    return whole


@pytest.mark.parametrize("load", LOADS)
def test_half_of_a_body_is_the_whole(load):
    whole = alike(("x",), **LOADS[load])
    if load.startswith("mass"):
        assert whole["kinetic_energy"].values[0] == pytest.approx(0.5 * (20.0 + 3.0))
    if load == "screw":
        np.testing.assert_allclose(whole["j.force"].values, 100.0, rtol=1e-7)


@pytest.mark.parametrize(
    ("load", "cuts"),
    [("screw", "xz"), ("mass", "z"), ("mass", "xz"), ("hinge", "z"), ("finite mass", "z")],
)
def test_halves_and_quarters_in_space(load, cuts):
    alike(cuts, dim=3, duration=1e-3, dt=2e-4, **SPACE[load])


def test_two_halves_slide_along_each_other():
    """Of two solids, both cut: what the joint between them says is the whole's."""
    low = scene(()).to_dict()["body"][0]
    high = low | {"name": "high", "velocity": ["0", "-1"]}
    slide = {"name": "j", "between": ["block/top", "high/bottom"], "point": [0.0, 0.1],
             "kind": "prismatic", "axis": [0, 1], "stiffness": 1e5, "damping": 5.0}  # fmt: skip
    given = scene(()).to_dict() | {"joint": [slide]}
    both = []
    for cuts in ([], ["x"]):
        shapes = [low["shape"] | {"symmetry": cuts, "corner": [-0.1, y]} for y in (0.0, 0.1)]
        bodies = [low | {"shape": shapes[0]}, high | {"shape": shapes[1]}]
        both.append(solve(Scene.from_dict(given | {"body": bodies})).history)
    for name in ("j.q", "j.force", "j.lost", "total_energy", "momentum.y", "force.block.floor"):
        size = np.abs(both[0][name].values).max()
        np.testing.assert_allclose(both[1][name].values, both[0][name].values, atol=1e-10 * size)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"point_mass": [MASS | {"point": [0.05, 0.1]}]},
         r"point_mass\[0\].point = \[0\.05, 0\.1\] is off the plane x = 0 that cuts block"),
        ({"point_mass": [MASS | {"surface": "right"}]},
         r"point_mass\[0\].surface = \[0\.1, 0\.05\] is off the plane"),
        ({"spring": [{"between": ["block/top", "ground"], "points": [[0, 0.1], [0.1, 0.3]],
                      "stiffness": 1.0}]},
         r"spring\[0\].points\[1\] = \[0\.1, 0\.3\] is off the plane"),
        ({"joint": [TOP | {"kind": "prismatic", "axis": [1, 1]}]},
         r"joint\[0\].axis = \[1\.0, 1\.0\] is at an angle to a plane of symmetry"),
        ({"joint": [TOP | {"kind": "revolute", "motor": "1"}]},
         r"joint\[0\].motor acts across a plane of symmetry, which it would break"),
        ({"joint": [TOP | {"kind": "fixed", "motion": ["t**2", "0"]}]},
         r"joint\[0\].motion\[0\] = .* moves what a plane of symmetry holds"),
        ({"joint": [TOP | {"kind": "fixed", "between": ["block/top", "box"]}]},
         r"joint\[0\].between = .*symmetry cuts block, and not box alike.*point_mass"),
    ],
)  # fmt: skip
def test_what_is_two_such_things_is_refused(keys, words):
    box = {"kind": "rigid", "name": "box", "mass": 1.0,
           "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [-0.05, 0.1]}}  # fmt: skip
    given = scene(("x",)).to_dict() | keys
    given["body"] = [*given["body"], *[box] * ("box" in words)]
    with pytest.raises(SceneError, match=words) as caught:
        Scene.from_dict(given)
    assert len(str(caught.value)) < 700


def test_supports_of_what_joints_hold_are_guides():
    """They do not say of how much of a whole they are."""
    side = [{"surface": "left", "kind": "symmetry"}]
    for loads, factor in (({}, 2), (LOADS["mass"], 1)):
        found = plan(scene((), **loads | {"body": FALLS | {"supports": side}}))
        assert found.whole.factor == factor
        assert ("guides" in found.reasons.get("symmetry supports", "")) is (factor == 1)


@pytest.mark.parallel([1, 2])
def test_restart_equals_the_whole_run(tmp_path, monkeypatch):
    keys = LOADS["slide"] | {"output": {"fields": [], "checkpoint": 4}}
    check_restart(scene(("x",), 1e-3, **keys), 7, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    check_ranks(lambda: scene(("x",), 1e-3, **LOADS["slide"] | LOADS["mass"]), monkeypatch)
