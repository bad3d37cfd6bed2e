"""The picture of a work-precision study: errors against time."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from impactfem.report.sheet import Sheet

if TYPE_CHECKING:
    from impactfem.studies.study import Study

_LEAST = 1e-12  # errors below this are rounding and shown here
_MARKS = "osD^vP*X<>"


def draw(study: "Study") -> Figure:
    """Displacement and force error against time, side by side, all axes logarithmic."""
    figure = Sheet(10.5, 5.0)
    axes = figure.subplots(1, 2, sharex=True)
    for ax, error, label in (
        (axes[0], "displacement_l2", "displacement, L2"),
        (axes[1], "force_l1", "contact force, L1"),
    ):
        _lines(ax, study, error)
        ax.set_ylabel(f"relative error of {label}")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(f"{study.title} (errors below {_LEAST:g} are shown there)")
    return figure


def _lines(axes: Axes, study: "Study", error: str) -> None:
    colour = 0
    for k, name in enumerate(study.methods):
        points = [
            (1e3 * row.seconds, max(getattr(row, error), _LEAST))
            for row in study.rows
            if row.method == name and row.seconds and getattr(row, error) is not None
        ]
        if not points:
            continue
        time, value = np.array(points).T
        peer = name in study.baselines
        axes.loglog(
            time,
            value,
            marker=_MARKS[k % len(_MARKS)],
            markersize=5,
            label=name,
            linestyle="--" if peer else "-",
            linewidth=1.3,
            color=("black", "0.55", "0.3")[study.baselines.index(name) % 3]
            if peer
            else f"C{colour}",
        )
        colour += not peer
    axes.yaxis.set_major_locator(LogLocator(numticks=9))
    axes.set_xlabel("time [ms]")
    axes.grid(visible=True, which="major", linewidth=0.3)
