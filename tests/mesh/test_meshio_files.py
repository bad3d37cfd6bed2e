"""Bodies from files that meshio reads: the same as from a .msh file, or refused by name."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import pytest

import impactfem
from impactfem.errors import MeshError, MissingDependencyError
from impactfem.mesh.body_files import read_body
from impactfem.reading.opening import MESHIO
from impactfem.scene.obstacles.mesh import RigidMesh
from impactfem.scene.surface_files import closed_surface

# In a process of its own: netCDF4 and h5py bring libraries of HDF5 that cannot write side by side.
WRITE = """
import itertools, sys
import meshio, numpy as np
folder, kinds = sys.argv[1], dict(word.split("=") for word in sys.argv[2:])
n = 4
points = np.array([[i / n, j / n, 0.0] for i in range(n + 1) for j in range(n + 1)])
at = lambda i, j: i * (n + 1) + j
squares = [[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
           for i in range(n) for j in range(n)]
cells = np.array([row for a, b, c, d in squares for row in ([a, b, c], [a, c, d])])
half = len(cells) // 2
sides = np.array([[at(i, 0), at(i + 1, 0)] for i in range(n)])
tags = [np.repeat([1, 2], half), np.full(n, 3)]
floor = np.flatnonzero(points[:, 1] == 0.0)

def write(name, kind, blocks, **more):
    meshio.write(f"{folder}/{name}", meshio.Mesh(points, blocks, **more), file_format=kind)

both = [("triangle", cells), ("line", sides)]
parts = [("triangle", cells[:half]), ("triangle", cells[half:])]
for ending, kind in kinds.items():
    name = f"body{ending}"
    try:
        if kind == "abaqus":
            text = ["*NODE", *(f"{k}, {x}, {y}, 0.0" for k, (x, y, _) in enumerate(points, 1))]
            for k, name_of in enumerate(("soft", "stiff")):
                text.append(f"*ELEMENT, TYPE=CPS3, ELSET={name_of}")
                text += [f"{1 + k * half + j}, {a + 1}, {b + 1}, {c + 1}"
                         for j, (a, b, c) in enumerate(parts[k][1])]
            text += ["*NSET, NSET=floor", ", ".join(str(k + 1) for k in floor)]
            text += ["*ELSET, ELSET=all, GENERATE", f"1, {2 * half}, 1"]
            open(f"{folder}/{name}", "w").write(chr(10).join(text) + chr(10))
        elif kind == "exodus":
            write(name, kind, parts, point_sets={"floor": floor})
        elif kind == "med":
            mesh = meshio.Mesh(points, both, cell_data={"cell_tags": [-tags[0], -tags[1]]})
            mesh.cell_tags = {-1: ["soft"], -2: ["stiff"], -3: ["floor"]}
            meshio.write(f"{folder}/{name}", mesh)
        elif kind in ("gmsh22", "xdmf"):
            write(name, kind, both, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
                  field_data={"soft": [1, 2], "stiff": [2, 2], "floor": [3, 1]})
        else:
            try:
                write(name, kind, both, cell_data={"gmsh:physical": tags})
            except Exception:
                write(name, kind, both[:1])
    except Exception:
        open(f"{folder}/{name}", "w").write("meshio cannot write it")
write("pentagon.vtu", "vtu", [("polygon", np.array([[0, 5, 10, 11, 1]]))])
write("mixed.vtu", "vtu", [("triangle", cells[2:]), ("quad", np.array(squares[:1]))])
write("volume.vtu", "vtu", [("tetra", np.array([[0, 5, 1, 3]]))])
lone = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
edges = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
ten = meshio.Mesh(np.r_[lone, lone[edges].mean(1)], [("tetra10", np.arange(10)[None])])
meshio.write(f"{folder}/ten.vtu", ten)
meshio.write(f"{folder}/four.ply", meshio.Mesh(
    lone, [("triangle", np.array([(1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)]))]))
"""
GROUPS = {  # words of the two materials and the surface in files that keep them
    ".msh": ("soft", "stiff", "floor"), ".xdmf": ("1", "2", "3"),
    ".inp": ("soft", "stiff", "floor"), ".med": ("soft", "stiff", "floor"),
    ".e": ("1", "2", "floor"), ".vtu": ("1", "2", "3"), ".vtk": ("1", "2", "3"),
    ".mesh": ("1", "2", "3"),
}  # fmt: skip
if find_spec("netCDF4") is None:  # as on Debian, whose meshio only suggests it
    del GROUPS[".e"]
ENDINGS = [ending for ending, kind in MESHIO.items() if kind != "exodus" or ".e" in GROUPS]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("meshio")
    kinds = dict(MESHIO) | {".msh": "gmsh22"}
    words = [f"{ending}={kind}" for ending, kind in kinds.items()]
    command = [sys.executable, "-c", WRITE, str(folder), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def read(path, **keys):
    return read_body(Path(path), keys.pop("model", "plane_strain"), keys.pop("degree", 1), **keys)


def test_materials_and_surfaces_are_those_of_the_msh_file(folder):
    def parts(ending):
        *inside, floor = GROUPS[ending]
        raw = read(folder / f"body{ending}", used=[floor], materials=inside)
        centres = [raw.points[raw.cells[raw.groups[name]]].mean(axis=1) for name in inside]
        ends = raw.points[raw.surfaces[floor]].reshape(-1, 2)
        return [np.unique(np.round(each, 12), axis=0) for each in (*centres, ends)]

    known = parts(".msh")
    assert [len(each) for each in known] == [16, 16, 5]
    for ending in GROUPS:
        for own, expected in zip(parts(ending), known, strict=True):
            np.testing.assert_array_equal(own, expected, err_msg=ending)


def scene(path, **keys):
    return impactfem.Scene.from_dict({
        "title": "Square on a floor", "duration": 0.8,
        "body": [{
            "name": "square", "kind": "solid", "model": "plane_strain", "mesh": str(path),
            "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3, "velocity": [0.0, -1.0],
        } | keys],
        "obstacle": [{
            "name": "floor", "kind": "half_space", "point": [0.0, -0.01], "normal": [0.0, 1.0],
        }],
        "solve": {"estimate": False, "method": "massless", "dt": 0.05},
    })  # fmt: skip


def test_a_run_of_two_materials_is_that_of_the_msh_file(folder):
    materials = {"soft": {"youngs_modulus": 0.5}, "stiff": {"density": 2.0}}
    impulses = []
    for ending in (".msh", ".inp"):
        keys = {"contact_surfaces": ["floor"], "materials": materials}
        result = impactfem.solve(scene(folder / f"body{ending}", **keys))
        impulses.append(result.summary["contact"]["impulse"])
    assert impulses[1] == pytest.approx(impulses[0], rel=1e-12)
    assert impulses[0] > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("ending", ENDINGS)
def test_each_format_is_read_as_written_or_refused_and_broken_files_always(
    folder, tmp_path, ending, monkeypatch
):
    # Six of its readers go round for ever in half a file, until their time is up.
    monkeypatch.setattr("impactfem.reading.apart._SECONDS", 2)

    def held(path):
        try:
            return read(path), ""
        except MeshError as error:
            return None, str(error)

    path = folder / f"body{ending}"
    raw, why = held(path)
    assert (raw is None) == why.startswith(f"mesh file {path}: ")
    if raw is not None:
        thirds = [k + third for k in range(4) for third in (1 / 3, 2 / 3)]
        each = np.sort(np.tile(np.array(thirds) / 4, 4))
        centres = raw.points[raw.cells].mean(axis=1)
        assert np.ptp(raw.points, axis=0).tolist() == [1.0, 1.0]
        np.testing.assert_allclose(
            np.sort(centres, axis=0), np.column_stack([each, each]), atol=1e-12
        )
    (tmp_path / path.name).write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    raw, why = held(tmp_path / path.name)
    # Half of a file whose format has no end may be a mesh.
    assert raw is not None or why.startswith(f"mesh file {tmp_path / path.name}: ")


def test_quadratic_elements_have_their_nodes_in_order(folder):
    raw = read(folder / "ten.vtu", model="3d", degree=2)
    middles = raw.points[raw.cells[0][4:]]
    ends = raw.points[raw.cells[0][np.array([(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)])]]
    np.testing.assert_allclose(middles, ends.mean(axis=1), atol=1e-15)


def test_surfaces_of_obstacles(folder):
    stone = RigidMesh(mesh=str(folder / "four.ply"))
    assert len(closed_surface(stone, 3).simplices) == 4


def refused(path, error=MeshError, **keys):
    with pytest.raises(error) as told:
        read(path, **keys)
    return str(told.value)


def test_what_cannot_be_used_is_refused_by_name(folder, tmp_path):
    assert "polygon" in refused(folder / "pentagon.vtu")
    assert "mixes elements: Triangle 3, Quadrilateral 4" in refused(folder / "mixed.vtu")
    assert "has volumes" in refused(folder / "volume.vtu")
    assert "give each one by body.materials" in refused(folder / "body.inp")
    text = refused(folder / "body.inp", materials=["soft"])
    assert "'stiff' has no material" in text
    (tmp_path / "more.inp").write_text("*NODE\n1, 0, 0, 0\n* include, input=/etc/passwd\n")
    assert "is another file" in refused(tmp_path / "more.inp")
    text = (folder / "body.inp").read_text()
    (tmp_path / "more.inp").write_text(text + "*ELSET, ELSET=two\nsoft, stiff\n")
    assert "ELSET=two lists sets by name" in refused(tmp_path / "more.inp")
    (tmp_path / "more.inp").write_text(text.replace(", ELSET=soft", ""))
    assert "give each its own" in refused(tmp_path / "more.inp")
    (tmp_path / "none.vtu").write_text("<VTKFile")
    assert "none.vtu: meshio says: it cannot be read as vtu" in refused(tmp_path / "none.vtu")


def test_files_elsewhere_are_not_opened(folder, tmp_path):
    text = (folder / "body.xdmf").read_text()
    (tmp_path / "a.xdmf").write_text(text)
    assert "body.h5, which it needs, cannot be read" in refused(tmp_path / "a.xdmf")
    (tmp_path / "b.xdmf").write_text(text.replace("body.h5", f"{folder}/body.h5"))
    assert "put that file into the same folder" in refused(tmp_path / "b.xdmf")
    hidden = text.replace("body.h5:/data0", f"<![CDATA[{folder}/body.h5:/data0]]>")
    assert hidden != text
    (tmp_path / "c.xdmf").write_text(hidden)
    (tmp_path / "body.h5").write_bytes((folder / "body.h5").read_bytes())
    assert "is in another file" in refused(tmp_path / "c.xdmf")
    with h5py.File(tmp_path / "body.h5", "a") as file:
        file["away"] = h5py.ExternalLink(str(folder / "body.h5"), "/data0")
    assert "is in another file" in refused(tmp_path / "a.xdmf")


def test_without_meshio_the_extra_is_named(folder, tmp_path, monkeypatch):
    (tmp_path / "meshio.py").write_text("raise ImportError('no meshio')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    text = refused(folder / "body.vtu", MissingDependencyError)
    assert "pip install 'impactfem[meshes]'" in text
