"""What a run answers: histories, fields and a summary, kept in memory or in a folder."""

from impactfem.result.fields import Fields
from impactfem.result.history import BodyMotion, make_history
from impactfem.result.result import Result

__all__ = ["BodyMotion", "Fields", "Result", "make_history"]
