"""Where a result comes from: date, command, versions of what was used, machine."""

import os
import platform
import sys
from collections.abc import Iterable, Sequence
from datetime import datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from impactfem.extensions import records

_FROM_PYTHON = "python: impactfem.solve(...)"

# Name shown, module that says whether it was used, distributions that know the version.
_LIBRARIES = (
    ("DOLFINx", "dolfinx", ("fenics-dolfinx", "dolfinx-solver-real", "dolfinx")),
    ("PETSc", "petsc4py.PETSc", ()),
    ("mpi4py", "mpi4py.MPI", ("mpi4py",)),
    ("Gmsh", "gmsh", ("gmsh",)),
    ("Numba", "numba", ("numba",)),
    ("NumPy", "numpy", ("numpy",)),
    ("SciPy", "scipy", ("scipy",)),
    ("xarray", "xarray", ("xarray",)),
)


def run_record(command: str | None = None, said: Iterable[str] = ()) -> dict[str, Any]:
    """What ``summary["run"]`` holds; nothing is imported for it.

    Args:
        command: The command line of the run; that it came from Python if None.
        said: What the scene names of what extensions add (`Content.said`).

    Returns:
        Plain data: ``date`` (ISO 8601 with the offset of the clock), ``command``, ``versions`` by
        name (of impactfem, Python and the libraries that the run has loaded), ``machine``
        (``system``, ``processor``, ``cores``) and, if there are any, ``extensions``
        (`impactfem.extensions.records`).
    """
    return {
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "command": command or _FROM_PYTHON,
        "versions": versions(),
        "machine": machine(),
    } | ({"extensions": found} if (found := records(said)) else {})


def shell_command(words: Sequence[str]) -> str:
    """A command as a shell on any system of the user's takes it; words are quoted where needed."""
    import shlex  # noqa: PLC0415  (only when a run ends)

    return shlex.join(words)


def versions() -> dict[str, str]:
    """Versions of impactfem, Python and those libraries that are loaded, by name."""
    found = {
        "impactfem": _of_distribution("impactfem") or "unknown",
        "Python": platform.python_version(),
    }
    for name, module, distributions in _LIBRARIES:
        loaded = sys.modules.get(module)
        if loaded is None:
            continue
        text = _of_module(module, loaded)
        for distribution in distributions:
            text = text or _of_distribution(distribution)
        found[name] = text or "unknown"
    return found


def machine() -> dict[str, Any]:
    """System, processor and number of cores; no name of the machine or of its user."""
    return {
        "system": f"{platform.system()} {platform.release()} {platform.machine()}".strip(),
        "processor": _processor(),
        "cores": os.cpu_count() or 1,
    }


def _of_module(name: str, module: Any) -> str:
    if name == "petsc4py.PETSc":  # the library's version, not that of its Python door
        return ".".join(str(number) for number in module.Sys.getVersion())
    return str(getattr(module, "__version__", ""))


@cache  # a study solves many times: what does not change is looked up once
def _of_distribution(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


@cache
def _processor() -> str:
    """Name of the processor as Linux tells it, as the platform does elsewhere."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    for line in lines:
        key, _, value = line.partition(":")
        if key.strip() in {"model name", "Model"} and value.strip():
            return " ".join(value.split())
    return platform.processor() or "unknown"
