"""Bodies from files: .msh, .geo and STEP, and what is wrong with broken ones."""

import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from measures import facet_nodes
from pytest_mpi import parallel_assert

import impactfem
from impactfem.errors import MeshError
from impactfem.fem import MPI
from impactfem.mesh.body import build_body_mesh
from impactfem.mesh.session import gmsh_session
from impactfem.scene.solids import Solid

MATERIAL = {"density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3}
SQUARE = """
Point(1) = {0, 0, 0, 0.25}; Point(2) = {1, 0, 0, 0.25};
Point(3) = {1, 1, 0, 0.25}; Point(4) = {0, 1, 0, 0.25};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Curve("floor") = {1};
Physical Curve("lid") = {3};
Physical Surface("body") = {1};
"""
DISC = """
Point(1) = {0, 0, 0, 0.1}; Point(2) = {0.5, 0, 0, 0.1}; Point(3) = {-0.5, 0, 0, 0.1};
Circle(1) = {2, 1, 3}; Circle(2) = {3, 1, 2};
Curve Loop(1) = {1, 2}; Plane Surface(1) = {1};
Physical Curve("rim") = {1, 2};
Physical Surface("body") = {1};
"""
EDGES = 32  # around the disc
HALF = math.pi / EDGES  # the angle of half an edge
# What polygons and parabolas of three points miss of a disc of radius 1/2.
MISSED = {1: math.pi / 4 - 0.25 * EDGES * math.sin(HALF) * math.cos(HALF)}
MISSED[2] = MISSED[1] - 0.25 * EDGES * 4 / 3 * math.sin(HALF) * (1 - math.cos(HALF))
CUBE = """
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 2, 3};
Physical Surface("ground", 7) = {3};
Physical Volume("body", 1) = {1};
Mesh.MeshSizeMax = 0.5;
"""
# Nodes, and elements as Gmsh's kind, physical group and nodes: format 2.2 says it shortest.
UNIT = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
TWO = ["2 1 1 2 3", "2 1 1 3 4"]


def listed(nodes, elements, names=()):
    """A .msh file of format 2.2."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    if names:
        lines += ["$PhysicalNames", str(len(names)), *names, "$EndPhysicalNames"]
    lines += ["$Nodes", str(len(nodes))]
    lines += [f"{k} {node}" for k, node in enumerate(nodes, 1)]
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    for k, element in enumerate(elements, 1):
        kind, group, rest = element.split(" ", 2)
        lines.append(f"{k} {kind} 2 {group} {group} {rest}")
    return "\n".join([*lines, "$EndElements", ""])


@pytest.fixture
def write(tmp_path):
    def write(content, name="body.msh"):
        path = tmp_path / name
        path.write_text(content)
        return path

    return write


def read(path, model="plane_strain", degree=1, comm=MPI.COMM_SELF, **more):
    solid = Solid(model=model, mesh=path.name, **MATERIAL, **more)
    return build_body_mesh(comm, solid, degree, path.parent)


def refused(path, *args, **keys):
    with pytest.raises(MeshError) as caught:
        read(path, *args, **keys)
    message = str(caught.value)
    assert message.startswith(f"mesh file {path}: ")
    assert len(message) < 600 + len(str(path))
    return message.removeprefix(f"mesh file {path}: ")


def saved(path, text, dim, degree=1, *, version=4.1, binary=0, everything=1):
    """Mesh a script in this process and save it."""
    with gmsh_session() as gmsh:
        script = path.with_suffix(".source.geo")
        script.write_text(text)
        gmsh.merge(str(script))
        gmsh.model.mesh.generate(dim)
        gmsh.model.mesh.setOrder(degree)
        options = {"MshFileVersion": version, "Binary": binary, "SaveAll": everything}
        for name, value in options.items():
            gmsh.option.setNumber("Mesh." + name, value)
        gmsh.write(str(path))
        gmsh.option.setNumber("Mesh.SaveAll", 0)
    return path


# good ones


def test_numbers_of_nodes_may_be_as_large_as_they_like(write):
    """A list of all numbers up to the largest would need 30 GiB."""
    elements = ["2 1 1 2 3", "2 1 1 3 4", "1 2 1 2", "1 3 3 4"]
    names = ['2 1 "body"', '1 2 "floor"', '1 3 "lid"']
    text = listed(["0 0 0", "1 0 0", "1 1 0", "0 1 0"], elements, names)
    one = read(write(text, "one.msh"), contact_surfaces=["lid"])
    large = text.replace("\n4 0 1 0", "\n4000000000 0 1 0").replace(" 3 4\n", " 3 4000000000\n")
    other = read(write(large, "other.msh"), contact_surfaces=["lid"])
    np.testing.assert_array_equal(one.mesh.geometry.x, other.mesh.geometry.x)
    assert {name: len(facets) for name, facets in other.surfaces.items()} == {"floor": 1, "lid": 1}


@pytest.mark.parametrize("degree", [1, 2])
def test_a_script_with_some_unnamed_boundary(write, degree):
    body = read(write(SQUARE, "body.geo"), degree=degree)
    assert body.cell == "triangle"
    assert body.degree == degree
    assert body.volume == pytest.approx(1.0)
    assert {name: len(facets) for name, facets in body.surfaces.items()} == {"floor": 4, "lid": 4}


def test_mesh_size_overrules_the_sizes_of_a_script(write):
    body = read(write(SQUARE, "body.geo"), mesh_size=0.1)
    assert len(body.facets("floor")) == 10


def test_a_script_can_be_refined(write):
    path = write(SQUARE, "body.geo")
    ball = {"point": [0.5, 0.0], "radius": 0.1, "size": 0.02}
    body = read(path, mesh_size=0.2, refine=[ball])
    assert len(body.facets("floor")) > 2 * len(body.facets("lid"))
    assert "refine needs mesh_size" in refused(path, refine=[ball])


@pytest.mark.parametrize("degree", [1, 2])
def test_centres_of_arcs_are_no_nodes_and_degree_2_is_curved(write, degree):
    body = read(write(DISC, "body.geo"), degree=degree)
    assert math.pi / 4 - body.volume == pytest.approx(MISSED[degree], rel=1e-6)
    assert (np.linalg.norm(body.mesh.geometry.x, axis=1) > 1e-12).sum() >= body.num_nodes - 1


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("degree", [1, 2])
def test_meshes_of_each_format_and_order(tmp_path, version, binary, order, degree):
    options = {"version": version, "binary": binary, "everything": 0}
    path = saved(tmp_path / "body.msh", DISC, 2, order, **options)
    if order > degree:
        message = refused(path, degree=degree)
        assert "curved, of order 2: nodes lie up to 0.03 of an element" in message
        assert "use body.degree = 2 with an implicit method, or save the mesh" in message
        return
    body = read(path, degree=degree)
    # Middles of edges that are not in the file lie on straight edges.
    assert math.pi / 4 - body.volume == pytest.approx(MISSED[order], rel=1e-6)
    assert len(body.facets("rim")) == EDGES
    told = f"order {order}{', curved' * (order == 2)}; curve 'rim' (32 elements) = a surface"
    assert told in body.source.text
    assert not body.source.unused


def test_curved_elements_of_order_3_are_refused(tmp_path):
    message = refused(saved(tmp_path / "body.msh", DISC, 2, 3), degree=2)
    assert "curved, of order 3" in message
    assert "save it with order 2" in message


@pytest.mark.parametrize("order", [2, 3])
def test_straight_elements_of_higher_order_lose_nothing_and_it_is_said(tmp_path, order):
    body = read(saved(tmp_path / "body.msh", SQUARE, 2, order))
    assert body.volume == pytest.approx(1.0)
    assert body.source.unused == (f"its geometry is of order {order}, but straight: read as 1",)
    assert body.source.unused[0] in body.source.text


SECOND = """
Point(5) = {2, 0, 0, 0.25}; Point(6) = {2, 1, 0, 0.25};
Line(5) = {2, 5}; Line(6) = {5, 6}; Line(7) = {6, 3};
Curve Loop(2) = {5, 6, 7, -2}; Plane Surface(2) = {2};
"""


def test_two_groups_of_elements_are_refused(write, tmp_path):
    two = SQUARE.replace('"body"', '"rubber"') + SECOND + 'Physical Surface("steel") = {2};'
    for path in (write(two, "body.geo"), saved(tmp_path / "body.msh", two, 2)):
        message = refused(path)
        assert re.search(r"2 groups .* 'rubber' \(\d+ elements\), surface 'steel'", message)
        assert 'Physical Surface("body")' in message
    box = 'Box(2) = {1, 0, 0, 1, 2, 3}; Coherence; Physical Volume("steel", 2) = {2};'
    message = refused(write(CUBE + box, "cube.geo"), "3d")
    assert "volume 'body'" in message
    assert "volume 'steel'" in message


def test_groups_that_format_2_mixes_are_refused(write):
    """Gmsh puts all elements of an elementary entity into the groups of any of them."""
    lines = listed(UNIT, ["1 7 1 2", "1 8 2 3", *TWO], ['1 7 "left"', '1 8 "right"', '2 1 "body"'])
    assert sorted(read(write(lines)).surfaces) == ["left", "right"]
    message = refused(write(lines.replace("1 2 8 8 2 3", "1 2 8 7 2 3")))
    assert "curve 'left'" in message
    assert "share the elementary entity 7" in message


def test_a_solid_in_space(write):
    body = read(write(CUBE, "body.geo"), "3d", degree=2)
    assert body.cell == "tetrahedron"
    assert body.volume == pytest.approx(6.0)
    assert list(body.surfaces) == ["ground"]
    x = body.mesh.geometry.x
    assert len(body.facets("ground")) > 10
    assert x[:, 1].min() == pytest.approx(0.0)


def test_elements_outside_the_physical_groups_are_left_out(write):
    body = read(write(SQUARE + SECOND, "body.geo"))
    assert body.volume == pytest.approx(1.0)
    (unused,) = body.source.unused
    assert re.fullmatch(r"44 of 86 elements are in no physical group and left out", unused)


def test_groups_of_numbers_are_names(write):
    path = write(listed(UNIT, ["1 7 1 2", "1 8 2 3", *TWO]))
    assert sorted(read(path).surfaces) == ["7", "8"]


def test_quadrilaterals_by_recombining(write):
    body = read(write(SQUARE, "body.geo"), cells="hexahedron", mesh_size=0.2)
    assert body.cell == "quadrilateral"
    assert body.volume == pytest.approx(1.0)


def test_hexahedra_of_a_transfinite_script(write):
    recombined = "Transfinite Curve{:} = 4; Transfinite Surface{:}; Transfinite Volume{:};"
    path = write(f"{CUBE}\n{recombined}\nRecombine Surface{{:}};", "body.geo")
    body = read(path, "3d", cells="hexahedron")
    assert body.cell == "hexahedron"
    assert body.num_cells == 27
    assert len(body.facets("ground")) == 9
    message = refused(write(CUBE, "body.geo"), "3d", cells="hexahedron")
    assert "volumes of hexahedra must be Transfinite" in message


def step_file(folder, draw):
    """A STEP file, written by a process of its own: Gmsh prints much while it does."""
    path = folder / "body.step"
    program = f"""
import gmsh
gmsh.initialize(readConfigFiles=False)
{draw}
gmsh.model.occ.synchronize()
gmsh.write({str(path)!r})
"""
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)
    return path


def test_step_in_millimetres_becomes_metres(tmp_path):
    path = step_file(tmp_path, "gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 20, 10)")
    body = read(path, "3d", degree=2, mesh_size=4e-3)
    assert body.volume == pytest.approx(math.pi * 1e-4 * 20e-3, rel=2e-3)
    assert sorted(body.surfaces) == ["face_1", "face_2", "face_3"]
    height = body.mesh.geometry.x[:, 2]
    assert np.ptp(height) == pytest.approx(20e-3)
    side, top, bottom = (
        height[facet_nodes(body, body.facets(name))] for name in sorted(body.surfaces)
    )
    assert np.ptp(side) == pytest.approx(20e-3)
    assert {round(float(end.mean()), 9) for end in (top, bottom)} == {0.0, 0.02}


def test_a_plane_step_file(tmp_path):
    path = step_file(tmp_path, "gmsh.model.occ.addDisk(0, 0, 0, 100, 100)")
    body = read(path, mesh_size=0.02)
    assert body.volume == pytest.approx(math.pi * 1e-2, rel=2e-2)
    assert sorted(body.surfaces) == ["edge_1"]


def test_the_boundary_at_r_0_is_the_axis(write):
    body = read(write(SQUARE, "body.geo"), "axisymmetric")
    assert len(body.facets("axis")) == 4


@pytest.mark.parallel([2, 4])
def test_a_file_is_read_and_refused_alike_on_all_ranks(tmp_path):
    comm = MPI.COMM_WORLD
    folder = Path(comm.bcast(str(tmp_path)))
    if comm.rank == 0:
        (folder / "good.geo").write_text(SQUARE)
        (folder / "bad.msh").write_text(listed(UNIT, ["2 1 1 2 3", "2 1 1 2 4"]))
    comm.barrier()
    body = read(folder / "good.geo", comm=comm)
    parallel_assert(body.volume == pytest.approx(1.0))
    try:
        read(folder / "bad.msh", comm=comm)
        message = ""
    except MeshError as error:
        message = str(error)
    parallel_assert("lie over each other" in message)


# broken ones


def test_files_that_cannot_be_read(write, tmp_path):
    assert "check `body.mesh`" in refused(tmp_path / "absent.msh")
    assert "empty" in refused(write(" \n"))
    assert "$MeshFormat" in refused(write("hello"))
    assert "ISO-10303-21" in refused(write("hello", "body.step"), mesh_size=1.0)
    assert "Gmsh" in refused(write("ISO-10303-21; nonsense", "body.stp"), "3d", mesh_size=1.0)
    cut = listed(UNIT, TWO)[:-40]
    assert refused(write(cut))


def test_a_script_can_run_no_commands(write, tmp_path):
    target = tmp_path / "touched"
    message = refused(write(f'SystemCall "touch {target}";\n{SQUARE}', "body.geo"))
    assert "'SystemCall' is not allowed" in message
    assert not target.exists()
    for word in ('a() = ListFromFile("x");', 'a = FileExists("x");'):
        assert "is not allowed" in refused(write(f"{word}\n{SQUARE}", "body.geo"))


@pytest.mark.parametrize("affine", ["", "Affine 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1\n"])
def test_which_nodes_are_copies_does_not_matter(write, affine):
    """Gmsh wrote such sections of format 2 anew in a way that it did not read again."""
    copies = f"$Periodic\n1\n0 2 1\n{affine}1\n2 1\n$EndPeriodic\n"
    assert read(write(listed(UNIT, TWO) + copies)).volume == pytest.approx(1.0)


BROKEN = {
    "inverted": (
        ["0 0 0", "1 0 0", "1 1 0", "0 1 0", "1.2 0.5 0"],
        ["2 1 1 2 5", "2 1 2 3 5", "2 1 3 4 5", "2 1 4 1 5"],
        "lie over each other",
    ),
    "flat": (["0 0 0", "1 0 0", "0.5 0 0", "0 1 0"], ["2 1 1 2 3", "2 1 1 2 4"],
             r"the triangle at \(0.5, 0\) is flat"),
    "mixed": (
        [*UNIT, "2 0 0"], ["3 1 1 2 3 4", "2 1 2 5 3"], "mixes elements: .*use one kind"),
    "apart": ([*UNIT, "5 0 0", "6 0 0", "5 1 0"], [*TWO, "2 1 5 6 7"],
              "falls into 2 parts that share no facets"),
    "joined at one node": ([*UNIT, "2 1 0", "2 2 0"], [*TWO, "2 1 3 5 6"],
                           "falls into 2 parts"),
    "doubled": (UNIT, [*TWO, "2 1 1 3 4"], "three or more elements share the facet"),
    "unjoined": ([*UNIT, "0 0 0", "1 1 0"], ["2 1 1 2 3", "2 1 5 6 4"], "falls into 2 parts"),
    "off the plane": (["0 0 1", "1 0 1", "1 1 1", "0 1 1"], TWO, "z runs from 1 to 1"),
    "upright": (["0 0 0", "1 0 0", "1 0 1", "0 0 1"], TWO, "z runs from 0 to 1"),
    "without elements": (UNIT, ["1 1 1 2"], "needs surfaces, it has none"),
    "in space": ([*UNIT, "0 0 1"], [*TWO, "4 1 1 2 3 5"], 'has volumes.*give model = "3d"'),
    "third order": (
        ["0 0 0", "3 0 0", "0 3 0", "1 0 0", "2 0 0", "2 1 0", "1 2 0", "0 2 0", "0 1 0", "1 1 0"],
        ["21 1 1 2 3 4 5 6 7 8 9 10"], None),
    "not finite": (["nan 0 0", *UNIT[1:]], TWO, ""),
    "curved too much": (
        ["0 0 0", "1 0 0", "0 1 0", "0.5 0.9 0", "0.5 0.5 0", "0 0.5 0"],
        ["9 1 1 2 3 4 5 6"], "the triangle .* is inverted"),
    "crossed": (UNIT, ["3 1 1 2 4 3"], "the quadrilateral .* is (inverted|flat)"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_meshes_are_explained(write, case):
    nodes, elements, wanted = BROKEN[case]
    path = write(listed(nodes, elements))
    degree = 2 if case == "curved too much" else 1
    if wanted is None:  # brought to the degree that is wanted
        assert read(path).volume == pytest.approx(4.5)
    else:
        assert re.search(wanted, refused(path, degree=degree))


def test_a_mesh_for_another_model(write):
    flat = listed(UNIT, TWO)
    assert "needs volumes, it has none; give a plane model" in refused(write(flat), "3d")
    left = listed(["-1 0 0", "1 0 0", "1 1 0", "-1 1 0"], TWO)
    message = refused(write(left), "axisymmetric")
    assert "nodes reach r = -1 < 0" in message


def test_a_mirrored_mesh_is_a_mesh(write):
    """Only cells that disagree with their neighbours are inverted."""
    assert read(write(listed(UNIT, ["2 1 1 3 2", "2 1 1 4 3"]))).volume == pytest.approx(1.0)
    assert read(write(listed(UNIT, ["2 1 1 3 2", "2 1 1 3 4"]))).volume == pytest.approx(1.0)


def test_nodes_without_elements(tmp_path):
    path = saved(tmp_path / "body.msh", SQUARE, 2)
    text = path.read_text()
    # Format 4.1 lists nodes by entity: one more inside the surface.
    header = re.search(r"\$Nodes\n(\d+) (\d+) (\d+) (\d+)\n", text)
    blocks, count, low, high = map(int, header.groups())
    text = text.replace(header[0], f"$Nodes\n{blocks} {count + 1} {low} {high + 1}\n")
    block = re.search(r"\n2 1 0 (\d+)\n", text)
    inside = int(block[1])
    lines = text[block.end() :].split("\n", 2 * inside)
    lines = [*lines[:inside], str(high + 1), *lines[inside : 2 * inside], "9 9 0", lines[-1]]
    path.write_text(text[: block.start()] + f"\n2 1 0 {inside + 1}\n" + "\n".join(lines))
    assert "1 nodes belong to no element, one at (9, 9, 0)" in refused(path)


def test_surfaces_that_do_not_exist_are_named_with_those_that_do(write):
    path = write(SQUARE, "body.geo")
    message = refused(path, supports=[{"surface": "flor", "kind": "fixed"}])
    assert "has no surface 'flor', it has floor, lid;" in message
    assert message.endswith("Did you mean 'floor'?")
    message = refused(path, contact_surfaces=["underside"])
    assert "has no surface 'underside', it has floor, lid" in message
    unnamed = write(SQUARE.replace("Physical Curve", "// "), "bare.geo")
    assert "it has none" in refused(unnamed, contact_surfaces=["floor"])


def test_surfaces_inside_the_body(write):
    path = write(listed(UNIT, ["1 7 1 3", "1 8 1 2", *TWO]))
    body = read(path)
    assert sorted(body.surfaces) == ["8"]
    assert "the curve '7' (1 element) does not lie on the boundary" in body.source.unused[0]
    message = refused(path, pressures=[{"surface": "7", "value": 1.0}])
    assert "surface '7': 1 of its 1 facets are not on the boundary" in message


def test_the_name_axis_is_kept(write):
    path = write(SQUARE.replace('"lid"', '"axis"'), "body.geo")
    assert "surface 'axis' leaves r = 0" in refused(path, "axisymmetric")
    assert "axis" in read(path).surfaces


def test_the_plan_honours_curves_and_lists_what_the_file_holds(tmp_path):
    body = {"name": "disc", "kind": "solid", "model": "plane_strain", "velocity": [0.0, -0.1]}
    floor = {"kind": "half_space", "name": "floor", "point": [0, -0.6], "normal": [0, 1]}
    scene = impactfem.Scene.from_dict({
        "title": "from a file", "duration": 1.0, "obstacle": [floor],
        "body": [body | MATERIAL | {"mesh": str(saved(tmp_path / "disc.msh", DISC, 2, 2))}],
    })  # fmt: skip
    plan = impactfem.plan(scene)
    assert (plan.method, plan.degree) == ("massless", 2)
    assert plan.reasons["degree"] == "the elements of disc.msh are curved, of order 2"
    assert plan.reasons["mesh"].startswith("disc.msh: 212 triangle elements of order 2, curved; ")
    with pytest.raises(MeshError, match="curved, of order 2"):
        impactfem.plan(scene.with_settings({"solve.method": "explicit"}))


@pytest.mark.slow
def test_a_mesh_file_tells_its_error_by_smaller_elements_and_its_rest_by_a_note(tmp_path):
    body = {"name": "block", "kind": "solid", "model": "plane_strain", "velocity": [0.0, -0.1]}
    floor = {"kind": "half_space", "name": "floor", "point": [0, -0.1], "normal": [0, 1]}
    mesh = {"mesh": str(saved(tmp_path / "square.msh", SQUARE, 2, 2))}
    scene = impactfem.Scene.from_dict({
        "title": "from a file", "duration": 2.0, "obstacle": [floor],
        "body": [body | MATERIAL | mesh], "output": {"fields": []},
    })  # fmt: skip
    plan = impactfem.plan(scene)
    notes = [found for found in plan.findings if found.code == "mesh_file"]
    assert [(found.severity, found.subject) for found in notes] == [("note", "block")]
    assert "elements half as large, those of" in plan.reasons["estimate"]
    found = impactfem.solve(scene).summary["error"]
    assert found["reference"] == "runs on elements half as large"
    assert 0.0 < found["displacement_max"] < 0.5
