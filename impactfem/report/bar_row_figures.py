"""Pictures of bars in a row: world lines with contacts, forces of pairs, velocities of bars."""

from collections.abc import Callable
from functools import partial

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from impactfem.report.sheet import Sheet
from impactfem.result import Fields, Record

_CONTACT, _GREY = "crimson", "0.45"
_MAX_LINES = 400  # samples along an axis that a picture can show
_POINTS = 6  # points of each bar whose world lines are drawn
_SHARE = 0.6  # of the length of all bars that their motion may take in a picture
_LEGEND = 10  # curves up to which each has a name of its own


def bar_row_painters(result: Record) -> dict[str, Callable[[], Figure]]:
    """What draws every figure that the result of a row of bars allows, by name."""
    found = {"forces": partial(_draw, forces, result)}
    found["velocities"] = partial(_draw, velocities, result)
    if result.fields is not None:
        found["world_lines"] = partial(_draw, world_lines, result, 5.4)
    return dict(found)


def _draw(painter: Callable[[Axes, Record], None], result: Record, height: float = 4.2) -> Figure:
    figure = Sheet(7.0, height)
    axes = figure.add_subplot()
    painter(axes, result)
    axes.set_xlabel("time [s]")
    axes.set_xlim(0.0, float(result.rows["time"].values[-1]))
    axes.ticklabel_format(axis="x", scilimits=(-2, 4))
    if result.summary["status"] != "completed":
        axes.set_title(f"{axes.get_title()}  [{result.summary['status']}]", color=_CONTACT)
    return figure


def world_lines(axes: Axes, result: Record) -> None:
    """Points of all bars over time, their contacts as thick lines, and the wall if there is one.

    Stiff bars move by far less than their length: their motion and the gaps between them are
    magnified alike, so that bars that touch do so in the picture too.
    """
    fields, scene = result.fields, result.scene
    if not isinstance(fields, Fields) or fields.counts is None:
        return
    place, factor = magnified(fields)
    t = np.unique(np.linspace(0, len(fields.times) - 1, min(len(fields.times), _MAX_LINES)))
    rows = t.astype(int)
    starts = np.cumsum([0, *fields.counts])
    colours = _colours(len(fields.counts))
    for k, colour in enumerate(colours):
        first, last = starts[k], starts[k + 1] - 1
        axes.fill_between(
            fields.times[rows], place[rows, first], place[rows, last], color=colour, alpha=0.15,
            linewidth=0,
        )  # fmt: skip
        for node in np.unique(np.linspace(first, last, _POINTS).astype(int)):
            width = 1.4 if node in (first, last) else 0.5
            axes.plot(fields.times[rows], place[rows, node], color=colour, linewidth=width)
        middle = 0.5 * (place[0, first] + place[0, last])
        if len(colours) <= _LEGEND:
            axes.annotate(scene.bars[k].name, (0.0, middle), xytext=(4, 0), va="center",
                          textcoords="offset points", color=colour, fontsize=9)  # fmt: skip
    offset = 0 if scene.obstacles else 1
    for pair, figures in enumerate(result.summary["contact"]["pairs"]):
        end = place[:, starts[pair + offset]]
        for begin, stop in figures["intervals"]:
            times = np.linspace(begin, stop, 60)
            axes.plot(
                times, np.interp(times, fields.times, end), color=_CONTACT, linewidth=3.0,
                solid_capstyle="butt",
            )  # fmt: skip
    axes.plot([], [], color=_CONTACT, linewidth=3.0, label="contact")
    if scene.obstacles:
        low = min(0.0, float(np.nanmin(place))) - 0.04 * float(np.nanmax(place))
        axes.axhspan(low, 0.0, color=_GREY, alpha=0.5, hatch="//", linewidth=0)
        axes.set_ylim(bottom=low)
    motion = f", motion and gaps x {factor:g}" if factor > 1.0 else ""
    axes.set_ylabel(f"place on the axis [m]{motion}")
    axes.set_title(f"{scene.title}: points of the bars")
    axes.legend(loc="lower right", framealpha=0.9)


def forces(axes: Axes, result: Record) -> None:
    """Force of each pair, that of the run as steps and the exact one as a broad line behind."""
    time, exact = result.rows["time"].values, result.exact_rows
    names = [name for name in result.rows.data_vars if name.startswith("force.")]
    for name, colour in zip(names, _colours(len(names)), strict=True):
        column = result.rows[name]
        if exact is not None and result.summary["method"] != "exact":
            axes.plot(exact["time"].values, exact[name].values, color=colour, linewidth=4.0,
                      alpha=0.35)  # fmt: skip
        label = column.attrs["label"] if len(names) <= _LEGEND else None
        if exact is not None and result.summary["method"] == "exact":
            axes.plot(exact["time"].values, exact[name].values, color=colour, label=label)
        else:
            axes.stairs(column.values[1:], time, baseline=None, color=colour, linewidth=1.2,
                        label=label)  # fmt: skip
    if exact is not None and result.summary["method"] != "exact":
        axes.plot([], [], color=_GREY, linewidth=4.0, alpha=0.35, label="exact")
    axes.set_ylabel("pressing force [N]")
    axes.set_title(f"{result.scene.title}: forces between neighbours")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False)


def velocities(axes: Axes, result: Record) -> None:
    """Velocity of the centre of mass of each bar."""
    bars = result.scene.bars
    for bar, colour in zip(bars, _colours(len(bars)), strict=True):
        label = bar.name if len(bars) <= _LEGEND else None
        axes.plot(result.rows["time"].values, result.rows[f"{bar.name}.vx"].values, color=colour,
                  linewidth=1.4, label=label)  # fmt: skip
    axes.set_ylabel("velocity of the centre of mass [m/s]")
    axes.set_title(f"{result.scene.title}: velocities of the bars")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False)


def magnified(
    fields: Fields, levels: NDArray[np.int64] | None = None
) -> tuple[NDArray[np.float64], float]:
    """Places of all nodes with magnified motion, and the factor.

    Args:
        fields: The motion.
        levels: Which of the kept levels; all if None.
    """
    counts = np.array(fields.counts or (len(fields.positions),))
    lengths = fields.positions[np.cumsum(counts) - 1]
    # Places if all bars touched, the first one at 0.
    stacked = fields.positions + np.repeat(np.cumsum(lengths) - lengths, counts)
    displacement = fields.displacement if levels is None else fields.displacement[levels]
    motion = fields.positions + displacement - stacked
    span = float(np.nanmax(motion) - np.nanmin(motion))
    factor = 1.0
    if 0.0 < span < _SHARE * lengths.sum():
        room = _SHARE * float(lengths.sum()) / span
        decade = 10.0 ** np.floor(np.log10(room))
        factor = float(max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= room))
    return stacked + factor * motion, factor


def _colours(count: int) -> NDArray[np.float64]:
    """Colours from dark to light, one for each of the neighbours in a row."""
    return np.asarray(mpl.colormaps["viridis"](np.linspace(0.0, 0.85, max(count, 1))))
