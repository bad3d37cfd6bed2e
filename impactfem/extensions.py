"""Extensions: modules of users that register bodies, obstacles, methods, laws (`register`).

A scene never names code. An extension is imported by a script, named on the command line
(``--extension``), or installed with an entry point of the group `GROUP`, whose value is its module.
"""

import hashlib
import sys
import warnings
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from impactfem.errors import ImpactWarning, SceneError

GROUP = "impactfem.extensions"
"""Group of entry points."""

ADDED: dict[str, str] = {}
"""Module of all that is registered, by what it is and its name: "body frame"."""


def load(text: str) -> None:
    """Import an extension.

    Args:
        text: A Python file, or the name of a module.

    Raises:
        SceneError: There is none, it fails, or it registers nothing.
    """
    before = len(ADDED)
    path = Path(text)
    is_file = path.suffix == ".py" or path.exists()
    name = path.stem if is_file else text
    try:
        new = _import_file(path) if is_file else _import(text)
    except Exception as error:
        # A user's module fails in any way.
        raise SceneError(f"--extension {text}: {_why(error)}") from error
    if new and len(ADDED) == before and name not in ADDED.values():
        raise SceneError(
            f"--extension {text}: registers nothing; end it with impactfem.register(...) of what "
            "it adds"
        )


def _import(name: str) -> bool:
    new = name not in sys.modules
    import_module(name)
    return new


def _import_file(path: Path) -> bool:
    """Import a file as the module of its name; False if that was done before."""
    name, path = path.stem, path.resolve()
    there = sys.modules.get(name)
    if there is not None:
        if Path(getattr(there, "__file__", None) or "").resolve() == path:
            return False
        raise ImportError(f"a module {name} is loaded already; give the file another name")
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError("no Python file (.py)")
    module = module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return True


def _why(error: Exception) -> str:
    """What went wrong in a module of a user, and in which of its lines."""
    trace, line = error.__traceback__, 0
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        if not name.startswith("<frozen") and name != __file__:
            line = line or trace.tb_lineno
        trace = trace.tb_next
    where = f", line {line}" if line else ""
    return f"cannot be loaded ({type(error).__name__}: {error}{where}); mend it"


@cache
def load_installed() -> tuple[str, ...]:
    """Import the installed extensions, once; what fails is warned of.

    Returns:
        What failed, in words.
    """
    faults = []
    for entry in sorted(entry_points(group=GROUP)):
        try:
            import_module(entry.module)
        except Exception as error:  # noqa: BLE001  (what is installed must not keep scenes from running)
            faults.append(f"the installed extension {entry.name} ({entry.module}): {_why(error)}")
    for fault in faults:
        warnings.warn(fault, ImpactWarning, stacklevel=2)
    return tuple(faults)


def records(said: Iterable[str]) -> list[dict[str, Any]]:
    """The extensions that a scene needs, for ``summary.json``.

    Args:
        said: What the scene names, as "body frame".

    Returns:
        Of each ``module``, ``adds`` (what of it is needed) and ``sha256`` of its file, if it has
        one.
    """
    found, modules = [], needed(said)
    for name in dict.fromkeys(modules.values()):
        file = getattr(sys.modules.get(name), "__file__", None)
        adds = [what for what, module in modules.items() if module == name]
        record: dict[str, Any] = {"module": name, "adds": adds}
        if file is not None and Path(file).is_file():
            record["sha256"] = hashlib.sha256(Path(file).read_bytes()).hexdigest()
        found.append(record)
    return found


def needed(said: Iterable[str]) -> dict[str, str]:
    """Modules of extensions by what of them a scene says, as "body frame"."""
    return {what: ADDED[what] for what in said if what in ADDED}


def missing(modules: Mapping[str, str]) -> str:
    """What of `needed` is not registered, and the remedy; empty if nothing is missing."""
    lost = {what: module for what, module in modules.items() if what not in ADDED}
    if not lost:
        return ""
    named = " and ".join(f"{what} of the extension {module}" for what, module in lost.items())
    options = " ".join(f"--extension {module}" for module in dict.fromkeys(lost.values()))
    return f"it needs {named}, which is not loaded: give its file or module, as {options}"
