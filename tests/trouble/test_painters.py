"""Whatever happens to the pictures, the data of a result are there, and are read."""

import errno
import json
import os
import signal
import sys
from pathlib import Path

import pytest
from processes import contents

import impactfem
from impactfem import Result, Scene
from impactfem.report import figures
from impactfem.report.sheet import Sheet
from impactfem.result.store import LAST
from impactfem.shipped import shipped_scenes

pytestmark = pytest.mark.filterwarnings("ignore:This process .* is multi-threaded")

DATA = {"scene.toml", "history.csv", "history.nc", "exact.nc", "fields.vtkhdf", LAST}
DRAWN = {
    f"{name}.png"
    for name in ("contact_force", "displacement", "energy", "strain", "velocity_map", "world_lines")
}
OFF = ["output.report=false", "output.film=false"]


@pytest.fixture(scope="module")
def result():
    scene = Scene.from_toml(shipped_scenes()["bar_impact"])
    return impactfem.solve(scene.with_settings(OFF), method="exact")


def whole(folder, result):
    again = Result.load(folder)
    return again.history.identical(result.history) and len(again.fields.times) > 1


def faulty(fault):
    def paint(*_):
        raise fault

    return paint


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [ValueError("bad\n\nvalue"), MemoryError(), RecursionError(), FileNotFoundError(2, "no font")],
)
def test_a_picture_that_fails_is_one_line(result, tmp_path, monkeypatch, fault):
    monkeypatch.setattr(figures, "_draw", faulty(fault))
    with pytest.warns(RuntimeWarning) as told:
        folder = result.save(tmp_path / "o")
    lines = [str(each.message) for each in told]
    assert len(lines) == len(DRAWN)
    for line in lines:
        assert "\n" not in line
        assert f".png ({type(fault).__name__}" in line
    assert whole(folder, result)
    assert set(contents(folder)) == DATA
    verdict = json.loads((folder / LAST).read_text())["verdict"]
    assert verdict["level"] == result.summary["verdict"]["level"]
    assert [each["code"] for each in verdict["findings"]].count("drawing") == len(DRAWN)
    monkeypatch.undo()
    assert impactfem.report.adding.add_pictures(Result.load(folder), folder)[1] == []
    assert "not drawn" not in (folder / LAST).read_text()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_full_disk_while_painting_is_one_line(result, tmp_path, monkeypatch, number):
    monkeypatch.setattr(figures, "_draw", faulty(OSError(number, os.strerror(number))))
    with pytest.warns(RuntimeWarning, match=r"draw with: impactfem plot .*o") as told:
        folder = result.save(tmp_path / "o")
    assert len(told) == 1
    assert set(contents(folder)) == DATA
    assert whole(folder, result)


@pytest.mark.slow
@pytest.mark.parametrize("fault", [KeyboardInterrupt, SystemExit])
def test_an_interrupt_while_painting_keeps_the_data(result, tmp_path, monkeypatch, fault):
    result.save(tmp_path / "o")
    monkeypatch.setattr(figures, "_draw", faulty(fault))
    with pytest.raises(fault):
        result.save(tmp_path / "o")
    assert set(contents(tmp_path / "o")) == DATA
    assert whole(tmp_path / "o", result)


def test_a_library_that_is_broken(result, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "impactfem.report.page.page", None)
    with pytest.warns(RuntimeWarning, match="not drawn: all pictures"):
        folder = result.save(tmp_path / "o")
    assert whole(folder, result)


@pytest.mark.slow
def test_a_kill_while_painting_and_while_pictures_are_moved_in(result, tmp_path, monkeypatch):
    """At every change of the folder; the next one who draws ends with all."""
    folder = tmp_path / "o"
    result.save(folder)
    ends = set()
    for step in range(50):
        child = os.fork()
        if child == 0:
            left = [step]

            def counted(function, left=left):
                def call(*arguments, **options):
                    left[0] -= 1
                    if left[0] < 0:
                        os.kill(os.getpid(), signal.SIGKILL)
                    return function(*arguments, **options)

                return call

            try:
                result.write_data(folder)
                monkeypatch.setattr(figures, "_draw", lambda *_: Sheet(1.0, 1.0))
                for name in ("rename", "replace", "unlink", "write_text", "mkdir"):
                    monkeypatch.setattr(Path, name, counted(getattr(Path, name)))
                impactfem.report.adding.add_pictures(result, folder)
            finally:
                os._exit(0)
        killed = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
        assert whole(folder, result), step
        found = {name for name in contents(folder) if not name.startswith(".")}
        ends.add(frozenset(found - DATA))
        if not killed:
            break
    assert ends == {frozenset(), frozenset(DRAWN)}
    assert step > 5
