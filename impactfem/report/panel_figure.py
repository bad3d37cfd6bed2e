"""Panels drawn by Matplotlib."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import NonUniformImage

from impactfem.report.panel import WALL, Curve, Map, Panel, limit_of
from impactfem.report.plane_picture import draw_obstacles
from impactfem.report.prefixes import prefix_ticks
from impactfem.report.sheet import Sheet
from impactfem.result import Record

_MOST_SPANS = 60  # contact intervals up to which they are shaded
_ROOM = 0.06  # of the extent, that is left free
_FEW = 30  # bars up to which each has its number


def panel_figure(result: Record, panel: Panel | Map) -> Figure:
    """A sheet with one panel."""
    figure = Sheet(7.0, 5.4 if isinstance(panel, Panel) and panel.high else 4.2)
    axes = figure.add_subplot()
    axes.set_title(f"{result.scene.title}: {panel.title[0].lower()}{panel.title[1:]}")
    if result.summary["status"] != "completed":
        axes.set_title(f"{axes.get_title()}  [{result.summary['status']}]", color="crimson")
    if isinstance(panel, Map):
        _draw_map(axes, panel)
    else:
        draw_panel(axes, panel)
        if panel.equal:  # places in the plane, with what stands there
            draw_obstacles(axes, result.scene.obstacles, 0.0)
    return figure


def draw_panel(axes: Axes, panel: Panel) -> None:
    """Draw the curves of a panel, with its axes and legend."""
    for curve in panel.curves:
        _draw(axes, curve)
    for first, last in panel.shaded if len(panel.shaded) <= _MOST_SPANS else ():
        axes.axvspan(first, last, color="0.93", linewidth=0, zorder=0)
    if panel.log:
        axes.set_yscale("log")
    if panel.span is not None:
        axes.set_xlim(*panel.span)
    if panel.equal:
        _fit(axes, panel)
    if panel.wall:
        low = min(0.0, *(float(np.nanmin(curve.y)) for curve in panel.curves))
        low -= _ROOM * (axes.get_ylim()[1] - low)
        axes.axhspan(low, 0.0, color=WALL, alpha=0.6, hatch="//", linewidth=0)
        axes.set_ylim(bottom=low)
    prefix_ticks(axes.xaxis, panel.x)
    prefix_ticks(axes.yaxis, panel.y)
    named = len(panel.curves) > 1 if panel.named is None else panel.named
    if named and axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False)


def _draw(axes: Axes, curve: Curve) -> None:
    style: dict[str, Any] = {
        "color": curve.colour, "alpha": curve.alpha,
        "label": curve.label if curve.named else None,
    }  # fmt: skip
    if curve.look == "stairs":
        dash = "--" if curve.dashed else "-"
        axes.stairs(
            curve.y[1:], curve.x, baseline=None, linewidth=curve.width, linestyle=dash, **style
        )
    elif curve.look == "dots":
        axes.plot(curve.x, curve.y, ".", markersize=curve.width, **style)
    elif curve.look == "bars":
        axes.bar(curve.x, curve.y, width=0.6, **style)
        axes.set_yscale("symlog", linthresh=1.0)
        axes.yaxis.set_major_formatter("{x:g}")  # powers as text would load a parser of formulas
        axes.set_ylim(0.0, 2.0 * max(1.0, float(curve.y.max())))
        for x, y in zip(curve.x, curve.y, strict=True) if len(curve.x) <= _FEW else ():
            axes.annotate(f"{y:g}", (x, y), ha="center", va="bottom")
    else:
        axes.plot(curve.x, curve.y, linewidth=curve.width, solid_capstyle="butt", **style)
    if curve.begins:
        axes.plot(curve.x[:1], curve.y[:1], "o", color=curve.colour, markersize=5)


def _fit(axes: Axes, panel: Panel) -> None:
    """Limits that show all curves at one scale."""
    x, y = (np.concatenate([getattr(curve, name) for curve in panel.curves]) for name in "xy")
    spans = [(float(np.nanmin(part)), float(np.nanmax(part))) for part in (x, y)]
    room = _ROOM * max(high - low for low, high in spans)
    axes.set_xlim(spans[0][0] - room, spans[0][1] + room)
    axes.set_ylim(spans[1][0] - room, spans[1][1] + room)
    axes.set_aspect("equal")


def _draw_map(axes: Axes, shown: Map) -> None:
    ends = shown.times[0], shown.times[-1], shown.places[0], shown.places[-1]
    colours = "coolwarm" if shown.signed else "viridis"
    image = NonUniformImage(axes, interpolation="bilinear", cmap=colours, extent=ends)
    image.set_data(shown.times, shown.places, shown.values)
    if shown.signed:
        most = limit_of(shown)
        image.set_clim(-most, most)
    axes.add_image(image)
    axes.set_xlim(*ends[:2])
    axes.set_ylim(*ends[2:])
    prefix_ticks(axes.figure.colorbar(image, ax=axes).ax.yaxis, shown.label)
    for curve in shown.touching:
        axes.plot(curve.x, curve.y, color=curve.colour, linewidth=5, clip_on=False,
                  solid_capstyle="butt")  # fmt: skip
    prefix_ticks(axes.xaxis, shown.x)
    prefix_ticks(axes.yaxis, shown.y)
