"""A result folder whose files appear whole or not at all."""

import errno
import fcntl
import json
import math
import os
import resource
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from impactfem.errors import OutputError
from impactfem.reading.live import is_copy
from impactfem.signals import InterruptedRunError, held_back

LAST = "summary.json"
"""Written last: a folder with it is complete."""

CHECKPOINT = "checkpoint.npz"
"""State of an unfinished run in its folder."""

PARTIAL = "history.partial.csv"
"""History of an unfinished run beside its checkpoint, for people."""

SPOOL = ".fields.partial.vtkhdf"
"""Fields of an unfinished run beside its checkpoint."""

# What a result may hold. A new one removes what an older one left and it has not itself.
_OWN = (
    "scene.toml", "history.csv", "history.nc", "exact.nc",
    "fields.vtkhdf", "fields.bp", "fields.pvd", "fields_pvd",
    "contact_force.png", "energy.png", "displacement.png", "position.png", "active_set.png",
    "centre_of_mass.png", "body.png", "motion.gif", "forces.png", "velocities.png",
    "world_lines.png", "path.png", "motion.png", "phase.png", "gaps.png", "impacts.png",
    "gap.png", "impulses.png", "strain.png", "velocity.png", "velocity_map.png",
    "impacts.csv", "report.html",
    LAST,
)  # fmt: skip

# Parts of the names of hidden folders: files being collected, a whole result being moved in.
_PARTIAL, _WHOLE = "partial", "whole"
_PROBE = ".impactfem-"  # an empty folder, to see whether one can be made
_STALE = ".stale"  # names of the files of the older result that go


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
            raise OutputError(cannot(folder, error.strerror)) from error
        if not is_folder:
            raise OutputError(f"{folder}: {place} is a file; choose another folder (--out)")
        try:  # permissions do not bind root, and some file systems take no folders
            probe = Path(tempfile.mkdtemp(prefix=_PROBE, dir=place))
            with suppress(FileNotFoundError):  # another run has cleaned it up
                probe.rmdir()
        except OSError as error:
            raise OutputError(cannot(folder, f"{place}: {error.strerror}")) from error
        return


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """Collect the files of a result in a hidden folder and move them in when all are written.

    If anything fails meanwhile (an error, an interrupt, a full disk) the hidden folder is removed
    and ``folder`` stays as it was.

    A summary among the files is given the key ``files``: the names of all of them.

    Args:
        folder: Where the files shall be; made if absent. The files of an older result are
            replaced or removed, others stay (`impactfem.result.occupied` refuses them before).

    A run that is killed meanwhile leaves the older result and the hidden folder, which the next
    one removes; one that is killed while it moves the files in has them moved in by `finish`.

    Yields:
        The staging folder to write into.

    Raises:
        OutputError: The folder cannot be written.
    """
    with _collected(folder, complete=True) as stage:
        yield stage


@contextmanager
def replaced(folder: Path) -> Iterator[Path]:
    """Like `staged`, for some files of a result whose other files stay; its summary lists all."""
    with _collected(folder, complete=False) as stage:
        yield stage


@contextmanager
def _collected(folder: Path, *, complete: bool) -> Iterator[Path]:
    """Stage files and publish them; ``complete`` says that they are a whole result."""
    check_writable(folder)
    made = [path for path in folder.absolute().parents if not path.exists()]
    stage: _Stage | None = None
    try:
        clean(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        # A folder that exists may be a mount or a link to another disk: files are moved within it.
        stage = _Stage(folder, folder if folder.is_dir() else folder.parent)
        stage.path.chmod(0o777 & ~_umask())  # mkdtemp is private to its user; results are not
        yield stage.path
        _list_files(stage.path, None if complete else folder)
        _publish(stage.path, folder, complete=complete)
        made = []
    except OutputError as error:
        inside = f"{stage.path}/" if stage else "/"
        if inside not in str(error):
            raise
        raise OutputError(cannot(folder, str(error).replace(inside, ""))) from error
    except (OSError, RuntimeError) as error:  # HDF5 and ADIOS2 raise RuntimeError on a full disk
        raise OutputError(cannot(folder, getattr(error, "strerror", None) or error)) from error
    finally:
        if stage is not None:
            stage.remove()
        for path in made:
            with suppress(OSError):
                path.rmdir()


class _Stage:
    """A hidden folder, locked as long as its process lives: others tell so that it is in use."""

    def __init__(self, folder: Path, place: Path) -> None:
        while True:
            self.path = Path(tempfile.mkdtemp(prefix=_prefix(folder, _PARTIAL), dir=place))
            lock = _lock(self.path)
            if lock is not None and self.path.is_dir():  # nobody has cleaned it up meanwhile
                self._lock = lock
                return

    def remove(self) -> None:
        """Remove what is left of it."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1


def _prefix(folder: Path, what: str) -> str:
    """How the names of hidden folders of a result begin."""
    return f".{folder.name[:40]}.{what}-"  # names end at 255 bytes


def _lock(folder: Path) -> int | None:
    """Lock a folder; None if a living process has it, -1 if its file system knows no locks."""
    file = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(file)
        return None
    except OSError:
        os.close(file)
        return -1
    return file


def clean(folder: Path) -> None:
    """Finish what a killed run was publishing, remove what another was collecting.

    Raises:
        OSError: The folder cannot be written.
    """
    finish(folder)
    for place in (folder, folder.parent):
        for path in _hidden(folder, place, _PARTIAL):
            with _dead(path) as dead:
                if dead:
                    shutil.rmtree(path, ignore_errors=True)
        for path in place.glob(f"{_PROBE}*"):
            with suppress(OSError):
                path.rmdir()


def finish(folder: Path) -> bool:
    """Move in the rest of a whole result whose run was killed meanwhile; whether there was one.

    Raises:
        OSError: The folder cannot be written.
    """
    found = False
    for path in _hidden(folder, folder, _WHOLE):
        with _dead(path) as dead:
            if dead:
                _move_in(path, folder)
                found = True
    return found


def _hidden(folder: Path, place: Path, what: str) -> list[Path]:
    """Hidden folders of a result; none where that cannot be seen."""
    prefix = _prefix(folder, what)
    try:
        found = [path for path in place.iterdir() if path.name.startswith(prefix)]
    except OSError:
        return []
    return sorted(path for path in found if path.is_dir() and not path.is_symlink())


@contextmanager
def _dead(path: Path) -> Iterator[bool]:
    """Lock a hidden folder whose process is gone; whether it is."""
    try:
        file = _lock(path)
    except OSError:  # it went meanwhile
        file = None
    yield file is not None and file >= 0
    if file is not None and file >= 0:
        os.close(file)


def reserve(folder: Path, size: int, there: int = 0) -> None:
    """Make sure that there is room before a library writes that crashes on a full disk.

    HDF5, ADIOS2 and DOLFINx do: they write again when their objects are destroyed.

    Args:
        folder: Where to write.
        size: Bytes that will be written.
        there: Bytes that the file has already; a limit of the file size counts them too.

    Raises:
        OSError: There is no room, or a limit of the file size or a quota forbids it.
    """
    with tempfile.TemporaryFile(dir=folder) as file:
        try:
            if there + size > _most_of_a_file():
                raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
            os.posix_fallocate(file.fileno(), 0, size)
        except OSError as error:
            if error.errno not in {errno.ENOSPC, errno.EFBIG, errno.EDQUOT}:
                raise
            needs = f"{error.strerror}; {in_mib(size)} are needed"
            raise OSError(error.errno, needs) from error


def _most_of_a_file() -> float:
    """Bytes that the limits of this process allow a file to have."""
    soft, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    return math.inf if soft == resource.RLIM_INFINITY else soft


def in_mib(size: int) -> str:
    """A number of bytes for people."""
    return f"{size / 2**20:.3g} MiB"


def cannot(folder: Path, why: object) -> str:
    """Message about a folder that cannot be written."""
    return f"{folder}: cannot be written ({why}); free some space or choose another folder (--out)"


def summary_in(folder: Path) -> dict[str, Any] | None:
    """The summary in a folder; None if there is none that impactfem may have written."""
    try:
        if not (folder / LAST).is_file():  # a pipe would be read for ever
            return None
        text = (folder / LAST).read_text(encoding="utf-8")
        found = json.loads(text, parse_constant=lambda _: None)  # numbers that are none
    except (OSError, ValueError, RecursionError):
        return None
    ours = isinstance(found, dict) and {"title", "status", "method"} <= found.keys()
    return found if ours else None


def write_summary(summary: Mapping[str, Any], folder: Path) -> None:
    """Write a summary into a stage.

    Raises:
        OSError: There is no room.
    """
    text = json.dumps(summary, indent=2, allow_nan=False)
    (folder / LAST).write_text(text + "\n", encoding="utf-8")


def listed(summary: Mapping[str, Any]) -> set[str]:
    """Names of the files of a result; version 0.1 listed none."""
    names = summary.get("files", _OWN)
    return {name for name in names if isinstance(name, str)} if isinstance(names, list) else {*_OWN}


def names_of_results(folder: Path) -> set[str]:
    """Names of the files that results of ours have in a folder, a killed run's half among them."""
    found: set[str] = set()
    for place in (folder, *_hidden(folder, folder, _WHOLE)):
        with suppress(OSError, UnicodeDecodeError):
            found.update((place / _STALE).read_text(encoding="utf-8").splitlines())
        if (summary := summary_in(place)) is not None:
            found |= listed(summary)
    return found


def _list_files(stage: Path, older: Path | None) -> None:
    """Have the summary in a stage list its files, with those of an older result that stay."""
    summary, names = summary_in(stage), {path.name for path in stage.iterdir()}
    if older is not None and (before := summary_in(older)):
        summary = summary or before
        names |= listed(before) & {path.name for path in older.iterdir()}
    if summary is not None:
        write_summary(summary | {"files": sorted(names | {LAST})}, stage)


def _publish(stage: Path, folder: Path, *, complete: bool) -> None:
    """Move the staged files in: all at once into a new folder, the summary last into an old one."""
    for path in stage.rglob("*"):
        _flush(path)
    done = False
    try:
        with held_back():
            _put_in_place(stage, folder, complete=complete)
            done = True
    except InterruptedRunError as error:
        if done:
            error.kept = f"the result is in {folder}; draw it with: impactfem plot {folder}"
        raise


def _put_in_place(stage: Path, folder: Path, *, complete: bool) -> None:
    if not folder.is_dir():
        stage.rename(folder)
        return
    there = {path.name for path in stage.iterdir()}
    copies = filter(is_copy, listed(summary_in(folder) or {}))
    stale = [name for name in (*_OWN, *copies) if name not in there] if complete else []
    (stage / _STALE).write_text("\n".join([LAST, *stale] if complete else []), encoding="utf-8")
    _flush(stage / _STALE)
    # From here on the result is whole, and `finish` goes on if this process is killed.
    own = stage.name.removeprefix(_prefix(folder, _PARTIAL))
    whole = stage.with_name(_prefix(folder, _WHOLE) + own)
    stage.rename(whole)
    _move_in(whole, folder)


def _move_in(stage: Path, folder: Path) -> None:
    """Move a whole result in; killed at any moment, it may be called again."""
    try:
        names = (stage / _STALE).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:  # killed while it removed the empty folder
        names = []
    entries = {path.name: path for path in stage.iterdir() if path.name != _STALE}
    if LAST in entries or LAST not in names:  # else all are in, and the summary is the new one
        for name in names:
            if name in {LAST, *_OWN} or is_copy(name):  # whatever a stranger may have written there
                _remove(folder / name)
    for name in sorted(entries, key=lambda name: (name == LAST, name)):
        _remove(folder / name, keep_file=entries[name].is_file())
        entries[name].replace(folder / name)
    shutil.rmtree(stage, ignore_errors=True)


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
