"""Several solids that cannot be: exit code 2, one message with its remedy, nothing written.

And what looks wrong but is not: bodies that never meet, or leave for ever.
"""

import json

import pytest
from conftest import launch
from processes import contents

from impactfem.cli import BAD_INPUT, DONE

BLOCKS = """
title = "Two blocks"
duration = 0.5

[[body]]
name = "left"
kind = "solid"
model = "plane_strain"
shape = { kind = "block", size = [1.0, 0.5], corner = [0.0, 0.0] }
mesh_size = 0.25
density = 1.0
youngs_modulus = 1.0
poisson_ratio = 0.0
velocity = [0.1, 0.0]

[[body]]
name = "right"
kind = "solid"
model = "plane_strain"
shape = { kind = "block", size = [1.0, 0.5], corner = [1.02, 0.0] }
mesh_size = 0.2
density = 1.0
youngs_modulus = 1.0
poisson_ratio = 0.0
"""
SECOND = "size = [1.0, 0.5], corner = [1.02, 0.0]"


VTX = '[output]\nfields = ["vtx"]\n'


def second(size, corner):
    assert BLOCKS.count(SECOND) == 1
    return BLOCKS.replace(SECOND, f"size = {size}, corner = {corner}")


def both(cells):
    return BLOCKS.replace("mesh_size = 0.2\n", f"mesh_size = 0.2\n{cells}\n")


BAD = {
    "side by side": (second([1.0, 0.5], [0.9, 0.0]), ["left and right", "0.1 m", "(0.9,", "move"]),
    "deep": (second([1.0, 0.5], [0.5, 0.1]), ["left and right overlap", "at t = 0", "move"]),
    "inside": (second([0.3, 0.2], [0.4, 0.15]), ["left and right overlap", "at t = 0", "move"]),
    "crossing": (second([0.2, 1.5], [0.4, -0.5]), ["left and right overlap", "at t = 0", "move"]),
    "on top": (second([1.0, 0.5], [0.0, 0.0]), ["left and right overlap", "at t = 0", "move"]),
    "by displacement": (
        BLOCKS.replace("velocity", "displacement = [0.05, 0.0]\nvelocity"),
        ["left and right overlap", "0.03 m", "displacement"],
    ),
    "different cells": (
        both('cells = "hexahedron"') + VTX,
        ["output.fields", 'fields = ["vtkhdf"]'],
    ),
    "different degrees": (both("degree = 2") + VTX, ["of degree 2", "VTKHDF"]),
    "explicit, degree 2": (
        both("degree = 2") + '[solve]\nmethod = "explicit"\n',
        ["body right: degree = 2", 'method = "massless"'],
    ),
    "too long a step": (
        BLOCKS + '[solve]\nmethod = "explicit"\ndt = 0.4\n',
        ["0.4 s", "stability limit", "use solve.dt <= 0.12"],
    ),
    "unknown surface": (
        BLOCKS + '[[contact]]\nbetween = ["left/rihgt", "right"]\n',
        ["contact[0].between", "rihgt", 'did you mean "right"'],
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_bodies_are_refused(name, command, work):
    text, parts = BAD[name]
    (work / "scene.toml").write_text(text, encoding="utf-8")
    before = contents(work)
    done = command("run", "scene.toml")
    assert done.code == BAD_INPUT, done.err
    for part in parts:
        assert part in done.err
    assert "Traceback" not in done.err
    assert contents(work) == before


@pytest.mark.slow
def test_every_rank_ends_and_one_speaks(work):
    (work / "scene.toml").write_text(BAD["deep"][0], encoding="utf-8")
    before = contents(work)
    done = launch(work, 2, "-m", "impactfem", "run", "scene.toml")
    assert done.code == BAD_INPUT, done.err
    assert done.err.count("overlap by") == 1
    assert contents(work) == before


def force_and_energy(work):
    summary = json.loads((work / "out/summary.json").read_text())
    assert summary["status"] == "completed"
    return summary["contact"]["max_force"], summary["energy"]["max_relative_drift"]


LONE = {
    "leaves for ever": (BLOCKS.replace("[0.1, 0.0]", "[-0.1, 0.0]"), "the bodies meet nothing"),
    "passes by": (second([1.0, 0.5], [1.02, 5.0]), "body right touches nothing"),
    "in no contact": (
        BLOCKS + '[[obstacle]]\nname = "floor"\nkind = "half_space"\npoint = [0.0, -1.0]\n'
        'normal = [0.0, 1.0]\n[[contact]]\nbetween = ["left", "floor"]\n',
        "body right touches nothing: no [[contact]] names it",
    ),
}


@pytest.mark.parametrize("method", ["explicit", "massless"])
@pytest.mark.parametrize("name", LONE)
def test_bodies_that_never_meet_just_move(name, method, command, work):
    text, warning = LONE[name]
    (work / "scene.toml").write_text(text, encoding="utf-8")
    quiet = ("--set", "output.fields=[]", "--set", f"solve.method={method}")
    done = command("run", "scene.toml", "--out", "out", *quiet)
    assert done.code == DONE, done.err
    assert f"warning: {warning}" in done.err
    force, drift = force_and_energy(work)
    assert force == 0.0
    assert drift < 1e-10
