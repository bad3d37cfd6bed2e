"""Pictures of a result: space-time map, position, contact force, energy, active-set history."""

from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import NonUniformImage

from impactfem.errors import SceneError
from impactfem.report.bar_row_figures import bar_row_painters
from impactfem.report.faults import Faults
from impactfem.report.sheet import Sheet, write_png
from impactfem.report.solid_figures import solid_painters
from impactfem.report.vibro_figures import vibro_painters
from impactfem.result import Fields, Record

_BLUE, _ORANGE, _GREEN, _GREY = "#0b559f", "#d95f02", "#1b7837", "0.45"
_MAX_LINES = 400  # samples along an axis that a picture can show


def painters(result: Record) -> dict[str, Callable[[], Figure | None]]:
    """What draws each figure that the result allows, by name; nothing is drawn yet."""
    own = (contact_force, energy)
    found: dict[str, Callable[[], Figure | None]]
    found = {painter.__name__: partial(_draw, painter, result) for painter in own}
    if result.scene.marches:
        return found | solid_painters(result)
    if result.scene.is_vibro:
        return found | vibro_painters(result)
    if result.scene.is_bar_row:
        return found | bar_row_painters(result)
    if result.fields is not None:
        found["displacement"] = partial(_draw, displacement, result)
        found["position"] = partial(_draw, position, result)
    if result.summary["active_set"]["set_changes"]:
        found["active_set"] = partial(_draw, active_set, result)
    return found


def draw_all(result: Record) -> dict[str, Figure]:
    """Draw every figure that the result allows, by name; no display is needed."""
    drawn = {name: paint() for name, paint in painters(result).items()}
    return {name: figure for name, figure in drawn.items() if figure is not None}


def draw_one(result: Record, name: str) -> Figure:
    """Draw one figure.

    Raises:
        SceneError: There is no such figure, or nothing finite to draw in it.
    """
    known = painters(result)
    if name not in known:
        near = get_close_matches(name, known, n=2, cutoff=0.4) or known
        raise SceneError(f'figure "{name}" is none of this result: give {" or ".join(near)}')
    figure = known[name]()
    if figure is None:
        raise SceneError(f'figure "{name}": nothing of the motion is finite; draw contact_force')
    return figure


def write_pictures(result: Record, folder: Path, faults: Faults) -> list[Path]:
    """Draw everything that the result allows, and write it one after the other.

    Args:
        result: What to draw.
        folder: Where.
        faults: Told of pictures that cannot be drawn.

    Returns:
        The paths.
    """
    paths = []
    for name, paint in (faults.guarded("pictures", lambda: painters(result)) or {}).items():
        path = folder / f"{name}.png"
        if faults.guarded(path.name, partial(_painted, paint, path), path):
            paths.append(path)
    return paths


def _painted(paint: Callable[[], Figure | None], path: Path) -> bool:
    figure = paint()
    if figure is not None:
        write_png(figure, path)
    return figure is not None


def write_all(figures: Mapping[str, Figure], folder: Path) -> list[Path]:
    """Write figures as NAME.png into a folder; returns the paths."""
    paths = []
    for name, figure in figures.items():
        path = folder / f"{name}.png"
        write_png(figure, path)
        paths.append(path)
    return paths


def _draw(painter: Callable[[Axes, Record], None], result: Record) -> Figure:
    figure = Sheet(7.0, 4.2)
    axes = figure.add_subplot()
    painter(axes, result)
    if result.summary["status"] != "completed":
        axes.set_title(f"{axes.get_title()}  [{result.summary['status']}]", color="crimson")
    return figure


def _time_label(axes: Axes, result: Record) -> None:
    axes.set_xlabel("time [s]")
    axes.set_xlim(0.0, float(result.rows["time"].values[-1]))


def displacement(axes: Axes, result: Record) -> None:
    """Displacement over time and position, with the contact line at the wall end."""
    fields = result.fields
    if not isinstance(fields, Fields):
        return
    t, x = _thin(len(fields.times)), _thin(len(fields.positions))
    values = fields.displacement[np.ix_(t, x)].T
    ends = fields.times[0], fields.times[-1], fields.positions[0], fields.positions[-1]
    image = NonUniformImage(axes, interpolation="bilinear", cmap="viridis", extent=ends)
    image.set_data(fields.times[t], fields.positions[x], values)
    axes.add_image(image)
    axes.set_ylim(ends[2], ends[3])
    axes.figure.colorbar(image, ax=axes, label="displacement u [m]")
    for first, last in result.summary["contact"]["intervals"]:
        axes.plot([first, last], [0.0, 0.0], color="crimson", linewidth=5, clip_on=False,
                  solid_capstyle="butt")  # fmt: skip
    _time_label(axes, result)
    axes.set_ylabel("position in the bar x [m]")
    axes.set_title(f"{result.scene.title}: displacement (red: contact)")


def position(axes: Axes, result: Record) -> None:
    """World lines of points of the bar, with the wall."""
    fields = result.fields
    if not isinstance(fields, Fields):
        return
    t = _thin(len(fields.times))
    nodes = np.unique(np.linspace(0, len(fields.positions) - 1, 11).astype(int))
    place = fields.positions + fields.displacement
    axes.fill_between(fields.times[t], place[t, 0], place[t, -1], color=_BLUE, alpha=0.12)
    for node in nodes:
        end = node in (nodes[0], nodes[-1])
        axes.plot(fields.times[t], place[t, node], color=_BLUE, linewidth=1.6 if end else 0.6)
    low = -0.06 * float(np.nanmax(place))
    axes.axhspan(low, 0.0, color=_GREY, alpha=0.5, hatch="//", linewidth=0)
    axes.set_ylim(bottom=low)
    _time_label(axes, result)
    axes.set_ylabel("distance from the wall [m]")
    axes.set_title(f"{result.scene.title}: points of the bar")


def contact_force(axes: Axes, result: Record) -> None:
    """Contact force of the run against the exact one."""
    if (exact := result.exact_rows) is not None:
        axes.plot(exact["time"].values, exact["contact_force"].values, color=_ORANGE,
                  linewidth=3.5, alpha=0.6, label="exact")  # fmt: skip
    time, force = result.rows["time"].values, result.rows["contact_force"].values
    # The force of row m holds during (t_{m-1}, t_m].
    axes.stairs(force[1:], time, baseline=None, color=_BLUE, linewidth=1.2,
                label=result.summary["method"])  # fmt: skip
    _time_label(axes, result)
    axes.set_ylabel("contact force [N]")
    axes.set_title(f"{result.scene.title}: contact force")
    if result.impacts is None:
        axes.legend(frameon=False)
        return
    axes.set_ylabel("force of lasting contact [N]", color=_BLUE)
    if len(result.impacts):
        right = axes.twinx()
        right.vlines(result.impacts.time, 0.0, result.impacts.impulse, color=_ORANGE, linewidth=0.9)
        right.set_ylim(bottom=0.0)
        axes.set_ylim(0.0, None if force.any() else 1.0)
        right.set_ylabel("impulse of an impact [N s]", color=_ORANGE)


def energy(axes: Axes, result: Record) -> None:
    """Kinetic, elastic, potential and total energy."""
    shown = (("kinetic", _BLUE), ("elastic", _ORANGE), ("potential", _GREEN))
    time = result.rows["time"].values
    for name, colour in shown:
        values = result.rows[f"{name}_energy"].values
        if np.any(values != 0.0):
            axes.plot(time, values, color=colour, label=name, linewidth=1.2)
    axes.plot(time, result.rows["total_energy"].values, color="black", label="total",
              linewidth=1.6)  # fmt: skip
    _time_label(axes, result)
    axes.set_ylabel("energy [J]")
    axes.set_title(f"{result.scene.title}: energy")
    axes.legend(frameon=False)


def active_set(axes: Axes, result: Record) -> None:
    """Changes of the active set after each iteration."""
    changes = np.asarray(result.summary["active_set"]["set_changes"])
    iterations = np.arange(1, len(changes) + 1)
    axes.bar(iterations, changes, color=_BLUE, width=0.6)
    if len(changes) <= 30:
        for k, change in zip(iterations, changes, strict=True):
            axes.annotate(str(change), (k, change), ha="center", va="bottom")
        axes.set_xticks(iterations)
    axes.set_xlim(0.0, len(changes) + 1.0)
    axes.set_yscale("symlog", linthresh=1.0)
    axes.yaxis.set_major_formatter("{x:g}")  # powers as text would load a parser of formulas
    axes.set_ylim(0.0, 2.0 * max(1, changes.max()))
    axes.set_xlabel("iteration")
    axes.set_ylabel("intervals that changed side")
    axes.set_title(f"{result.scene.title}: {result.summary['active_set']['message']}")


def _thin(count: int) -> np.ndarray:
    """At most `_MAX_LINES` indices, ends included."""
    return np.unique(np.linspace(0, count - 1, min(count, _MAX_LINES)).astype(int))
