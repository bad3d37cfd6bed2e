"""A result is killed at every step of its publishing: it is the old one, or the whole new one."""

import os
import shutil
import signal
from pathlib import Path

import pytest
from processes import contents
from trouble_process import hidden, until

from impactfem.errors import OutputError
from impactfem.result import store
from impactfem.result.claim import LOCK, Claim
from impactfem.result.store import LAST, clean, replaced, staged

pytestmark = pytest.mark.filterwarnings("ignore:This process .* is multi-threaded")

OLD = {"history.csv": b"old", "exact.nc": b"old", "body.png": b"old", "mine.txt": b"mine"}
NEW = {"history.csv": b"new", "history.nc": b"new", "fields_pvd/a.vtu": b"new", LAST: b"new"}
WHOLE = {**NEW, "fields_pvd": None, "mine.txt": b"mine"}


def fill(folder, files):
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def in_child(action):
    """Run something in a child; whether it was killed."""
    child = os.fork()
    if child == 0:
        try:
            action()
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL


def dying(step):
    """Patch all that changes a folder, in this process: it dies before the step-th change."""
    left = [step]

    def counted(function):
        def call(*arguments, **options):
            left[0] -= 1
            if left[0] < 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return function(*arguments, **options)

        return call

    for name in ("rename", "replace", "unlink", "rmdir", "write_bytes", "write_text"):
        setattr(Path, name, counted(getattr(Path, name)))
    shutil.rmtree = counted(shutil.rmtree)


@pytest.mark.slow
@pytest.mark.parametrize("opened_by", ["claim", "load", "next"])
def test_every_step(tmp_path, opened_by):
    """How often a process can die before it is through is found out on the way."""
    ends = set()
    for step in range(100):
        folder = tmp_path / f"{step}"
        fill(folder, {**OLD, LAST: b"old"})

        def publish(folder=folder, step=step):
            dying(step)
            with staged(folder) as stage:
                fill(stage, NEW)

        killed = in_child(publish)
        if opened_by == "claim":
            claim = Claim(folder)
            claim.take()
            claim.release()
        elif opened_by == "load":
            store.finish(folder)  # what `Result.load` does first
        else:
            with replaced(folder):
                pass
        now = {k: v for k, v in contents(folder).items() if not k.startswith(".")}
        assert now in ({**OLD, LAST: b"old"}, WHOLE), step
        ends.add(LAST in now and now[LAST])
        if opened_by != "load":
            assert hidden(folder) == []
        if not killed:
            break
    assert ends == {b"old", b"new"}
    assert step > 10


def test_even_the_one_who_finishes_may_be_killed(tmp_path):
    fill(tmp_path / "o", {**OLD, LAST: b"old"})
    for step in (8, 1, 2, 1, 3, 50):

        def go_on(step=step):
            dying(step)
            with staged(tmp_path / "o") as stage:
                fill(stage, NEW)

        in_child(go_on)
    clean(tmp_path / "o")
    assert contents(tmp_path / "o") == WHOLE


def test_stages_of_the_living_are_left_alone(tmp_path):
    with staged(tmp_path / "o") as stage:
        fill(stage, NEW)
        clean(tmp_path / "o")
        assert set(contents(stage)) >= set(NEW)
    assert contents(tmp_path / "o") == {k: v for k, v in WHOLE.items() if k != "mine.txt"}


def test_names_of_any_length(tmp_path):
    folder = tmp_path / ("é" * 120)  # 240 bytes of the 255 allowed
    with staged(folder) as stage:
        fill(stage, NEW)
    with staged(folder) as stage:
        fill(stage, NEW)
    assert hidden(tmp_path) == []


def holding(folder):
    """A child that keeps a folder; its number."""
    child = os.fork()
    if child == 0:
        Claim(folder).take()
        signal.pause()
    return child


def test_a_claim_is_one_run_s_and_ends_with_it(tmp_path):
    folder = tmp_path / "deep/o"
    child = holding(folder)
    try:
        assert until(lambda: (folder / LOCK).exists() and (folder / LOCK).read_bytes())
        with pytest.raises(OutputError) as caught:
            Claim(folder).take()
        for part in (str(folder), f"process {child} on {os.uname().nodename}", "--out"):
            assert part in str(caught.value)
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert contents(tmp_path).keys() == {"deep", "deep/o", f"deep/o/{LOCK}"}
    claim = Claim(folder)
    claim.take()
    assert (folder / LOCK).read_text() == f"process {os.getpid()} on {os.uname().nodename}"
    claim.release()
    assert contents(folder) == {}


def test_a_claim_leaves_nothing_of_its_own(tmp_path):
    claim = Claim(tmp_path / "a/b")
    claim.take()
    assert hidden(tmp_path) == [LOCK]
    claim.release()
    assert contents(tmp_path) == {}


def test_a_lock_that_is_a_link_or_a_pipe_is_refused(tmp_path):
    (tmp_path / "victim").write_text("dear")
    (tmp_path / LOCK).symlink_to("victim")
    with pytest.raises(OutputError, match="cannot be written"):
        Claim(tmp_path).take()
    assert (tmp_path / "victim").read_text() == "dear"
    (tmp_path / LOCK).unlink()
    os.mkfifo(tmp_path / LOCK)
    with pytest.raises(OutputError, match="is no file; remove it"):
        Claim(tmp_path).take()
