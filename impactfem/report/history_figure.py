"""Columns of a history over time: those of one unit share axes, labels carry the units."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from impactfem.errors import SceneError
from impactfem.report.prefixes import prefix_ticks
from impactfem.report.sheet import Sheet
from impactfem.result import Record
from impactfem.result.table import Series, Table
from impactfem.scene.nearest import meant
from impactfem.scene.values import show

DEFAULT = ("gap", "contact_force", "kinetic_energy", "elastic_energy", "total_energy")
"""Columns that are drawn if none are named."""

_QUANTITIES: Mapping[str, str] = {
    "m": "length", "m/s": "velocity", "N": "force", "J": "energy", "kg m/s": "momentum",
    "1": "number",
}  # fmt: skip
_LEGEND = 12  # curves up to which each has a name
_LONGEST = 42  # letters of a label before it is wrapped


def plot_history(result: Record, *names: str) -> Figure:
    """Draw columns of the history; see `Result.plot_history`."""
    history = result.rows
    groups: dict[str, list[str]] = {}
    for name in dict.fromkeys(names or DEFAULT):
        unit = str(_column(history, name).attrs.get("units", ""))
        groups.setdefault(unit, []).append(name)
    figure = Sheet(7.0, 1.2 + 2.2 * len(groups))
    panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (unit, group) in zip(panels, groups.items(), strict=True):
        _draw(axes, unit, history, group)
    times = history["time"].values
    panels[-1].set_xlim(float(times[0]), float(times[-1]))
    prefix_ticks(panels[-1].xaxis, _label(history, "time"))
    panels[0].set_title(result.scene.title)
    return figure


def _column(history: Table, name: str) -> Series:
    known = list(history.data_vars)
    if name not in known:
        raise SceneError(f"history has no column {show(name)}; {meant(name, known)}")
    return history[name]


def _draw(axes: Axes, unit: str, history: Table, names: list[str]) -> None:
    time = history["time"].values
    for name in names:
        column = history[name]
        # The force of row m is that during (t_{m-1}, t_m].
        held = unit == "N" or name == "active"
        values = column.values.astype(float)
        label = str(column.attrs.get("long_name", name))
        if held:
            first = np.concatenate([values[1:2], values[1:]])
            axes.step(time, first, where="pre", label=label, linewidth=1.2)
        else:
            axes.plot(time, values, label=label, linewidth=1.2)
    if len(names) == 1:
        prefix_ticks(axes.yaxis, _label(history, names[0]))
        return
    prefix_ticks(axes.yaxis, f"{_QUANTITIES.get(unit, '')} [{unit}]".strip())
    if len(names) <= _LEGEND:
        axes.legend(frameon=False, fontsize="small")


def _label(history: Table, name: str) -> str:
    """Long name with the unit; the name alone if it has none."""
    told = str(history[name].attrs.get("long_name", name))
    unit = str(history[name].attrs.get("units", ""))
    space = "\n" if len(told) > _LONGEST else " "
    return f"{told}{space}[{unit}]" if unit else told
