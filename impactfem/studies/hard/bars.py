"""Hard cases of bars: how they are run, what is measured, and what is told of many contacts."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from impactfem.errors import ConvergenceError
from impactfem.facade import Result
from impactfem.methods import DISPERSIVE, METHODS
from impactfem.reference.bar import exact_bar
from impactfem.result import Fields
from impactfem.result.summary import Summary
from impactfem.scene import Scene
from impactfem.solving import solve
from impactfem.studies.hard.board import Facts
from impactfem.studies.hard.rows import Row

SIZES = {"dg": 16, "exact": 4, "monolithic": 20}  # elements; 40 of the others


def bound(method: str, elements: int, contacts: int, courant: float = 1.0) -> float:
    """Largest relative displacement error to expect of a method."""
    constant, rate = METHODS[method].error
    if METHODS[method].stable == "limited" and courant < 1.0 - 1e-9:
        constant, rate = DISPERSIVE
    return float(constant * max(1, contacts) / elements**rate * max(1.0, courant))


def solved(method: str, scene: Scene) -> Result:
    """The result at the size of the board, with at most some hundred levels kept.

    Raises:
        ConvergenceError: The active set did not settle.
    """
    given = scene.solve
    settings: dict[str, Any] = {"solve.method": method}
    elements = given.elements or SIZES.get(method, 40)
    if given.mesh is not None:
        elements = 16
    else:
        settings["solve.elements"] = SIZES["exact"] if METHODS[method].exact else elements
    if not METHODS[method].layered and given.fitted is None:
        settings["solve.fitted"] = False  # the plan may fit the mesh; that has cases of its own
    if METHODS[method].exact:
        elements = SIZES["exact"]  # which only samples it
    layers = scene.duration / scene.bar.transit_time * elements / (given.courant or 1.0)
    settings["output.every"] = max(1, int(layers) // 400)
    result = solve(scene.with_settings(settings))
    if result.summary["status"] == "not_converged":
        raise ConvergenceError(f"active set: {result.summary['active_set']['message']}")
    return result


def facts_of(result: Result) -> dict[str, float]:
    """Figures of a run, dimensionless."""
    summary, history = result.summary, result.history
    errors, gap = summary["error"], history["gap"].values
    moved = result.fields.displacement if isinstance(result.fields, Fields) else gap
    force = history["contact_force"].values
    peak = max(float(np.abs(force).max()), 1e-300)
    # The total may be next to zero: potentials have no natural origin.
    kinetic, total = history["kinetic_energy"].values, history["total_energy"].values
    start = float(kinetic[0] + history["elastic_energy"].values[0])
    drift = (total - total[0]) / max(abs(float(total[0])), start, 1e-300)
    facts = {
        "growth": max(0.0, float(drift.max())),
        "drift": float(np.abs(drift).max()),
        "loss": 0.0 - float(drift[-1]),
        "penetration": max(0.0, -float(gap.min())) / max(float(np.abs(moved).max()), 1e-300),
        "pull": max(0.0, -float(np.min(force))) / peak,
    }
    if errors:
        facts["displacement"] = _number(errors["displacement_max"])
        facts["force"] = _number(errors["force_l1"])
    return facts


def _number(value: float | None) -> float:
    """What is not finite is None in a summary."""
    return float("inf") if value is None else float(value)


def plain(method: str, row: Row) -> Facts:
    """The worst of the scenes; with the error as a share of the method's bound if it is asked."""

    def facts(scene: Scene) -> Facts:
        found, given = facts_of(solved(method, scene)), scene.solve
        if "of bound" in row.figures and not METHODS[method].exact and "displacement" in found:
            elements = given.elements or SIZES.get(method, 40)
            contacts = len(exact_bar(scene).contacts)
            limit = bound(method, elements, contacts, given.courant or 1.0)
            found["of bound"] = found["displacement"] / limit
        return found

    return row.worst(facts)


def by_default(method: str, row: Row) -> Facts:
    """Many contacts, with nothing asked for."""
    summary = solve(row.scene()).summary
    return {
        "displacement": _farthest(summary),
        "drift": summary["energy"]["max_relative_drift"],
        "not chosen": float(summary["method"] != method),
        "not trusted": float(_level(summary) != "trust"),
    }


def rounding(method: str, row: Row) -> Facts:
    """38 contacts by a scheme whose rounding grows in each, and 11, after which it is small."""
    long, short = (
        solve(row.scene({"duration": duration}), method=method).summary
        for duration in (100.0, 30.0)
    )
    return {
        "displacement": _farthest(long),
        "believed": float(_level(long) != "do_not_trust"),
        "false alarm": float(_level(short) != "trust"),
    }


def _farthest(summary: Summary) -> float:
    error = summary["error"]
    return np.nan if error is None else error["displacement_max"]


def _level(summary: Mapping[str, Any]) -> str:
    level: str = summary["verdict"]["level"]
    return level


def impulse(method: str, row: Row) -> Facts:
    """Irregular bounces: the forces of layers add up to the impulse of the exact history."""
    scene = row.scene()
    result = solve(scene, method=method)
    history, exact = result.history, result.summary["contact"]["impulse"] or np.nan
    force, time = history["contact_force"].values, history["time"].values
    momentum = history["momentum"].values
    gained = float(momentum[-1] - momentum[0]) + scene.duration  # the weight is 1
    return {
        "impulse": abs(float(force[1:] @ np.diff(time)) / exact - 1.0),
        "momentum": abs(gained / exact - 1.0),
    }
