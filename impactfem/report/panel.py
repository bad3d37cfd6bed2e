"""What a panel shows, as data: pictures and the page are drawn from the same."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats, Integers
from impactfem.methods import METHODS
from impactfem.result import Record

BLUE, ORANGE, GREEN, GREY = "#0b559f", "#d95f02", "#1b7837", "#666666"
COLOURS = (BLUE, ORANGE, GREEN, "#7b3294", "#b2182b", GREY)
"""Colours of bodies, pairs and curves, one after the other."""
CONTACT, WALL, FAINT = "crimson", "#999999", "#bbbbbb"

_COLOURED = 0.99  # share of the values of a map within the colours

MOST_NAMES = 10
"""Curves up to which each has a name in the legend."""


@dataclass(frozen=True)
class Curve:
    """A curve, or dots.

    Attributes:
        label: Its name.
        x, y: Shape (points,).
        unit: Of y.
        colour: Of Matplotlib and CSS.
        look: "line"; "stairs", whose value at a point holds since the point before; "dots";
            "bars", from 0.
        width: Of the line or size of the dots [pt].
        alpha: 1 is opaque.
        named: Whether the legend has it.
        beside: What one who points at it is told besides, shape (points,); None: nothing.
        told: In words, with %{x}, %{y} and %{customdata} as plotly has them; None: x is a time.
        begins: Whether its first point has a dot.
        dashed: Whether it is a line of dashes.
    """

    label: str
    x: Floats
    y: Floats
    unit: str
    colour: str = BLUE
    look: Literal["line", "stairs", "dots", "bars"] = "line"
    width: float = 1.6
    alpha: float = 1.0
    named: bool = True
    beside: Floats | None = None
    told: str | None = None
    begins: bool = False
    dashed: bool = False


@dataclass(frozen=True)
class Panel:
    """Curves that share axes.

    Attributes:
        name: Short and unique, for files and anchors.
        title: What it is.
        caption: One sentence: what is seen and what to look for.
        curves: From the back to the front.
        y, x: Titles of the axes with their units.
        span: Ends of the horizontal axis; None: all of the curves.
        shaded: Intervals of it that are grey, as those of contact.
        log: Whether the vertical axis is logarithmic.
        equal: Whether both axes have one scale, as places in the plane.
        wall: Whether what lies below 0 is a wall.
        named: Whether there is a legend; None: of several curves.
        high: Whether it is higher than others.
        still: Whether it is a picture among the files of a result too.
    """

    name: str
    title: str
    caption: str
    curves: Sequence[Curve]
    y: str
    x: str = "time [s]"
    span: tuple[float, float] | None = None
    shaded: Sequence[Sequence[float]] = ()
    log: bool = False
    equal: bool = False
    wall: bool = False
    named: bool | None = None
    high: bool = False
    still: bool = True


@dataclass(frozen=True)
class Map:
    """A quantity over time and place.

    Attributes:
        name, title, caption: As those of a panel.
        times: [s], shape (times,).
        places: Increasing [m], shape (places,).
        values: Shape (places, times).
        label: Of the values, with their unit.
        y, x: Titles of the axes of places and times.
        signed: Whether colours tell both signs apart.
        touching: Curves where bodies touch.
        still: As that of a panel.
    """

    name: str
    title: str
    caption: str
    times: Floats
    places: Floats
    values: Floats
    label: str
    y: str
    signed: bool = False
    touching: Sequence[Curve] = ()
    still: bool = True
    x: str = "time [s]"


def colour(k: int) -> str:
    """Of the k-th body, pair or curve."""
    return COLOURS[k % len(COLOURS)]


def is_exact(summary: Mapping[str, Any]) -> bool:
    """Whether a run is itself an exact solution, by its summary."""
    known = METHODS.get(summary["method"])
    return known is not None and known.exact


def is_told(values: ArrayLike) -> bool:
    """Whether a column says anything: some value is finite and not 0."""
    column = np.asarray(values, dtype=np.float64)
    return bool((np.isfinite(column) & (column != 0.0)).any())


def evenly(count: int, most: int) -> Integers:
    """At most so many indices, ends included."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


def over_time(
    result: Record, name: str, title: str, caption: str, curves: Sequence[Curve], y: str,
    **more: Any,
) -> Panel:  # fmt: skip
    """A panel over the time of a run, with its contact; see `Panel`."""
    time, shaded = result.rows["time"].values, result.summary["contact"]["intervals"]
    span = float(time[0]), float(time[-1])
    return Panel(name, title, caption, curves, y, span=span, shaded=shaded, **more)


def limit_of(shown: Map) -> float:
    """End of the colours of both signs: one spot shall not spoil them."""
    sizes = np.abs(shown.values[np.isfinite(shown.values)])
    return float(np.quantile(sizes, _COLOURED)) if sizes.any() else 1.0
