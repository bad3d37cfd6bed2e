"""Runs of solids are killed at many moments: nothing is lost, nothing half-written is left."""

import os
import signal
import sys
from pathlib import Path

import pytest
from processes import contents
from trouble_process import DISC, SHORT, equal, hidden, run, started, until

from impactfem.result.claim import LOCK
from impactfem.result.store import CHECKPOINT, LAST


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A result of the run that is killed in the tests, and its scene."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "scene.toml").write_text(DISC, encoding="utf-8")
    code, _, err = run(folder, "run", "scene.toml", "--out", "whole", "--quiet")
    assert (code, err) == (0, "")
    return folder


def killed(folder, process, seen, delay):
    """Kill a run a moment after something is there; whether it was running."""
    until(lambda: seen() or process.poll() is not None)
    until(lambda: process.poll() is not None, 0.007 * delay)
    running = process.poll() is None
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    return running and folder.exists()


@pytest.mark.slow
def test_a_run_that_is_killed_again_and_again_loses_nothing(whole):
    out = whole / "killed"
    words = (sys.executable, "-m", "impactfem", "run")
    first = ("scene.toml", "--out", "killed", "--quiet")
    for count in range(4):
        arguments = ("--restart", "killed", "--quiet") if (out / CHECKPOINT).exists() else first
        last = (out / CHECKPOINT).stat().st_mtime_ns if (out / CHECKPOINT).exists() else 0

        def anew(last=last):
            return (out / CHECKPOINT).exists() and (out / CHECKPOINT).stat().st_mtime_ns > last

        def published(count=count):  # the last time: while the result is being written
            return count > 0 and any(out.glob(".killed.*"))

        with started(whole, *words, *arguments) as process:
            killed(out, process, anew if count < 3 else published, count)
    if (out / CHECKPOINT).exists():
        code, _, err = run(whole, "run", "--restart", "killed", "--quiet")
        assert (code, err) == (0, "")
    else:  # killed while it drew: the data are whole, the pictures are made anew
        equal(whole / "whole", out)
        code, _, err = run(whole, "plot", "killed")
        assert (code, err) == (0, "")
    equal(whole / "whole", out)
    assert contents(out).keys() - {"report.html", "motion.gif"} == contents(whole / "whole").keys()
    assert hidden(out) == []


@pytest.mark.slow
def test_an_older_result_survives_a_kill(whole):
    before = contents(whole / "whole")
    words = (sys.executable, "-m", "impactfem", "run", "scene.toml", "--out", "whole", "--quiet")
    with started(whole, *words) as process:
        assert killed(whole / "whole", process, (whole / "whole" / CHECKPOINT).exists, 1)
    now = contents(whole / "whole")
    assert {name: now[name] for name in before} == before
    code, _, err = run(whole, "run", "--restart", "whole", "--quiet")
    assert (code, err) == (0, "")
    assert contents(whole / "whole").keys() == before.keys()


@pytest.mark.slow
def test_a_second_run_is_refused_and_the_first_unharmed(whole):
    words = (sys.executable, "-m", "impactfem", "run", "scene.toml", "--out", "two", "--quiet")
    with started(whole, *words) as process:
        assert until((whole / "two" / CHECKPOINT).exists)
        os.kill(process.pid, signal.SIGSTOP)  # so that it is there as long as is needed
        for arguments in (
            ("run", "--restart", "two", "--quiet", "--out", "three"),
            (*SHORT, "./two"),
        ):
            code, out, err = run(whole, *arguments)
            assert (code, out) == (1, "")
            assert err.startswith("impactfem: ")
            assert err.count("\n") == 1
            who = f"process {process.pid} on {os.uname().nodename}"
            for part in ("two: another run writes into this folder", who, "--out"):
                assert part in err
        os.kill(process.pid, signal.SIGCONT)
        assert process.wait(60) == 0
    equal(whole / "whole", whole / "two")
    assert not (whole / "two" / LOCK).exists()
    assert not (whole / "three").exists()


def test_pictures_are_not_drawn_into_a_folder_in_use(tmp_path):
    from impactfem.result.claim import Claim

    code, _, err = run(tmp_path, *SHORT, "o", "--set", "output.report=false")
    assert (code, err) == (0, "")
    claim = Claim(tmp_path / "o")
    claim.take()
    try:
        code, _, err = run(tmp_path, "plot", "o")
    finally:
        claim.release()
    assert code == 1
    assert f"process {os.getpid()}" in err


def test_gmsh_ends_with_its_run(tmp_path):
    """A script that never ends, in a process of its own, whose parent is killed."""
    (tmp_path / "body.geo").write_text("For i In {1:1e12}\nx = i;\nEndFor\n")
    text = DISC.replace('shape = { kind = "disc", radius = 0.5, center = [0.0, 0.50125] }\n', "")
    (tmp_path / "scene.toml").write_text(
        text.replace("mesh_size", 'mesh = "body.geo"\nmesh_size'), encoding="utf-8"
    )
    with started(tmp_path, sys.executable, "-m", "impactfem", "plan", "scene.toml") as process:
        children = []

        def born():
            listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
            children[:] = [int(word) for word in listed.split()]
            return bool(children) and process_uses(children[0], b"source.geo")

        assert until(born)
        os.kill(process.pid, signal.SIGKILL)  # it alone, not its group
        process.wait()
        assert until(lambda: not alive(children[0]), 5.0)


def process_uses(number, word):
    try:
        return word in Path(f"/proc/{number}/cmdline").read_bytes()
    except OSError:
        return False


def alive(number):
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_a_folder_without_summary_is_no_result(whole):
    (whole / "half").mkdir()
    for name in ("scene.toml", "history.nc"):
        (whole / "half" / name).write_bytes((whole / "whole" / name).read_bytes())
    assert not (whole / "half" / LAST).exists()
    code, out, err = run(whole, "plot", "half")
    assert (code, out) == (2, "")
    assert "half: no complete result" in err
