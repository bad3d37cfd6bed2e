"""Interactive charts of bars: space-time map, world lines, forces and velocities of a row."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.report.page.chart import (
    BLUE,
    COLOURS,
    Chart,
    Trace,
    is_told,
    line,
    numbers,
    over_time,
    stairs,
)
from impactfem.result import Fields, Record

Floats = NDArray[np.float64]

_MAP = 200  # samples of a map along each axis
_LINE = 500  # samples of a world line
_LINES = 11  # world lines of one bar, and at most of each bar in a row
_LEGEND = 10  # curves up to which each has a name of its own
_CONTACT, _WALL = "crimson", "#999999"
_MAP_DIGITS = 5


def bar_charts(result: Record) -> list[Chart]:
    """Charts that only a single bar has."""
    fields = result.fields
    return [_map(result, fields), _points(result, fields)] if isinstance(fields, Fields) else []


def row_charts(result: Record) -> list[Chart]:
    """Charts that only a row of bars has."""
    made = [_forces(result), _velocities(result)]
    if isinstance(result.fields, Fields):
        made.insert(1, _row_points(result, result.fields))
    return [chart for chart in made if chart is not None]


def evenly(count: int, most: int) -> NDArray[np.int64]:
    """At most so many indices, ends included."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


def stacked_places(fields: Fields) -> Floats:
    """Places of the nodes if all bars touched each other and the wall [m], shape (nodes,)."""
    counts = np.array(fields.counts or (len(fields.positions),))
    lengths = fields.positions[np.cumsum(counts) - 1]
    places: Floats = fields.positions + np.repeat(np.cumsum(lengths) - lengths, counts)
    return places


def magnifier(fields: Fields, room: float) -> float:
    """Factor of motion and gaps, at least 1, at which they take some share of all lengths.

    Args:
        fields: Of one or several bars.
        room: That share.
    """
    stacked = stacked_places(fields)
    motion = fields.positions + fields.displacement - stacked
    span = float(np.nanmax(motion) - np.nanmin(motion))
    wanted = room * float(stacked[-1])
    return round_below(wanted / span) if 0.0 < span < wanted else 1.0


def round_below(number: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is not above a number from 1 on."""
    decade = 10.0 ** np.floor(np.log10(number))
    return float(max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= number))


def _map(result: Record, fields: Fields) -> Chart:
    t, x = evenly(len(fields.times), _MAP), evenly(len(fields.positions), _MAP)
    values = fields.displacement[np.ix_(t, x)].T
    heat = {
        "type": "heatmap",
        "x": numbers(fields.times[t]),
        "y": numbers(fields.positions[x]),
        "z": [numbers(row, _MAP_DIGITS) for row in values],
        "colorscale": "Viridis",
        "zsmooth": "best",
        "colorbar": {"title": {"text": "u [m]"}, "thickness": 14, "x": 1.05},
        "hovertemplate": "t = %{x:.6g} s<br>x = %{y:.6g} m<br>u = %{z:.5g} m<extra></extra>",
        "showlegend": False,
    }
    traces: list[Trace] = [heat, *_contacts(result.summary["contact"]["intervals"])]
    figure = over_time(fields.times, traces, "position in the bar x [m]", showlegend=False)
    caption = (
        "Displacement u of each cross-section x, measured from the near end; waves run along "
        "oblique lines, the red line at x = 0 marks contact."
    )
    return Chart("displacement", "Displacement in space and time", caption, figure)


def _contacts(spans: Sequence[Sequence[float]]) -> list[Trace]:
    """Red lines at the wall during contact, in one trace."""
    if not spans:
        return []
    x = [entry for first, last in spans for entry in (*numbers([first, last]), None)]
    y = [entry for _ in spans for entry in (0.0, 0.0, None)]
    return [
        {
            "type": "scatter", "mode": "lines", "x": x, "y": y, "name": "contact",
            "line": {"color": _CONTACT, "width": 6}, "cliponaxis": False,
            "hovertemplate": "contact at t = %{x:.6g} s<extra></extra>",
        }
    ]  # fmt: skip


def _points(result: Record, fields: Fields) -> Chart:
    t = evenly(len(fields.times), _LINE)
    nodes = evenly(len(fields.positions), _LINES)
    traces = []
    for node in nodes:
        x = numbers(fields.positions[[node]])[0]
        end = node in (nodes[0], nodes[-1])
        place = (fields.positions[node] + fields.displacement[:, node])[t]
        traces.append(
            line(fields.times[t], place, f"x = {x:.4g} m", BLUE, "m",
                 line={"width": 2.0 if end else 0.8}, showlegend=False)
        )  # fmt: skip
    low = float(np.nanmin(fields.positions + fields.displacement))
    high = float(np.nanmax(fields.positions + fields.displacement))
    figure = over_time(
        fields.times, traces, "distance from the wall [m]",
        result.summary["contact"]["intervals"], showlegend=False,
    )  # fmt: skip
    _add_wall(figure, low, high)
    caption = (
        "World lines of cross-sections; thick lines are both ends, the band below is the wall, "
        "grey marks contact. Lines that come closer show compression."
    )
    return Chart("position", "World lines", caption, figure)


def _add_wall(figure: dict[str, Any], low: float, high: float) -> None:
    room = 0.05 * (high - min(low, 0.0))
    wall = {
        "type": "rect", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": min(low, 0.0) - room,
        "y1": 0, "layer": "below", "fillcolor": _WALL, "line": {"width": 0},
    }  # fmt: skip
    figure["layout"]["shapes"].append(wall)
    figure["layout"]["yaxis"]["range"] = numbers([min(low, 0.0) - room, high + room])


def _row_points(result: Record, fields: Fields) -> Chart:
    """World lines of all bars; motion and gaps magnified alike where they are small."""
    factor = magnifier(fields, 0.6)
    stacked = stacked_places(fields)
    t = evenly(len(fields.times), _LINE)
    motion = (fields.positions + fields.displacement - stacked)[t]
    place = stacked + factor * motion
    bars = result.scene.bars
    counts = fields.counts or (len(fields.positions),)
    starts = np.cumsum([0, *counts])
    each = _LINES if len(bars) <= 3 else 4 if len(bars) <= 12 else 2
    traces = []
    for k, bar in enumerate(bars):
        first, last = int(starts[k]), int(starts[k + 1]) - 1
        for node in first + evenly(last + 1 - first, each):
            trace = line(
                fields.times[t], place[:, node], bar.name, _colour(k), "m",
                line={"width": 2.0 if node in (first, last) else 0.8},
                showlegend=bool(node == first) and len(bars) <= _LEGEND, legendgroup=bar.name,
            )  # fmt: skip
            if factor > 1.0:
                trace["customdata"] = numbers((fields.displacement[t] + fields.positions)[:, node])
                trace["hovertemplate"] = (
                    f"t = %{{x:.6g}} s<br>at %{{customdata:.6g}} m<extra>{bar.name}</extra>"
                )
            traces.append(trace)
    offset = 0 if result.scene.obstacles else 1
    for pair, found in enumerate(result.summary["contact"]["pairs"]):
        end = place[:, starts[pair + offset]]
        for first, last in found["intervals"][:20]:
            times = np.linspace(first, last, 20)
            trace = line(times, np.interp(times, fields.times[t], end), "contact", _CONTACT, "m",
                         line={"width": 4.0}, showlegend=False, hoverinfo="skip")  # fmt: skip
            del trace["hovertemplate"]
            traces.append(trace)
    shown = f", motion and gaps × {factor:g}" if factor > 1.0 else ""
    figure = over_time(fields.times, traces, f"place on the axis [m]{shown}")
    if result.scene.obstacles:
        _add_wall(figure, float(np.nanmin(place)), float(np.nanmax(place)))
    figure["layout"]["height"] = 440
    caption = "World lines of cross-sections of all bars, in red where neighbours touch"
    if factor > 1.0:
        caption += f"; motion and gaps are magnified {factor:g} times, hovering tells true places"
    return Chart("world_lines", "World lines", f"{caption}.", figure)


def _forces(result: Record) -> Chart | None:
    """Force of each pair, exact ones as broad lines behind."""
    history, exact = result.rows, result.exact_rows
    time = history["time"].values
    names = [str(name) for name in history.data_vars if str(name).startswith("force.")]
    own = result.summary["method"] == "exact"
    if len(names) < 2:  # the one pair is the whole contact force
        return None
    traces: list[Trace] = []
    for k, name in enumerate(names):
        told = is_told(history[name].values)
        label = str(history[name].attrs["label"])
        named = {"showlegend": len(names) <= _LEGEND, "legendgroup": label}
        if exact is not None and (told or is_told(exact[name].values)):
            width, alpha = (1.6, 1.0) if own else (4.0, 0.35)
            traces.append(
                line(exact["time"].values, exact[name].values, f"{label}, exact", _colour(k), "N",
                     line={"width": width}, opacity=alpha, **(named | {"showlegend": own}))
            )  # fmt: skip
        if told and not (own and exact is not None):
            traces.append(stairs(time, history[name].values, label, _colour(k), "N") | named)
    if not traces:
        return None
    caption = "Pressing force between neighbours"
    if exact is not None and not own:
        caption += "; the broad pale lines are exact"
    figure = over_time(time, traces, "force [N]")
    return Chart("forces", "Forces between neighbours", f"{caption}.", figure)


def _velocities(result: Record) -> Chart:
    time, bars = result.rows["time"].values, result.scene.bars
    traces = [
        line(time, result.rows[f"{bar.name}.vx"].values, bar.name, _colour(k), "m/s",
             showlegend=len(bars) <= _LEGEND)
        for k, bar in enumerate(bars)
    ]  # fmt: skip
    caption = (
        "Velocity of each bar's centre of mass: a contact hands momentum from one to the next."
    )
    figure = over_time(time, traces, "velocity [m/s]")
    return Chart("velocities", "Velocities of the bars", caption, figure)


def _colour(k: int) -> str:
    return COLOURS[k % len(COLOURS)]
