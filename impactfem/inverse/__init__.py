"""Gradients of what runs answer, and numbers of scenes found from measurements."""

from impactfem.inverse.gradients import Gradient, gradient
from impactfem.inverse.identification import Identified, identify

__all__ = ["Gradient", "Identified", "gradient", "identify"]
