"""Parts of STEP assemblies: taken by name, in their place, bonded where several make one body."""

import re
import subprocess
import sys

import numpy as np
import pytest

import impactfem
from impactfem.errors import MeshError, SceneError
from impactfem.mesh.body_files import read_body
from impactfem.mesh.checks import check_body

DRAW = """
import gmsh, sys
gmsh.initialize(readConfigFiles=False)
occ = gmsh.model.occ
occ.addBox(0, 0, 0, 20, 10, 5)
occ.addBox(0, 0, 5, 20, 10, 3)
occ.addSphere(40, 0, 0, 4)
occ.addSphere(60, 0, 0, 4)
occ.synchronize()
gmsh.write(sys.argv[1])
"""
NAMES = {1: "housing", 2: "board", 3: "screw", 4: "screw"}
STUFF = {"density": 1000.0, "youngs_modulus": 1e7, "poisson_ratio": 0.3}


@pytest.fixture(scope="module")
def assembly(tmp_path_factory):
    path = tmp_path_factory.mktemp("step") / "assembly.step"
    subprocess.run([sys.executable, "-c", DRAW, path], check=True, capture_output=True)
    text = path.read_text()
    product = re.search(r"PRODUCT\('([^']*)'", text)[1]
    for number, name in NAMES.items():
        text = text.replace(f"{product}.{number}'", f"{name}'")
    path.write_text(text.replace(f"{product}'", "box'"))
    return path


def part(path, name, **more):
    return read_body(path, "3d", 1, mesh_size=4e-3, part=name, **more)


def test_a_part_is_taken_where_it_is(assembly):
    raw = part(assembly, "board")
    assert np.ptp(raw.points, axis=0) == pytest.approx([0.02, 0.01, 0.003])
    assert raw.points.min(axis=0) == pytest.approx([0.0, 0.0, 0.005], abs=1e-9)
    assert sorted(raw.surfaces) == [f"face_{k}" for k in range(1, 7)]
    assert "'board'" in raw.source.text
    assert raw.source.text.endswith("its unit of length: millimetre")
    fourth = part(assembly, "4/screw")  # of two of one name, by its place in the assembly
    assert fourth.points.mean(axis=0) == pytest.approx([0.06, 0.0, 0.0], abs=1e-3)


def test_the_unit_of_the_file_counts(assembly):
    path = assembly.with_name("metres.step")
    path.write_text(assembly.read_text().replace(".MILLI.,.METRE.", "$,.METRE."))
    raw = read_body(path, "3d", 1, mesh_size=4.0, part="board")
    assert np.ptp(raw.points, axis=0) == pytest.approx([20.0, 10.0, 3.0])
    assert raw.source.text.endswith("its unit of length: metre")


def test_parts_that_touch_are_one_body_of_two_materials(assembly):
    path = assembly.with_name("two.step")
    program = DRAW.replace("occ.addSphere", "0 and occ.addSphere")
    subprocess.run([sys.executable, "-c", program, path], check=True, capture_output=True)
    with pytest.raises(MeshError, match=r'take one by body\.part = "(.*1)"') as told:
        read_body(path, "3d", 1, mesh_size=4e-3)
    first = str(told.value).split('"')[1]
    raw = read_body(
        path, "3d", 1, mesh_size=4e-3, materials=[first, f"{first[:-1]}2"]
    )  # they share faces: else this check finds two pieces
    assert check_body(raw, "it", axisymmetric=False) == pytest.approx(20 * 10 * 8e-9)
    assert sum(map(len, raw.groups.values())) == len(raw.cells)


def test_rigid_bodies_and_obstacles_are_parts_too(assembly):
    body = {"kind": "rigid", "name": "b", "mesh": str(assembly), "mesh_size": 0.01, "density": 1e3}
    stone = {"kind": "mesh", "name": "s", "mesh": str(assembly), "mesh_size": 0.01}
    tables = {
        "title": "parts", "duration": 1e-3, "gravity": [0.0, 0.0, -9.81],
        "body": [body | {"part": "board"}],
    }  # fmt: skip
    scene = impactfem.Scene.from_dict(tables)
    assert scene.bodies[0].form.volume == pytest.approx(20 * 10 * 3e-9)
    ball = {"kind": "rigid", "name": "b", "shape": {"kind": "sphere", "radius": 1e-3}, "mass": 1.0}
    ball["shape"]["center"] = [0.0, 0.0, 0.1]
    tables |= {"body": [ball], "obstacle": [stone | {"part": "housing"}]}
    scene = impactfem.Scene.from_dict(tables)
    points = scene.obstacles[0].surface.points
    assert np.ptp(points, axis=0) == pytest.approx([0.02, 0.01, 0.005])
    assert impactfem.Scene.from_dict(scene.to_dict()) == scene
    tables |= {"body": [body | {"part": "nut"}], "obstacle": []}
    known = r"no part 'nut', it has 'housing', 'board', '3/screw', '4/screw'; give one"
    with pytest.raises(SceneError, match=rf"body\[0\]\.mesh = .*{known}"):
        impactfem.Scene.from_dict(tables)


def test_only_step_files_have_parts(assembly):
    body = {"kind": "solid", "name": "b", "model": "3d", **STUFF, "part": "nut"}
    tables = {"title": "parts", "duration": 1e-3, "gravity": [0.0] * 3}
    for more in (
        {"mesh": "a.msh"},
        {"shape": {"kind": "block", "size": [1, 1, 1]}, "mesh_size": 1},
    ):
        with pytest.raises(
            SceneError, match=r'body\[0\]\.part = "nut": only a STEP file has parts'
        ):
            impactfem.Scene.from_dict(tables | {"body": [body | more]})
    with pytest.raises(MeshError, match="no part 'nut', it has 'housing'"):
        part(assembly, "nut")
