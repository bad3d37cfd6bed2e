"""How high a ball rebounds: a study built on impactfem."""

from rebound.ball import Case, Rebound, drop, scene_of
from rebound.pendulum import rebound_angle, swing
from rebound.study import Table, run_study

__all__ = [
    "Case",
    "Rebound",
    "Table",
    "drop",
    "rebound_angle",
    "run_study",
    "scene_of",
    "swing",
]
