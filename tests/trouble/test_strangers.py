"""Scenes, meshes and checkpoints of strangers: refused at once, and nothing of them is run."""

import io
import json
import os
import resource
import time
import tomllib
import zipfile

import numpy as np
import pytest
from processes import contents
from trouble_process import DISC, run

from impactfem.errors import MeshError, OutputError, SceneError, plain
from impactfem.marching.checkpoint import FILE, load, scene_of
from impactfem.reading import apart, opening
from impactfem.result.store import LAST
from impactfem.scene import Scene
from impactfem.scene.toml import MAX_BYTES, MAX_PARTS, read_toml

ALL = MAX_BYTES - 1000
BAR = """
title = "a bar"
duration = 5.0
[[body]]
name = "bar"
kind = "bar"
length = 1.0
density = 1.0
youngs_modulus = 1.0
gap = 0.5
velocity = {velocity}
[[obstacle]]
kind = "wall"
"""


def numbered(text, count):
    return "".join(text.format(k) for k in range(count))


# Each as long as a scene may be.
BOMBS = {
    "dotted key": "a" + ".a" * (ALL // 2) + "=1",
    "quoted key": '"a"' + ".'a'" * (ALL // 4) + "=1",
    "spaced key": "a" + " . a" * (ALL // 4) + "=1",
    "dotted heading": "[" + "a." * (ALL // 4) + "a]\n" + numbered("k{}=1\n", 40_000),
    "many dotted keys": numbered("a" + ".a" * (MAX_PARTS - 2) + ".b{}=1\n", 26_000),
    "many keys": numbered("k{}=1\n", 110_000),
    "many tables": numbered("[t{}]\n", 100_000),
    "many bodies": "[[body]]\n" * (ALL // 9),
    "lists in lists": "a=" + "[" * (ALL // 2),
    "tables in tables": "a=" + "{a=" * (ALL // 4),
    "huge list": "gravity=[" + "0," * (ALL // 2) + "0]",
    "huge text": 'title="' + "a" * ALL + '"',
    "huge integer": "duration=" + "9" * ALL,
    "huge number": "duration=1e" + "9" * ALL,
    "quotes": '"' * ALL,
    "words": "a " * (ALL // 2),
    "100 MB": "#" * 100_000_000,
}


@pytest.mark.slow
@pytest.mark.parametrize("text", BOMBS.values(), ids=BOMBS)
def test_bombs_of_toml(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    start, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(SceneError) as caught:
        Scene.from_toml(path)
    # Memory and processor time are limits of behaviour here, far above what is needed.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500 * 1024
    assert time.process_time() - start < 20
    assert len(str(caught.value)) < 2000


def test_keys_of_many_parts_may_stand_in_texts_that_are_none(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text('title = "see a.b.c.d, e.f: 1.2.3"\nx.' + ".".join("ab" * 7) + " = 1.5\n")
    assert read_toml(path)["title"].endswith("1.2.3")


@pytest.mark.parametrize(
    "formula",
    [
        "__import__('os').system('touch hit')", "().__class__.__bases__[0].__subclasses__()",
        "x.__class__", "lambda: 0", "[x for x in ()]", "exec(x)", "open(x)", "x if x else x",
        "9**9**9**9", "x" * 1001, "(" * 51 + "x" + ")" * 51, "-" * 900 + "x", "f'{x}'",
        "\N{MATHEMATICAL BOLD SMALL X}", "x:=1", "print(x)", "x\x1b[31m", "1j*x", "x;x", "x@x",
    ],
)  # fmt: skip
def test_formulas_are_no_programs(tmp_path, formula, monkeypatch):
    monkeypatch.chdir(tmp_path)
    quoted = '"' + formula.replace("\x1b", "\\u001b") + '"'
    (tmp_path / "scene.toml").write_text(BAR.format(velocity=quoted), encoding="utf-8")
    before = contents(tmp_path)
    with pytest.raises(SceneError) as caught:
        Scene.from_toml("scene.toml")
    assert "\x1b" not in str(caught.value)
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    "name", ["../../x", "/etc/x", "a/b", "..", "", "a\\u001b[2Jb", "a\\nb", "a\\u0000"]
)
def test_names_are_no_paths(name):
    text = BAR.format(velocity=0).replace('name = "bar"', f'name = "{name}"')
    with pytest.raises(SceneError):
        Scene.from_dict(tomllib.loads(text))


def test_what_is_said_cannot_repaint_the_terminal(tmp_path):
    assert (
        plain("a\x1b[2J\rb\x9b\N{RIGHT-TO-LEFT OVERRIDE}\t\nü") == "a\\x1b[2J\\rb\\x9b\\u202e\t\nü"
    )
    name = "\x1b[31mred.toml"
    (tmp_path / name).write_text("title = 1")
    code, out, err = run(tmp_path, "validate", name)
    assert (code, out) == (2, "")
    assert "\x1b" not in err
    assert "\\x1b[31mred.toml" in err


SCRIPTS = {
    "a loop": "For i In {1:1e12}\nx = i;\nEndFor\n",
    "a macro": "Macro a\nCall a;\nReturn\nCall a;\n",
    "a text that doubles": 's = "a";\nFor i In {1:60}\ns = StrCat(s, s);\nEndFor\n',
    "a list": "x[] = {1:1e10};\n",
}


@pytest.mark.slow
@pytest.mark.parametrize("text", SCRIPTS.values(), ids=SCRIPTS)
def test_scripts_end(tmp_path, monkeypatch, text):
    monkeypatch.setattr(apart, "_SECONDS", 1)
    monkeypatch.setattr(apart, "_BYTES", 2**31)
    path = tmp_path / "mesh.geo"
    path.write_text(text)
    with pytest.raises(MeshError, match=r"takes too long|crashed|memory"), opening.opened(path):
        pass


MESHES = {
    "noise": b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + np.random.default_rng(0).bytes(100_000),
    "nodes": b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 100000000000 1 100000000000\n",
    "entities": b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n99999999999 0 0 0\n",
    "binary": b"$MeshFormat\n4.1 1 8\n\1\0\0\0\n$EndMeshFormat\n$Nodes\n" + b"\xff" * 64,
    "packed": b"\x1f\x8b" + bytes(1000),
}


@pytest.mark.parametrize("content", MESHES.values(), ids=MESHES)
def test_meshes_that_claim_more_than_they_hold(tmp_path, content):
    path = tmp_path / "mesh.msh"
    path.write_bytes(content)
    with pytest.raises(MeshError), opening.opened(path):
        pass
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    assert children < 4 * 2**20  # in KiB; that of scripts above counts too


class Trap:
    """What a pickle would run."""

    def __reduce__(self):
        return os.mkdir, ("hit",)


def npz(path, compression=zipfile.ZIP_STORED, **arrays):
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, values in arrays.items():
            buffer = io.BytesIO()
            np.save(buffer, values, allow_pickle=True)
            file.writestr(f"{name}.npy", buffer.getvalue())


def test_checkpoints_hold_no_programs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    npz(tmp_path / FILE, scene=np.array([Trap()], dtype=object))
    with pytest.raises(OutputError, match="no checkpoint that can be read"):
        scene_of(tmp_path)
    assert not (tmp_path / "hit").exists()


def test_checkpoints_are_not_packed(tmp_path):
    npz(tmp_path / FILE, zipfile.ZIP_DEFLATED, scene="x", bomb=np.zeros(10_000_000))
    assert (tmp_path / FILE).stat().st_size < 200_000
    with pytest.raises(OutputError, match="its arrays are packed"):
        load(tmp_path / FILE)


def test_a_checkpoint_is_a_file(tmp_path):
    os.mkfifo(tmp_path / FILE)  # reading it would wait for ever
    with pytest.raises(OutputError, match="not a file"):
        scene_of(tmp_path)


@pytest.mark.parametrize("text", ["a.b = ", "title = 1", "a" + ".a" * 99 + "=1", "[" * 9999])
def test_the_scene_in_a_checkpoint_is_read_like_any_other(tmp_path, text):
    from impactfem.resuming import scene_to_continue

    npz(tmp_path / FILE, scene=text)
    with pytest.raises(SceneError):
        scene_to_continue(tmp_path)


@pytest.mark.slow
def test_links_in_a_folder_do_no_harm(tmp_path):
    """What is written while a run goes on is written into the folder, not through a link in it."""
    (tmp_path / "scene.toml").write_text(DISC, encoding="utf-8")
    (tmp_path / "victim").write_text("dear")
    out = tmp_path / "o"
    out.mkdir()
    names = (".fields.partial.vtkhdf", f".{FILE}.partial", "history.csv")
    for name in names:
        (out / name).symlink_to("../victim")
    listed = {"title": "", "status": "", "method": "", "files": ["history.csv", LAST]}
    (out / LAST).write_text(json.dumps(listed))
    code, _, err = run(tmp_path, "run", "scene.toml", "--out", "o", "--quiet")
    assert (code, err) == (0, "")
    assert (tmp_path / "victim").read_text() == "dear"
    assert not any(path.is_symlink() for path in out.iterdir())
