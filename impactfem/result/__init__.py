"""What a run answers: histories, fields and a summary, kept in memory or in a folder."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from impactfem.result.bar_motion import BarMotion, Effort
    from impactfem.result.fields import Fields
    from impactfem.result.history import BodyMotion, make_history
    from impactfem.result.result import Result
    from impactfem.result.solid_fields import FieldSpool, SolidFields

# Loaded when first used: a plan takes `BodyMotion` and needs neither h5py nor xarray.
_HOMES = {
    "BarMotion": "impactfem.result.bar_motion",
    "BodyMotion": "impactfem.result.history",
    "Effort": "impactfem.result.bar_motion",
    "FieldSpool": "impactfem.result.solid_fields",
    "Fields": "impactfem.result.fields",
    "Result": "impactfem.result.result",
    "SolidFields": "impactfem.result.solid_fields",
    "make_history": "impactfem.result.history",
}

__all__ = [
    "BarMotion",
    "BodyMotion",
    "Effort",
    "FieldSpool",
    "Fields",
    "Result",
    "SolidFields",
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
