"""All interactive charts that a result allows: those of every body here, others by kind."""

import numpy as np
from numpy.typing import NDArray

from impactfem.report.page.bar_charts import bar_charts, row_charts
from impactfem.report.page.chart import (
    BLUE,
    COLOURS,
    GREEN,
    ORANGE,
    Chart,
    axis,
    is_told,
    layout,
    line,
    numbers,
    over_time,
    stairs,
)
from impactfem.report.page.solid_charts import solid_charts
from impactfem.report.page.vibro_charts import vibro_charts
from impactfem.result import Record

Floats = NDArray[np.float64]

_MOST_CURVES = 8
_RAMP = 1e-8  # share of the duration below which a step of samples stands for a jump
_ROUNDING = 1e-17  # relative, below which a point counts as exact
_SURE = 0.5  # share of an error up to which its reference may be uncertain


def charts(result: Record) -> list[Chart]:
    """Make every chart that has something to tell, the most telling first.

    Args:
        result: Of any kind of body, with or without fields and exact solution.

    Returns:
        Charts with names of their own.
    """
    if not result.scene.bars:
        own = vibro_charts(result) if result.scene.is_vibro else solid_charts(result)
    else:
        own = row_charts(result) if result.scene.is_bar_row else bar_charts(result)
    made = [contact_force(result), *own, gap(result), energy(result), momentum(result)]
    made += [error(result), active(result), set_changes(result)]
    return [chart for chart in made if chart is not None]


def contact_force(result: Record) -> Chart | None:
    """Contact force of the run against the exact one; None if there never is any."""
    time, force = result.rows["time"].values, result.rows["contact_force"].values
    exact, method = result.exact_rows, result.summary["method"]
    if not is_told(force) and (exact is None or not is_told(exact["contact_force"].values)):
        return None
    traces = []
    if exact is not None:
        broad = {"width": 4.0}
        traces.append(
            line(exact["time"].values, exact["contact_force"].values, "exact", ORANGE, "N",
                 line=broad, opacity=0.6)
        )  # fmt: skip
    if exact is None or method != "exact":
        traces.append(stairs(time, force, method, BLUE, "N"))
    several = "pairs" in result.summary["contact"] or len(_columns(result, "gap.")) > 1
    caption = "Sum of the forces of all contacts" if several else "Force between body and obstacle"
    caption += "; a value holds for a whole time step, grey marks contact"
    if exact is not None and method != "exact":
        caption += ". The run should lie on the exact force: look at height, start and end"
    elif result.impacts is not None:
        caption += ". Impacts have impulses instead, which the chart of impacts tells"
    spans = result.summary["contact"]["intervals"]
    figure = over_time(time, traces, "contact force [N]", spans)
    return Chart("contact_force", "Contact force", f"{caption}.", figure)


def gap(result: Record) -> Chart:
    """Smallest distance from the obstacles, or that of each contact if these are few."""
    history = result.rows
    time = history["time"].values
    names = _columns(result, "gap.")
    if not 1 < len(names) <= _MOST_CURVES:
        names = ["gap"]
    traces = []
    if result.exact_rows is not None and len(names) == 1 and result.summary["method"] != "exact":
        exact = result.exact_rows
        traces.append(
            line(exact["time"].values, exact["gap"].values, "exact", ORANGE, "m",
                 line={"width": 4.0}, opacity=0.6)
        )  # fmt: skip
    for k, name in enumerate(names):
        label = _label(result, name) if len(names) > 1 else "gap"
        traces.append(line(time, history[name].values, label, COLOURS[k % len(COLOURS)], "m"))
    caption = "Distance left between the surfaces: 0 in contact, never clearly below."
    spans = result.summary["contact"]["intervals"]
    return Chart("gap", "Gap", caption, over_time(time, traces, "gap [m]", spans))


def energy(result: Record) -> Chart | None:
    """Parts of the energy and their sum."""
    history = result.rows
    time = history["time"].values
    parts = (("kinetic", BLUE), ("elastic", ORANGE), ("potential", GREEN))
    traces = [
        line(time, history[f"{name}_energy"].values, name, colour, "J")
        for name, colour in parts
        if is_told(history[f"{name}_energy"].values)
    ]
    if not traces:
        return None
    total = history["total_energy"].values
    traces.append(line(time, total, "total", "#000000", "J", line={"width": 2.2}))
    caption = "Where the energy is; the total must never rise"
    if result.summary["energy"].get("driven"):
        caption = "Where the energy is; loads that drive the motion may raise the total"
    spans = result.summary["contact"]["intervals"]
    return Chart("energy", "Energy", f"{caption}.", over_time(time, traces, "energy [J]", spans))


def momentum(result: Record) -> Chart | None:
    """Linear momentum, as the history holds it."""
    column = result.rows["momentum"]
    if not is_told(column.values):
        return None
    time = result.rows["time"].values
    traces = [line(time, column.values, "momentum", BLUE, "kg m/s")]
    what = str(column.attrs.get("long_name", "linear momentum"))
    caption = f"{what[:1].upper()}{what[1:]}: only forces from outside change it, as contact does."
    spans = result.summary["contact"]["intervals"]
    return Chart(
        "momentum", "Momentum", caption, over_time(time, traces, "momentum [kg m/s]", spans)
    )


def error(result: Record) -> Chart | None:
    """Error of the gap and of the impulse so far against the exact solution, where both are known.

    Returns:
        None without an exact solution, or if the run is that solution.
    """
    if result.exact_rows is None or result.summary["method"] == "exact":
        return None
    time = result.rows["time"].values
    at, exact_gap = result.exact_rows["time"].values, result.exact_rows["gap"].values
    wrong = np.abs(result.rows["gap"].values - np.interp(time, at, exact_gap))
    wrong[interpolation_bound(time, at, exact_gap) > _SURE * wrong] = np.nan
    force = result.rows["contact_force"].values
    impulse = np.append(0.0, np.cumsum(force[1:] * np.diff(time)))
    exact_force = result.exact_rows["contact_force"].values
    exact_impulse = _integral(at, exact_force, time)
    off = np.abs(impulse - exact_impulse)
    off[ramp_bound(time, at, exact_force) > _SURE * off] = np.nan
    traces, curves = [], []
    scale = float(np.abs(exact_gap).max())
    if scale > 0.0 and np.count_nonzero(wrong > 0.0) >= 0.2 * len(time):
        curves.append(("gap, over the largest one", wrong / scale, BLUE))
    scale = float(np.abs(exact_impulse).max())
    if scale > 0.0:
        curves.append(("impulse so far, over all of it", off / scale, ORANGE))
    for name, values, colour in curves:
        shown = np.where(values > _ROUNDING, values, np.nan)
        if np.isfinite(shown).any():
            traces.append(line(time, shown, name, colour, ""))
    if not traces:
        return None
    caption = (
        "Distance from the exact solution over time, relative, on a logarithmic scale: 1e-2 is one "
        "per cent, 1e-15 is rounding. Missing points are exact, or closer than the exact curve "
        "is sampled."
    )
    figure = over_time(time, traces, "relative error", yaxis={"type": "log"}, showlegend=True)
    return Chart("error", "Error over time", caption, figure)


def interpolation_bound(time: Floats, at: Floats, values: Floats) -> Floats:
    """Bound of the error of linear interpolation between samples, from their bends; shape (rows,).

    Args:
        time: Where it is interpolated [s], shape (rows,).
        at: Times of the samples [s], at least two.
        values: Samples of a curve whose kinks and bends near each sample turn one way.
    """
    steps = np.diff(at)
    slopes = np.diff(values) / steps
    turns = np.abs(np.diff(slopes))
    # A kink or a bend within an interval changes the slopes from one neighbour to the other.
    bends = 0.25 * steps * (np.append(turns, 0.0) + np.insert(turns, 0, 0.0))
    k = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(steps) - 1)
    share = np.clip((time - at[k]) / steps[k], 0.0, 1.0)
    bound: Floats = 4.0 * share * (1.0 - share) * bends[k]
    return bound


def ramp_bound(time: Floats, at: Floats, force: Floats) -> Floats:
    """Bound of the error of the impulse up to each time as jumps are sampled as ramps [N s].

    Args:
        time: Where the impulse is taken [s], shape (rows,).
        at: Times of the samples [s].
        force: Samples; a jump is one within a very short interval [N].
    """
    steps = np.diff(at)
    ramps = steps < _RAMP * (at[-1] - at[0])
    parts = np.where(ramps, 0.5 * np.abs(np.diff(force)) * steps, 0.0)
    total = np.append(0.0, np.cumsum(parts))
    bound: Floats = total[np.clip(np.searchsorted(at, time, side="right"), 0, len(at) - 1)]
    return bound


def active(result: Record) -> Chart | None:
    """Number of active contacts of solids over time, where there are several."""
    column = result.rows["active"].values
    if not result.scene.marches or column.max() <= 1:
        return None
    time = result.rows["time"].values
    traces = [stairs(time, column, "active contacts", BLUE, "active")]
    caption = "How many contact nodes carry a force: they enter and leave one by one."
    return Chart(
        "active", "Active contacts", caption, over_time(time, traces, "active contacts [1]")
    )


def set_changes(result: Record) -> Chart | None:
    """Changes of the active set after each iteration; None if there were not several iterations."""
    changes = result.summary["active_set"]["set_changes"]
    if len(changes) < 2:
        return None
    trace = {
        "type": "bar", "x": list(range(1, len(changes) + 1)), "y": numbers(changes),
        "text": [str(change) for change in changes], "textposition": "outside",
        "cliponaxis": False, "marker": {"color": BLUE}, "name": "changes",
        "hovertemplate": "iteration %{x}: %{y} changed side<extra></extra>",
    }  # fmt: skip
    if len(changes) > 30:
        del trace["text"], trace["textposition"]
    across = axis("iteration") | ({"dtick": 1} if len(changes) <= 30 else {})
    figure = {"data": [trace], "layout": layout(across, axis("changes [1]"), showlegend=False)}
    ending = result.summary["active_set"]["message"] or "the last one should change nothing"
    caption = f"How many contacts changed side in each iteration of the active set; {ending}."
    return Chart("active_set", "Active set", caption, figure)


def _integral(at: Floats, values: Floats, time: Floats) -> Floats:
    """Integral up to each time of a curve that is straight between samples."""
    places = np.union1d(at, time)
    curve = np.interp(places, at, values)
    total = np.append(0.0, np.cumsum(0.5 * (curve[1:] + curve[:-1]) * np.diff(places)))
    return np.asarray(total[np.searchsorted(places, time)])


def _columns(result: Record, prefix: str) -> list[str]:
    return [str(name) for name in result.rows.data_vars if str(name).startswith(prefix)]


def _label(result: Record, name: str) -> str:
    return str(result.rows[name].attrs.get("label", name))
