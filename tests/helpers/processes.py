"""Processes that tests start: their environment, ranks, quiet runs, and what lies in a folder."""

import os
import re
import shutil
import signal
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

# A launcher's variables in the environment of the tests would make every child a rank.
LAUNCHER = re.compile(r"(PMI|OMPI|PRTE|HYDRA|SLURM|MPI_LOCAL)")

BARE = tuple(
    word
    for what in ("pictures", "film", "report")
    for word in ("--set", f"output.{what}=false")
)  # fmt: skip  # a run that draws nothing


def environment(**changes):
    """That of the tests, but for marks of ranks; one thread, and no files beside the sources."""
    kept = {name: value for name, value in os.environ.items() if not LAUNCHER.match(name)}
    return kept | {"OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"} | changes


@contextmanager
def as_started():
    """What the command line finds in a process of its own, and sets, for calls in this one."""
    with pytest.MonkeyPatch.context() as patch:
        for name in os.environ:
            if LAUNCHER.match(name):
                patch.delenv(name)
        for name in ("OMP_NUM_THREADS", "PETSC_OPTIONS"):  # as they were, whatever is set meanwhile
            patch.setenv(name, os.environ.get(name, ""))
        patch.setenv("OMP_NUM_THREADS", "1")
        numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        handlers = {number: signal.getsignal(number) for number in numbers}
        yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


def ranks(count):
    """The words that start Python on several ranks, and what they need in the environment."""
    beside = Path(sys.executable).parent / "mpirun"
    found = str(beside) if beside.exists() else shutil.which("mpirun")
    if found is None:
        pytest.skip("no mpirun beside this Python or on PATH")
    needed = {"PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}
    if os.geteuid() == 0:  # else Open MPI refuses
        needed |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return [found, "-n", str(count), sys.executable], needed


def contents(folder):
    """Every file and folder below, with its content: what must stay as it was."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }
