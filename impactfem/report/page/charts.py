"""All interactive charts that a result allows: its panels as plain data for plotly."""

from typing import Any

import numpy as np

from impactfem.arrays import Integers
from impactfem.report.page.chart import (
    Chart,
    Trace,
    axis,
    layout,
    numbers,
    over_time,
    thin,
)
from impactfem.report.page.chart_units import prefixed_map, prefixed_panel
from impactfem.report.panel import WALL, Curve, Map, Panel, limit_of
from impactfem.report.panels import panels
from impactfem.report.prefixes import unit_of
from impactfem.result import Record

_PATH = 2000  # samples of a curve that turns back
_FEW = 30  # bars up to which each has its number
_HIGH = 440  # of a high chart [px]
_MAP_DIGITS = 5


def charts(result: Record) -> list[Chart]:
    """Make every chart that has something to tell, the most telling first.

    Args:
        result: Of any kind of body, with or without fields and exact solution.

    Returns:
        Charts with names of their own.
    """
    made = (make() for make in panels(result).values())
    return [_chart(panel) for panel in made if panel is not None]


def _chart(panel: Panel | Map) -> Chart:
    told = panel.name, panel.title, panel.caption
    if isinstance(panel, Map):
        return Chart(*told, _map(prefixed_map(panel)))
    return Chart(*told, _figure(prefixed_panel(panel)))


def _figure(panel: Panel) -> dict[str, Any]:
    data = [trace for curve in panel.curves for trace in _traces(curve)]
    named = len(data) > 1 if panel.named is None else panel.named
    more: dict[str, Any] = {"showlegend": named} | ({"height": _HIGH} if panel.high else {})
    vertical: dict[str, Any] = {"type": "log"} if panel.log else {}
    if panel.x.startswith("time") and panel.span is not None:
        titles = panel.x, panel.y
        figure = over_time(panel.span, data, titles, panel.shaded, yaxis=vertical, **more)
    else:
        few = bool(panel.curves) and panel.curves[0].look == "bars"
        across = {"dtick": 1} if few and len(panel.curves[0].x) <= _FEW else {}
        vertical |= {"scaleanchor": "x", "scaleratio": 1} if panel.equal else {}
        shown = axis(panel.x, **across), axis(panel.y, **vertical)
        figure = {"data": data, "layout": layout(*shown, **more)}
    if panel.wall:
        _add_wall(figure, panel)
    return figure


def _traces(curve: Curve) -> list[Trace]:
    kept = _kept(curve)
    trace: Trace = {
        "type": "scatter", "mode": "markers" if curve.look == "dots" else "lines",
        "x": numbers(curve.x[kept]), "y": numbers(curve.y[kept]), "name": curve.label,
        "legendgroup": curve.label, "showlegend": curve.named,
        "hovertemplate": f"{curve.told}<extra>{curve.label}</extra>",
    }  # fmt: skip
    if curve.alpha < 1.0:
        trace["opacity"] = curve.alpha
    if curve.beside is not None:
        trace["customdata"] = numbers(curve.beside[kept])
    if curve.look == "dots":
        trace["marker"] = {"color": curve.colour, "size": curve.width}
    elif curve.look == "bars":
        trace |= {"type": "bar", "marker": {"color": curve.colour}, "cliponaxis": False}
        del trace["mode"]
        if len(curve.x) <= _FEW:
            trace |= {"text": [f"{y:g}" for y in curve.y], "textposition": "outside"}
    else:
        held = {"shape": "vh"} if curve.look == "stairs" else {}
        held |= {"dash": "dash"} if curve.dashed else {}
        trace["line"] = {"color": curve.colour, "width": curve.width} | held
    if not curve.begins:
        return [trace]
    start = {
        "type": "scatter", "mode": "markers", "x": trace["x"][:1], "y": trace["y"][:1],
        "marker": {"color": curve.colour, "size": 9}, "name": "start", "showlegend": False,
        "legendgroup": curve.label, "hovertemplate": "start<extra></extra>",
    }  # fmt: skip
    return [trace, start]


def _kept(curve: Curve) -> Integers:
    """Points of a long curve that keep its look."""
    if curve.look in {"dots", "bars"}:
        return np.arange(len(curve.x), dtype=np.int64)
    if (np.diff(curve.x) >= 0.0).all():
        return thin(curve.y)
    return np.union1d(thin(curve.x, _PATH), thin(curve.y, _PATH))


def _add_wall(figure: dict[str, Any], panel: Panel) -> None:
    low = min(0.0, *(float(np.nanmin(curve.y)) for curve in panel.curves))
    high = max(float(np.nanmax(curve.y)) for curve in panel.curves)
    room = 0.05 * (high - low)
    wall = {
        "type": "rect", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": low - room,
        "y1": 0, "layer": "below", "fillcolor": WALL, "line": {"width": 0},
    }  # fmt: skip
    figure["layout"]["shapes"].append(wall)
    figure["layout"]["yaxis"]["range"] = numbers([low - room, high + room])


def _map(shown: Map) -> dict[str, Any]:
    units = [unit_of(title) for title in (shown.x, shown.y, shown.label)]
    heat = {
        "type": "heatmap",
        "x": numbers(shown.times),
        "y": numbers(shown.places),
        "z": [numbers(row, _MAP_DIGITS) for row in shown.values],
        "colorscale": "RdBu" if shown.signed else "Viridis",  # plotly's: red is high
        "zsmooth": "best",
        "colorbar": {"title": {"text": shown.label, "side": "right"}, "thickness": 14, "x": 1.05},
        "hovertemplate": f"t = %{{x:.6g}} {units[0]}<br>x = %{{y:.6g}} {units[1]}<br>"
        f"%{{z:.5g}} {units[2]}<extra></extra>",
        "showlegend": False,
    }
    if shown.signed:
        limit = limit_of(shown)
        heat |= {"zmin": -limit, "zmax": limit}
    touching = [trace | {"cliponaxis": False} for c in shown.touching for trace in _traces(c)]
    return over_time(shown.times, [heat, *touching], (shown.x, shown.y), showlegend=False)
