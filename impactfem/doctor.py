"""What is installed, what works and what is missing."""

import importlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path

import numpy as np

import impactfem
from impactfem.extensions import ADDED, load_installed, records
from impactfem.result.grids import drawing_fault

_LIBRARIES = ("numpy", "scipy", "numba", "xarray", "h5py", "matplotlib", "tqdm")
_EXTRAS = (
    ("pinocchio", "mechanisms need", "robots"),
    ("clarabel", "whole-body controllers need", "robots"),
    ("casadi", 'objective.solver = "ipopt" needs', "optimise"),
)
_WITHOUT = "missing; bars with method exact, bars in a row, points, rods and beams need none"
_PACKAGES = ("mumps", "superlu_dist", "hypre", "ptscotch", "slepc")
_PAGE = Path(__file__).parent / "report" / "page"


def examine() -> tuple[list[tuple[str, str]], list[str]]:
    """Look at the environment.

    Returns:
        Rows (what, finding), and the faults that keep scenes from being solved.
    """
    rows = [
        ("impactfem", impactfem.__version__),
        ("python", f"{platform.python_version()} ({sys.executable})"),
    ]
    faults: list[str] = []
    for name in _LIBRARIES:
        found = _version(name)
        rows.append((name, found))
        if found.startswith(("missing", "broken")):
            faults.append(f"{name} is {found}: pip install --force-reinstall {name}")
    rows += _finite_elements(faults)
    for name, needs, extra in _EXTRAS:
        found = _version(name)
        needed = f"missing; {needs} it: pip install impactfem[{extra}]"
        rows.append((name, needed if found == "missing" else found))
    rows += [("compiler", _compiler(faults)), ("gmsh", _gmsh(faults))]
    rows += [("cache of forms", _forms(faults)), ("cache of loops", _loops())]
    faults += load_installed()
    rows.append(("extensions", _extensions()))
    rows += [("report.html", _report(faults)), ("rendering", _rendering())]
    rows.append(("OMP_NUM_THREADS", os.environ.get("OMP_NUM_THREADS", "not set (1 is used)")))
    return rows, faults


def _version(name: str) -> str:
    """Version of a library, "missing", or why it cannot be loaded."""
    try:
        module = importlib.import_module(name)
        return str(getattr(module, "__version__", None) or importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return "unknown version"
    except ModuleNotFoundError:
        return "missing"
    except Exception as error:  # noqa: BLE001  (compiled modules break in many ways)
        return f"broken ({error})"


def _finite_elements(faults: list[str]) -> list[tuple[str, str]]:
    """DOLFINx, MPI and PETSc."""
    try:
        from impactfem.fem import MPI, PETSc, dolfinx_fem  # noqa: F401, PLC0415
    except impactfem.errors.MissingDependencyError as error:
        faults.append(str(error))
        return [("dolfinx", _WITHOUT)]
    mpi = MPI.Get_library_version().split("\n")[0].replace("\t", " ").strip(" \0")
    petsc = ".".join(str(part) for part in PETSc.Sys.getVersion())
    has = {name: PETSc.Sys.hasExternalPackage(name) for name in _PACKAGES}
    if not has["mumps"]:
        faults.append("PETSc has no MUMPS: install dolfinx-solver-real or Debian's python3-dolfinx")
    import dolfinx  # noqa: PLC0415

    adios = "yes" if hasattr(dolfinx.io, "VTXWriter") else "no (field output vtx is not available)"
    return [
        ("dolfinx", dolfinx.__version__),
        ("ADIOS2", adios),
        ("mpi4py", f"{_version('mpi4py')}, {mpi}"),
        ("mpirun", _mpirun()),
        ("petsc", f"{petsc}, {np.dtype(PETSc.ScalarType).name}"),
        ("petsc packages", ", ".join(f"{k} {'yes' if v else 'no'}" for k, v in has.items())),
    ]


def _mpirun() -> str:
    """The mpirun that starts this MPI; that of another one starts runs side by side."""
    first = shutil.which("mpirun")
    own = shutil.which("mpirun", path=Path(sys.executable).parent)
    if first and own and not Path(first).samefile(own):
        return f"{own} (not {first}, the first on PATH)"
    return own or first or "not on PATH"


def _compiler(faults: list[str]) -> str:
    """The C compiler that builds the forms."""
    found = next(
        (p for n in (os.environ.get("CC"), "cc", "gcc") if n and (p := shutil.which(n))), None
    )
    if found is None:
        faults.append("no C compiler: apt-get install gcc libc6-dev")
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.exists():
        faults.append(f"no {header}, with which forms are compiled: apt-get install python3-dev")
    return found or "missing"


def _forms(faults: list[str]) -> str:
    """Where compiled forms are kept; without such a folder there are no finite elements."""
    try:
        from impactfem.fem import form_cache  # noqa: PLC0415
    except impactfem.errors.MissingDependencyError:
        return "none"
    folder = form_cache()
    fault = _cannot_write(folder)
    if fault:
        faults.append(f"{folder}: {fault}; set XDG_CACHE_HOME to a folder that can be written")
    return f"{folder}{_held(folder, '*.so')}"


def _loops() -> str:
    """Where compiled time loops are kept."""
    try:
        from impactfem.compiled import cache_folder  # noqa: PLC0415
    except ImportError:  # Numba is missing or broken, which is a fault of its own
        return "none"
    folder = cache_folder(_loops)
    if folder is None:
        return "none can be written: compiled in each run (set NUMBA_CACHE_DIR)"
    return "beside the source" if folder.name == "__pycache__" else str(folder)


def _cannot_write(folder: Path) -> str:
    """Why a folder cannot be written; empty if it can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return str(error.strerror)


def _held(folder: Path, pattern: str) -> str:
    size = sum(path.stat().st_size for path in folder.glob(pattern))
    return f", {size / 2**20:.1f} MiB" if size else ", empty"


def _report(faults: list[str]) -> str:
    """Whether the page of a run can be written: its library, and its parts in the package."""
    lost = {".html", ".css", ".js", ".gz"} - {path.suffix for path in _PAGE.glob("*")}
    if lost:
        missing = ", ".join(sorted(lost))
        faults.append(f"impactfem/report/page has no {missing}: reinstall impactfem")
        return "cannot be written"
    return "can be written; no browser is needed for that, any shows it"


def _gmsh(faults: list[str]) -> str:
    found = _version("gmsh")
    if found.startswith(("missing", "broken")):
        faults.append(
            f"gmsh is {found}: pip install impactfem[fem], or apt-get install python3-gmsh"
        )
    return found


def _extensions() -> str:
    """What is registered, by module."""
    each = (f"{one['module']} ({', '.join(one['adds'])})" for one in records(ADDED))
    return "; ".join(each) or "none"


def _rendering() -> str:
    """Whether pyvista can draw without a display; tried in its own process, as VTK may abort."""
    if importlib.util.find_spec("pyvista") is None:
        return "matplotlib only (pyvista is optional: pip install impactfem[view])"
    version, fault = _version("pyvista"), drawing_fault()
    if not fault:
        return f"matplotlib and pyvista {version}, off screen"
    return f"matplotlib; pyvista {version} reads files but {fault}"
