"""The command line as a user starts it: in this process, in one of its own, or on several ranks."""

import os
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from impactfem.cli import main

# A launcher's variables in the environment of the tests would make every child a rank.
LAUNCHER = re.compile(r"(PMI|OMPI|PRTE|HYDRA|SLURM|MPI_LOCAL)")

SCENE = """
title = "a bar"
duration = 5.0

[[body]]
name = "bar"
kind = "bar"
length = 1.0
density = 1.0
youngs_modulus = 1.0
gap = 0.5
velocity = -0.5

[[obstacle]]
kind = "wall"

[solve]
elements = 4
"""

BARE = tuple(
    word for what in ("pictures", "film", "report") for word in ("--set", f"output.{what}=false")
)  # a run that draws nothing


def clean_environment(**changes):
    kept = {name: value for name, value in os.environ.items() if not LAUNCHER.match(name)}
    return kept | {"OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"} | changes


def start(folder, *arguments, **options):
    """Start the command line in a process of its own."""
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(
        [sys.executable, "-m", "impactfem", *map(str, arguments)],
        cwd=folder, env=clean_environment(), **(given | options),
    )  # fmt: skip


def said(text):
    """Standard error without what depends on caches: that something is compiled."""
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith("compiling "))


@dataclass
class Done:
    code: int
    out: str
    err: str


def finish(process, timeout=120):
    try:
        out, err = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    return Done(process.returncode, out, err and said(err))


def launch(folder, ranks, *arguments, timeout=120):
    """Run Python on several ranks."""
    mpirun = Path(sys.executable).parent / "mpirun"
    found = str(mpirun) if mpirun.exists() else shutil.which("mpirun")
    if found is None:
        pytest.skip("no mpirun beside this Python or on PATH")
    environment = clean_environment(PRTE_MCA_rmaps_default_mapping_policy=":oversubscribe")
    if os.geteuid() == 0:  # else Open MPI refuses
        environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    process = subprocess.Popen(
        [found, "-n", str(ranks), sys.executable, *map(str, arguments)],
        cwd=folder, env=environment, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    return finish(process, timeout)


def contents(folder):
    """Every file and folder below, with its content: what must stay as it was."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def work(tmp_path, monkeypatch):
    """An empty working folder."""
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def command(work, capsys, monkeypatch):  # noqa: ARG001  (in the working folder)
    """Run the command line in this process, which is as good as a start and faster.

    Pictures and pages, most of the time of a small run, are drawn only if they are asked for.
    """
    for name in os.environ:
        if LAUNCHER.match(name):
            monkeypatch.delenv(name)
    for name in ("OMP_NUM_THREADS", "PETSC_OPTIONS"):  # as they were, whatever is set meanwhile
        monkeypatch.setenv(name, os.environ.get(name, ""))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def run(*arguments, drawn=False):
        words = [str(argument) for argument in arguments]
        if words[:1] == ["run"] and "--restart" not in words and not drawn:
            words += BARE
        capsys.readouterr()
        code = main(words)
        captured = capsys.readouterr()
        return Done(code, captured.out, said(captured.err))

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)
