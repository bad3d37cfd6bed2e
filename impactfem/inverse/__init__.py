"""Gradients of what runs answer; numbers found from measurements, or with which most is reached."""

from impactfem.inverse.gradients import Gradient, gradient
from impactfem.inverse.identification import Identified, identify
from impactfem.inverse.optimisation import Optimised, optimise

__all__ = ["Gradient", "Identified", "Optimised", "gradient", "identify", "optimise"]
