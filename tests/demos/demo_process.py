"""Scripts and commands of the demos."""

import contextlib
import io
import runpy
import subprocess
import sys
import warnings
from unittest.mock import patch

from processes import environment


def run(*command):
    """What a command prints, in a process of its own; it must end well."""
    return subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=900, env=environment()
    ).stdout


def script(path, *arguments):
    """What a script prints, in this process: as good as a start, and two seconds faster."""
    said = io.StringIO()
    given = [str(word) for word in (path, *arguments)]
    with (
        patch.object(sys, "argv", given),
        contextlib.redirect_stdout(said),
        warnings.catch_warnings(),
    ):
        runpy.run_path(given[0], run_name="__main__")
    return said.getvalue()
