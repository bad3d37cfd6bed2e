"""DOLFINx, PETSc and MPI, loaded in the order they need, or a clear word about what is missing."""

import functools
import mmap
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from impactfem import first_use
from impactfem.errors import MissingDependencyError

# h5py's own HDF5 library must load before that of DOLFINx, which it would take for its own.
import impactfem.hdf5  # isort: skip  # noqa: F401

try:
    # mpi4py must load and initialise MPI before DOLFINx is loaded.
    from mpi4py import MPI  # isort: skip
    import basix.ufl
    import dolfinx
    import dolfinx.jit
    import ffcx.codegeneration.jit
    import ffcx.compiler
    import ufl
    from dolfinx import fem as dolfinx_fem
    from dolfinx import mesh as dolfinx_mesh
    from dolfinx.fem import petsc as petsc_assembly
    from petsc4py import PETSc as _PETSc
except ImportError as error:
    raise MissingDependencyError(
        f"DOLFINx, PETSc or mpi4py cannot be imported ({error}). Remedy: "
        "`pip install impactfem[fem]`, or on Debian 13 `apt-get install python3-dolfinx`; "
        "`impactfem doctor` says what is missing."
    ) from error

try:  # DOLFINx >= 0.10
    from dolfinx.io import gmsh as dolfinx_gmsh
except ImportError:  # DOLFINx 0.9
    from dolfinx.io import gmshio as dolfinx_gmsh

# The type stubs of petsc4py, where there are any, refuse NumPy arrays and mpi4py communicators.
PETSc: Any = _PETSc

_missed: list[float] = []  # when FFCx began on a form that its cache does not hold [s]
_ROOM = 320 * 2**20  # bytes; BLAS takes 128 MiB when it is first called


def _check_room() -> None:
    """Refuse a limit of the address space (``ulimit -v``) under which BLAS crashes.

    Raises:
        MissingDependencyError: There is no room.
    """
    private, unreserved = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, 0x4000
    try:
        mmap.mmap(-1, _ROOM, flags=private | unreserved).close()
    except OSError as error:
        raise MissingDependencyError(
            f"DOLFINx cannot work: {error.strerror}, less than {_ROOM >> 20} MiB of address space "
            'are left; allow more (ulimit -v), or choose method = "exact" where a bar has it'
        ) from error


_check_room()


def form_cache() -> Path:
    """Folder in which FFCx keeps compiled forms."""
    return Path(dolfinx.jit.get_options()["cache_dir"])


def _announced(compile_objects: Callable[..., Any]) -> Callable[..., Any]:
    """FFCx's compiler, which is not called for forms that its cache holds, with an announcement."""

    @functools.wraps(compile_objects)
    def announcing(*arguments: Any, **settings: Any) -> Any:
        first_use.compiling("finite-element forms", form_cache())
        _missed.append(time.perf_counter())
        return compile_objects(*arguments, **settings)

    return announcing


def _timed(compile_forms: Callable[..., Any]) -> Callable[..., Any]:
    """FFCx's way from forms to machine code; what its cache holds is not counted."""

    @functools.wraps(compile_forms)
    def timed(*arguments: Any, **settings: Any) -> Any:
        try:
            return compile_forms(*arguments, **settings)
        finally:
            if _missed:
                first_use.compiled(_missed.pop(), time.perf_counter())

    return timed


# FFCx tells nobody when it compiles: its log can only be had together with all of its details.
ffcx.compiler.compile_ufl_objects = _announced(ffcx.compiler.compile_ufl_objects)
for _name in ("compile_forms", "compile_expressions"):
    setattr(ffcx.codegeneration.jit, _name, _timed(getattr(ffcx.codegeneration.jit, _name)))

# Another process may be compiling the same form on a busy machine: ten seconds are too few.
_patience, _meaning = dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"]
dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (max(120, _patience), _meaning)

ADD = dolfinx.la.InsertMode.add
"""Adds in `scatter_reverse` what ghosts hold to their owners."""

__all__ = [
    "ADD",
    "MPI",
    "PETSc",
    "basix",
    "dolfinx",
    "dolfinx_fem",
    "dolfinx_gmsh",
    "dolfinx_mesh",
    "petsc_assembly",
    "ufl",
]
