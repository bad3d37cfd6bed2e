"""The figures of a run, as written to ``summary.json``."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.planning import Plan
from impactfem.runs.forces import largest_force, peak_findings, spells_of, strongest_spells
from impactfem.runs.run import Run
from impactfem.runs.scales import rounding_energy
from impactfem.runs.verdict import GROWTH_LIMITS, is_damped, judge
from impactfem.scene import Scene

# Share of the largest energy or gap that is but rounding of it.
_ROUNDING = 1e-15

DAMPED = "damping and the method"
"""What takes energy where bodies are damped, besides what is known."""

_SHUT = 1e-9  # share of the largest gap that counts as none
_HELD = 0.015  # the same of a layer's way: the law of finite strain holds gaps closed up to 0.01


def summarise(scene: Scene, chosen: Plan[Any], run: Run) -> dict[str, Any]:
    """Figures and verdict of a run, as in ``summary.json``; None for what is not finite.

    Args:
        scene: What was modelled.
        chosen: The plan.
        run: What its runner gave.
    """
    history, effort, cost, driven = run.history, run.effort, run.cost, not run.conservative
    t, force = history["time"].values, history["contact_force"].values
    energy = history["total_energy"].values
    # Kinetic and elastic energy too: the potential may make the sum nearly vanish. And the work on
    # a body that starts at rest.
    moving = history["kinetic_energy"].values + history["elastic_energy"].values
    worked = history["potential_energy"].values - history["potential_energy"].values[0]
    given = max(abs(energy[0]), moving[0], np.abs(worked).max()) or moving.max()
    layers = int(effort.details.get("layers", len(t) - 1))
    rounding = rounding_energy(scene, history, layers, effort.bodies)
    given = max(given, rounding) or 1.0
    scale = max(given, moving.max())
    growth = (energy - energy[0]) / scale
    # Of what was given: of the largest energy no growth would be more than all of it. What friction
    # has taken by then is missing already.
    rubbed = history["friction_work"].values if "friction_work" in history else 0.0
    grown = max(0.0, float((energy - energy[0] - rubbed).max()) - rounding) / given
    gap = history["gap"].values
    pushing, struck = force, {}
    if "contact_impulse" in history:  # impacts are no force, but contact
        impulse = history["contact_impulse"].values
        pushing = force + np.append(0.0, impulse[1:] / np.diff(t))
        struck = {"max_impulse": float(impulse.max())} if impulse.any() else {}
    intervals = contact_intervals(t, pushing, gap)
    taken = dict(effort.details.get("energy_taken", {}))
    if work := effort.details.get("friction_work"):
        taken["friction"] = -float(work)
    taken = {name: work for name, work in taken.items() if not abs(work) <= rounding}
    unexplained = float(energy[-1] - energy[0] + sum(taken.values()))
    if unexplained < -rounding and is_damped(scene):
        taken[DAMPED], unexplained = -unexplained, 0.0
    summary = {
        "title": scene.title,
        "status": "",  # filled in by the verdict
        "method": chosen.method,
        "num_dofs": effort.num_unknowns,
        "num_steps": len(t) - 1,
        "wall_time": cost.wall_time,
        "compile_time": cost.compile_time,
        "peak_memory_mib": cost.memory_mib,  # of all ranks together
        "ranks": cost.ranks,
        "active_set": {
            "iterations": effort.iterations,
            "set_changes": list(effort.set_changes),
            "converged": effort.converged,
            "message": effort.message,
            "iterates": [
                {"gap": gap.tolist(), "contact_force": force.tolist()}
                for gap, force in effort.iterates
            ],
        },
        "energy": {
            "initial": _cleared(energy[0], scale, rounding),
            "final": _cleared(energy[-1], scale, rounding),
            "max_relative_drift": np.abs(growth).max(),
            "final_relative_drift": growth[-1],
            "max_relative_growth": grown,
            "grows": grown > GROWTH_LIMITS[0] and not driven,
            "driven": driven,
            "taken": taken,  # by what is known to take it [J]
            "unexplained": _cleared(unexplained, scale, rounding) / scale,
        },
        "contact": {
            "intervals": intervals,
            **largest_force(
                t,
                force,
                strongest_spells(history, intervals),
                effort.force_window,
                effort.least_window,
            ),
            **struck,
            "impulse": float(np.sum(pushing[1:] * np.diff(t))),
            "max_penetration": _cleared(
                max(0.0, -float(np.fmin.reduce(gap))),
                np.abs(gap).max(),
            ),
        },
        "controllers": dict(effort.details.get("controllers", {})),
        "error": asdict(run.errors) if run.errors else None,
        "bodies": effort.bodies,
        "details": {n: v for n, v in effort.details.items() if n != "controllers"},
        "plan": chosen.as_dict(),
    }
    plain: dict[str, Any] = _plain(summary)
    findings = [*effort.findings, *peak_findings(plain["contact"], effort.least_window)]
    found = judge(scene, history, plain, chosen.findings, findings, effort.measured)
    plain |= _plain(found)
    plain["contact"] |= run.contact
    return plain


def _cleared(value: float, scale: float, rounding: float = 0.0) -> float:
    """A figure without what is but rounding: of sums of a size, and of what is summed."""
    return 0.0 if abs(value) < max(_ROUNDING * scale, rounding) else float(value)


def contact_intervals(times: Floats, force: Floats, gap: Floats) -> list[list[float]]:
    """Join the layers in which the obstacle pushes to intervals.

    A pair that is active without a force (gap and force both zero to rounding) does not count.
    Where the gap is still open when the force sets in, or open again when it ends, contact begins
    and ends inside layers: where the gap of the two levels beside would close, as in free flight.

    Args:
        times: Layer times [s], shape (rows,).
        force: Contact force during (t_{m-1}, t_m] [N], shape (rows,); row 0 is ignored.
        gap: Gap at t_m [m], shape (rows,).

    Returns:
        Pairs [t_in, t_out] in seconds.
    """
    rounding = _SHUT * np.abs(gap).max()
    found = []
    for first, last in spells_of(force):
        ways = np.abs(np.diff(gap[max(first - 1, 0) : first + 2]))
        shut = ~(gap[first : last + 1] > max(rounding, _HELD * ways.max(initial=0.0)))
        closed = first + np.flatnonzero(shut)
        begin, end = (closed[0], closed[-1]) if len(closed) else (first + 1, last - 1)
        before, after = max(begin - 1, first), min(end + 1, last)
        begins = _closing_time(times, gap, before - 1, before)
        ends = _closing_time(times, gap, after + 1, after)
        t_in = float(np.clip(begins, times[first], times[begin]))
        t_out = float(np.clip(ends, times[end], times[last]))
        found.append([t_in, max(t_in, t_out)])
    return found


def _closing_time(times: Floats, gap: Floats, far: int, near: int) -> float:
    """When a gap that goes on changing as from one level to another closes [s]."""
    if not 0 <= far < len(times) or not gap[far] > gap[near]:
        return float(times[near])
    way = gap[near] / (gap[far] - gap[near])
    return float(times[near] + way * (times[near] - times[far]))


def _plain(value: Any) -> Any:
    """Make plain JSON data: Python numbers, None for what is not finite."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
