"""The command line as a user starts it: in this process, in one of its own, or on several ranks."""

import subprocess
import sys
from dataclasses import dataclass

import pytest
from processes import BARE, as_started, environment, ranks

from impactfem.cli import main

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


def start(folder, *arguments, **options):
    """Start the command line in a process of its own."""
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(
        [sys.executable, "-m", "impactfem", *map(str, arguments)],
        cwd=folder, env=environment(), **(given | options),
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


def finish(process, timeout=480):
    try:
        out, err = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    return Done(process.returncode, out, err and said(err))


def launch(folder, count, *arguments, timeout=480):
    """Run Python on several ranks."""
    words, needed = ranks(count)
    process = subprocess.Popen(
        [*words, *map(str, arguments)],
        cwd=folder, env=environment(**needed), stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    return finish(process, timeout)


@pytest.fixture
def work(tmp_path, monkeypatch):
    """An empty working folder."""
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def command(work, capsys):  # noqa: ARG001  (in the working folder)
    """Run the command line in this process, which is as good as a start and faster.

    Pictures and pages, most of the time of a small run, are drawn only if they are asked for.
    """

    def run(*arguments, drawn=False):
        words = [str(argument) for argument in arguments]
        if words[:1] == ["run"] and "--restart" not in words and not drawn:
            words += BARE
        capsys.readouterr()
        code = main(words)
        captured = capsys.readouterr()
        return Done(code, captured.out, said(captured.err))

    with as_started():
        yield run
