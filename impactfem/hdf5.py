"""h5py, loaded so that it works beside the HDF5 library that DOLFINx brings.

Wheels of both hold a library of their own, of different versions. DOLFINx loads its one for all of
the process to see, and an h5py that is loaded later would take half of its functions from there
("Not a datatype"). So it is bound to its own library first, in any order of imports.
"""

import ctypes
import os
import sys
from pathlib import Path
from typing import Any


def _another_is_loaded() -> bool:
    """Whether this process has an HDF5 library already."""
    try:
        return "libhdf5" in Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return True


_usual = sys.getdlopenflags()
try:
    if "h5py" not in sys.modules and _another_is_loaded():
        sys.setdlopenflags(os.RTLD_NOW | os.RTLD_DEEPBIND)
    import h5py
finally:
    sys.setdlopenflags(_usual)

__all__ = ["h5py", "of_a_dead_writer"]


def of_a_dead_writer(path: Path) -> Any:
    """Open a file in the mode of many readers whose one writer may have been killed.

    Such a reader takes a checksum that is wrong for a writer's work that is half done, and looks
    again a hundred times, with pauses, at each of them: for minutes or hours in a file that is
    damaged. Nobody writes here any more: once must do.

    Raises:
        OSError: It cannot be opened.
    """
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_libver_bounds(h5py.h5f.LIBVER_V110, h5py.h5f.LIBVER_V110)
    # h5py has no name for it; asked of its module, so that it is of the library it is linked to.
    once = ctypes.CDLL(h5py.h5p.__file__).H5Pset_metadata_read_attempts
    once(ctypes.c_int64(access.id), ctypes.c_uint(1))
    mode = h5py.h5f.ACC_RDONLY | h5py.h5f.ACC_SWMR_READ
    return h5py.File(h5py.h5f.open(os.fsencode(path), mode, fapl=access))
