"""The moving picture of a run: what motion.js draws beside the contact force."""

from typing import Any

import numpy as np

from impactfem.report.page.chart import MOST_SPANS, numbers, thin
from impactfem.report.page.motion_bars import bars_motion
from impactfem.report.page.motion_bodies import bodies_motion
from impactfem.report.page.motion_data import rows_at
from impactfem.report.page.motion_points import points_motion
from impactfem.report.page.motion_poles import poles_motion
from impactfem.report.panel import is_exact, is_told
from impactfem.result import Fields, Record
from impactfem.result.shapes import LINE, VERTEX

SCRIPTS = ("motion_tools.js", "motion_views.js", "motion.js")
"""Scripts beside this module that draw charts and moving pictures, in the order of loading."""

_CURVE = 2000  # points of the force beside the picture


def _is_pole(result: Record) -> bool:
    """Whether all that moves is one slender body."""
    bodies: tuple[Any, ...] = result.scene.bodies
    return len(bodies) == 1 and bodies[0].dim > 1 and bodies[0].centreline() is not None


def motion(result: Record) -> dict[str, Any] | None:
    """Make the data of the moving picture.

    Args:
        result: With fields.

    Returns:
        Plain data: ``kind`` ("bars", "plane", "space" or "points"), ``caption``, ``times`` of the
        frames with ``force`` and ``gap`` at each, ``curve`` of the force over time, and what the
        kind needs. None if there is nothing to show.
    """
    fields = result.fields
    if fields is None:
        return None
    layout = fields.layout
    kinds = set(layout.types.tolist())
    if isinstance(fields, Fields):
        own = bars_motion(result, fields)
    elif kinds == {VERTEX}:  # alone, with the ways that they have gone
        own = points_motion(result, layout.radius)
    elif kinds == {LINE} and _is_pole(result):
        own = poles_motion(result, fields)
    else:
        own = bodies_motion(result, fields)
    if own is None or len(own["times"]) < 2:
        return None
    times = np.asarray(own.pop("times"))
    rows = rows_at(result, times)
    steps = np.diff(times)
    if steps[1:-1].size and steps[1:-1].max() > 1.5 * steps[1:-1].min():
        own["caption"] += " Frames lie closer together in contact: playing is slower there."
    return own | {
        "times": numbers(times),
        "force": numbers(result.rows["contact_force"].values[rows]),
        "gap": numbers(result.rows["gap"].values[rows]),
        "curve": _curve(result),
    }


def _curve(result: Record) -> dict[str, Any]:
    """Contact force over time with its spans, and the exact one if the run is not exact itself."""
    time, force = result.rows["time"].values, result.rows["contact_force"].values
    kept = thin(force, _CURVE)
    curve: dict[str, Any] = {"time": numbers(time[kept]), "force": numbers(force[kept])}
    if len(spans := result.summary["contact"]["intervals"]) <= MOST_SPANS:
        curve["spans"] = [numbers(span) for span in spans]
    exact = None if is_exact(result.summary) else result.exact_rows
    if exact is not None and is_told(exact["contact_force"].values):
        known = exact["contact_force"].values
        kept = thin(known, _CURVE)
        curve["exact_time"] = numbers(exact["time"].values[kept])
        curve["exact_force"] = numbers(known[kept])
    return curve
