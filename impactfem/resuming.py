"""Runs of solids that were stopped: their scene, their files, and how to go on with them."""

import tomllib
from pathlib import Path

from impactfem.errors import OutputError, SceneError
from impactfem.processes import on_root
from impactfem.scene import Scene


def scene_to_continue(folder: Path) -> Scene:
    """The scene whose checkpoint lies in a folder.

    Raises:
        SceneError: There is no checkpoint that can be read.
    """
    from impactfem.marching.checkpoint import scene_of  # noqa: PLC0415  (loads DOLFINx)

    try:
        text = scene_of(folder)
    except OutputError as error:  # a wrong argument, not a fault of the disk
        raise SceneError(f"run: --restart {folder}: {error}") from None
    return Scene.from_dict(tomllib.loads(text), base=folder)


def make_place(folder: Path) -> None:
    """Make the folder of checkpoints (collective).

    Raises:
        OutputError: It cannot be made.
    """

    def make() -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"{folder}: cannot be made ({error.strerror}); choose another folder (--out)"
            ) from error

    on_root(make)


def what_is_kept(folder: Path) -> str:
    """What a stopped run leaves in its folder, and how to go on with it."""
    from impactfem.marching.checkpoint import FILE  # noqa: PLC0415  (loads DOLFINx)

    if not (folder / FILE).exists():
        return "nothing was written"
    return f"continue with: impactfem run --restart {folder}"


def clear(folder: Path) -> None:
    """Remove what served to continue a run that is now complete (collective)."""
    from impactfem.marching.checkpoint import FILE  # noqa: PLC0415  (loads DOLFINx)
    from impactfem.solid_runs import SPOOL  # noqa: PLC0415

    def remove() -> None:
        for name in (FILE, SPOOL):
            (folder / name).unlink(missing_ok=True)

    on_root(remove)
