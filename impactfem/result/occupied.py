"""Folders that a result may not take, for they hold the files of somebody else."""

import zipfile
from pathlib import Path

from impactfem.errors import FolderError
from impactfem.reading.live import is_copy
from impactfem.result.store import CHECKPOINT, PARTIAL, names_of_results

_MOST = 3  # names that a message lists


def check_free(folder: Path, scene: Path | None = None) -> None:
    """Refuse a folder that holds more than results of impactfem, or the scene of the run.

    Files that a summary of ours lists are of a result, and a checkpoint of ours of a stopped run.
    Hidden files are never replaced, so they may stay. Nothing is written.

    Args:
        folder: Where the result shall be; it may be absent.
        scene: File of the scene that is solved.

    Raises:
        FolderError: It holds anything else; the message names it.
    """
    if scene is not None and scene.resolve().parent == folder.resolve():
        raise FolderError(
            f"{folder}: holds the scene of this run, {scene.name}, which the result would replace; "
            "choose another folder (--out)"
        )
    try:
        names = {path.name for path in folder.iterdir() if not path.name.startswith(".")}
    except OSError:  # absent, a file, or closed: said where it is written
        return
    ours = names_of_results(folder)
    if _is_checkpoint(folder / CHECKPOINT):
        ours |= {CHECKPOINT, PARTIAL, *filter(is_copy, names)}
    if strange := sorted(names - ours):
        more = [f"{len(strange) - _MOST} more"] if len(strange) > _MOST else []
        shown = ", ".join(strange[:_MOST] + more)
        raise FolderError(
            f"{folder}: holds what no result of impactfem has brought there ({shown}); choose "
            "another folder (--out), or move that elsewhere"
        )


def _is_checkpoint(path: Path) -> bool:
    """Whether a file is a checkpoint of ours and no other archive of NumPy."""
    if not path.is_file():  # a pipe would be read for ever
        return False
    try:
        with zipfile.ZipFile(path) as file:
            return "scene.npy" in file.namelist()
    except (OSError, zipfile.BadZipFile):
        return False
