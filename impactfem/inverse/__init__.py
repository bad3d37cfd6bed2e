"""Gradients of what runs answer, and numbers of scenes found from measurements."""

from impactfem.inverse.gradient import Gradient, gradient
from impactfem.inverse.identify import Identified, identify

__all__ = ["Gradient", "Identified", "gradient", "identify"]
