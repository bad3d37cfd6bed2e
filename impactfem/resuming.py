"""The folder of a run: claimed by it, and what serves to go on with a run that was stopped."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from impactfem.errors import OutputError, SceneError
from impactfem.extensions import missing
from impactfem.processes import on_root, rank
from impactfem.result.claim import Claim
from impactfem.result.store import CHECKPOINT, PARTIAL, SPOOL
from impactfem.scene import Scene
from impactfem.scene.toml import parse_toml
from impactfem.signals import InterruptedRunError, kept_apart


def scene_to_continue(folder: Path) -> Scene:
    """The scene whose checkpoint lies in a folder.

    Raises:
        SceneError: There is no checkpoint that can be read, or it needs an extension.
    """
    from impactfem.marching.checkpoint import scene_of  # noqa: PLC0415  (loads DOLFINx)

    try:
        text, extensions = scene_of(folder)
    except OutputError as error:  # a wrong argument, not a fault of the disk
        raise SceneError(f"run: --restart {folder}: {error}") from None
    if why := missing(extensions):
        raise SceneError(f"run: --restart {folder}: {why}")
    return Scene.from_dict(parse_toml(text, str(folder / CHECKPOINT)), base=folder)


@contextmanager
def claimed(*folders: Path | None) -> Iterator[None]:
    """Keep folders for this run: no other one may write there meanwhile (collective to begin).

    Args:
        *folders: Made if absent; those that are still empty at the end go. None stands for none.

    Raises:
        OutputError: Another run has one, or it cannot be written.
    """
    claims: list[Claim] = []

    def take() -> None:
        for folder in {path.resolve(): path for path in folders if path is not None}.values():
            claim = Claim(folder)
            claim.take()
            claims.append(claim)

    try:
        on_root(take)
        yield
    finally:  # each rank for itself: others may have gone
        for claim in claims:
            claim.release()


@contextmanager
def kept(folder: Path, active: bool) -> Iterator[None]:
    """Have a run that stops say what is left in its folder of checkpoints, and leave no rubbish.

    Args:
        folder: Of the checkpoints.
        active: Whether the run writes any.
    """
    if not active:
        yield
        return
    try:
        with kept_apart():
            yield
    except InterruptedRunError as error:
        if (folder / CHECKPOINT).exists():
            error.kept = what_is_kept(folder)
        raise
    except OutputError as error:
        if (folder / CHECKPOINT).exists():
            raise OutputError(f"{error}. Then {what_is_kept(folder)}") from error
        raise
    finally:
        if rank() == 0 and not (folder / CHECKPOINT).exists():
            with suppress(OSError):  # fields without a checkpoint are of no use
                (folder / SPOOL).unlink(missing_ok=True)
                (folder / PARTIAL).unlink(missing_ok=True)


def what_is_kept(folder: Path) -> str:
    """How to go on with a stopped run that has left a checkpoint in its folder."""
    partial = folder / PARTIAL
    seen = f" (its history so far: {partial})" if partial.exists() else ""
    return f"continue with: impactfem run --restart {folder}{seen}"


def clear(folder: Path, name: str) -> None:
    """Remove what served to continue a run that is now complete (collective)."""
    on_root(lambda: (folder / name).unlink(missing_ok=True))
