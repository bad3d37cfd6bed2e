"""A result folder whose files appear whole or not at all."""

import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from impactfem.errors import OutputError
from impactfem.signals import held_back

LAST = "summary.json"
"""Written last: a folder with it is complete."""

# What a result may hold. A new one removes what an older one left and it has not itself.
_OWN = (
    "scene.toml", "history.csv", "history.nc", "exact.nc", "axis.nc",
    "fields.vtkhdf", "fields.bp", "fields.pvd", "fields_pvd",
    "contact_force.png", "energy.png", "displacement.png", "position.png", "active_set.png",
    "centre_of_mass.png", "body.png", "motion.gif", "forces.png", "velocities.png",
    "world_lines.png", "path.png", "motion.png", "phase.png", "gaps.png", "impacts.png",
    "impacts.csv", "report.html",
    LAST,
)  # fmt: skip


def check_writable(folder: Path) -> None:
    """Say before a long run that its result could not be written; nothing stays behind.

    Raises:
        OutputError: The folder is a file, or neither it nor the folder it will be made in can be
            written.
    """
    for place in (folder, *folder.absolute().parents):
        try:
            is_folder = stat.S_ISDIR(place.stat().st_mode)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:  # a name that is too long, or behind a closed folder
            raise OutputError(_cannot(folder, error.strerror)) from error
        if not is_folder:
            raise OutputError(f"{folder}: {place} is a file; choose another folder (--out)")
        try:  # permissions do not bind root, and some file systems take no folders
            Path(tempfile.mkdtemp(prefix=".impactfem-", dir=place)).rmdir()
        except OSError as error:
            raise OutputError(_cannot(folder, f"{place}: {error.strerror}")) from error
        return


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """Collect the files of a result in a hidden folder and move them in when all are written.

    If anything fails meanwhile (an error, an interrupt, a full disk) the hidden folder is removed
    and ``folder`` stays as it was.

    Args:
        folder: Where the files shall be; made if absent. The files of an older result are
            replaced or removed, others stay.

    Yields:
        The staging folder to write into.

    Raises:
        OutputError: The folder cannot be written.
    """
    with _collected(folder, complete=True) as stage:
        yield stage


@contextmanager
def replaced(folder: Path) -> Iterator[Path]:
    """Like `staged`, for some files of a result whose other files stay."""
    with _collected(folder, complete=False) as stage:
        yield stage


@contextmanager
def _collected(folder: Path, *, complete: bool) -> Iterator[Path]:
    """Stage files and publish them; ``complete`` says that they are a whole result."""
    check_writable(folder)
    made = [path for path in folder.absolute().parents if not path.exists()]
    stage: Path | None = None
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        # A folder that exists may be a mount or a link to another disk: files are moved within it.
        place = folder if folder.is_dir() else folder.parent
        stage = Path(tempfile.mkdtemp(prefix=f".{folder.name}.partial-", dir=place))
        stage.chmod(0o777 & ~_umask())  # mkdtemp is private to its user; results are not
        yield stage
        _publish(stage, folder, complete=complete)
        made = []
    except (OSError, RuntimeError) as error:  # HDF5 and ADIOS2 raise RuntimeError on a full disk
        raise OutputError(_cannot(folder, getattr(error, "strerror", None) or error)) from error
    finally:
        if stage is not None:
            shutil.rmtree(stage, ignore_errors=True)
        for path in made:
            with suppress(OSError):
                path.rmdir()


def reserve(folder: Path, size: int) -> None:
    """Make sure that there is room before a library writes that crashes on a full disk.

    HDF5, ADIOS2 and DOLFINx do: they write again when their objects are destroyed.

    Args:
        folder: Where to write.
        size: Bytes that will be written.

    Raises:
        OSError: There is no room, or a limit of the file size or a quota forbids it.
    """
    with tempfile.TemporaryFile(dir=folder) as file:
        os.posix_fallocate(file.fileno(), 0, size)


def _cannot(folder: Path, why: object) -> str:
    return f"{folder}: cannot be written ({why}); free some space or choose another folder (--out)"


def _publish(stage: Path, folder: Path, *, complete: bool) -> None:
    """Move the staged files in: all at once into a new folder, the summary last into an old one."""
    for path in stage.rglob("*"):
        _flush(path)
    with held_back():
        if not folder.is_dir():
            stage.rename(folder)
            return
        entries = {path.name: path for path in stage.iterdir()}
        if complete:
            (folder / LAST).unlink(missing_ok=True)
            for name in _OWN:
                if name not in entries:
                    _remove(folder / name)
        for name in sorted(entries, key=lambda name: (name == LAST, name)):
            _remove(folder / name, keep_file=entries[name].is_file())
            entries[name].replace(folder / name)


def _remove(path: Path, *, keep_file: bool = False) -> None:
    """Remove a file or folder if it is there; a file to be replaced by a file may stay."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    elif not keep_file:
        path.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    """Have a file's content on disk before its name appears."""
    if path.is_file():
        with path.open("rb") as file:
            os.fsync(file.fileno())


def _umask() -> int:
    """The process's file creation mask."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
