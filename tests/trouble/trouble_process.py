"""Runs in processes of their own, killed whatever happens, and the scenes they solve."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from processes import BARE, environment, ranks

from impactfem.facade import Result

DRAWN = ("run", "bar_impact", "--set", "solve.method=exact", "--quiet", "--out")
SHORT = ("run", "bar_impact", *BARE, "--set", "solve.method=exact", "--quiet", "--out")

DISC = (Path(__file__).parents[1] / "disc.toml").read_text(encoding="utf-8")


@contextlib.contextmanager
def started(folder, *command, env=None, **options):
    """A process group that is gone afterwards."""
    process = subprocess.Popen(
        [str(word) for word in command], cwd=folder, env=environment(**(env or {})),
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        start_new_session=True, **options,
    )  # fmt: skip
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def run(folder, *arguments, timeout=240, **options):
    """Run the command line, or a script; returns code, standard output and error."""
    words = arguments if str(arguments[0]).endswith(".py") else ("-m", "impactfem", *arguments)
    with started(folder, sys.executable, *words, **options) as process:
        out, err = process.communicate(timeout=timeout)
        lines = err.decode("utf-8", "replace").splitlines(keepends=True)
        # Whether something is compiled depends on caches.
        told = "".join(line for line in lines if not line.startswith("compiling "))
        return process.returncode, out.decode("utf-8", "replace"), told


def launched(folder, count, *words, timeout=240):
    """Run Python on several ranks; returns code, standard error, and the seconds it took."""
    start, needed = ranks(count)
    with started(folder, *start, *words, env=needed) as process:
        _, err = process.communicate(timeout=timeout)
        return process.returncode, err.decode("utf-8", "replace")


def until(condition, seconds=120.0):
    """Wait for something; whether it came."""
    limit = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > limit:
            return False
        time.sleep(0.002)
    return True


def hidden(folder):
    return sorted(path.name for path in folder.rglob(".*"))


def equal(one, other):
    """Assert that two results are the same."""
    one, other = Result.load(one), Result.load(other)
    for name in one.history.data_vars:
        a, b = one.history[name].values, other.history[name].values
        np.testing.assert_allclose(b, a, rtol=1e-10, atol=1e-12, err_msg=name)
    if one.fields is not None:
        assert one.fields.times.tolist() == other.fields.times.tolist()
        for layer in range(0, len(one.fields), 7):
            a, b = one.fields.read(layer), other.fields.read(layer)
            for name in a:
                np.testing.assert_allclose(b[name], a[name], rtol=1e-10, atol=1e-12)
