"""Sweeps drawn: figures over what was varied, and sections as bifurcation diagrams."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.report.panel import colour
from impactfem.report.sheet import Sheet

if TYPE_CHECKING:
    from impactfem.studies.sweeping import Sweep

_SHOWN = ("max_force", "max_impulse", "error")
_MOST = 4  # panels


def sweep_figure(found: "Sweep") -> Figure:
    """Draw figures over the one key that was varied, of two keys as maps, of more by points."""
    known = {name: _numbers(found.column(name)) for name in (*found.asked.figures, *_SHOWN)}
    shown = {name: values for name, values in known.items() if np.isfinite(values).any()}
    shown = dict(list(shown.items())[:_MOST]) or {"wall_time": _numbers(found.column("wall_time"))}
    figure = Sheet(7.0, 1.0 + 2.6 * len(shown))
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    places = [_places(axis.values) for axis in found.axes]
    for k, (axes, (name, values)) in enumerate(zip(panels, shown.items(), strict=True)):
        if len(places) == 2:
            shape = len(places[0]), len(places[1])
            drawn = axes.pcolormesh(*places, values.reshape(shape).T, shading="nearest")
            figure.colorbar(drawn, ax=axes, label=name)
            axes.set_ylabel(found.axes[1].key)
        else:
            x = _numbers(found.column(found.axes[0].key), places[0], found.axes[0].values)
            style = ".-" if len(places) == 1 else "."
            for way, own in _ways(found, np.arange(len(x))).items():
                hue = colour(k + (way == "back")) if way else colour(k)
                axes.plot(x[own], values[own], style, color=hue, label=way)
            axes.set_ylabel(name)
    panels[-1].set_xlabel(found.axes[0].key)
    panels[0].set_title(found.title)
    if found.continued:
        panels[0].legend()
    return figure


def section_figure(found: "Sweep") -> Figure:
    """Draw a section over the first key: phases of impacts, or values of a column."""
    figure = Sheet(7.0, 4.8)
    axes = figure.add_subplot()
    rows = found.section_rows()
    impacts = found.asked.section == "impacts"
    x = _numbers([row[1] for row in rows], _places(found.axes[0].values), found.axes[0].values)
    y = _numbers([row[-2 if impacts else -1] for row in rows])
    for k, (way, own) in enumerate(_ways(found, np.array([row[0] for row in rows])).items()):
        axes.plot(x[own], y[own], ".", ms=1.5 + k, alpha=1.0 - 0.5 * k, color=colour(k), label=way)
    axes.set_xlabel(found.axes[0].key)
    axes.set_ylabel("phase of impact [s]" if impacts else str(found.asked.section))
    axes.set_title(found.title)
    if found.continued:
        axes.legend()
    return figure


def _ways(found: "Sweep", points: NDArray[np.int64]) -> dict[str, Any]:
    """Which of the points of rows lie on which way of a sweep that continues."""
    if not found.continued:
        return {"": slice(None)}
    ways = np.array(found.ways)
    return {way: ways[points] == way for way in ("there", "back")}


def _places(values: Sequence[Any]) -> Floats:
    """Where values are drawn: numbers where they are, others one after the other."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values, dtype=np.float64)
    return np.arange(len(values), dtype=np.float64)


def _numbers(
    column: Sequence[Any], places: Floats | None = None, values: Sequence[Any] = ()
) -> Floats:
    """A column as numbers, what is none as NaN; or where its values are drawn."""
    if places is not None:
        at: Mapping[str, float] = {str(v): float(p) for v, p in zip(values, places, strict=True)}
        return np.array([at[str(each)] for each in column], dtype=np.float64)
    return np.array([np.nan if each is None else float(each) for each in column], dtype=np.float64)
