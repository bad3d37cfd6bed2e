"""The table of panels: what a result tells in curves, by the columns that its history has."""

from collections.abc import Callable
from functools import partial
from typing import Literal

import numpy as np

from impactfem.report.error_panel import error
from impactfem.report.line_panels import displacement, strain, velocity_map, world_lines
from impactfem.report.motion_panels import impacts, impulses, motion, path, phase, velocity
from impactfem.report.panel import (
    BLUE,
    GREEN,
    MOST_NAMES,
    ORANGE,
    Curve,
    Map,
    Panel,
    colour,
    is_exact,
    is_told,
    over_time,
)
from impactfem.result import Record

_MOST_GAPS, _MOST_FORCES = 8, 40
_PARTS = (("kinetic", BLUE), ("elastic", ORANGE), ("potential", GREEN))


def panels(result: Record) -> dict[str, Callable[[], Panel | Map | None]]:
    """What makes each panel, by name, the most telling first; None if there is nothing to tell."""
    known = (
        contact_force, displacement, world_lines, velocity_map, strain, forces, motion, velocity,
        path, phase, impacts, impulses, gap, energy, momentum, error, active, active_set,
        iterates, iterate_gaps,
    )  # fmt: skip
    return {make.__name__: partial(make, result) for make in known}


def contact_force(result: Record) -> Panel | None:
    """Contact force of the run against the exact one; None if there never is any."""
    time, force = result.rows["time"].values, result.rows["contact_force"].values
    exact, method = result.exact_rows, result.summary["method"]
    if not is_told(force) and (exact is None or not is_told(exact["contact_force"].values)):
        return None
    curves = _exact(result, "contact_force", "exact", "N")
    if exact is None or not is_exact(result.summary):
        curves.append(Curve(method, time, force, "N", look="stairs", width=1.4))
    several = "pairs" in result.summary["contact"] or len(_columns(result, "gap.")) > 1
    caption = "Sum of the forces of all contacts" if several else "Force between body and obstacle"
    caption += "; a value holds for a whole time step, grey marks contact"
    if exact is not None and not is_exact(result.summary):
        caption += ". The run should lie on the exact force: look at height, start and end"
    elif result.impacts is not None:
        caption += ". Impacts have impulses instead, which the chart of impacts tells"
    return over_time(
        result, "contact_force", "Contact force", f"{caption}.", curves, "contact force [N]"
    )


def forces(result: Record) -> Panel | None:
    """Force of each pair, exact ones as broad lines behind, where several are told."""
    time, exact = result.rows["time"].values, result.exact_rows
    told = [
        name
        for name in _columns(result, "force.", "tangential_force.")
        if is_told(result.rows[name].values)
    ]
    if not 1 < len(told) <= _MOST_FORCES:
        return None
    curves, own = [], is_exact(result.summary) and exact is not None
    several = any(name.startswith("tangential") for name in told)
    for k, name in enumerate(told):
        attributes = result.rows[name].attrs
        label = str(attributes.get("long_name" if several else "label", name))
        named = len(told) <= MOST_NAMES
        if exact is not None and name in exact:
            width, alpha = (1.6, 1.0) if own else (4.0, 0.35)
            curves.append(
                Curve(
                    f"{label}, exact", exact["time"].values, exact[name].values, "N", colour(k),
                    named=own and named, width=width, alpha=alpha,
                )
            )  # fmt: skip
        if not own:
            values = result.rows[name].values
            curves.append(
                Curve(label, time, values, "N", colour(k), look="stairs", width=1.4, named=named)
            )
    caption = "Force of each pair that may meet"
    if exact is not None and not own:
        caption += "; the broad pale lines are exact"
    if result.impacts is not None:
        caption += ", without the impulses of impacts"
    return over_time(result, "forces", "Forces of pairs", f"{caption}.", curves, "force [N]")


def gap(result: Record) -> Panel:
    """Smallest distance from the obstacles, or that of each contact if these are few."""
    time, names = result.rows["time"].values, _columns(result, "gap.")
    if not 1 < len(names) <= _MOST_GAPS:
        names = ["gap"]
    curves = []
    if len(names) == 1 and not is_exact(result.summary):
        curves = _exact(result, "gap", "exact", "m")
    for k, name in enumerate(names):
        column = result.rows[name]
        label = str(column.attrs.get("label", name)) if len(names) > 1 else "gap"
        curves.append(Curve(label, time, column.values, "m", colour(k)))
    caption = "Distance left between the surfaces: 0 in contact, never clearly below."
    still = result.impacts is not None  # others have the force that tells when it is closed
    return over_time(result, "gap", "Gap", caption, curves, "gap [m]", still=still)


def energy(result: Record) -> Panel | None:
    """Parts of the energy and their sum."""
    history, time = result.rows, result.rows["time"].values
    curves = [
        Curve(name, time, history[f"{name}_energy"].values, "J", tint)
        for name, tint in _PARTS
        if is_told(history[f"{name}_energy"].values)
    ]
    if not curves:
        return None
    total = history["total_energy"].values
    curves.append(Curve("total", time, total, "J", "#000000", width=2.2))
    caption = "Where the energy is; the total must never rise"
    if result.summary["energy"].get("driven"):
        caption = "Where the energy is; loads that drive the motion may raise the total"
    return over_time(result, "energy", "Energy", f"{caption}.", curves, "energy [J]")


def momentum(result: Record) -> Panel | None:
    """Linear momentum, as the history holds it."""
    column, time = result.rows["momentum"], result.rows["time"].values
    if not is_told(column.values):
        return None
    curves = [Curve("momentum", time, column.values, "kg m/s")]
    what = str(column.attrs.get("long_name", "linear momentum"))
    caption = f"{what[:1].upper()}{what[1:]}: only forces from outside change it, as contact does."
    label = "momentum [kg m/s]"
    return over_time(result, "momentum", "Momentum", caption, curves, label, still=False)


def active(result: Record) -> Panel | None:
    """Number of active contacts over time, where there are several."""
    column, time = result.rows["active"].values, result.rows["time"].values
    if not result.scene.marches or column.max() <= 1:
        return None
    curves = [Curve("active contacts", time, column.astype(float), "active", look="stairs")]
    caption = "How many contact nodes carry a force: they enter and leave one by one."
    label = "active contacts [1]"
    return over_time(result, "active", "Active contacts", caption, curves, label, still=False)


def active_set(result: Record) -> Panel | None:
    """Changes of the active set after each iteration; None if there were not several iterations."""
    changes = np.asarray(result.summary["active_set"]["set_changes"], dtype=np.float64)
    if len(changes) < 2:
        return None
    iterations = np.arange(1.0, len(changes) + 1.0)
    told = "iteration %{x}: %{y} changed side"
    ending = result.summary["active_set"]["message"] or "the last one should change nothing"
    caption = f"How many contacts changed side in each iteration of the active set; {ending}."
    curves = [Curve("changes", iterations, changes, "1", look="bars", told=told)]
    return Panel(
        "active_set", "Active set", caption, curves, "changes [1]", "iteration",
        (0.0, len(changes) + 1.0), named=False,
    )  # fmt: skip


def iterates(result: Record) -> Panel | None:
    """Contact force of each iterate of an active set that has all time steps at once."""
    caption = "What each iterate of the active set takes for the contact force: the first one knows"
    caption += " no contact, and forces may pull until the sets stand still."
    return _iterates(result, "iterates", "Forces of the iterates", "contact_force", "N", caption)


def iterate_gaps(result: Record) -> Panel | None:
    """Gap of the same."""
    caption = "The gap of each iterate: it may be negative until the sets stand still."
    return _iterates(result, "iterate_gaps", "Gaps of the iterates", "gap", "m", caption)


def _iterates(
    result: Record, name: str, title: str, column: str, unit: str, caption: str
) -> Panel | None:
    kept = result.summary["active_set"].get("iterates", [])
    if len(kept) < 2:
        return None
    time = result.rows["time"].values[1:]
    look: Literal["line", "stairs"] = "line" if column == "gap" else "stairs"
    curves = [
        Curve(
            f"iterate {k + 1}", time, np.asarray(iterate[column], dtype=np.float64), unit,
            colour(k), look=look, width=2.0 if k + 1 == len(kept) else 1.0,
        )
        for k, iterate in enumerate(kept)
    ]  # fmt: skip
    label = f"{column.replace('_', ' ')} [{unit}]"
    return over_time(result, name, title, caption, curves, label, still=False)


def _exact(result: Record, column: str, label: str, unit: str) -> list[Curve]:
    """The exact curve, broad, behind that of the run."""
    if (exact := result.exact_rows) is None:
        return []
    values = exact[column].values
    return [Curve(label, exact["time"].values, values, unit, ORANGE, width=4.0, alpha=0.6)]


def _columns(result: Record, *prefixes: str) -> list[str]:
    return [str(name) for name in result.rows.data_vars if str(name).startswith(prefixes)]
