"""A result folder whose files appear whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from impactfem.errors import OutputError

LAST = "summary.json"
"""Written last: a folder with it is complete."""


@contextmanager
def replaced(folder: Path) -> Iterator[Path]:
    """Like `staged`, for some files of a result that stays complete."""
    with _collected(folder, complete=False) as stage:
        yield stage


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """Collect files in a hidden neighbour of ``folder`` and move them in when all are written.

    If anything fails meanwhile (an error, an interrupt, a full disk) the neighbour is removed and
    ``folder`` stays as it was.

    Args:
        folder: Where the files shall be; made if absent. Older files of the same names are
            replaced, others stay.

    Yields:
        The staging folder to write into.

    Raises:
        OutputError: The folder cannot be written.
    """
    with _collected(folder, complete=True) as stage:
        yield stage


@contextmanager
def _collected(folder: Path, *, complete: bool) -> Iterator[Path]:
    """Stage files and publish them; ``complete`` says that the summary is among them."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        if folder.exists() and not folder.is_dir():
            raise OutputError(f"{folder}: is a file; choose another folder with --out")
        stage = Path(tempfile.mkdtemp(prefix=f".{folder.name}.partial-", dir=folder.parent))
    except OSError as error:
        raise OutputError(
            f"{folder}: cannot be written ({error.strerror}); choose another folder with --out"
        ) from error
    try:
        # mkdtemp is private to its user; results are not.
        stage.chmod(0o777 & ~_umask())
        yield stage
        _publish(stage, folder, complete=complete)
    except OSError as error:
        raise OutputError(
            f"{folder}: the result could not be written ({error.strerror or error}); free some "
            "space or choose another folder with --out"
        ) from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _publish(stage: Path, folder: Path, *, complete: bool) -> None:
    """Move all entries; the summary leaves first and comes last."""
    folder.mkdir(exist_ok=True)
    if complete:
        (folder / LAST).unlink(missing_ok=True)
    entries = sorted(stage.iterdir(), key=lambda entry: (entry.name == LAST, entry.name))
    for entry in entries:
        _flush(entry)
        target = folder / entry.name
        if target.is_dir() and not target.is_symlink():
            shutil.rmtree(target)
        elif entry.is_dir():
            target.unlink(missing_ok=True)
        os.replace(entry, target)  # noqa: PTH105  (atomic for files, unlike shutil.move)


def _flush(entry: Path) -> None:
    """Have the file's content on disk before its name appears."""
    if entry.is_file():
        with entry.open("rb") as file:
            os.fsync(file.fileno())


def _umask() -> int:
    """The process's file creation mask."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
