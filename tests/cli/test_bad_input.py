"""Malformed scenes and command lines: exit code 2, one message with its remedy, nothing written."""

import pytest
from conftest import SCENE, finish, start
from processes import contents

HEAD, BODY, REST = SCENE.partition("\n[[body]]")[0], "[[body]]", "[[obstacle]]"


def changed(old, new):
    assert SCENE.count(old) == 1
    return SCENE.replace(old, new)


# name: (scene text or bytes, parts of the message)
SCENES = {
    # keys
    "missing key": (changed("length = 1.0\n", ""), ["body[0].length is missing", "give"]),
    "missing duration": (changed("duration = 5.0\n", ""), ["duration is missing", "give"]),
    "missing body": (HEAD + '\n[[obstacle]]\nkind = "wall"\n', ["body is missing", "[[body]]"]),
    "missing wall": (
        SCENE.replace('[[obstacle]]\nkind = "wall"\n', "").replace("gap", 'load = "t"\ngap'),
        ["body[0].load", "alone before a wall", "out of its reach"],
    ),
    "missing kind": (changed('kind = "bar"\n', ""), ["body[0].kind is missing", '"bar"']),
    "misspelt key": (changed("density", "densty"), ["body[0].densty", 'did you mean "density"']),
    "misspelt table": (changed("[solve]", "[solver]"), ["solver", 'did you mean "solve"']),
    "extra key": (changed("gap = 0.5", "gap = 0.5\ncolour = 1"), ["body[0].colour", "remove"]),
    "key twice": (changed("gap = 0.5", "gap = 0.5\ngap = 1"), ["line 12", "correct it"]),
    # types
    "text for number": (changed("gap = 0.5", 'gap = "wide"'), ['body[0].gap = "wide"', "give"]),
    "list for number": (changed("gap = 0.5", "gap = [1]"), ["body[0].gap = [1]", "give"]),
    "true for number": (changed("gap = 0.5", "gap = true"), ["body[0].gap = true", "give"]),
    "number for text": (changed('"a bar"', "3"), ["title = 3", "quotes"]),
    "date": (changed("5.0", "2020-01-01"), ["duration = 2020-01-01", "give"]),
    "half an element": (changed("elements = 4", "elements = 4.5"), ["solve.elements = 4.5"]),
    "table for list": (changed("[[body]]", "[body]"), ["body = ", "[[body]] with two brackets"]),
    # values
    "nan": (changed("5.0", "nan"), ["duration = nan", "not a finite number", "give"]),
    "infinite": (changed("gap = 0.5", "gap = inf"), ["body[0].gap = inf", "give"]),
    "minus infinite": (changed("-0.5", "-inf"), ["body[0].velocity = -inf", "give"]),
    "negative length": (changed("length = 1.0", "length = -1"), ["body[0].length = -1", "> 0"]),
    "negative gap": (changed("gap = 0.5", "gap = -0.5"), ["body[0].gap = -0.5", ">= 0"]),
    "zero density": (changed("density = 1.0", "density = 0"), ["body[0].density = 0", "> 0"]),
    "no elements": (changed("elements = 4", "elements = 0"), ["solve.elements = 0", "from 2"]),
    "unknown method": (changed("elements", 'method = "fem"\nelements'), ['"fem"', '"galerkin"']),
    "unknown kind": (changed('"wall"', '"well"'), ['obstacle[0].kind = "well"', '"wall"']),
    "unknown field": (SCENE + '[output]\nfields = ["vtk"]\n', ["output.fields", '"vtk"', "give"]),
    # contradictions
    "courant and dt": (SCENE + "courant = 1\ndt = 0.1\n", ["solve.dt = 0.1", "remove one"]),
    "mesh and elements": (SCENE + 'mesh = "a.msh"\n', ["solve.mesh", "elements = 4", "remove"]),
    "exact and active set": (
        SCENE + 'method = "exact"\nactive_set = "pdas"\n',
        ['solve.method = "exact"', "remove one"],
    ),
    "too fast": (SCENE + 'method = "galerkin"\ncourant = 1.5\n', ["courant = 1.5", "use"]),
    "too long a step": (SCENE + 'method = "galerkin"\ndt = 0.3\n', ["courant = 1.2", "0.25 s"]),
    "step beyond the end": (SCENE + "dt = 6.0\n", ["solve.dt = 6.0", "give a smaller step"]),
    "inside the wall": (
        changed("gap = 0.5", 'gap = 0.5\ndisplacement = "-1"'),
        ['body[0].displacement = "-1"', "increase gap"],
    ),
    # formulas
    "import": (changed("-0.5", "\"__import__('os').system('touch hit')\""), ["body[0].velocity"]),
    "attribute": (changed("-0.5", '"x.__class__"'), ["attributes are not allowed", "give"]),
    "power tower": (changed("-0.5", '"9**9**9"'), ["body[0].velocity", "is inf", "give"]),
    "unknown name": (changed("-0.5", '"t*x"'), ["unknown name 't'", "give"]),
    "pole": (changed("-0.5", '"1/x"'), ['body[0].velocity = "1/x"', "at x = 0", "give"]),
    "deep formula": (
        changed("-0.5", f'"{"(" * 900}x{")" * 900}"'),
        ["body[0].velocity", "shorten it"],
    ),
    # files
    "empty": ("", ["scene.toml: the file is empty", "add title"]),
    "blank": ("\n \n", ["scene.toml: the file is empty", "add title"]),
    "binary": (b"\x7fELF\0\1\2", ["scene.toml: this is a binary file", "give a scene file"]),
    "not UTF-8": (b'title = "St\xf6\xdfe"\n', ["scene.toml: byte 11", "save the file as UTF-8"]),
    "huge": ("#" * (2**20 + 1), ["scene.toml: larger than the limit of 1 MiB", "give"]),
    "not TOML": ("title: a bar\n", ["scene.toml: not valid TOML", "line 1", "correct it"]),
    "cut off": (SCENE[:-20], ["not valid TOML", "correct it"]),
    "nested": ("a = " + "[" * 5000, ["nested too deeply", "simplify"]),
    # meshes
    "no mesh": (changed("elements = 4", 'mesh = "no.msh"'), ["no.msh", "check `solve.mesh`"]),
    "mesh of another kind": (changed("elements = 4", 'mesh = "a.vtk"'), ["solve.mesh", ".geo"]),
}

GOOD = ("run", "bar_impact", "--set")
LINES = {
    "no command": ((), ["required: COMMAND"]),
    "unknown command": (("solve", "bar_impact"), ["invalid choice", "run"]),
    "no scene": (("run",), ["run: no scene is given; name one, or use --restart"]),
    "no scene to plan": (("plan",), ["required: SCENE"]),
    "unknown scene": (("run", "bar_impct"), ["bar_impct: neither a file nor", "bar_impact"]),
    "missing file": (("run", "none.toml"), ["none.toml: there is no such file; check the path"]),
    "folder": (("run", "."), [".: this is a folder; give the scene file in it"]),
    "unknown option": (("run", "bar_impact", "--fast"), ["unrecognized arguments: --fast"]),
    "option without value": (("run", "bar_impact", "--out"), ["--out: expected one argument"]),
    "two scenes": (("run", "bar_impact", "doyen_impact"), ["unrecognized arguments: doyen_impact"]),
    "unknown key": ((*GOOD, "solve.elemnts=3"), ["solve.elemnts", 'did you mean "elements"']),
    "unknown table": ((*GOOD, "solver.elements=3"), ['no table "solver"', "solve"]),
    "no such body": ((*GOOD, "body.1.length=3"), ["body.1"]),
    "no equals sign": ((*GOOD, "solve.elements"), ["write it as key=value, as solve.elements=80"]),
    "no key": ((*GOOD, "=3"), ["write it as key=value"]),
    "bad value": ((*GOOD, "solve.elements=many"), ['solve.elements = "many"']),
    "negative value": ((*GOOD, "duration=-1"), ["duration = -1", "must be > 0"]),
    "nan value": ((*GOOD, "duration=nan"), ["duration = nan", "not a finite number"]),
    "removed key": ((*GOOD, "duration="), ["duration is missing"]),
    "courant": ((*GOOD, "solve.courant=2"), ["courant = 2", "use courant <= 1"]),
    "null character": ((*GOOD, "title=a\0b"), ["title", "control character"]),
    "too large": ((*GOOD, "solve.elements=1000000"), ["GiB", "or fewer elements"]),
    "plot of nothing": (("plot", "nowhere"), ["nowhere: no complete result", "run the scene"]),
    "plot of a file": (("plot", "file"), ["file: no complete result", "run the scene"]),
    "plot of a folder": (("plot", "."), [".: no complete result", "run the scene"]),
    "plan of a bad scene": (("plan", "bar_impact", "--set", "duration=0"), ["duration = 0"]),
    "validation of a bad scene": (("validate", "none.toml"), ["none.toml: there is no such"]),
}


def check(done, parts, folder, before):
    assert done.code == 2
    assert done.out == ""
    for part in parts:
        assert part in done.err
    assert "Traceback" not in done.err
    assert len(done.err) < 1500
    assert contents(folder) == before


@pytest.fixture
def written(work):
    """Write the scene; returns the content of the working folder."""

    def write(content):
        data = content if isinstance(content, bytes) else content.encode()
        (work / "scene.toml").write_bytes(data)
        (work / "file").touch()
        return contents(work)

    return write


def test_the_scene_to_change_is_good(command, written):
    written(SCENE)
    assert command("validate", "scene.toml").code == 0


def test_there_are_many():
    assert len(SCENES) + len(LINES) >= 70


@pytest.mark.parametrize(("content", "parts"), SCENES.values(), ids=SCENES)
@pytest.mark.parametrize("action", ["run", "validate"])
def test_malformed_scene(command, work, written, content, parts, action):
    before = written(content)
    done = command(action, "scene.toml")
    check(done, parts, work, before)
    assert "scene.toml" in done.err or "no.msh" in done.err or "solve" in done.err


@pytest.mark.parametrize(("line", "parts"), LINES.values(), ids=LINES)
def test_malformed_command_line(command, work, written, line, parts):
    before = written(SCENE)
    check(command(*line), parts, work, before)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["missing key", "power tower", "binary", "no mesh"])
def test_malformed_scene_in_a_process_of_its_own(work, written, name):
    content, parts = SCENES[name]
    before = written(content)
    check(finish(start(work, "run", "scene.toml")), parts, work, before)


MESH = """
T = 5; L = 1;
Point(1) = {0, 0, 0}; Point(2) = {T, 0, 0}; Point(3) = {T, L, 0}; Point(4) = {0, L, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1:4}; Plane Surface(1) = {1}; Transfinite Surface {1};
Transfinite Curve {1, 3} = 21; Transfinite Curve {2, 4} = 5;
Physical Curve("wall") = {1}; Physical Curve("end") = {2}; Physical Curve("far") = {3};
Physical Curve("start") = {4}; Physical Surface("bar") = {1};
"""
MESHES = {
    "script error": (MESH + "Line(9) = {1, ;", ["mesh.geo", "syntax error", "correct"]),
    "program": (MESH + 'SystemCall "touch hit";', ["mesh.geo", "'SystemCall'", "not allowed"]),
    "too long": (MESH.replace("T = 5", "T = 6"), ["mesh.geo", "t runs from 0 to 6 s", "0 to 5 s"]),
    "no name": (MESH.replace('"far"', '"fra"'), ["mesh.geo", "curves far are missing", "name"]),
    "empty": ("", ["mesh.geo: empty", "write a mesh"]),
}


@pytest.mark.parametrize("method", ["monolithic", None])
def test_the_mesh_to_change_is_good(command, work, method):
    (work / "mesh.geo").write_text(MESH)
    choice = f'method = "{method}"\n' if method else ""
    (work / "scene.toml").write_text(changed("elements = 4", f'{choice}mesh = "mesh.geo"'))
    assert command("validate", "scene.toml").code == 0


@pytest.mark.parametrize(("content", "parts"), MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("action", ["run", "validate"])
def test_broken_mesh(command, work, content, parts, action):
    (work / "mesh.geo").write_text(content)
    (work / "scene.toml").write_text(changed("elements = 4", 'mesh = "mesh.geo"'))
    before = contents(work)
    check(command(action, "scene.toml"), parts, work, before)


@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("file", "file: "),
        ("file/below", "is a file; choose another folder (--out)"),
        ("o" * 300, "File name too long"),
        ("/proc/here", "choose another folder (--out)"),
    ],
)
def test_a_folder_that_cannot_be_written_is_refused_before_solving(
    command, work, written, monkeypatch, out, said
):
    import impactfem.solving

    def solved(*_args, **_options):
        raise AssertionError("solved in vain")

    monkeypatch.setattr(impactfem.solving, "solve", solved)
    before = written(SCENE)
    done = command("run", "scene.toml", "--set", "solve.method=exact", "--out", out)
    assert done.code == 1
    assert done.out == ""
    assert said in done.err
    assert "choose another folder (--out)" in done.err
    assert contents(work) == before
