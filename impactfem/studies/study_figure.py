"""The picture of a work-precision study: errors against time."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from impactfem.report.sheet import Sheet

_LEAST = 1e-12  # errors below this are rounding and shown here
_MARKS = "osD^vP*X<>"


type Points = Callable[[str, str], list[tuple[float, float]]]


def draw(title: str, methods: Sequence[str], peers: Sequence[str], points: Points) -> Figure:
    """Displacement and force error against time, side by side, all axes logarithmic.

    Args:
        title: What was studied.
        methods: Names of the lines.
        peers: Those of them that are others' methods.
        points: Times [ms] and errors by a method and the name of an error.
    """
    figure = Sheet(10.5, 5.0)
    axes = figure.subplots(1, 2, sharex=True)
    for ax, error, label in (
        (axes[0], "displacement_l2", "displacement, L2"),
        (axes[1], "force_l1", "contact force, L1"),
    ):
        _lines(ax, methods, peers, error, points)
        ax.set_ylabel(f"relative error of {label}")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(f"{title} (errors below {_LEAST:g} are shown there)")
    return figure


def _lines(
    axes: Axes, methods: Sequence[str], peers: Sequence[str], error: str, points: Points
) -> None:
    colour = 0
    for k, name in enumerate(methods):
        found = points(name, error)
        if not found:
            continue
        time, value = np.array(found).T
        peer = name in peers
        axes.loglog(
            time,
            np.maximum(value, _LEAST),
            marker=_MARKS[k % len(_MARKS)],
            markersize=5,
            label=name,
            linestyle="--" if peer else "-",
            linewidth=1.3,
            color=("black", "0.55", "0.3")[peers.index(name) % 3] if peer else f"C{colour}",
        )
        colour += not peer
    axes.yaxis.set_major_locator(LogLocator(numticks=9))
    axes.set_xlabel("time [ms]")
    axes.grid(visible=True, which="major", linewidth=0.3)
