"""Hard cases of many contacts of bars: what is taken by default, and what is told of it."""

from typing import Any

import numpy as np

from impactfem.result import Result
from impactfem.scene import Scene
from impactfem.solving import solve
from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.scenes import BOUNCES, ROUNDING, bar_scene


def _bounces(duration: float) -> Scene:
    """Doyen's bounces: a contact of 2/3 s every 8/3 s."""
    return bar_scene(duration, gravity=10.0, **BOUNCES)


def _with(method: str, scene: Scene, **settings: Any) -> Result:
    return solve(scene, method=method, elements=40, **settings)


def _level(result: Result) -> str:
    level: str = result.summary["verdict"]["level"]
    return level


def _by_default(method: str) -> Facts:
    """38 contacts, with nothing asked for."""
    result = solve(_bounces(100.0))
    return {
        "displacement": result.summary["error"]["displacement_max"],
        "drift": result.summary["energy"]["max_relative_drift"],
        "not chosen": float(result.summary["method"] != method),
        "not trusted": float(_level(result) != "trust"),
    }


def _rounding(method: str) -> Facts:
    """38 contacts by a scheme whose rounding grows in each, and 11, after which it is small."""
    long, short = (_with(method, _bounces(duration)) for duration in (100.0, 30.0))
    return {
        "displacement": long.summary["error"]["displacement_max"],
        "believed": float(_level(long) != "do_not_trust"),
        "false alarm": float(_level(short) != "trust"),
    }


def _impulse(method: str) -> Facts:
    """Irregular bounces: the forces of layers add up to the impulse of the exact history."""
    result = _with(method, bar_scene(15.0, gravity=1.0, gap=0.5, velocity=-2.0))
    history, contact = result.history, result.summary["contact"]
    force, time = history["contact_force"].values, history["time"].values
    momentum = history["momentum"].values
    gained = float(momentum[-1] - momentum[0]) + 15.0  # the weight is 1
    return {
        "impulse": abs(float(force[1:] @ np.diff(time)) / contact["impulse"] - 1.0),
        "momentum": abs(gained / contact["impulse"] - 1.0),
    }


CASES: tuple[Case, ...] = (
    Case("38 bounces, T = 100, by default", _by_default,
         lambda _: [ROUNDING, Claim("drift", 1e-9, "a rigid wall does no work"),
                    Claim("not chosen", 0.0, "the plan takes it"),
                    Claim("not trusted", 0.0, "nothing speaks against it")], ("exact",)),
    Case("38 bounces, T = 100, rounding grows", _rounding,
         lambda _: [Claim("believed", 0.0, "the verdict says: do not trust"),
                    Claim("false alarm", 0.0, "it trusts 11 bounces")], ("galerkin",)),
    Case("irregular bounces, impulse of the force", _impulse,
         lambda _: [Claim("impulse", 1e-12, "forces are means over layers"),
                    Claim("momentum", 1e-10, "momentum changes by impulses")], ("exact",)),
)  # fmt: skip
"""Hard cases of many contacts of bars."""
