"""What runs of one bar and of bars in a row share: a bar is a row of one."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from impactfem.findings import Finding, by_limits, percent
from impactfem.planning import Plan
from impactfem.planning.bar_errors import rounding_findings
from impactfem.reference.bar import Errors
from impactfem.result.bar_row_motion import RowMotion, row_fields, row_history
from impactfem.result.table import Table
from impactfem.runs.line_bodies import bar_figures
from impactfem.runs.line_probes import bar_probes, thinned
from impactfem.runs.run import Cost, Run
from impactfem.scene import Bar, Scene


@dataclass(frozen=True)
class Measured:
    """What the exact solution tells of a motion.

    Attributes:
        errors: Errors of the motion; None if they are unknown.
        curves: Exact curves; None if they are unknown.
        contact: Figures of contact that are better than those of the history.
        window: Time [s] over which the largest force is told as a mean.
    """

    errors: Errors | None
    curves: Table | None
    contact: Mapping[str, Any] = field(default_factory=dict)
    window: float = 0.0


def _moved(scene: Scene) -> tuple[Finding, ...]:
    """How far a bar had to go until the wall held it."""
    (body,), bar = scene.bodies, scene.bar
    if bar.far_end == "clamped":
        return ()
    given = cast("Bar", body)
    way = float(given.initial_displacement(x=0.0) - bar.initial_displacement(x=0.0))
    share = way / bar.length
    text = f'start = "static" has moved {bar.name} by {way:.3g} m, {percent(share)} of its length'
    remedy = "check that this is the rest that is meant, or give it no gap"
    return by_limits("setting", share, (0.01, np.inf), text, bar.name, remedy)


def run_of_bars(
    scene: Scene, plan: Plan[Any], used: Scene, full: RowMotion, measured: Measured, cost: Cost
) -> Run:
    """The run of bars whose motion is known.

    Args:
        scene: The scene.
        plan: Its plan.
        used: The scene with the choices of the plan filled in.
        full: The motion; with all levels kept if there are probes.
        measured: What the exact solution tells of it.
        cost: What it took.
    """
    motion = thinned(full, scene)
    bodies = {
        bar.name: bar_figures(bar, x, u)
        for bar, x, u in zip(scene.bars, motion.positions, motion.displacement, strict=True)
    }
    effort = replace(motion.effort, force_window=measured.window, bodies=bodies)
    errors = measured.errors
    if errors is not None and any(told.code == "rounding_growth" for told in plan.findings):
        grown = rounding_findings(errors.displacement_max, "has grown")
        effort = replace(effort, findings=grown, measured=("rounding_growth",))
    if scene.starts_at_rest:
        effort = replace(effort, findings=(*effort.findings, *_moved(scene)))
    names = tuple(bar.name for bar in scene.bars)
    return Run(
        used=used,
        history=row_history(motion, scene.bars, bar_probes(scene, full)),
        effort=effort,
        errors=errors,
        cost=cost,
        fields=row_fields(motion, names) if scene.output.fields else None,
        exact=measured.curves,
        contact=measured.contact,
    )
