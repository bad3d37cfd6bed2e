"""Systems of few degrees of freedom in Python, their motion, and many motions at once."""

from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.ensemble import EnsembleResult, integrate_ensemble
from impactfem.vibro.hybrid import HybridSystem, Passage, Phase
from impactfem.vibro.integrating import integrate
from impactfem.vibro.orbits import Orbit, periodic_orbit
from impactfem.vibro.position_level import PositionSettings
from impactfem.vibro.velocity_level import VelocitySettings

__all__ = [
    "EnsembleResult",
    "GeneralizedSystem",
    "HybridSystem",
    "LinearSystem",
    "Orbit",
    "Passage",
    "Phase",
    "PositionSettings",
    "Trajectory",
    "VelocitySettings",
    "integrate",
    "integrate_ensemble",
    "periodic_orbit",
]
