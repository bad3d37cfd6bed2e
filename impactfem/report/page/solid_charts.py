"""Interactive charts of solids: centres of mass, forces of pairs, pressure if it is stored."""

import numpy as np

from impactfem.report.page.chart import COLOURS, Chart, is_told, line, over_time, stairs
from impactfem.result import Record

_STILL = 1e-3  # of the largest component, below which one is not seen


def solid_charts(result: Record) -> list[Chart]:
    """Charts that only solids have: forces of pairs, way and velocity of each body."""
    made = [_pair_forces(result), *_centres(result)]
    return [chart for chart in made if chart is not None]


def _pair_forces(result: Record) -> Chart | None:
    """Force of each pair, where the history holds several of them."""
    history = result.rows
    names = [
        str(name)
        for name in history.data_vars
        if str(name).startswith(("force.", "tangential_force.")) and is_told(history[name].values)
    ]
    if len(names) < 2:
        return None
    time = history["time"].values
    traces = []
    for k, name in enumerate(names):
        label = str(history[name].attrs["long_name"])
        traces.append(stairs(time, history[name].values, label, COLOURS[k % len(COLOURS)], "N"))
    caption = "Force of each pair that may meet."
    return Chart("forces", "Forces of pairs", caption, over_time(time, traces, "force [N]"))


def _centres(result: Record) -> list[Chart]:
    """Way and velocity of the centres of mass, components that stay zero left out."""
    history, bodies = result.rows, result.scene.bodies
    time = history["time"].values
    spans = result.summary["contact"]["intervals"]
    letters = "xyz"[: result.scene.dim]
    made = []
    for name, title, prefix, unit in (
        ("way", "Way of the centre of mass", "", "m"),
        ("velocity", "Velocity of the centre of mass", "v", "m/s"),
    ):
        curves = []
        for body in bodies:
            for letter in letters:
                values = history[f"{body.name}.{prefix}{letter}"].values
                if not prefix:
                    values = values - values[0]  # bodies far from each other, with small ways
                curves.append((f"{body.name}, {letter}", values))
        sizes = [float(np.abs(v[np.isfinite(v)]).max(initial=0.0)) for _, v in curves]
        told = [
            curve for curve, size in zip(curves, sizes, strict=True) if size > _STILL * max(sizes)
        ]
        if not told:
            continue
        traces = [
            line(time, values, label, COLOURS[k % len(COLOURS)], unit)
            for k, (label, values) in enumerate(told)
        ]
        what = "way of the centre of mass" if not prefix else "velocity of the centre of mass"
        caption = f"The {what} along each axis; grey marks contact"
        if len(bodies) > 1:
            caption = f"The {what} of each body along each axis; grey marks contact"
        caption += ", where its slope turns." if not prefix else ", where it changes."
        figure = over_time(time, traces, f"{name} [{unit}]", spans, showlegend=True)
        made.append(Chart(name, title, caption, figure))
    return made
