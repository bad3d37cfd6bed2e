"""Snapshots of bodies in the plane and in space, and what survey they need."""

from collections.abc import Iterable
from dataclasses import replace
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from impactfem.arrays import Floats
from impactfem.report.camera import Camera
from impactfem.report.marks import Marks
from impactfem.report.page.numbers import quantity
from impactfem.report.painter import Painter
from impactfem.report.palette import FORCE, HELD, PRESSURE, STRESS
from impactfem.report.plane_picture import WIDEST, PlanePainter
from impactfem.report.prefixes import prefix_ticks, prefixed_unit
from impactfem.report.pressure_maps import draw_pressure_maps
from impactfem.report.relief import relief_of
from impactfem.report.sheet import Sheet
from impactfem.report.skin import Skin, Snapshot, spread, union
from impactfem.report.space_picture import SpacePainter, skin_of
from impactfem.report.telling import telling_snapshots
from impactfem.result import Record, Snapshots
from impactfem.result.whole import Whole
from impactfem.scene import Scene
from impactfem.scene.pairing import self_meeting

_FAR = 2.5  # a body that moves farther than so many of its sizes is followed
_FLASHED, _FLASHES = 5.0, 14  # sizes from which it is drawn as by flashes, and how many

_COLOURED = 0.99  # share of the nodes below the end of the colours
_LETTERS = 11  # of a title for each inch
_TENSE = 0.5  # share of the largest stress that all have, from which the colours begin there

LABEL = "von Mises stress [Pa]"
"""Label of the colours."""
SCALE = "Colours: one scale for all times, which ends at the 99th percentile"
"""What is said of them."""
FLAT = 0.3
"""Height over width of a picture below which panels stand one above the other."""


def survey(
    result: Record, skin: Skin, snapshots: Iterable[Snapshot]
) -> tuple[Painter, list[Floats]]:
    """Look at some snapshots, one at a time.

    Returns:
        A painter with colours that suit them, and the extent of the body in each that is finite.
    """
    painter = _painter(result, skin)
    marks = Marks.of(result.scene, skin)
    stress, least, pressure, force, extents, places = 0.0, np.inf, 0.0, 0.0, [], list[Floats]()
    for snapshot in snapshots:
        if snapshot.is_finite:
            if skin.is_stressed.any():  # a spot at the edge of contact would spoil the colours
                seen = snapshot.von_mises[skin.nodes][skin.is_stressed[skin.nodes]]
                stress = max(stress, float(np.quantile(seen, _COLOURED)))
                least = min(least, float(np.quantile(seen, 1.0 - _COLOURED)))
            pressure = max(pressure, float(snapshot.pressure.max()))
            force = max(force, snapshot.largest_force)
            extents.append(painter.extent(snapshot))
            marks = marks.seen(skin, snapshot)
            places += [snapshot.place.min(axis=0), snapshot.place.max(axis=0)]
    if extents and not len(skin.triangles):
        skin = replace(skin, span=float(np.ptp(union(extents, 0.0), axis=1).max()))
    if pressure > 0.0 and skin.dim == 2 and _are_pressures(result.scene):
        force = 0.0  # the pressure is drawn: no force twice
    ends = least if stress * _TENSE < least < stress else 0.0, stress or 1.0
    if isinstance(painter, SpacePainter) and spread(extents) > _FLASHED * skin.size:
        middle = 0.5 * (np.min(places, axis=0) + np.max(places, axis=0))
        painter = replace(painter, ground=(middle, 0.8 * spread(extents)))
    found = replace(painter, skin=skin, stress=ends, pressure=pressure, force=force, marks=marks)
    return found, extents


def _are_pressures(scene: Scene) -> bool:
    """Whether all contact forces are pressures on solids, without friction."""
    return len(scene.solids) == len(scene.bodies) and not any(
        contact.friction_coefficient for contact in scene.contacts
    )


def _painter(result: Record, skin: Skin) -> Painter:
    if skin.dim == 2:
        turned = any(solid.is_axisymmetric for solid in result.scene.solids)
        several = len(result.scene.bodies) > 1 or bool(self_meeting(result.scene))
        return PlanePainter(skin, result.scene.obstacles, axisymmetric=turned, several=several)
    return SpacePainter(skin, result.scene.obstacles, Camera.of(result.scene))


def body(result: Record) -> Figure | None:
    """Snapshots of the deformed body with its obstacles, true to scale; None if nothing can be."""
    if result.fields is None:
        return None
    skin = drawn_skin(result, result.fields)
    snapshots = telling_snapshots(result, skin, 6 if skin.dim == 2 else 4)
    if not snapshots:
        return None
    painter, extents = survey(result, skin, snapshots)
    window = painter.window(extents)
    far = float(np.ptp(window, axis=1).max()) / painter.skin.size
    if far > _FLASHED and not any(obstacle.moves for obstacle in result.scene.obstacles):
        return _flashes(result, skin)
    return _row(result, painter, snapshots, extents, None if far > _FAR else window)


def _flashes(result: Record, skin: Skin) -> Figure:
    """One picture of what moves far, as if lit by flashes."""
    snapshots = telling_snapshots(result, skin, _FLASHES)
    painter, extents = survey(result, skin, snapshots)
    painter, window = replace(painter, force=0.0), painter.window(extents)
    clock = prefixed_unit("s", snapshots[-1].time)
    aspect = float(np.ptp(window[1]) / np.ptp(window[0]))
    width = float(np.clip(8.0 / aspect, 4.5, 10.0))
    figure = Sheet(width, float(np.clip(width * aspect + 1.0, 3.2, 9.0)))
    axes = figure.add_subplot()
    painter.prepare(axes, window, 0.0)
    for snapshot, extent in zip(snapshots, extents, strict=True):
        painter.draw(axes, snapshot)
        axes.annotate(
            clock.text(snapshot.time, 3), (float(extent[0].mean()), float(extent[1, 1])),
            (0, 2), textcoords="offset points", ha="center", fontsize=7, zorder=5,
        )  # fmt: skip
    _complete(figure, result, painter, [axes], f"at {len(snapshots)} times")
    return figure


def _row(
    result: Record,
    painter: Painter,
    snapshots: list[Snapshot],
    extents: list[Floats],
    window: Floats | None,
) -> Figure:
    """A panel for each snapshot, all of the same window, or each around its bodies if None."""
    skin, count = painter.skin, len(snapshots)
    clock = prefixed_unit("s", snapshots[-1].time)
    maps = skin.dim == 3 and painter.pressure > 0.0
    aspect = 1.0 if window is None else float(np.ptp(window[1]) / np.ptp(window[0]))
    side_by_side = aspect > 1.8 or (aspect > 1.2 and count == 4) or maps
    columns = count if side_by_side else min(2 if count == 4 else 3, count)
    if aspect < FLAT and not maps:
        columns = 1
    rows = -(-count // columns)
    width = min(12.0, 3.4 * columns) if columns > 1 else 9.0
    stressed = bool(skin.is_stressed.any())  # then colours have a bar beside the panels
    height = (width - 1.5 * stressed) / columns * (aspect * rows + maps) + 0.3 * rows + 1.0
    figure = Sheet(width, float(np.clip(height, 3.2, 11.0)))
    grid = figure.subplots(rows + maps, columns, squeeze=False)
    panels = list(grid[:rows].ravel())
    for axes, snapshot, extent in zip(panels, snapshots, extents, strict=False):
        shown = _square(painter.window([extent])) if window is None else window
        painter.prepare(axes, shown, snapshot.time)
        painter.draw(axes, snapshot)
        axes.set_title(f"t = {clock.text(snapshot.time, 4)}", fontsize=10)
        if window is not None:
            axes.label_outer()
    for axes in panels[count:]:
        axes.set_visible(False)
    if maps:
        closed = Skin.of(skin.fields, Whole.of_summary(result.summary))
        draw_pressure_maps(
            figure, list(grid[rows]), closed, snapshots, painter.pressure,
            [body.name for body in result.scene.bodies],
            result.summary.get("details", {}).get("carriers", {}).values(),
        )  # fmt: skip
    _complete(figure, result, painter, panels, "", areas=not maps)
    return figure


def _complete(
    figure: Figure, result: Record, painter: Painter, panels: list[Axes], when: str, *,
    areas: bool = True,
) -> None:  # fmt: skip
    """The bar of the colours, what marks say, and the title."""
    stressed = bool(painter.skin.is_stressed.any())
    if stressed:
        colours = ScalarMappable(Normalize(*painter.stress), STRESS)
        # Ticks that do not depend on the bar's length: the layout measures them once.
        ticks = MaxNLocator(6, steps=(1, 2, 5, 10))
        bar = figure.colorbar(colours, ax=panels, shrink=0.9, ticks=ticks)
        prefix_ticks(bar.ax.yaxis, LABEL)
    keys = _keys(painter, areas=areas)
    if keys or stressed:
        title = SCALE if stressed else None
        figure.legend(handles=keys, loc="outside lower center", frameon=False, title=title)
    what = "bodies" if len(result.scene.bodies) > 1 else "body"
    what = f"deformed {what}" if result.scene.meshed else what
    what = f"{what} {when}".strip()
    title = _title(result, f"{what}, {scale_of(painter.skin)}")
    figure.suptitle(fill(title, round(_LETTERS * figure.get_figwidth())), fontsize=11)


def drawn_skin(result: Record, fields: Snapshots) -> Skin:
    """The skin of still pictures and films: of a plate with its deflection magnified."""
    skin = skin_of(result, fields)
    return replace(skin, relief=relief_of(result.scene, skin) if skin.dim == 3 else None)


def scale_of(skin: Skin) -> str:
    """What is said of the scale."""
    if skin.relief is None:
        return "true to scale"
    return f"deflection and gaps magnified {skin.relief.factor:g} times"


def _keys(painter: Painter, *, areas: bool) -> list[Patch | Line2D]:
    """What pressures, if they are drawn as areas or lines, and arrows say."""
    keys: list[Patch | Line2D] = []
    if painter.pressure > 0.0 and areas:
        most = quantity(painter.pressure, "Pa", 4)
        label = f"contact pressure, at most {most}"
        key: Patch | Line2D = Patch(color=PRESSURE, label=label)
        if isinstance(painter, PlanePainter) and painter.several:
            label = f"contact pressure by the width of the line, at most {most}"
            key = Line2D([], [], color=PRESSURE, linewidth=WIDEST, label=label)
        keys.append(key)
    if painter.force > 0.0:
        keys.append(Line2D([], [], color=FORCE, marker=">", label=forces_key(painter)))
    return keys + _marks_keys(painter.marks)


def _marks_keys(marks: Marks) -> list[Patch | Line2D]:
    """What the marks of joints and supports say."""
    keys: list[Patch | Line2D] = []
    for grounded, label in ((False, "joint"), (True, "joint to the ground")):
        if any(pin.grounded is grounded for pin in marks.pins):
            face = HELD if grounded else "white"
            keys.append(Line2D([], [], color=HELD, marker="o", markerfacecolor=face,
                               linestyle="none", label=label))  # fmt: skip
    if marks.held.any():
        keys.append(Line2D([], [], color=HELD, linewidth=3.0, label="held"))
    return keys


def forces_key(painter: Painter) -> str:
    """What the arrows of pictures say."""
    return f"contact forces, the longest arrow {quantity(painter.force, 'N', 4)}"


def _square(window: Floats) -> Floats:
    middle, half = window.mean(axis=1), 0.5 * np.ptp(window, axis=1).max()
    return np.stack([middle - half, middle + half], axis=1)


def _title(result: Record, what: str) -> str:
    status = result.summary["status"]
    return f"{result.scene.title}: {what}" + (f"  [{status}]" if status != "completed" else "")
