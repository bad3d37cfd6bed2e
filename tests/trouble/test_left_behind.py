"""Runs leave no meshes behind: MPI has about 2000 communicators, and each mesh holds some ten."""

import gc
from collections import Counter

import pytest

from impactfem import Scene, solve
from impactfem.fem import PETSc, dolfinx_mesh

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
    "tied, of finite strain": {
        "body": [block("a", 0.0, strain="finite"), block("b", 0.05, mesh_size=0.02)],
        "tie": [TIE],
    },
    "joined at rest": {
        "body": [block("a", 0.0, velocity=[0.0, 0.0]), block("b", 0.05, velocity=[0.0, 0.0])],
        "joint": [
            {
                "name": "j",
                "kind": "fixed",
                "between": ["a/top", "b/bottom"],
                "point": [0.05, 0.05],
                "radius": 0.026,
            }
        ],
        "gravity": [0.0, -9.81],
        "start": "static",
    },
    "tied": {"body": [block("a", 0.0), block("b", 0.05, mesh_size=0.02)], "tie": [TIE]},
}


def kept():
    """Meshes, and matrices and the like that are not freed."""
    kinds = dolfinx_mesh.Mesh, PETSc.Object
    return Counter(
        type(each).__name__
        for each in gc.get_objects()
        if isinstance(each, kinds) and getattr(each, "handle", True)
    )


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
        before = kept()
        for _ in range(2):
            solve(scene)
        assert kept() == before
    finally:
        gc.enable()
