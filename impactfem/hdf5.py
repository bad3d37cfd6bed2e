"""h5py, loaded so that it works beside the HDF5 library that DOLFINx brings.

Wheels of both hold a library of their own, of different versions. DOLFINx loads its one for all of
the process to see, and an h5py that is loaded later would take half of its functions from there
("Not a datatype"). So it is bound to its own library first, in any order of imports.
"""

import os
import sys
from pathlib import Path


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

__all__ = ["h5py"]
