"""Scripts and commands of the demos, each in a process of its own."""

import os
import subprocess
import sys


def run(*command):
    """What a command prints; it must end well."""
    # Not as a rank: the MPI of this process may have left its marks in the environment.
    marks = ("PMI_", "PMIX_", "OMPI_COMM_")
    clean = {name: value for name, value in os.environ.items() if not name.startswith(marks)}
    return subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=300, env=clean
    ).stdout


def draw(script, folder, picture):
    """Run a script that draws into a folder; its picture is there and named."""
    said = run(sys.executable, str(script), str(folder))
    assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    assert picture in said
