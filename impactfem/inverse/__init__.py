"""Gradients of what runs answer; numbers found from measurements, or with which most is reached."""

from impactfem.inverse.gradients import Gradient, gradient
from impactfem.inverse.identification import Identified, identify
from impactfem.inverse.optimisation import Optimised, optimise
from impactfem.scene import Control, Measure, Objective, Parameter, Term

__all__ = [
    "Control",
    "Gradient",
    "Identified",
    "Measure",
    "Objective",
    "Optimised",
    "Parameter",
    "Term",
    "gradient",
    "identify",
    "optimise",
]
