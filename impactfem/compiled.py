"""Compilation of the time loops, cached on disk where that is possible."""

from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call.

    The machine code is kept beside the source or in the user's cache folder. Where neither can
    be written (a cluster with a read-only home) it is compiled anew in each process.
    """
    try:
        return numba.njit(cache=True)(function)
    except RuntimeError:  # Numba: "no locator available"
        return numba.njit(function)
