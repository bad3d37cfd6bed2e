"""Whether to trust a run: what its own figures say, as findings and one word."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from impactfem.findings import Finding, by_limits, level_of, percent, settled, warning
from impactfem.methods import is_exact
from impactfem.planning.model_limits import as_asked
from impactfem.result.table import Table
from impactfem.runs.scales import size_of
from impactfem.scene import Scene

ERROR_LIMITS = (0.05, 0.5)
"""Relative error of the displacement from which a run is looked at with care, and is no answer."""

PENETRATION_LIMITS = (1e-3, 0.1)
"""Share of a body's size from which penetration calls for care, and is no contact."""

GROWTH_LIMITS = (1e-6, 1e-2)
"""Relative growth of energy from which it is pointed out, and from which a run is unstable.

No method that the plan may choose exceeds the first on normals that stay.
"""

LOSS_LIMIT = 0.05
"""Share of the energy that may go where nothing in the scene takes it, before care is called for.

What the schemes lose at an impact falls with the step; it is not wrong as a gain would be.
"""

# Codes that every run looks for itself, so that what its plan foresaw of them is settled.
_RATES = {"vx", "vy", "vz", "w", "wx", "wy", "wz"}  # in formulas of forces, which brake by them
_JUDGED = ("energy_growth", "energy_loss", "penetration", "not_finite", "not_converged")

_STATUS = {
    "not_converged": "not_converged",
    "not_finite": "unstable",
    "energy_growth": "unstable",
    "model_rotation": "out_of_model",
    "model_strain": "out_of_model",
    "model_thin": "out_of_model",
    "model_layers": "out_of_model",
}
"""Status of a run by the code of its worst fault; "completed" for all others."""


def judge(
    scene: Scene, history: Table, summary: Mapping[str, Any],
    foreseen: Sequence[Finding], found: Sequence[Finding], measured: Sequence[str] = (),
) -> dict[str, Any]:  # fmt: skip
    """Status and verdict of a run, for its summary.

    Args:
        scene: What was modelled.
        history: History of the run.
        summary: Its figures: method, active_set, energy, contact, error, details, plan.
        foreseen: Findings of the plan.
        found: What the run has found besides.
        measured: Codes that the run has looked for besides.

    Returns:
        ``status`` and ``verdict``, as they stand in ``summary.json``.
    """
    own = [
        *_ending(history, summary),
        *_energy(scene, summary),
        *_error(scene, summary),
        *_contact(scene, history, summary),
    ]
    codes = [*_JUDGED, *measured]
    if summary["error"] is not None or is_exact(summary["method"]):
        codes += ["error_large", "no_estimate"]
    every = settled(foreseen, [*own, *as_asked(scene, found)], codes)
    faults = [finding.code for finding in every if finding.severity == "fault"]
    status = next((status for code, status in _STATUS.items() if code in faults), "completed")
    return {
        "status": status,
        "verdict": {
            "level": level_of(every),
            "findings": [finding.as_dict() for finding in every],
        },
    }


def _ending(history: Table, summary: Mapping[str, Any]) -> Iterator[Finding]:
    active = summary["active_set"]
    remedy = "take a smaller step, another method or a shorter duration"
    if not active["converged"]:
        why = f": {active['message']}" if active["message"] else ""
        text = f"it did not converge{why}"
        yield Finding("not_converged", "fault", text, remedy=remedy)
    elif not all(
        np.isfinite(column.values).all()
        # What is far from all else has no gap.
        or (name.partition(".")[0] == "gap" and not np.isinf(column.values).any())
        for name, column in history.items()
    ):
        text = "its history holds numbers that are not finite"
        yield Finding("not_finite", "fault", text, remedy=remedy)
    if watched := summary["details"].get("watch"):
        yield warning("outside_contact", str(watched))


def _energy(scene: Scene, summary: Mapping[str, Any]) -> tuple[Finding, ...]:
    energy = summary["energy"]
    growth, change = energy["max_relative_growth"], energy["unexplained"]
    if energy["driven"] or growth is None or change is None:
        return ()
    if not is_damped(scene):
        text = f"{percent(-change)} of the energy is lost, though nothing in the scene takes it"
        remedy = f"take {_finer(scene, 'and')}, or a method that conserves energy"
        if scene.ends:
            remedy = f"take {_finer(scene, 'and')}, or leave surfaces that supports let go of out "
            remedy += "of contact_surfaces: what may touch carries no mass"
        lost = by_limits("energy_loss", -change, (LOSS_LIMIT, np.inf), text, remedy=remedy)
        if lost:
            return lost
    remedy = "take a smaller step or another method"
    text = f"the energy grows by {percent(growth)}, though nothing feeds it"
    if summary["contact"]["impulse"] == 0.0:
        text += f" and nothing touches: its steps ({summary['method']}) keep it to their error only"
    elif summary["plan"].get("normals") == "updated":
        text = f"the energy grows by {percent(growth)}: contact that follows the bodies is right "
        text += "to the first order of step and faces only"
        remedy = f"take {_finer(scene, 'and')}"
    return by_limits("energy_growth", growth, _growth_limits(scene, summary), text, remedy=remedy)


def _growth_limits(scene: Scene, summary: Mapping[str, Any]) -> tuple[float, float]:
    """Of growth; of bars whose wall gives way what is within the error that is told is no news.

    Layers in which contact begins or ends give or take energy there, of the order of that error.
    """
    low, high = GROWTH_LIMITS
    error = summary["error"]
    if error is None or all(bar.wall_stiffness is None for bar in scene.bars):
        return low, high
    return max(low, error["displacement_max"]), high


def is_damped(scene: Scene) -> bool:
    """Whether bodies of a scene take energy themselves."""
    return any(_takes_energy(body) for body in scene.bodies)


def _has_elements(scene: Scene) -> bool:
    """Whether any of its bodies is made of elements."""
    return any(body.in_elements for body in scene.bodies)


def _finer(scene: Scene, word: str) -> str:
    """What can be made smaller in a scene."""
    return f"smaller elements {word} steps" if _has_elements(scene) else "smaller steps"


def _takes_energy(body: Any) -> bool:
    """Whether a body takes energy itself."""
    names = "rayleigh_mass", "rayleigh_stiffness", "retardation", "quality_factor", "damping_ratio"
    rates = (getattr(body, name, None) or 0.0 for name in names)
    springs = (spring.damping for spring in getattr(body, "springs", ()))
    loads = (*(getattr(body, "force", None) or ()), *(getattr(body, "moment", None) or ()))
    braked = any(formula.used & _RATES for formula in loads)
    return braked or any(
        (*rates, *getattr(body, "relaxing", ()), *getattr(body, "rayleigh_damping", ()), *springs)
    )


def _error(scene: Scene, summary: Mapping[str, Any]) -> tuple[Finding, ...]:
    error = summary["error"]
    if error is None:
        if is_exact(summary["method"]):
            return ()
        why = summary["details"].get("error_estimate", {})
        why = why.get("message", "") if isinstance(why, Mapping) else why
        if not why and not summary["plan"].get("estimate"):  # else how it would have been made
            why = summary["plan"]["reasons"].get("estimate", "").removeprefix("no: ")
        text = "its error was neither measured nor estimated" + (f": {why}" if why else "")
        return (warning("no_estimate", text, remedy="compare runs of two mesh sizes or steps"),)
    largest = error["displacement_max"], error["force_l1"]
    if None in largest:
        return (Finding("error_large", "fault", "its error is not finite"),)
    how = "measured error" if error["measured"] else "estimated error"
    how += " of the mesh" * (_has_elements(scene) and not error["measured"])
    text = f"{how}: displacement {percent(largest[0])}, force {percent(largest[1])}"
    remedy = f"take {_finer(scene, 'or')}, or another method"
    remedy += f": {offer}" if (offer := summary["plan"]["reasons"].get("offer method")) else ""
    small, large = ERROR_LIMITS
    if largest[0] > large:
        text = f"{text}: the course of the motion is not predicted"
        return by_limits("error_large", largest[0], ERROR_LIMITS, text, remedy=remedy)
    # A force that is wrong does not make the motion worthless: it calls for care at most.
    return by_limits("error_large", max(largest), (small, np.inf), text, remedy=remedy)


def _contact(scene: Scene, history: Table, summary: Mapping[str, Any]) -> tuple[Finding, ...]:
    deep, size = summary["contact"]["max_penetration"], size_of(scene, history)
    if not deep or not size:
        return ()
    share = deep / size
    text = f"bodies penetrate by up to {deep:.3g} m, {percent(share)} of a body"
    remedy = f"take {_finer(scene, 'or')}, or another method"
    return by_limits("penetration", share, PENETRATION_LIMITS, text, remedy=remedy)
