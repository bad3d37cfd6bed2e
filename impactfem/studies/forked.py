"""Copies of this process that run points of sweeps, and look like `subprocess.Popen`."""

import os
import signal
import traceback
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TextIO


@dataclass
class Forked:
    """A copy, and its lines.

    Attributes:
        pid: Its number.
        stdin: What it reads.
        stdout: What it answers.
    """

    pid: int
    stdin: TextIO
    stdout: TextIO
    _code: int | None = field(default=None, repr=False)

    @classmethod
    def start(
        cls, work: Callable[[TextIO, TextIO], None], noise: int, others: Sequence["Forked"]
    ) -> "Forked":
        """Copy this process; the copy ends with its input, also when we are killed.

        Args:
            work: What it does with its input and its answers.
            noise: Descriptor of a file for what libraries print.
            others: Copies whose lines it must not hold open.
        """
        into, told = os.pipe(), os.pipe()
        with warnings.catch_warnings():
            # Of threads of NumPy's BLAS, which ends them before and starts them anew.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        if pid:
            os.close(into[0])
            os.close(told[1])
            return cls(pid, os.fdopen(into[1], "w"), os.fdopen(told[0]))
        code = 1
        try:  # the copy, which never returns
            os.setsid()
            for each in (signal.SIGINT, signal.SIGTERM):
                signal.signal(each, signal.SIG_DFL)
            os.close(into[1])
            os.close(told[0])
            for other in others:
                os.close(other.stdin.fileno())
                os.close(other.stdout.fileno())
            os.dup2(noise, 2)
            os.dup2(2, 1)
            os.environ["OMP_NUM_THREADS"] = "1"
            work(os.fdopen(into[0]), os.fdopen(told[1], "w"))
            code = 0
        except BaseException:  # noqa: BLE001  (told as those of other processes are)
            os.write(2, traceback.format_exc().encode())
        finally:
            os._exit(code)

    def poll(self) -> int | None:
        """How it has ended; None while it runs."""
        return self._ended(os.WNOHANG)

    def wait(self) -> int | None:
        """How it ends: its exit code, or the signal that ended it, negative."""
        return self._ended(0)

    def kill(self) -> None:
        """End it."""
        if self._code is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    def _ended(self, how: int) -> int | None:
        if self._code is None:
            pid, status = os.waitpid(self.pid, how)
            self._code = os.waitstatus_to_exitcode(status) if pid else None
        return self._code
