"""The folder of a result: whole or not at all."""

import os
import signal
import threading

import pytest

from impactfem.errors import OutputError
from impactfem.result.store import LAST, check_writable, replaced, reserve, staged


def fill(stage, text="new", names=("history.csv", LAST)):
    for name in names:
        (stage / name).write_text(text)


def tree(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def test_a_new_folder_appears_with_its_parents(tmp_path):
    with staged(tmp_path / "a/b/o") as stage:
        fill(stage)
        (stage / "fields_pvd").mkdir()
        (stage / "fields_pvd/part").write_text("1")
        assert not (tmp_path / "a/b/o").exists()
    assert tree(tmp_path / "a/b/o") == ["fields_pvd", "fields_pvd/part", "history.csv", LAST]
    assert tree(tmp_path / "a/b")[0] == "o"  # no staging folder is left


def test_an_older_result_is_replaced_and_foreign_files_stay(tmp_path):
    with staged(tmp_path) as stage:
        fill(stage, "old", ("history.csv", "exact.nc", "fields.pvd", LAST))
        (stage / "fields.bp").mkdir()
        (stage / "fields.bp/data").write_text("old")
    (tmp_path / "mine.png").write_text("mine")
    (tmp_path / "folder").mkdir()
    with staged(tmp_path) as stage:
        fill(stage)
    assert tree(tmp_path) == ["folder", "history.csv", "mine.png", LAST]
    assert (tmp_path / "history.csv").read_text() == "new"


def test_files_and_folders_replace_each_other(tmp_path):
    (tmp_path / "fields.bp").write_text("a file")
    (tmp_path / "history.csv").mkdir()
    (tmp_path / "history.csv/within").write_text("x")
    with staged(tmp_path) as stage:
        fill(stage)
        (stage / "fields.bp").mkdir()
    assert (tmp_path / "fields.bp").is_dir()
    assert (tmp_path / "history.csv").read_text() == "new"


def test_some_files_are_replaced_and_the_others_stay(tmp_path):
    with staged(tmp_path) as stage:
        fill(stage, "old")
    with replaced(tmp_path) as stage:
        fill(stage, "new", ("energy.png",))
    assert tree(tmp_path) == ["energy.png", "history.csv", LAST]
    assert (tmp_path / LAST).read_text() == "old"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("place", ["old", "new/deep"])
def test_an_error_leaves_all_as_it_was(tmp_path, error, place):
    with staged(tmp_path / "old") as stage:
        fill(stage, "old")
    before = tree(tmp_path)
    with pytest.raises(error), staged(tmp_path / place) as stage:  # noqa: PT012
        fill(stage)
        raise error
    assert tree(tmp_path) == before
    assert (tmp_path / "old" / LAST).read_text() == "old"


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), RuntimeError("HDF5: No space left on device")]
)
def test_a_full_disk_becomes_an_error_with_remedy(tmp_path, error):
    with pytest.raises(OutputError) as caught, staged(tmp_path / "o"):
        raise error
    assert str(caught.value) == (
        f"{tmp_path / 'o'}: cannot be written ({str(error).removeprefix('[Errno 28] ')}); free "
        "some space or choose another folder (--out)"
    )
    assert tree(tmp_path) == []


def test_a_disk_that_fails_at_the_end_keeps_the_older_result(tmp_path, monkeypatch):
    with staged(tmp_path / "o") as stage:
        fill(stage, "old")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left"), staged(tmp_path / "o") as stage:
        fill(stage)
    assert tree(tmp_path) == ["o", "o/history.csv", f"o/{LAST}"]
    assert (tmp_path / "o" / LAST).read_text() == "old"


def test_the_summary_comes_last(tmp_path, monkeypatch):
    """A process that is killed while it publishes leaves no folder that looks complete."""
    from pathlib import Path

    with staged(tmp_path) as stage:
        fill(stage, "old", ("history.csv", "history.nc", LAST))
    seen = []
    replace = Path.replace

    def watched(path, target):
        seen.append((path.name, (tmp_path / LAST).exists()))
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", watched)
    with staged(tmp_path) as stage:
        fill(stage, "new", ("history.csv", "history.nc", LAST))
    assert seen == [("history.csv", False), ("history.nc", False), (LAST, False)]


def test_a_file_in_place_of_the_folder(tmp_path):
    (tmp_path / "o").touch()
    for folder in (tmp_path / "o", tmp_path / "o/below"):
        with pytest.raises(OutputError, match="is a file; choose another folder"):
            check_writable(folder)
        with pytest.raises(OutputError, match="is a file"), staged(folder):
            pass


def test_checking_leaves_nothing(tmp_path):
    check_writable(tmp_path / "a/b/c")
    check_writable(tmp_path)
    assert tree(tmp_path) == []


def test_the_folder_is_as_open_as_others(tmp_path):
    mask = os.umask(0o027)
    try:
        with staged(tmp_path / "o") as stage:
            fill(stage)
    finally:
        os.umask(mask)
    assert (tmp_path / "o").stat().st_mode & 0o777 == 0o750


def test_room_is_reserved_and_given_back(tmp_path):
    reserve(tmp_path, 10_000)
    assert tree(tmp_path) == []
    with pytest.raises(OSError, match=r"No space left|too large"):
        reserve(tmp_path, 2**62)
    assert tree(tmp_path) == []


def test_results_can_be_written_by_other_threads(tmp_path):
    def write():
        with staged(tmp_path / "o") as stage:
            fill(stage)

    thread = threading.Thread(target=write)
    thread.start()
    thread.join()
    assert tree(tmp_path / "o") == ["history.csv", LAST]


def test_handlers_are_as_before(tmp_path):
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for _ in range(2):
        with staged(tmp_path) as stage:
            fill(stage)
    assert before == {number: signal.getsignal(number) for number in before}
