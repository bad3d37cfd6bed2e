"""Systems of few degrees of freedom in Python, their motion, and many motions at once."""

from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.ensemble import integrate_ensemble
from impactfem.vibro.integrating import integrate

__all__ = [
    "GeneralizedSystem",
    "LinearSystem",
    "Trajectory",
    "integrate",
    "integrate_ensemble",
]
