"""Systems of few degrees of freedom in Python, their motion, and many motions at once."""

from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.ensemble import EnsembleResult, integrate_ensemble
from impactfem.vibro.integrating import integrate
from impactfem.vibro.position_level import PositionSettings
from impactfem.vibro.velocity_level import VelocitySettings

__all__ = [
    "EnsembleResult",
    "GeneralizedSystem",
    "LinearSystem",
    "PositionSettings",
    "Trajectory",
    "VelocitySettings",
    "integrate",
    "integrate_ensemble",
]
