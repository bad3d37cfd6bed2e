"""All pictures of a result: its panels, and the bodies as they move."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from impactfem.errors import SceneError
from impactfem.report.faults import Faults
from impactfem.report.panel import Map, Panel
from impactfem.report.panel_figure import panel_figure
from impactfem.report.panels import panels
from impactfem.report.sheet import write_png
from impactfem.report.solid_figures import body
from impactfem.result import Record
from impactfem.scene.nearest import meant
from impactfem.scene.values import show


def painters(result: Record) -> dict[str, Callable[[], Figure | None]]:
    """What draws each figure that the result allows, by name; nothing is drawn yet."""
    found: dict[str, Callable[[], Figure | None]] = {
        panel.name: partial(_draw, result, panel)
        for panel in (make() for make in panels(result).values())
        if panel is not None and panel.still
    }
    if result.fields is not None and result.scene.dim > 1:
        found["body"] = partial(body, result)
    return found


def _draw(result: Record, panel: Panel | Map) -> Figure:
    return panel_figure(result, panel)


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
        raise SceneError(f"figure {show(name)} is none of this result; {meant(name, known)}")
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
