"""Compilation of the time loops, announced and cached on disk where that is possible."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import event

from impactfem import first_use


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call.

    The machine code is kept beside the source or in the user's cache folder. Where neither can
    be written (a cluster with a read-only home) it is compiled anew in each process.
    """
    return _compiled(function)


def fused(function: Callable[..., Any]) -> Any:
    """The same, with products and sums in one and in any order: a fifth faster where they abound.

    Numbers that are not finite stay what they are.
    """
    return _compiled(function, fastmath={"contract", "arcp", "nsz", "reassoc"})


def threaded(function: Callable[..., Any]) -> Any:
    """The same, beside which other threads of Python go on while it runs."""
    return _compiled(function, nogil=True)


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    try:
        return numba.njit(cache=True, error_model="numpy", **options)(function)
    except RuntimeError:  # Numba: "no locator available"
        return numba.njit(error_model="numpy", **options)(function)


def cache_folder(function: Callable[..., Any]) -> Path | None:
    """Where the machine code of a function is kept; None if it cannot be."""
    folder = compiled(function).stats.cache_path
    return _told(Path(folder)) if folder else None


class _Announcer(event.Listener):
    """Hears of each compilation, not of code that is found in the cache.

    One begins inside another where a function calls one that is not compiled yet.
    """

    def __init__(self) -> None:
        super().__init__()
        self._begun: list[float] = []

    def on_start(self, event: Any) -> None:
        self._begun.append(time.perf_counter())
        function = event.data["dispatcher"]
        if function.py_func.__module__.startswith("impactfem."):
            folder = function.stats.cache_path
            first_use.compiling("time loops", _told(Path(folder)) if folder else None)

    def on_end(self, event: Any) -> None:  # noqa: ARG002  (its name is Numba's)
        begun = self._begun.pop()
        if not self._begun:
            first_use.compiled(begun, time.perf_counter())


def _told(folder: Path) -> Path:
    """Beside the source the folder itself; elsewhere the one that holds it, named by a hash."""
    return folder if folder.name == "__pycache__" else folder.parent


event.register("numba:compile", _Announcer())
