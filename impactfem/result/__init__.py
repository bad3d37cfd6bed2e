"""What a run answers: histories, fields and a summary, kept in memory or in a folder."""

from impactfem.result.bar_motion import BarMotion, Effort
from impactfem.result.fields import Fields
from impactfem.result.history import BodyMotion, make_history
from impactfem.result.result import Result

__all__ = ["BarMotion", "BodyMotion", "Effort", "Fields", "Result", "make_history"]
