"""Gradients of what runs answer; numbers found from measurements, or with which most is reached.

Motions that reach what is asked (`Transcribed`) are in `trajectory`, which knows no runs.
"""

from impactfem.inverse.gradients import Gradient, gradient
from impactfem.inverse.identification import Identified, identify
from impactfem.inverse.optimisation import Optimised, optimise
from impactfem.scene import Control, Measure, Objective, Parameter, Term
from impactfem.scene.trajectory import Cost, TrajectoryKeys
from impactfem.trajectory import Impact, Transcribed
from impactfem.trajectory.scenes import Planned, trajectory

__all__ = [
    "Control",
    "Cost",
    "Gradient",
    "Identified",
    "Impact",
    "Measure",
    "Objective",
    "Optimised",
    "Parameter",
    "Planned",
    "Term",
    "TrajectoryKeys",
    "Transcribed",
    "gradient",
    "identify",
    "optimise",
    "trajectory",
]
