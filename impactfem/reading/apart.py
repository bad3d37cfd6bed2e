"""Libraries that crash on broken files, or take all memory: each is run in a process of its own."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence

from impactfem.errors import MissingDependencyError

MISSING = 3
"""Exit code of a process whose library is not installed; it says which."""

TOLD = 4
"""Exit code of a process that says what is wrong and what to do."""

_SECONDS, _SECONDS_PER_MIB = 20, 60
_BYTES, _BYTES_PER_BYTE = 2**32, 50
# Set by MPI launchers; a library that saw them would take itself for a rank.
_LAUNCHER = re.compile(r"(PMI|MPI|OMPI|PRTE|HYDRA|SLURM)")

# `bounded` holds while the file is read: it may ask for more than it holds, and a script need not
# end. What follows, as meshing, may take the machine's memory: that must end this process only.
_START = """
import contextlib
import ctypes
import os
import resource
import signal
import sys
import time

# Whatever ends the parent ends this process; it may have gone already.
ctypes.CDLL(None, use_errno=True).prctl(1, signal.SIGKILL)  # 1: PR_SET_PDEATHSIG
parent, seconds, room = (int(word) for word in sys.argv[1:4])
if os.getppid() != parent:
    sys.exit("the run has ended")

def limit(kind, most):
    _, hard = resource.getrlimit(kind)
    resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
memory = max(2**33, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))

@contextlib.contextmanager
def bounded():
    kinds = resource.RLIMIT_CPU, resource.RLIMIT_FSIZE
    before = [resource.getrlimit(kind) for kind in kinds]
    limit(resource.RLIMIT_AS, min(memory, room))
    limit(resource.RLIMIT_CPU, int(time.process_time() + seconds))
    limit(resource.RLIMIT_FSIZE, 0)  # reading writes nothing
    signal.alarm(10 * seconds)  # what waits takes no processor time
    yield
    signal.alarm(0)
    for kind, known in zip(kinds, before):
        resource.setrlimit(kind, known)
    limit(resource.RLIMIT_AS, memory)
"""


class ApartError(Exception):
    """What went wrong in the process, and what to do."""


def apart(program: str, arguments: Sequence[str], size: int, name: str) -> None:
    """Run a program of ours that reads a file of strangers.

    Args:
        program: Finds its arguments from ``sys.argv[4]`` on, and reads under ``with bounded():``.
        arguments: Of it.
        size: Of the file [bytes]; limits of processor time and memory go with it.
        name: Of the library that reads, for messages.

    Raises:
        ApartError: It said something, crashed, or took too long.
        MissingDependencyError: The library is not installed.
    """
    environment = {key: value for key, value in os.environ.items() if not _LAUNCHER.match(key)}
    limits = int(_SECONDS + _SECONDS_PER_MIB * size / 2**20), _BYTES + _BYTES_PER_BYTE * size
    words = [str(os.getpid()), *map(str, limits), *arguments]
    done = subprocess.run(  # noqa: S603  (our own program)
        [sys.executable, "-P", "-c", _START + program, *words],
        env=environment, stdin=subprocess.DEVNULL, capture_output=True, check=False,
    )  # fmt: skip
    if -done.returncode in {signal.SIGXCPU, signal.SIGALRM}:
        raise ApartError(
            "reading it takes too long (a loop without end?); write fewer commands, or save its "
            "mesh as .msh"
        )
    if done.returncode < 0:
        raise ApartError(
            f"{name} crashed on it (signal {-done.returncode}); the file is broken or too large: "
            "write it again"
        )
    said = done.stderr.decode(errors="replace").strip().splitlines() or ["nothing"]
    if done.returncode == MISSING:
        raise MissingDependencyError(said[-1])
    if done.returncode == TOLD:
        raise ApartError(said[-1])
    if done.returncode > 0:
        said = [
            line.removeprefix("Error:").strip() for line in said if line[:6] == "Error:"
        ] or said
        raise ApartError(f"{name} says: {said[-1][:500]}; correct the file")
