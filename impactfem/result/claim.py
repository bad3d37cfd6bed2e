"""A result folder that one run at a time may write into."""

import errno
import fcntl
import os
import stat
from contextlib import suppress
from pathlib import Path

from impactfem.errors import OutputError
from impactfem.result.store import cannot, check_writable, clean

LOCK = ".impactfem.lock"
"""Hidden file in a folder while a run writes into it: process and machine of the run."""

# What a file system says that knows no such locks: some network file systems.
_UNKNOWN = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL}


class Claim:
    """Keeps a folder for this run, from `take` to `release`.

    The lock is the kernel's and ends with the process, however that ends: what a killed run leaves
    hinders none. On network file systems it may hold for the runs of one machine only. To be used
    on one rank.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._file = folder, -1
        self._made: list[Path] = []

    def take(self) -> None:
        """Make the folder and lock it; clean up after runs that were killed in it.

        Raises:
            OutputError: Another run has it, or it cannot be written.
        """
        check_writable(self._folder)
        above = [self._folder.absolute(), *self._folder.absolute().parents]
        self._made = [path for path in above if not path.exists()]
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._file = self._locked(self._folder / LOCK)
            clean(self._folder)
        except OSError as error:
            self.release()
            raise OutputError(cannot(self._folder, error.strerror)) from error
        except OutputError:
            self._remove_made()
            raise

    def release(self) -> None:
        """Give the folder back; it goes if this claim made it and nothing is in it."""
        if self._file >= 0:
            with suppress(OSError):
                (self._folder / LOCK).unlink(missing_ok=True)
            os.close(self._file)
            self._file = -1
        self._remove_made()

    def _remove_made(self) -> None:
        for path in self._made:
            with suppress(OSError):
                path.rmdir()
        self._made = []

    def _locked(self, path: Path) -> int:
        """Open and lock the file."""
        while True:
            # No link: a stranger's folder must not have us write elsewhere.
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
            try:
                if not stat.S_ISREG(os.fstat(file).st_mode):
                    raise OSError(errno.EEXIST, f"{LOCK} is no file; remove it")
                self._lock(file)
                # The run before may have removed the file between our opening and locking it.
                if path.exists() and path.stat().st_ino == os.fstat(file).st_ino:
                    os.ftruncate(file, 0)
                    os.pwrite(file, f"process {os.getpid()} on {os.uname().nodename}".encode(), 0)
                    return file
            except BaseException:
                os.close(file)
                raise
            os.close(file)

    def _lock(self, file: int) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            who = os.pread(file, 200, 0).decode(errors="replace") or "unknown"
            raise OutputError(
                f"{self._folder}: another run writes into this folder ({who}); wait for its end, "
                "or choose another folder (--out)"
            ) from error
        except OSError as error:
            if error.errno not in _UNKNOWN:
                raise
