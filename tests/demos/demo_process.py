"""Scripts and commands of the demos, each in a process of its own."""

import subprocess
import sys

from processes import environment


def run(*command):
    """What a command prints; it must end well."""
    return subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=300, env=environment()
    ).stdout


def draw(script, folder, picture):
    """Run a script that draws into a folder; its picture is there and named."""
    said = run(sys.executable, str(script), str(folder))
    assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    assert picture in said
