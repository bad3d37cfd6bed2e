"""Hard cases of few degrees of freedom: how they are run, and what is measured of any motion."""

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import ImpactWarning
from impactfem.facade import Result
from impactfem.methods import METHODS
from impactfem.result.trajectory import Trajectory
from impactfem.scene import Scene
from impactfem.shipped import find_scene
from impactfem.solving import solve
from impactfem.studies.hard.rows import Sizes
from impactfem.system.generalized import GeneralizedSystem
from impactfem.vibro.integrating import integrate


def run(
    method: str,
    system: GeneralizedSystem,
    start: ArrayLike,
    speed: ArrayLike,
    duration: float,
    sizes: Sizes,
    **settings: Any,
) -> Trajectory:
    """A motion; whether it warned is in the details of its effort, under "together"."""
    rows = {"rows": math.ceil(duration / sizes.row)}
    chosen = (rows if METHODS[method].locates else {"dt": sizes.dt}) | settings
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ImpactWarning)
        return integrate(system, start, speed, duration, method=method, **chosen)


def solved(method: str, name: str, sizes: Sizes, **settings: Any) -> Result:
    """A shipped scene by a method; ``restitution`` replaces that of all its contacts."""
    scene = Scene.from_toml(find_scene(name))
    e = settings.pop("restitution", None)
    if e is not None:
        scene = replace(scene, contacts=tuple(replace(c, restitution=e) for c in scene.contacts))
    settings["dt"] = sizes.row if METHODS[method].locates else sizes.dt
    return solve(scene, method=method, estimate=False, **settings)


def unwarned(motion: Trajectory) -> float:
    """1 if a motion does not say that constraints meet, else 0."""
    return float("together" not in motion.effort.details)


def facts_of(motion: Trajectory, energy: float, size: float = 1.0) -> dict[str, float]:
    """Penetration over a size, pulling force over the largest, growth over an energy."""
    force = motion.impulse
    return {
        "penetration": max(0.0, -float(motion.gap.min())) / size,
        "pull": max(0.0, -float(force.min())) / max(float(force.max()), 1e-300),
        "growth": max(0.0, float((motion.total - motion.total[0]).max())) / energy,
    }


def away_from_impacts(motion: Trajectory) -> NDArray[np.bool_]:
    """Rows whose velocity is not a mean over an impact: two rows about each are left out."""
    free = np.ones(len(motion.times), dtype=bool)
    acts = np.flatnonzero((motion.impulse > 0.0).any(axis=1))
    for shift in (-2, -1, 0, 1, 2):
        free[np.clip(acts + shift, 0, len(free) - 1)] = False
    return free
