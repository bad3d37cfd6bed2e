"""Mesh files: broken ones are explained, good ones of every format are read."""

import os
from pathlib import Path

import numpy as np
import pytest

from impactfem.errors import MeshError
from impactfem.fem import MPI
from impactfem.mesh.files import read_mesh, told
from impactfem.mesh.session import gmsh_session
from impactfem.reading import opening

T, L = 2.0, 1.0
GOOD = """
T = 2; L = 1; n = 4;
Point(1) = {0, 0, 0}; Point(2) = {T, 0, 0}; Point(3) = {T, L, 0}; Point(4) = {0, L, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Transfinite Curve {1, 3} = 2*n + 1;
Transfinite Curve {2, 4} = n + 1;
Transfinite Surface {1} Right;
Physical Curve("wall") = {1};
Physical Curve("end") = {2};
Physical Curve("far") = {3};
Physical Curve("start") = {4};
Physical Surface("bar") = {1};
"""


def changed(*changes):
    text = GOOD
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def read(path, wave_speed=1.0):
    return read_mesh(MPI.COMM_SELF, Path(path), L, T, wave_speed)


def refused(path):
    with pytest.raises(MeshError) as caught:
        read(path)
    message = str(caught.value)
    assert message.startswith(f"mesh file {path}: ")
    assert len(message) < 700 + len(str(path))
    return message


@pytest.fixture
def write(tmp_path):
    def write(content, name="mesh.geo"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def meshed(text, version=4.1, binary=0, change=lambda _: None):
    """The bytes of a .msh file of a script."""
    with gmsh_session() as gmsh:
        folder = Path(os.environ["PYTEST_MESHES"])
        (folder / "script.geo").write_text(text)
        gmsh.merge(str(folder / "script.geo"))
        gmsh.model.mesh.generate(2)
        change(gmsh)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(folder / "mesh.msh"))
        return (folder / "mesh.msh").read_bytes()


@pytest.fixture(autouse=True)
def folder_of_meshes(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("PYTEST_MESHES", str(tmp_path_factory.mktemp("meshes")))


# good ones


def check_good(space, nodes=45):
    mesh = space.mesh
    assert mesh.geometry.x.shape == (nodes, 3)
    np.testing.assert_allclose(mesh.geometry.x.max(axis=0), [T / L, 1, 0], rtol=0, atol=1e-12)
    for name, count in (("start", 4), ("end", 4), ("wall", 8), ("far", 8)):
        assert len(space.facets(name)) == count


def test_a_script(write):
    space = read(write(GOOD))
    check_good(space)
    np.testing.assert_array_equal(space.layout.times, np.linspace(0, 2, 9))
    np.testing.assert_array_equal(space.layout.nodes, np.linspace(0, 1, 5))


def test_a_script_without_a_last_line_break_loses_nothing(write):
    check_good(read(write(GOOD.strip())))


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("binary", [0, 1])
def test_a_mesh_of_each_format(write, version, binary):
    space = read(write(meshed(GOOD, version, binary), "mesh.msh"))
    check_good(space)
    np.testing.assert_array_equal(space.layout.times, np.linspace(0, 2, 9))


def test_endings_may_be_capitals(write):
    check_good(read(write(GOOD, "MESH.GEO")))


def test_coordinates_are_dimensionless(write):
    space = read(write(GOOD), wave_speed=3.0)
    assert space.mesh.geometry.x[:, 0].max() == 6.0
    np.testing.assert_array_equal(space.layout.times, np.linspace(0, 6, 9))


def test_layers_may_differ(write):
    space = read(write(changed(("2*n + 1;", "2*n + 1 Using Progression 1.2;"),
                               ("{1, 3}", "{1, -3}"))))  # fmt: skip
    check_good(space)
    steps = np.diff(space.layout.times)
    np.testing.assert_allclose(steps[1:] / steps[:-1], 1.2, rtol=1e-6)
    x = space.mesh.geometry.x
    assert np.isin(x[:, 0], space.layout.times).all()
    assert np.isin(x[:, 1], space.layout.nodes).all()


def test_without_layers(write):
    space = read(write(changed(("Transfinite Surface {1} Right;", ""))))
    assert space.layout.times is None
    assert space.layout.nodes is None
    assert space.layout.num_nodes == len(space.mesh.geometry.x)


def test_a_side_of_several_curves_and_surfaces(write):
    split = """
    T = 2; L = 1; n = 4;
    Point(1) = {0, 0, 0}; Point(2) = {T/2, 0, 0}; Point(3) = {T, 0, 0};
    Point(4) = {T, L, 0}; Point(5) = {T/2, L, 0}; Point(6) = {0, L, 0};
    Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5}; Line(5) = {5, 6};
    Line(6) = {6, 1}; Line(7) = {2, 5};
    Curve Loop(1) = {1, 7, 5, 6}; Plane Surface(1) = {1};
    Curve Loop(2) = {2, 3, 4, -7}; Plane Surface(2) = {2};
    Transfinite Curve {1:7} = n + 1; Transfinite Surface {1, 2};
    Physical Curve("wall") = {1, 2}; Physical Curve("far") = {4, 5};
    Physical Curve("start") = {6}; Physical Curve("end") = {3};
    """
    check_good(read(write(split + 'Physical Surface("bar") = {1, 2};')))
    check_good(read(write(split + 'Physical Surface("a") = {1}; Physical Surface("b") = {2};')))


def test_groups_along_the_bar_are_materials_that_it_cannot_have(write):
    """One bar has one material; groups that divide time do no harm."""
    split = """
    T = 2; L = 1; n = 4;
    Point(1) = {0, 0, 0}; Point(2) = {T, 0, 0}; Point(3) = {T, L/2, 0};
    Point(4) = {T, L, 0}; Point(5) = {0, L, 0}; Point(6) = {0, L/2, 0};
    Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5}; Line(5) = {5, 6};
    Line(6) = {6, 1}; Line(7) = {6, 3};
    Curve Loop(1) = {1, 2, -7, 6}; Plane Surface(1) = {1};
    Curve Loop(2) = {7, 3, 4, 5}; Plane Surface(2) = {2};
    Transfinite Curve {1:7} = n + 1; Transfinite Surface {1, 2};
    Physical Curve("wall") = {1}; Physical Curve("far") = {4};
    Physical Curve("start") = {5, 6}; Physical Curve("end") = {2, 3};
    """
    one = write(split + 'Physical Surface("bar") = {1, 2};', "one.geo")
    assert len(read(one).facets("start")) == 8
    assert "curve 'wall' (4 elements) = the side 'wall'" in told(one)
    assert "surface 'bar' (64 elements) = the bar" in told(one)
    two = 'Physical Surface("rubber") = {1}; Physical Surface("steel") = {2};'
    message = refused(write(split + two))
    assert "surface 'rubber' (32 elements), surface 'steel' (32 elements)" in message
    assert "'rubber' covers x = 0 to 0.5 m of a bar of 1 m, which has one material" in message


@pytest.mark.parametrize(
    "more",
    [
        'Physical Curve("outside") = {1, 2, 3, 4};',
        'Physical Surface("again") = {1};',
        'Physical Point("corner") = {1};',
        'Physical Curve("turned") = {-4};',
    ],
)
def test_further_groups_do_no_harm(write, more):
    check_good(read(write(GOOD + more)))


def test_curves_may_be_taken_backwards(write):
    check_good(read(write(changed(('("start") = {4}', '("start") = {-4}')))))


def test_forbidden_words_may_stand_in_comments(write):
    check_good(read(write('// Include "a"; SystemCall "b"\n/* Merge "c";\n Exit; */' + GOOD)))


def test_names_may_look_like_comments(write):
    check_good(read(write('a = "/*"; b = \'//\'; c = "*/";' + GOOD)))


def test_personal_options_of_gmsh_have_no_say(write, tmp_path, monkeypatch):
    (tmp_path / ".gmshrc").write_text("Mesh.ElementOrder = 2;\n")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("GMSH_HOME", str(tmp_path))
    check_good(read(write(GOOD)))


def test_a_session_of_the_user_stays_as_it_is(write):
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.model.add("mine")
        check_good(read(write(GOOD)))
        with pytest.raises(MeshError):
            read(write("Point(1) = {;"))
        assert gmsh.model.getCurrent() == "mine"
        assert "impactfem" not in gmsh.model.list()
    finally:
        gmsh.finalize()


@pytest.mark.slow
def test_a_fault_does_not_spoil_the_next_file(write):
    for broken in ("Point(1) = {;", "/* for ever", 'a = "for ever', "If (1)\n"):
        refused(write(broken, "broken.geo"))
        check_good(read(write(GOOD)))


# broken files


@pytest.mark.parametrize("name", ["mesh.geo", "mesh.msh"])
@pytest.mark.parametrize("content", ["", " \n\n\t"])
def test_empty(write, name, content):
    assert "empty; write a mesh" in refused(write(content, name))


def test_no_such_file(tmp_path):
    message = refused(tmp_path / "none.msh")
    assert "cannot be read (No such file or directory); check `solve.mesh`" in message


def test_folder(tmp_path):
    (tmp_path / "mesh.msh").mkdir()
    assert "cannot be read (Is a directory); check `solve.mesh`" in refused(tmp_path / "mesh.msh")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no /dev/zero")
def test_endless(tmp_path):
    (tmp_path / "mesh.msh").symlink_to("/dev/zero")
    message = refused(tmp_path / "mesh.msh")
    assert "cannot be read (it is no regular file); check `solve.mesh`" in message


@pytest.mark.parametrize("name", ["mesh.vtk", "mesh", "mesh.geo_unrolled"])
def test_other_ending(write, name):
    assert "is not known; use .geo or .msh" in refused(write(GOOD, name))


def test_too_large(write, monkeypatch):
    monkeypatch.setattr(opening, "MAX_SCRIPT_BYTES", 100)
    message = refused(write(GOOD))
    assert f"{len(GOOD)} bytes, more than the 100 that are read); save its mesh as .msh" in message


@pytest.mark.parametrize("content", [GOOD, "\n$MeshFormat\n", " $MeshFormat\n", "\x89PNG", "MZ\0"])
def test_no_mesh_in_disguise(write, content):
    assert "does not begin with $MeshFormat; save it as" in refused(write(content, "mesh.msh"))


COMMANDS = {
    "system": 'SystemCall "touch hit";',
    "system, short": 'System "touch hit";',
    "system, in the background": 'NonBlockingSystemCall "touch hit";',
    "after a text like a comment": 'a = "/*"; SystemCall "touch hit"; b = "*/";',
    "after a quoted text like a comment": "a = '/*'; SystemCall \"touch hit\"; b = '*/';",
    "after a text with two slashes": 'a = "//"; SystemCall "touch hit";',
    "after a text that ends with a backslash": 'a = "\\"; SystemCall "touch hit"; b = "//";',
    "after a text of two lines": 'a = "\n/*"; SystemCall "touch hit"; b = "*/";',
    "after a comment in a comment": '/* /* */ SystemCall "touch hit"; /* */',
    "after an odd comment": '/*/ */ SystemCall "touch hit"; /* **/',
    "after a null": 'a = 1;\0SystemCall "touch hit";',
    "by a name in a text": 'StringToName["SystemCall"] "touch hit";',
    "by a built name": 'StringToName[StrCat("System", "Call")] "touch hit";',
    "external process": 'Field[1] = ExternalProcess; Field[1].CommandLine = "touch hit";',
    "include": 'Include "other.geo";',
    "merge": 'Merge "other.msh";',
    "merge, other": 'MergeWithBoundingBox "other.msh";',
    "shape": 'ShapeFromFile("other.brep");',
    "folder": 'CreateDir "hit";',
    "print": 'Printf("x") > "hit";',
    "picture": 'Print "hit.png";',
    "save": 'Save "hit.msh";',
    "plugin": "Plugin(MathEval).Run;",
    "solver": 'OnelabRun("a", "touch hit");',
    "environment": 'a = GetEnv("HOME");',
    "log": 'General.LogFileName = "hit";',
    "exit": "Exit;",
    "sleep": "Sleep 1000;",
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
@pytest.mark.parametrize("place", ["first", "last"])
def test_commands_that_reach_beyond_the_file(write, tmp_path, monkeypatch, command, place):
    monkeypatch.chdir(tmp_path)
    path = write(f"{command}\n{GOOD}" if place == "first" else f"{GOOD}\n{command}\n")
    message = refused(path)
    assert "is not allowed in a scene's mesh" in message
    assert "write the geometry in this one file" in message
    assert [entry.name for entry in tmp_path.iterdir()] == ["mesh.geo"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Point(1) = {0, 0;", "syntax error"),
        (GOOD + "Line(9) = {77, 78};", "Gmsh says"),
        (GOOD + "/* no end", "End of file"),
        ("\x89\0noise\xff", "Gmsh says"),
        ("the mesh of a bar", "Gmsh says"),
    ],
)
def test_script_errors(write, text, said):
    message = refused(write(text))
    assert said in message
    assert message.endswith("correct the file")
    assert "impactfem-" not in message  # the copy that Gmsh saw
    assert "Traceback" not in message


@pytest.mark.slow
@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("binary", [0, 1])
def test_cut_off_noisy_and_changed_meshes_end_in_an_error_or_are_whole(write, version, binary):
    """Gmsh crashes on some of them; that must not take this process along."""
    whole = meshed(GOOD, version, binary)
    rng = np.random.default_rng(int(10 * version) + binary)
    cut = len(whole) // 2
    broken = [whole[:40], whole[:cut], whole[:cut] + rng.bytes(300)]
    for _ in range(3):
        data = bytearray(whole)
        for at in rng.integers(60, len(data), 5):
            data[at] = rng.integers(256)
        broken.append(bytes(data))
    for content in broken:
        path = write(content, "mesh.msh")
        try:
            check_good(read(path))
        except MeshError as error:
            assert str(error).startswith(f"mesh file {path}: ")  # noqa: PT017


def test_a_crash_of_gmsh_is_an_error(write, monkeypatch):
    crash = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    monkeypatch.setattr(opening, "PROGRAM", crash)
    assert "Gmsh crashed on it (signal 11); the file is broken" in refused(write(GOOD))


# meshes that do not fit


@pytest.mark.parametrize("name", ["start", "end", "wall", "far"])
def test_missing_name(write, name):
    message = refused(write(changed((f'"{name}"', '"other"'))))
    assert f'physical curves {name} are missing, found "' in message
    assert '"other"' in message
    assert "name the sides start (t = 0)" in message


def test_no_names(write):
    message = refused(write(GOOD.split("Physical", maxsplit=1)[0] + "Physical Surface(1) = {1};"))
    assert "start, end, wall, far are missing, found none" in message


def test_no_physical_surface(write):
    message = refused(write(changed(('Physical Surface("bar") = {1};', ""))))
    assert 'no physical surface; add `Physical Surface("bar")' in message


@pytest.mark.parametrize(("one", "other"), [("wall", "far"), ("start", "end"), ("start", "wall")])
def test_names_on_the_wrong_side(write, one, other):
    swapped = changed((f'"{one}"', '"-"'), (f'"{other}"', f'"{one}"')).replace('"-"', f'"{other}"')
    message = refused(write(swapped))
    assert "must lie at " in message
    assert "wrong orientation?" in message


def test_turned_axes(write):
    message = refused(write(changed(("T = 2; L = 1;", "T = 1; L = 2;"))))
    assert "t runs from 0 to 1 s, the scene needs 0 to 2 s; make the mesh" in message
    assert "seems turned: the first coordinate is time" in message


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("T = 3; L = 1;", "t runs from 0 to 3 s, the scene needs 0 to 2 s; make"),
        ("T = 2; L = 1.001;", "x runs from 0 to 1.001 m, the scene needs 0 to 1 m; make"),
        ("T = -2; L = 1;", "t runs from -2 to 0 s"),
        ("T = 2000; L = 1000;", "t runs from 0 to 2000 s"),
    ],
)
def test_wrong_size(write, change, said):
    message = refused(write(changed(("T = 2; L = 1;", change))))
    assert said in message
    assert "turned" not in message


@pytest.mark.parametrize("size", ["T = 0; L = 0;", "T = 0; L = 1;", "T = 1e-300; L = 1e-300;"])
def test_no_size(write, size):
    refused(write(changed(("T = 2; L = 1;", size))))


@pytest.mark.parametrize("surface", ["Transfinite Surface {1} Right;", ""])
def test_unequal_node_counts(write, surface):
    text = changed(("Transfinite Surface {1} Right;", ""), ("{2, 4} = n + 1", "{2} = n + 1"))
    message = refused(write(text + surface + "Transfinite Curve {4} = n + 3;"))
    if not surface:
        assert "7 nodes at start, 5 at end" in message
        assert "divide both sides alike" in message


def test_quadrilaterals(write):
    message = refused(write(GOOD + "Recombine Surface {1};"))
    assert "needs 3-node triangles only, it has Quadrilateral 4;" in message
    assert "first-order triangles" in message


def test_second_order(write):
    assert "it has Triangle 6;" in refused(write(GOOD + "Mesh.ElementOrder = 2;"))


def test_three_dimensions(write):
    message = refused(write(GOOD + "Extrude {0, 0, 1} { Surface{1}; } Mesh 3;"))
    assert "needs 3-node triangles only" in message or "nodes leave the plane" in message


def test_no_surface(write):
    assert "it has none;" in refused(write(GOOD.split("Curve Loop", maxsplit=1)[0]))


@pytest.mark.parametrize("height", ["1", "1e-3"])
def test_off_the_plane(write, height):
    message = refused(write(changed(("{T, L, 0}", f"{{T, L, {height}}}"))))
    assert "nodes leave the plane z = 0; draw (t, x) in the plane" in message


def test_loose_nodes(write):
    text = GOOD + 'Point(9) = {1, 0.3, 0}; Physical Point("probe") = {9};'
    assert "1 of 46 nodes belong to no triangle; remove loose nodes" in refused(write(text))


def test_half_a_side(write):
    text = changed(
        ("Line(4) = {4, 1};", "Point(5) = {0, L/2, 0}; Line(4) = {4, 5}; Line(5) = {5, 1};"),
        ("{1, 2, 3, 4};\nPlane", "{1, 2, 3, 4, 5};\nPlane"),
        ("{2, 4} = n + 1", "{2} = n + 1; Transfinite Curve {4, 5} = n/2 + 1"),
        ("Transfinite Surface {1} Right;", ""),
    )
    message = refused(write(text))
    assert "boundary 'start' has 2 edges, that side of the mesh 4; put every curve" in message
    check = text.replace('Physical Curve("start") = {4}', 'Physical Curve("start") = {4, 5}')
    assert read(write(check)).layout.num_nodes > 0


def test_an_edge_given_twice(write):
    lines = meshed(GOOD, 2.2).decode().splitlines()
    at = lines.index("$Elements") + 1
    twice = [str(int(lines[at]) + 1), lines[at + 1], *lines[at + 1 :]]
    twice[1] = "999 " + twice[1].split(" ", 1)[1]
    message = refused(write("\n".join([*lines[:at], *twice]) + "\n", "mesh.msh"))
    assert "has 9 edges, that side of the mesh 8; put every curve of that side, and each" in message


def coordinates_changed(node, value):
    """The ASCII mesh with one coordinate replaced."""
    lines = meshed(GOOD, 2.2).decode().splitlines()
    at = lines.index("$Nodes") + 1 + node
    words = lines[at].split()
    words[1] = value
    return "\n".join([*lines[:at], " ".join(words), *lines[at + 1 :]]) + "\n"


@pytest.mark.parametrize("value", ["nan", "inf", "-nan"])
def test_coordinates_that_are_not_finite(write, value):
    message = refused(write(coordinates_changed(40, value), "mesh.msh"))
    assert "a node coordinate is not finite; write the mesh again" in message or "Gmsh" in message


def test_a_node_out_of_place_makes_triangles_overlap(write):
    message = refused(write(coordinates_changed(40, "0.05"), "mesh.msh"))
    assert "do not fill the rectangle once" in message or "has no area" in message


def test_hole(write):
    text = changed(("Transfinite Surface {1} Right;", ""), ("Plane Surface(1) = {1};", """
        Point(5) = {.9, .4, 0}; Point(6) = {1.1, .4, 0}; Point(7) = {1, .6, 0};
        Line(5) = {5, 6}; Line(6) = {6, 7}; Line(7) = {7, 5}; Curve Loop(2) = {5, 6, 7};
        Plane Surface(1) = {1, 2};"""))  # fmt: skip
    message = refused(write(text))
    assert "do not fill the rectangle once, without holes" in message
    assert "near t = " in message


def test_unjoined_parts(write):
    """Two rectangles that touch but share no curve: no wave would pass."""
    text = """
    n = 4;
    For i In {0:1}
      p = 10 * i;
      Point(p+1) = {i, 0, 0}; Point(p+2) = {i+1, 0, 0};
      Point(p+3) = {i+1, 1, 0}; Point(p+4) = {i, 1, 0};
      Line(p+1) = {p+1, p+2}; Line(p+2) = {p+2, p+3}; Line(p+3) = {p+3, p+4};
      Line(p+4) = {p+4, p+1};
      Curve Loop(p+1) = {p+1, p+2, p+3, p+4}; Plane Surface(p+1) = {p+1};
      Transfinite Curve {p+1, p+2, p+3, p+4} = n + 1; Transfinite Surface {p+1};
    EndFor
    Physical Curve("wall") = {1, 11}; Physical Curve("far") = {3, 13};
    Physical Curve("start") = {4}; Physical Curve("end") = {12};
    Physical Surface("bar") = {1, 11};
    """
    message = refused(write(text))
    assert "unjoined parts (look near t = 1, x = " in message
    assert "let neighbouring surfaces share their curves" in message
