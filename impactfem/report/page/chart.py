"""A chart of the page as plain data for plotly.js, and what charts have in common."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Integers

type Trace = dict[str, Any]
type Spans = Sequence[Sequence[float]]

MOST_POINTS = 4000
"""Points of a trace at most."""
DIGITS = 7
"""Significant digits of the numbers in the page."""

MOST_SPANS = 60
"""Contact intervals up to which they are shaded."""

_HEIGHT = 340  # of a chart [px]


@dataclass(frozen=True)
class Chart:
    """A chart.

    Attributes:
        name: Short and unique, for anchors.
        title: What it is.
        caption: One sentence: what is seen and what to look for.
        figure: ``{"data": [...], "layout": {...}}`` for plotly.js, plain data without NaN.
    """

    name: str
    title: str
    caption: str
    figure: dict[str, Any]


def thin(values: ArrayLike, most: int = MOST_POINTS) -> Integers:
    """Choose points of a long curve that keep its look: the extremes of each part and both ends.

    Args:
        values: Shape (rows,), finite or not.
        most: Points at most, from 4 on.

    Returns:
        Indices, increasing.
    """
    curve = np.asarray(values, dtype=np.float64)
    count = len(curve)
    if count <= most:
        return np.arange(count, dtype=np.int64)
    width = math.ceil(count / (most // 2 - 1))
    parts = math.ceil(count / width)
    found = [np.array([0, count - 1])]
    for beyond, choose in ((np.inf, np.argmin), (-np.inf, np.argmax)):
        padded = np.full(parts * width, beyond)
        padded[:count] = np.where(np.isfinite(curve), curve, beyond)
        found.append(choose(padded.reshape(parts, width), axis=1) + width * np.arange(parts))
    chosen = np.unique(np.concatenate(found)).astype(np.int64)
    return chosen[chosen < count]


def numbers(values: ArrayLike, digits: int = DIGITS) -> list[float | None]:
    """Plain numbers with some significant digits; None where they are not finite."""
    form = f".{digits}g"
    return [
        float(format(value, form)) if math.isfinite(value) else None
        for value in np.asarray(values, dtype=np.float64).ravel().tolist()
    ]


def axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis with its title, unit included."""
    return {
        "title": {"text": title, "standoff": 10},
        "zeroline": False,
        "gridcolor": "#e6e6e6",
        "linecolor": "#999999",
        "ticks": "outside",
        "automargin": True,
        "exponentformat": "power",
    } | more


def layout(x: dict[str, Any], y: dict[str, Any], **more: Any) -> dict[str, Any]:
    """The layout that all charts share."""
    return {
        "xaxis": x,
        "yaxis": y,
        "height": _HEIGHT,
        "autosize": True,
        "margin": {"l": 70, "r": 40, "t": 30, "b": 50},
        "modebar": {"orientation": "v", "bgcolor": "rgba(0,0,0,0)"},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": "#222222"},
        "hovermode": "closest",
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
    } | more


def over_time(
    time: ArrayLike, traces: Iterable[Trace], titles: Sequence[str], spans: Spans = (), **more: Any
) -> dict[str, Any]:
    """A figure of curves over time.

    Args:
        time: In the unit of its axis, for the range of this.
        traces: The curves.
        titles: Of the axes of time and of the values, with their units.
        spans: Intervals to shade, such as those of contact; none if there are too many.
        more: Further keys of the layout; ``yaxis`` is merged.
    """
    data = list(traces)
    start, *_, end = numbers(np.asarray(time)[[0, -1]])
    x = axis(titles[0], range=[start, end])
    vertical = axis(titles[1]) | more.pop("yaxis", {})
    shapes = []
    if 0 < len(spans) <= MOST_SPANS:
        shapes = [
            {
                "type": "rect", "xref": "x", "yref": "paper", "x0": first, "x1": last, "y0": 0,
                "y1": 1, "layer": "below", "fillcolor": "#eeeeee",
                "line": {"width": 0.5, "color": "#dddddd"},
            }
            for first, last in (numbers(span) for span in spans)
        ]  # fmt: skip
    legend = {"showlegend": len(data) > 1}
    return {"data": data, "layout": layout(x, vertical, shapes=shapes, **(legend | more))}
