"""What a run answers: histories, fields and a summary, kept in memory or in a folder."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from impactfem.result.bar_motion import BarMotion, Effort
    from impactfem.result.fields import Fields
    from impactfem.result.history import BodyMotion, make_history
    from impactfem.result.record import Record
    from impactfem.result.shapes import Layout, Shape
    from impactfem.result.snapshots import KeptSnapshots, Snapshots
    from impactfem.result.spool import FieldSpool
    from impactfem.result.stored_snapshots import StoredSnapshots

# Loaded when first used: a plan takes `BodyMotion` and needs neither h5py nor xarray.
_HOMES = {
    "BarMotion": "impactfem.result.bar_motion",
    "BodyMotion": "impactfem.result.history",
    "Effort": "impactfem.result.bar_motion",
    "FieldSpool": "impactfem.result.spool",
    "Fields": "impactfem.result.fields",
    "KeptSnapshots": "impactfem.result.snapshots",
    "Layout": "impactfem.result.shapes",
    "Record": "impactfem.result.record",
    "Shape": "impactfem.result.shapes",
    "Snapshots": "impactfem.result.snapshots",
    "StoredSnapshots": "impactfem.result.stored_snapshots",
    "make_history": "impactfem.result.history",
}

__all__ = [
    "BarMotion",
    "BodyMotion",
    "Effort",
    "FieldSpool",
    "Fields",
    "KeptSnapshots",
    "Layout",
    "Record",
    "Shape",
    "Snapshots",
    "StoredSnapshots",
    "make_history",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
