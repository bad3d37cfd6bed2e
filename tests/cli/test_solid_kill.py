"""Runs of solids that are killed while they march, and what is left of them."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import finish, launch, start

from impactfem.facade import Result
from impactfem.marching.checkpoint import FILE

SCENE = (Path(__file__).parents[1] / "disc.toml").read_text(encoding="utf-8")
for line, other in {
    "duration = 6.0": "duration = 12.0",
    "mesh_size = 0.15": "mesh_size = 0.07",
    'method = "explicit"': 'method = "METHOD"',
    "report = false": "every = 5\nreport = false\npictures = false\nfilm = false",
    "checkpoint = 5": "checkpoint = 20",
}.items():
    SCENE = SCENE.replace(line, other)


def killed_while_marching(process, folder, waits=120.0):
    """Kill a process, and all of its group, soon after its first checkpoint; whether it ran."""
    limit = time.monotonic() + waits
    while not (folder / FILE).exists():
        if process.poll() is not None or time.monotonic() > limit:
            break
        time.sleep(0.002)
    time.sleep(0.03)
    running = process.poll() is None
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    return running


def check_equal(work):
    one, other = Result.load(work / "whole"), Result.load(work / "killed")
    for name in one.history.data_vars:
        a, b = one.history[name].values, other.history[name].values
        assert np.array_equal(a, b, equal_nan=True), name
    assert len(one.fields) == len(other.fields)
    for layer in range(0, len(one.fields), 7):
        a, b = one.fields.read(layer), other.fields.read(layer)
        for name in a:
            assert np.array_equal(a[name], b[name], equal_nan=True), name
    assert not (work / "killed" / FILE).exists()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["explicit", "massless"])
def test_a_killed_run_is_continued_to_the_same_result(work, command, method):
    (work / "scene.toml").write_text(SCENE.replace("METHOD", method))
    assert command("run", "scene.toml", "--out", "whole", "--quiet").code == 0
    process = start(work, "run", "scene.toml", "--out", "killed", start_new_session=True)
    if not killed_while_marching(process, work / "killed"):
        pytest.skip("this machine was done before the signal")
    assert not (work / "killed/summary.json").exists()
    done = finish(start(work, "run", "--restart", "killed", "--quiet"))
    assert (done.code, done.err) == (0, "")
    check_equal(work)


@pytest.mark.slow
def test_a_killed_run_is_continued_on_two_ranks(work):
    """Rank 0 dies by itself: the launcher ends the other."""
    (work / "scene.toml").write_text(SCENE.replace("METHOD", "massless"))
    (work / "killed.py").write_text(
        "import os, signal, sys\n"
        "from impactfem.marching.solids import SolidMarch\n"
        "from impactfem.fem import MPI\n"
        "advance = SolidMarch._advance\n"
        "def dying(self):\n"
        "    if self.layer == 90 and MPI.COMM_WORLD.rank == 0:\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return advance(self)\n"
        "SolidMarch._advance = dying\n"
        "from impactfem.cli import main\n"
        "sys.exit(main(['run', 'scene.toml', '--out', 'killed', '--quiet']))\n"
    )
    run = ("-m", "impactfem", "run")
    assert launch(work, 2, *run, "scene.toml", "--out", "whole", "--quiet").code == 0
    assert launch(work, 2, "killed.py", timeout=240).code != 0
    assert (work / "killed" / FILE).exists()
    done = launch(work, 2, *run, "--restart", "killed", "--quiet")
    assert done.code == 0, done.err
    check_equal(work)
