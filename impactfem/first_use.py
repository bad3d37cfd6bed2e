"""Says once in a process that code is compiled, so that the longer first run is explained."""

from collections.abc import Callable
from pathlib import Path

_listeners: list[Callable[[str], None]] = []
_said: set[str] = set()


def announce_to(say: Callable[[str], None]) -> None:
    """Tell ``say`` from now on what is compiled; before, nobody is told."""
    _listeners[:] = [say]


def compiling(what: str, kept: Path | None) -> None:
    """Say that something is being compiled; of one kind only the first in a process.

    Args:
        what: What is compiled, as "time loops".
        kept: Folder of the compiled code; None if it cannot be kept.
    """
    if what in _said or not _listeners:
        return
    _said.add(what)
    place = f"once, kept in {_short(kept)}" if kept else "no cache folder can be written: each time"
    for say in _listeners:
        say(f"compiling {what} ({place}) ...")


def _short(folder: Path) -> str:
    """The folder with ~ for the user's home."""
    try:
        home = Path.home()
    except RuntimeError:  # a user without a home
        return str(folder)
    return f"~/{folder.relative_to(home)}" if folder.is_relative_to(home) else str(folder)
