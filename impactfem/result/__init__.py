"""What a run answers: histories, fields and a summary, kept in memory or in a folder."""

from impactfem.result.bar_motion import BarMotion, Effort
from impactfem.result.fields import Fields
from impactfem.result.history import BodyMotion, make_history
from impactfem.result.result import Result
from impactfem.result.solid_fields import FieldSpool, SolidFields
from impactfem.result.solid_motion import SolidMotion, solid_history

__all__ = [
    "BarMotion",
    "BodyMotion",
    "Effort",
    "FieldSpool",
    "Fields",
    "Result",
    "SolidFields",
    "SolidMotion",
    "make_history",
    "solid_history",
]
