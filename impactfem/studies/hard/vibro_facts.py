"""Hard cases of few degrees of freedom: how they are run, and how accurate a method must be."""

import math
import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import ImpactWarning
from impactfem.result import Result
from impactfem.result.trajectory import Trajectory
from impactfem.scene import Scene
from impactfem.shipped import find_scene
from impactfem.solving import solve
from impactfem.studies.hard.board import Claim
from impactfem.system.generalized import GeneralizedSystem
from impactfem.vibro.integrating import integrate

Floats = NDArray[np.float64]

STEPPED = ("paoli_schatzman", "moreau_jean")
LOCATED = ("event_driven", *STEPPED)
VIBRO = (*LOCATED, "penalty")

PULL = Claim("pull", 1e-12, "lambda >= 0: an obstacle does not pull")
WARNED = Claim("unwarned", 0.0, "the run says that coupled constraints meet")

_EXACT = 1e-9


@dataclass(frozen=True)
class Sizes:
    """Numbers of a run.

    Attributes:
        dt: Step h of the schemes with time steps [s].
        stiffness: k of the penalty method [1/s^2].
        row: Time between rows of the methods that have no steps of their own [s].
    """

    dt: float = 1e-4
    stiffness: float = 1e8
    row: float = 1e-2

    def time(self, method: str) -> float:
        """What a method cannot tell from an instant, tau [s]: the length of its impacts.

        h of moreau_jean, 2 h of paoli_schatzman, pi / sqrt(k) of penalty, none of event_driven.
        """
        if method == "event_driven":
            return 0.0
        if method == "penalty":
            return math.pi / math.sqrt(self.stiffness)
        return 2.0 * self.dt if method == "paoli_schatzman" else self.dt

    def claim(self, figure: str, method: str, slope: float, why: str) -> Claim:
        """That a figure is at most slope * tau, and 1e-9 of the event-driven method.

        Args:
            figure: Name among the facts.
            method: Name of the method.
            slope: How much a delay by tau can change the figure [1/s].
            why: Why, in words.
        """
        if method == "event_driven":
            return Claim(figure, _EXACT, why)
        return Claim(figure, float(f"{slope * self.time(method):.3g}"), why)


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
    own: dict[str, dict[str, Any]] = {
        "event_driven": {"rows": math.ceil(duration / sizes.row)},
        "penalty": {"dt": sizes.row, "stiffness": sizes.stiffness},
    }
    chosen = own.get(method, {"dt": sizes.dt}) | settings
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ImpactWarning)
        return integrate(system, start, speed, duration, method=method, **chosen)


def solved(method: str, name: str, sizes: Sizes, **settings: Any) -> Result:
    """A shipped scene by a method; ``restitution`` replaces that of all its contacts."""
    scene = Scene.from_toml(find_scene(name))
    e = settings.pop("restitution", None)
    if e is not None:
        scene = replace(scene, contacts=tuple(replace(c, restitution=e) for c in scene.contacts))
    located = method in {"event_driven", "penalty"}
    settings["dt"] = sizes.row if located else sizes.dt
    if method == "penalty":
        settings["penalty_stiffness"] = sizes.stiffness
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


def basic_claims(sizes: Sizes, method: str, speed: float, growth: float) -> list[Claim]:
    """What holds of `facts_of` in every motion.

    Energy cannot grow by `moreau_jean`: an impulse P does the work P (w^+ + w^-)/2 <= 0.

    Args:
        sizes: Numbers of the run.
        method: Name of the method.
        speed: Largest normal speed over the size of the case [1/s].
        growth: Energy per time that a delayed impact may add over the energy, a v / E [1/s]; 0
            where nothing accelerates.
    """
    deep = sizes.claim("penetration", method, speed, "v tau, the way before an impact acts")
    if method == "penalty":  # its damped springs pull, which its restitution needs
        return [deep, Claim("growth", 1e-6, "springs give back no more than they took")]
    if method == "paoli_schatzman" and growth > 0.0:
        grown = sizes.claim("growth", method, growth, "a v tau / E, the work of a delay")
    else:
        grown = Claim("growth", _EXACT, "no impulse does positive work")
    return [deep, PULL, grown]


def away_from_impacts(motion: Trajectory) -> NDArray[np.bool_]:
    """Rows whose velocity is not a mean over an impact: two rows about each are left out."""
    free = np.ones(len(motion.times), dtype=bool)
    acts = np.flatnonzero((motion.impulse > 0.0).any(axis=1))
    for shift in (-2, -1, 0, 1, 2):
        free[np.clip(acts + shift, 0, len(free) - 1)] = False
    return free
