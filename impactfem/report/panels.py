"""The table of panels: what a result tells in curves, by the columns that its history has."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from impactfem.report.error_panel import error
from impactfem.report.line_panels import displacement, strain, velocity_map, world_lines
from impactfem.report.motion_panels import impacts, impulses, motion, path, phase, velocity
from impactfem.report.panel import (
    BLUE,
    FAINT,
    GREEN,
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

_MOST_GAPS, _MOST_FORCES, _MOST_PAIRS = 8, 40, 5
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
    """Forces of pairs, exact ones as broad lines behind; of many pairs the largest have names.

    What another chart shows is left out: the normal force of a single pair is the contact force,
    and components of tangential forces have a magnitude.
    """
    told = [n for n in _columns(result, "force.", "tangential_force.") if _is_own(result, n)]
    if len(normal := [name for name in told if name.startswith("force.")]) == 1:
        told.remove(normal[0])
    if not told or len(told) > _MOST_FORCES:
        return None
    pairs = list(dict.fromkeys(_pair(name) for name in told))
    largest = sorted(pairs, key=lambda pair: -_impulse(result, pair))[:_MOST_PAIRS]
    known = [pair for pair in pairs if pair in largest]
    mixed = 1 < len(normal) < len(told)
    curves = [
        curve
        for name in sorted(told, key=lambda name: _pair(name) in known)
        for curve in _force(result, name, known, mixed=mixed)
    ]
    if rest := len(pairs) - len(known):
        curves[0] = replace(curves[0], label=f"{rest} other{'s' * (rest > 1)}", named=True)
    what = "Force" if len(normal) > 1 else "Tangential force"
    caption = f"{what} of each pair that may meet{'; dashes are tangential' * mixed}"
    if result.exact_rows is not None and not is_exact(result.summary):
        caption += "; the broad pale lines are exact"
    if result.impacts is not None:
        caption += ", without the impulses of impacts"
    title = f"{what}s{' of pairs' * (len(normal) > 1)}"
    y = f"{what.lower()} [N]"
    return over_time(result, "forces", title, f"{caption}.", curves, y, named=True)


def _pair(name: str) -> str:
    """The pair of a column of forces."""
    return name.partition("force.")[2]


def _is_own(result: Record, name: str) -> bool:
    """Whether a column of forces says something, and is no component of another one."""
    whole, _, letter = name.rpartition(".")
    return not (letter in "xyz" and whole in result.rows) and is_told(result.rows[name].values)


def _impulse(result: Record, pair: str) -> float:
    """Of all that a pair exchanges, without signs [N s]."""
    steps = np.diff(result.rows["time"].values)
    names = [name for kind in ("", "tangential_") if (name := f"{kind}force.{pair}") in result.rows]
    forces = [result.rows[name].values[1:] for name in names]
    return float(sum(np.nansum(np.abs(force) * steps) for force in forces))


def _force(result: Record, name: str, known: Sequence[str], *, mixed: bool) -> list[Curve]:
    """The force of a pair, behind it the exact one; thin and grey of a pair that is not known."""
    tangential, pair, time = name.startswith("tangential"), _pair(name), result.rows["time"].values
    column, exact = result.rows[name], result.exact_rows
    own = exact is not None and is_exact(result.summary)
    label = str(column.attrs.get("label", pair)) + ", tangential" * (tangential and mixed)
    if pair not in known:
        values = column.values
        return [Curve(label, time, values, "N", FAINT, look="stairs", width=0.7, named=False)]
    tint, curves = colour(known.index(pair)), []
    if exact is not None and name in exact:
        width, alpha = (1.6, 1.0) if own else (4.0, 0.35)
        curves.append(
            Curve(
                f"{label}, exact", exact["time"].values, exact[name].values, "N", tint,
                named=own, width=width, alpha=alpha,
            )
        )  # fmt: skip
    if not own:
        curves.append(
            Curve(label, time, column.values, "N", tint, look="stairs", width=1.4,
                  dashed=tangential and mixed)
        )  # fmt: skip
    return curves


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
