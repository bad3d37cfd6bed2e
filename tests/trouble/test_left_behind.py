"""Runs leave no meshes behind: MPI has about 2000 communicators, and each mesh holds some ten."""

import gc

import pytest

from impactfem import Scene, solve
from impactfem.fem import dolfinx_mesh

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}


def block(name, low, **more):
    return {
        "kind": "solid", "name": name, "model": "plane_strain", "mesh_size": 0.025,
        "shape": {"kind": "block", "size": [0.1, 0.05], "corner": [0.0, low]},
        "density": 1000.0, "youngs_modulus": 1e7, "poisson_ratio": 0.3, "velocity": [0.0, -1.0],
    } | more  # fmt: skip


TIE = {"name": "glue", "between": ["a/top", "b/bottom"]}
SCENES = {
    "estimated": {"body": [block("a", 0.0)], "solve": {"estimate": True}},
    "explicit": {"body": [block("a", 0.0)], "solve": {"method": "explicit"}},
    "at rest, of finite strain": {
        "body": [block("a", 0.0, strain="finite", velocity=[0.0, 0.0])],
        "gravity": [0.0, -9.81],
        "start": "static",
    },
    "meeting": {
        "body": [block("a", 0.0), block("b", 0.05, velocity=[0.0, -2.0])],
        "contact": [{"between": ["a", "b"]}],
    },
    "tied": {"body": [block("a", 0.0), block("b", 0.05, mesh_size=0.02)], "tie": [TIE]},
}


def meshes():
    return sum(isinstance(each, dolfinx_mesh.Mesh) for each in gc.get_objects())


@pytest.mark.parametrize("name", SCENES)
def test_no_mesh_waits_for_the_garbage_collector(name):
    more = dict(SCENES[name])
    more["contact"] = [{"between": ["a", "floor"]}, *more.get("contact", ())]
    scene = Scene.from_dict(
        {"title": name, "duration": 1e-3, "obstacle": [FLOOR], "output": {"fields": []}} | more
    )
    solve(scene)  # what is kept of the last scene is there from now on
    gc.collect()
    gc.disable()
    try:
        before = meshes()
        for _ in range(2):
            solve(scene)
        assert meshes() == before
    finally:
        gc.enable()
