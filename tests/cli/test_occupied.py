"""A folder that holds somebody else's files is refused before anything is computed."""

import json
import os
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import Done, finish, start
from processes import contents

import impactfem
from impactfem import Result, Scene
from impactfem.errors import FolderError, OutputError
from impactfem.result.occupied import check_free
from impactfem.result.store import CHECKPOINT, LAST, replaced
from impactfem.shipped import shipped_scenes

SCENE = shipped_scenes()["bar_impact"].read_text(encoding="utf-8")

DISC = (Path(__file__).parents[1] / "disc.toml").read_text(encoding="utf-8")
DISC += "film = false\npictures = false\n"


@pytest.fixture(scope="module")
def result():
    scene = Scene.from_toml(shipped_scenes()["bar_impact"])
    return impactfem.solve(scene, method="exact")


@pytest.fixture
def refused(command, work):
    def run(*arguments):
        before = contents(work)
        done = command("run", *arguments)
        assert (done.code, done.out) == (2, "")
        assert contents(work) == before
        return done.err

    return run


def test_the_scene_of_a_user_is_not_replaced(refused, work):
    (work / "scene.toml").write_text(SCENE, encoding="utf-8")
    (work / "history.csv").write_text("mine")
    for out in (".", str(work), "../" + work.name):
        err = refused("scene.toml", "--out", out)
        assert "holds the scene of this run, scene.toml" in err
        assert "choose another folder (--out)" in err
        assert err.count("\n") == 1
    assert "(history.csv, scene.toml); choose another" in refused("bar_impact", "--out", ".")


@pytest.mark.parametrize("out", ["/", "/usr"])
def test_folders_of_the_system(refused, out):
    assert f"{out}: holds what no result" in refused("bar_impact", "--out", out)


def test_no_name_is_no_folder(refused):
    for arguments in (("bar_impact", "--out", ""), ("--restart", "")):
        assert '"" names no folder; "." is the present one' in refused(*arguments)


def test_a_result_is_replaced_and_its_neighbours_refuse(tmp_path, result):
    folder = result.save(tmp_path / "o", pictures=False)
    listed = json.loads((folder / LAST).read_text())["files"]
    assert set(listed) == set(contents(folder))
    result.save(folder, pictures=False)
    result.plot(folder)  # its pictures belong to the result
    result.save(folder, pictures=False)
    (folder / ".gitignore").write_text("*")
    result.save(folder, pictures=False)
    (folder / "notes.txt").write_text("mine")
    before = contents(folder)
    with pytest.raises(
        OutputError, match=r"holds what no .*\(notes\.txt\); choose another"
    ) as told:
        result.save(folder)
    assert isinstance(told.value, FolderError)
    assert contents(folder) == before
    # One that comes while a run goes on costs nothing.
    result.write_data(folder)
    assert (folder / "notes.txt").read_text() == "mine"


def test_many_files_are_not_all_named(tmp_path):
    for k in range(9):
        (tmp_path / f"{k}.txt").touch()
    with pytest.raises(FolderError, match=r"\(0.txt, 1.txt, 2.txt, 6 more\)"):
        check_free(tmp_path)


def test_results_of_version_0_1_list_no_files(tmp_path, result):
    folder = result.save(tmp_path / "o", pictures=False)
    summary = json.loads((folder / LAST).read_text())
    del summary["files"]
    (folder / LAST).write_text(json.dumps(summary))
    (folder / "energy.png").touch()
    check_free(folder)
    with replaced(folder) as stage:
        (stage / "body.png").touch()
    assert set(json.loads((folder / LAST).read_text())["files"]) == set(contents(folder))
    (folder / "scenes.toml").touch()
    with pytest.raises(FolderError, match=r"scenes\.toml"):
        check_free(folder)


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '"files"', '{"files": ["history.csv"]}', "{" * 99_999, "\xff"]
)
def test_a_summary_of_another_program_allows_nothing(tmp_path, text):
    (tmp_path / LAST).write_text(text, encoding="latin-1")
    (tmp_path / "history.csv").touch()
    with pytest.raises(FolderError):
        check_free(tmp_path)


@pytest.mark.parametrize("files", [5, None, {"a": 1}, [["x"]], ["../x", 3]])
def test_lists_of_files_of_strangers_are_read_with_care(tmp_path, files):
    summary = {"title": "", "status": "", "method": "", "files": files, "x": float("nan")}
    (tmp_path / LAST).write_text(json.dumps(summary))
    (tmp_path / "mine").touch()
    with pytest.raises(FolderError, match=r"mine"):
        check_free(tmp_path)
    with replaced(tmp_path) as stage:
        (stage / "body.png").touch()


def test_only_a_checkpoint_of_ours_is_one(tmp_path):
    np.savez(tmp_path / CHECKPOINT, weights=np.zeros(3))
    with pytest.raises(FolderError, match=CHECKPOINT):
        check_free(tmp_path)
    np.savez(tmp_path / CHECKPOINT, scene="title = 1")
    check_free(tmp_path)
    (tmp_path / CHECKPOINT).unlink()
    os.mkfifo(tmp_path / CHECKPOINT)
    with pytest.raises(FolderError, match=CHECKPOINT):
        check_free(tmp_path)


@pytest.mark.slow
def test_a_stopped_run_goes_on_in_its_folder_and_may_begin_anew(command, work):
    (work / "scene.toml").write_text(DISC, encoding="utf-8")
    process = start(work, "run", "scene.toml", "--out", "o", "--quiet")
    while not (work / "o" / CHECKPOINT).exists() and process.poll() is None:
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    finish(process)
    assert (work / "o" / CHECKPOINT).exists()
    shutil.copytree(work / "o", work / "p")
    for arguments in (("--restart", "o"), ("scene.toml", "--out", "p")):
        assert command("run", *arguments, "--quiet") == Done(0, "", "")
    assert Result.load(work / "p").history.equals(Result.load(work / "o").history)
    assert contents(work / "p").keys() == contents(work / "o").keys()
