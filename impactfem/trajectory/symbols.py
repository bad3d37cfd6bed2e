"""CasADi's door: its import, and functions of users tried with its symbols."""

import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

from impactfem.errors import MissingDependencyError, SceneError


def loaded() -> Any:
    """CasADi.

    Raises:
        MissingDependencyError: It is not installed.
    """
    try:
        return import_module("casadi")  # an extra, 277 MB
    except ImportError as error:
        raise MissingDependencyError(
            f"trajectories need CasADi ({error}): pip install impactfem[optimise]"
        ) from None


def tried(what: str, function: Callable[..., Any], symbols: Sequence[Any]) -> Any:
    """What a user's function makes of symbols, as one column.

    Args:
        what: Its name, for messages.
        function: Of time, states, controls and, if there are any, parameters.
        symbols: These.

    Raises:
        SceneError: It does not work with symbols.
    """
    casadi = loaded()
    try:
        with warnings.catch_warnings():
            # Symbols stay symbols under NumPy's functions, which is all that is asked of them.
            warnings.simplefilter("ignore", FutureWarning)
            found = function(*symbols)
    except SceneError:
        raise
    except Exception as error:
        raise SceneError(
            f"{what}: cannot be made of CasADi's symbols ({_first(error)}); write it with "
            "functions of NumPy or casadi (numpy.sin, not math.sin; casadi.if_else, not if)"
        ) from error
    parts = found if isinstance(found, list | tuple) else getattr(found, "flat", None)
    if parts is None or isinstance(found, casadi.MX | casadi.DM):
        parts = [found]
    column = casadi.vertcat(*(casadi.MX(part) for part in parts))
    return casadi.vec(column)


def _first(error: Exception) -> str:
    """What an error says last: CasADi begins with a place in its own code."""
    lines = [line for line in str(error).splitlines() if line.strip()]
    return lines[-1].strip() if lines else type(error).__name__
