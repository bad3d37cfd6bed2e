"""Whether to trust a run, and why: what its own figures say, in plain words."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from impactfem.report.page.numbers import percent, quantity
from impactfem.report.page.scales import size_of
from impactfem.report.table import FOLLOWED
from impactfem.result import Result

type Level = Literal["good", "care", "bad"]

HEADLINES: dict[Level, str] = {
    "good": "Trust this run",
    "care": "Trust this run with care",
    "bad": "Do not trust this run",
}

SMALL_ERROR = 0.05
"""Relative error of the displacement from which a run is looked at with care."""

LARGE_ERROR = 0.5
"""Relative error of the displacement from which it is no answer."""

SMALL_PENETRATION = 1e-3
"""Share of the body's size from which penetration is pointed out."""


@dataclass(frozen=True)
class Verdict:
    """What the figures of a run say about it.

    Attributes:
        level: "good", "care" or "bad".
        reasons: Why, the worst first; plain text.
    """

    level: Level
    reasons: tuple[str, ...]

    @property
    def headline(self) -> str:
        """The verdict in a few words."""
        return HEADLINES[self.level]


def verdict(result: Result) -> Verdict:
    """Judge a run by its summary and history."""
    found = [*_ending(result), *_energy(result), *_error(result), *_contact(result)]
    found += [("care", text) for text in _warnings(result)]
    order = ("bad", "care", "good")
    found.sort(key=lambda entry: order.index(entry[0]))
    return Verdict(found[0][0], tuple(text for _, text in found))


def _ending(result: Result) -> list[tuple[Level, str]]:
    summary = result.summary
    message = summary["active_set"]["message"]
    finite = all(np.isfinite(column.values).all() for column in result.history.values())
    if not finite:
        return [("bad", "Its history holds numbers that are not finite.")]
    if summary["status"] == "not_converged":
        why = f": {message}" if message else ""
        return [("bad", f"It did not converge{why}. What was computed is kept.")]
    if summary["status"] != "completed":
        return [("bad", f"It ended with the status “{summary['status']}”.")]
    return [("good", "It completed, and the contact conditions were solved in every step.")]


def _energy(result: Result) -> list[tuple[Level, str]]:
    energy = result.summary["energy"]
    growth = energy["max_relative_growth"]
    if energy.get("driven"):
        return [("good", "Loads or moving obstacles do work, so the energy is no check here.")]
    if not energy["grows"]:
        lost = energy["final_relative_drift"]
        text = "Energy never grows"
        if lost is not None and lost < -1e-6:
            text += f"; {percent(-lost)} of it is gone at the end"
        return [("good", f"{text}.")]
    text = f"Energy grows by {percent(growth)}"
    if result.summary["plan"].get("normals") == "updated" and growth and growth < FOLLOWED:
        return [("care", f"{text}, since normals follow the bodies: less on finer meshes.")]
    return [("bad", f"{text}, though nothing feeds it.")]


def _error(result: Result) -> list[tuple[Level, str]]:
    error = result.summary["error"]
    if error is None:
        if result.summary["method"] == "exact":
            return [("good", "It is the exact solution, to rounding.")]
        return [("care", "Its error was not measured: see the section on errors.")]
    displacement, force = error["displacement_max"], error["force_l1"]
    if displacement is None or force is None:
        return [("bad", "Its error is not finite.")]
    how = "Measured" if "exact" in error["reference"] else "Estimated"
    text = f"{how} error: displacement {percent(displacement)}, force {percent(force)}"
    if displacement >= LARGE_ERROR:
        return [("bad", f"{text}: the course of the motion is not predicted.")]
    if max(displacement, force) >= SMALL_ERROR:
        return [("care", f"{text}.")]
    return [("good", f"{text}.")]


def _contact(result: Result) -> list[tuple[Level, str]]:
    deep = result.summary["contact"]["max_penetration"]
    if deep is None:
        return [("bad", "The penetration is not finite.")]
    size = size_of(result)
    if size and deep > SMALL_PENETRATION * size:
        share = percent(deep / size)
        return [("care", f"Bodies penetrate by up to {quantity(deep, 'm', 3)}, {share} of a body.")]
    return []


def _warnings(result: Result) -> list[str]:
    told = [*result.summary["plan"].get("warnings", []), *result.summary.get("warnings", [])]
    if watched := result.summary["details"].get("watch"):
        told.append(watched)
    return [f"{text[:1].upper()}{text[1:]}." for text in told]
