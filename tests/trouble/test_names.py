"""Names, paths, languages and clocks of all sorts."""

import os
import re
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from processes import BARE, contents
from trouble_process import DISC, SHORT, equal, run, started, until

import impactfem
from impactfem.facade import Result
from impactfem.result.store import CHECKPOINT
from impactfem.shipped import shipped_scenes

ODD = "Stöße 衝突 'o \"$x"
LANGUAGES = {
    "C": {
        "LC_ALL": "C",
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
        "PYTHONIOENCODING": "ascii",
    },
    "Turkish": {"LC_ALL": "tr_TR.UTF-8"},  # dotless i: lower-case words differ
    "German": {"LC_ALL": "de_DE.UTF-8"},  # decimal comma
}


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_languages(tmp_path, language):
    """Numbers and words are the same in each; what a terminal cannot show is spelt out."""
    text = shipped_scenes()["bar_impact"].read_text(encoding="utf-8")
    text = re.sub("title = .*", 'title = "Stöße"', text, count=1)
    (tmp_path / "ü.toml").write_text(text, encoding="utf-8")
    arguments = ("run", "ü.toml", "--set", "solve.method=exact", *BARE, "--quiet", "--out", "ö o")
    code, out, err = run(tmp_path, *arguments, env=LANGUAGES[language])
    assert (code, err) == (0, "")
    result = Result.load(tmp_path / "ö o")
    assert result.scene.title == "Stöße"
    table = np.loadtxt(tmp_path / "ö o/history.csv", delimiter=",", skiprows=1)
    assert np.array_equal(table[:, 2], result.history["contact_force"].values)
    code, out, err = run(tmp_path, "validate", "ö o/scene.toml", env=LANGUAGES[language])
    assert (code, err) == (0, "")
    assert ("St\\xf6\\xdfe" if language == "C" else "Stöße") in out


@pytest.fixture
def odd(tmp_path):
    """A scene with a mesh of its own in a folder with an odd name."""
    folder = tmp_path / ODD
    folder.mkdir()
    (folder / "netz ü.geo").write_text(
        'SetFactory("OpenCASCADE"); Disk(1) = {0, 0.50125, 0, 0.5}; MeshSize{:} = 0.25;\n'
        'Physical Surface("Körper") = {1}; Physical Curve("Rand") = {1};\n'
    )
    shape = 'shape = { kind = "disc", radius = 0.5, center = [0.0, 0.50125] }\n'
    assert shape in DISC
    text = DISC.replace(shape, 'mesh = "netz ü.geo"\n').replace("mesh_size = 0.15\n", "")
    text = text.replace("6.0", "1.5")
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.slow
def test_odd_names_from_scene_to_restart(odd, tmp_path):
    """Scene, mesh, surfaces, title and folder; also where a killed run goes on."""
    scene, out = f"{ODD}/scene.toml", f"{ODD}/ergebnis ß"
    code, _, err = run(tmp_path, "run", scene, "--out", "whole", "--quiet")
    assert (code, err) == (0, "")
    words = (sys.executable, "-m", "impactfem", "run", scene, "--out", out, "--quiet")
    with started(tmp_path, *words) as process:
        assert until((tmp_path / out / CHECKPOINT).exists)
        process.kill()
        process.wait()
    code, _, err = run(odd, "run", "--restart", "ergebnis ß", "--quiet")
    assert (code, err) == (0, "")
    equal(tmp_path / "whole", tmp_path / out)
    result = Result.load(tmp_path / out)
    assert result.scene.title.startswith("Schütte Ω")


def test_a_folder_behind_a_link_and_another_working_folder(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "work").mkdir()
    (tmp_path / "link").symlink_to("real")
    settings = ("--set", "output.report=false")
    code, _, err = run(tmp_path / "work", *SHORT, "../link", *settings)
    assert (code, err) == (0, "")
    assert (tmp_path / "link").is_symlink()
    assert "summary.json" in contents(tmp_path / "real")
    assert contents(tmp_path / "work") == {}


def test_very_long_paths(tmp_path):
    deep = tmp_path.joinpath(*["a" * 200] * 25)  # more than the 4096 bytes that Linux takes
    for arguments in ((*SHORT, deep), (*SHORT, "b" * 300)):
        code, out, err = run(tmp_path, *arguments)
        assert (code, out) == (1, "")
        assert "File name too long" in err
        assert err.count("\n") == 1
    code, out, err = run(tmp_path, "run", f"{deep}.toml")
    assert (code, out) == (2, "")
    assert "Traceback" not in err
    assert contents(tmp_path) == {}


def test_files_of_the_future(tmp_path):
    """A clock that was put back: nothing depends on the times of files."""
    assert run(tmp_path, *SHORT, "o")[0] == 0
    later = time.time() + 1e8
    for path in (tmp_path / "o").iterdir():
        os.utime(path, (later, later))
    code, _, err = run(tmp_path, *SHORT, "o", "--set", "title=new")
    assert (code, err) == (0, "")
    assert Result.load(tmp_path / "o").scene.title == "new"


def test_durations_are_measured_by_a_clock_that_cannot_be_put():
    """The time of day may jump while a run goes on."""
    package = Path(impactfem.__file__).parent
    used = [
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if re.search(r"\btime\.time\(|from time import time\b", path.read_text(encoding="utf-8"))
    ]
    assert used == []
