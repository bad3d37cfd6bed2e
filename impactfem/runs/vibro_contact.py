"""Contact of points, rods and beams in figures: forces of lasting contact, impulses of impacts."""

from typing import Any

import numpy as np

from impactfem.findings import Finding
from impactfem.result.trajectory import Trajectory

_INTERVALS = 1000  # contact intervals that the summary lists
_SAME = 0.02  # share by which largest forces and impulses may depend on the step

_NAMES = {"max_force": ("force of lasting contact", "N"), "max_impulse": ("impulse", "N s")}


def contact_figures(
    motion: Trajectory, reference: Trajectory | None
) -> tuple[dict[str, Any], list[Finding]]:
    """Contact in the summary: intervals, largest force of lasting contact, impulses.

    An event-driven run knows force and impulses. Those of a run by steps are given if a second
    run, with events or with half the step, has them too; else they are None, and a finding says
    why: a figure that depends on the step is none.

    Args:
        motion: The motion.
        reference: A second run with another step; None if there is none.
    """
    exact = "sticking" in motion.effort.details
    figures: dict[str, Any] = {
        "intervals": _intervals(motion),
        "force_window": motion.window,
        "impulse": float(motion.impulse.sum()),
        "unknown": [],
    }
    findings = []
    for name, (what, unit) in _NAMES.items():
        own = _largest(motion)[name]
        other = own if exact or reference is None else _largest(reference)[name]
        sizes = own or 0.0, other or 0.0
        why = ""
        if own is not None and not exact and reference is None:
            why = "no second run has tried another step"
        elif abs(sizes[0] - sizes[1]) > _SAME * max(sizes):
            why = f"it depends on the step ({sizes[0]:.4g} {unit}, in a second run {sizes[1]:.4g})"
        figures[name] = None if why else own
        if why:
            remedy = "take a smaller step with estimate = true, or method event_driven"
            figures["unknown"].append(name)
            text = f"the largest {what} is not known: {why}"
            findings.append(Finding("force_peak", "note", text, name, own, remedy=remedy))
    figures["max_force_raw"] = figures["max_force"]
    return figures, findings


def impact_loss(motion: Trajectory) -> float:
    """Energy that impacts have taken, and what sticking has dropped [J]; walls are at rest.

    An impulse P does the work P (w- + w+) / 2 at the normal speeds w before and after.
    """
    impacts = motion.impacts
    work = 0.0 if impacts is None else impacts.impulse @ (impacts.before + impacts.after)
    return float(motion.effort.details.get("energy_dropped", 0.0)) - 0.5 * float(work)


def _largest(motion: Trajectory) -> dict[str, float | None]:
    impacts = motion.impacts
    impulse = None if impacts is None or not len(impacts) else float(impacts.impulse.max())
    return {"max_force": motion.peak, "max_impulse": impulse}


def _intervals(motion: Trajectory) -> list[list[float]]:
    """Lasting contacts and impacts [start, end] [s], the first of them."""
    details = motion.effort.details
    spells = [[float(s[0]), float(s[1])] for s in details.get("sticking", [])]
    if "sticking" not in details:  # rows of lasting contact, joined
        held = np.append((motion.contact_force > 0.0).any(axis=1), np.False_)  # row 0 is 0
        ends = motion.times[np.flatnonzero(held[1:] != held[:-1])]
        spells = ends.reshape(-1, 2).tolist()
    times = [] if motion.impacts is None else np.unique(motion.impacts.time)[:_INTERVALS].tolist()
    hits = [[t, t] for t in times if not any(a <= t <= b for a, b in spells)]
    return sorted(spells + hits)[:_INTERVALS]
