"""Compilation of code at its first use: said once in a process, its seconds counted apart."""

import logging
from collections.abc import Callable
from pathlib import Path

_listeners: list[Callable[[str], None]] = [logging.getLogger("impactfem").info]
_counters: list[Callable[[str], None]] = []
_said: set[str] = set()
_spans: list[tuple[float, float]] = []  # begin and length of each compilation [s]


def announce_to(say: Callable[[str], None]) -> None:
    """Tell ``say`` from now on what is compiled; before, the logger "impactfem" is told."""
    _listeners[:] = [say]


def count_to(show: Callable[[str], None] | None) -> None:
    """Tell ``show`` from now on how far a compilation has come; None: nobody."""
    _counters[:] = [show] if show is not None else []


def compiled(begin: float, end: float) -> None:
    """Note that code was compiled between two times of the clock ``perf_counter`` [s]."""
    _spans.append((begin, end - begin))
    for show in _counters:
        show(f"compiling: {len(_spans)} pieces, {sum(span for _, span in _spans):.0f} s")


def compiled_since(start: float) -> float:
    """Seconds that were spent on compilations that began since a time of ``perf_counter`` [s]."""
    return sum(length for begin, length in _spans if begin >= start)


def compiling(what: str, kept: Path | None) -> None:
    """Say that something is being compiled; of one kind only the first in a process.

    Args:
        what: What is compiled, as "time loops".
        kept: Folder of the compiled code; None if it cannot be kept.
    """
    if what in _said:
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
