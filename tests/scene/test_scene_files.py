"""Scene files: unreadable, broken and good ones, and where relative paths start."""

import os
from pathlib import Path

import pytest

from impactfem.errors import SceneError
from impactfem.scene import Scene

GOOD = """
title = "a bar"
duration = 5.0
gravity = [[0.0, 1.0], [0.618, 0.0]]

[[body]]
kind = "bar"
length = 1.0
density = 1.0
youngs_modulus = 1.0
gap = 0.5
velocity = -0.5

[[obstacle]]
kind = "wall"

[solve]
mesh = "meshes/bar.geo"
"""


def refused(path):
    with pytest.raises(SceneError) as caught:
        Scene.from_toml(path)
    assert len(str(caught.value)) < 1000 + len(str(path))
    return str(caught.value)


@pytest.fixture
def write(tmp_path):
    def write(content):
        path = tmp_path / "scene.toml"
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content, encoding="utf-8")
        return path

    return write


def test_missing_file(tmp_path):
    message = refused(tmp_path / "none.toml")
    assert "none.toml: there is no such file; check the path" in message


def test_folder(tmp_path):
    assert "this is a folder; give the scene file in it" in refused(tmp_path)


def test_file_used_as_folder(write):
    assert "cannot be read" in refused(write(GOOD) / "scene.toml")


@pytest.mark.parametrize("name", ["a\0b.toml", "x" * 5000])
def test_impossible_names(name):
    message = refused(name)
    assert "the file cannot be read" in message
    assert "check it" in message


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may read everything")
def test_no_permission(write):
    path = write(GOOD)
    path.chmod(0)
    assert "no permission to read the file; allow it" in refused(path)


def test_no_permission_as_any_user(write, monkeypatch):
    def denied(*_args, **_options):
        raise PermissionError(13, "Permission denied")

    path = write(GOOD)
    monkeypatch.setattr(Path, "open", denied)
    assert "no permission to read the file; allow it" in refused(path)


@pytest.mark.parametrize("content", ["", " \n\t\n", "\ufeff"])
def test_empty(write, content):
    message = refused(write(content))
    assert "the file is empty; add title, duration, [[body]] and [[obstacle]]" in message


def test_only_a_comment(write):
    assert "title is missing" in refused(write("# nothing yet\n"))


@pytest.mark.parametrize("character", ["#", "a", "["])
def test_huge(write, character):
    message = refused(write(character * (2**20 + 1)))
    assert "larger than the limit of 1 MiB; give a scene file" in message


def test_endless():
    if not Path("/dev/zero").exists():
        pytest.skip("no /dev/zero")
    assert "larger than the limit of 1 MiB" in refused("/dev/zero")


def test_binary(write):
    assert "this is a binary file; give a scene file" in refused(write(GOOD.encode() + b"\0\1"))


def test_not_utf8(write):
    message = refused(write(b'title = "St\xf6\xdfe"\n'))
    assert "byte 11 (0xf6) is not UTF-8; save the file as UTF-8" in message


def test_utf16(write):
    assert "is not UTF-8; save the file as UTF-8" in refused(write(GOOD.encode("utf-16")))


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (
            "title = a bar\n",
            ["at line 1, column 9", 'in "title = a bar"', "in quotes"],
        ),
        ('\ntitle "x"\n', ["at line 2, column 7", r'in "title "x""', "correct it"]),
        (
            GOOD.replace("gap = 0.5", "gap = 0,5"),
            ["at line 11, column 8", '"gap = 0,5"', "with a dot, not a comma"],
        ),
        (GOOD.replace("gap", "length"), ["at line 11", '"length = 0.5"', "remove one"]),
        ("title = 'a'\ntitle = 'b'\n", ["at line 2", "\"title = 'b'\"", "remove one"]),
        ("[solve]\n[solve]\n", ["twice", "at line 2", "put its keys together"]),
        ("[[body]\n", ["at line 1", "correct it"]),
        ('title = "a\n', ["at line 1", "correct it"]),
        ("title = 'a'\rduration = 3", ["at line 1", "correct it"]),
        ("duration = " + "9" * 5000, ["not valid TOML", "correct the value"]),
        ("x = " + "[" * 5000, ["nested too deeply; simplify"]),
        ("x = [" + "{a = [" * 5000, ["nested too deeply; simplify"]),
    ],
)
def test_toml_errors_name_line_and_column(write, text, parts):
    message = refused(write(text))
    assert message.startswith(f"{write(text)}: not valid TOML: ")
    for part in parts:
        assert part in message


def test_deeply_nested_tables_are_refused(write):
    few, many = (refused(write(".".join("a" * n) + " = 1")) for n in (10, 5000))
    assert "a = {" in few
    assert "is not a known key: remove it" in few
    assert "not valid TOML: line 1 has a key of more than" in many
    assert "shorten it" in many


def test_errors_in_values_name_the_file_and_the_path(write):
    path = write(GOOD.replace("gap = 0.5", "gap = -0.5"))
    assert refused(path).startswith(f"{path}: body[0].gap = -0.5 is not allowed: it must be >= 0")


def test_duplicate_tables_of_bodies(write):
    body = GOOD[GOOD.index("[[body]]") : GOOD.index("[[obstacle]]")]
    message = refused(write(GOOD + "\n" + body.replace("[[body]]", '[[body]]\nname = "b"')))
    assert "body[1].gap" in message
    assert "they overlap by 1 m" in message


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_good_files_of_any_editor(write, mark, end):
    scene = Scene.from_toml(write((mark + GOOD).replace("\n", end).encode()))
    assert scene.title == "a bar"
    assert scene.gravity.times == (0.0, 0.618)


def test_mesh_paths_start_at_the_scene_file(write, tmp_path, monkeypatch):
    write(GOOD)
    monkeypatch.chdir(tmp_path)
    scene = Scene.from_toml("scene.toml")
    monkeypatch.chdir("/")
    assert scene.folder == tmp_path
    assert scene.mesh_path == tmp_path / "meshes" / "bar.geo"
    assert Scene.from_toml(tmp_path / "scene.toml") == scene


def test_folder_does_not_count_for_equality(write, tmp_path):
    scene = Scene.from_toml(write(GOOD))
    other = tmp_path / "other"
    other.mkdir()
    (other / "copy.toml").write_text(GOOD)
    copy = Scene.from_toml(other / "copy.toml")
    assert copy == scene
    assert copy.mesh_path != scene.mesh_path


def test_written_mesh_path_still_resolves(write, tmp_path):
    scene = Scene.from_toml(write(GOOD))
    (tmp_path / "results").mkdir()
    for folder in (tmp_path, tmp_path / "results", tmp_path / "meshes"):
        folder.mkdir(exist_ok=True)
        (folder / "used.toml").write_text(scene.to_toml(folder))
        assert Scene.from_toml(folder / "used.toml").mesh_path == scene.mesh_path
    assert 'mesh = "meshes/bar.geo"' in scene.to_toml()
    assert 'mesh = "meshes/bar.geo"' in scene.to_toml(tmp_path)
    assert 'mesh = "bar.geo"' in scene.to_toml(tmp_path / "meshes")
    assert f'mesh = "{tmp_path}/meshes/bar.geo"' in scene.to_toml(tmp_path / "results")


def test_absolute_mesh_path_stays(tmp_path):
    mesh = tmp_path / "bar.msh"
    text = GOOD.replace("meshes/bar.geo", str(mesh))
    (tmp_path / "scene.toml").write_text(text)
    scene = Scene.from_toml(tmp_path / "scene.toml")
    assert scene.mesh_path == mesh
    assert f'mesh = "{mesh}"' in scene.to_toml(tmp_path)


def test_written_mesh_paths_of_all_bodies_still_resolve(tmp_path):
    solid = {
        "kind": "solid", "model": "3d", "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3,
    }  # fmt: skip
    scene = Scene.from_dict(
        {
            "title": "two parts", "duration": 1.0,
            "body": [solid | {"name": name, "mesh": f"{name}.msh"} for name in ("one", "two")],
        },
        folder=tmp_path,
    )  # fmt: skip
    assert scene.folder == tmp_path
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep/used.toml").write_text(scene.to_toml(tmp_path / "deep"))
    read = Scene.from_toml(tmp_path / "deep/used.toml")
    assert [body.mesh for body in read.bodies] == [f"{tmp_path}/{n}.msh" for n in ("one", "two")]
