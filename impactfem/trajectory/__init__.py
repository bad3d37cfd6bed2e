"""Motions that reach what is asked at least cost, and how far they are from what follows."""

from impactfem.trajectory.impacts import Impact
from impactfem.trajectory.transcribing import Transcribed, transcribe

__all__ = ["Impact", "Transcribed", "transcribe"]
