"""Pictures of a solid's motion: snapshots of the body, and its centre of mass over time."""

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from impactfem.report.plane_picture import PRESSURE, PlanePainter
from impactfem.report.skin import Skin, Snapshot, normals
from impactfem.report.space_picture import SpacePainter
from impactfem.result import Result, SolidFields

if TYPE_CHECKING:
    from impactfem.scene import Solid

Floats = NDArray[np.float64]
type Painter = PlanePainter | SpacePainter

_BLUE, _ORANGE = "#0b559f", "#d95f02"
_FAR = 2.5  # a body that moves farther than so many of its sizes is followed
_PRESSURES = "YlOrBr"

FLAT = 0.3
"""Height over width of a picture below which panels stand one above the other."""


def draw_solid(result: Result) -> dict[str, Figure]:
    """Pictures that only solids have, by name."""
    figures = {"centre_of_mass": centre_of_mass(result)}
    picture = body(result)
    return figures if picture is None else figures | {"body": picture}


def survey(
    result: Result, skin: Skin, snapshots: Iterable[Snapshot]
) -> tuple[Painter, list[Floats]]:
    """Look at some snapshots, one at a time.

    Returns:
        A painter with colours that suit them, and the extent of the body in each that is finite.
    """
    painter = _painter(result, skin)
    stress, pressure, extents = 0.0, 0.0, []
    for snapshot in snapshots:
        if snapshot.is_finite:
            # The few nodes beyond, at the edges of contact, would leave no colours to the others.
            stress = max(stress, float(np.quantile(snapshot.von_mises[skin.nodes], 0.999)))
            pressure = max(pressure, float(snapshot.pressure.max()))
            extents.append(painter.extent(snapshot))
    return replace(painter, stress=stress or 1.0, pressure=pressure), extents


def _painter(result: Result, skin: Skin) -> Painter:
    if skin.dim == 2:
        body = cast("Solid", result.scene.bodies[0])
        return PlanePainter(skin, result.scene.obstacles, body.is_axisymmetric)
    shape = result.scene.solid.shape
    cuts = () if shape is None else tuple(-np.eye(3)["xyz".index(axis)] for axis in shape.symmetry)
    return SpacePainter(skin, result.scene.obstacles, _vertical(result), cuts=cuts)


def body(result: Result) -> Figure | None:
    """Snapshots of the deformed body with its obstacles, true to scale; None if nothing can be."""
    if not isinstance(result.fields, SolidFields):
        return None
    skin = Skin.of(result.fields)
    snapshots = [
        skin.snapshot(layer) for layer in telling_layers(result, 6 if skin.dim == 2 else 4)
    ]
    snapshots = [snapshot for snapshot in snapshots if snapshot.is_finite]
    if not snapshots:
        return None
    painter, extents = survey(result, skin, snapshots)
    maps = skin.dim == 3 and painter.pressure > 0.0
    window = painter.window(extents)
    follows = float(np.ptp(window, axis=1).max()) > _FAR * skin.size
    aspect = 1.0 if follows else float(np.ptp(window[1]) / np.ptp(window[0]))
    columns = len(snapshots) if aspect > 1.8 or maps else min(3, len(snapshots))
    if aspect < FLAT and not maps:
        columns = 1
    rows = -(-len(snapshots) // columns)
    width = min(12.0, 3.4 * columns) if columns > 1 else 9.0
    height = (width - 1.5) / columns * (aspect * rows + maps) + 0.3 * rows + 1.0
    figure = Figure(figsize=(width, float(np.clip(height, 3.2, 11.0))), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows + maps, columns, squeeze=False)
    panels = grid[:rows].ravel()
    for axes, snapshot, extent in zip(panels, snapshots, extents, strict=False):
        shown = _square(painter.window([extent])) if follows else window
        painter.prepare(axes, shown, snapshot.time)
        painter.draw(axes, snapshot)
        axes.set_title(f"t = {snapshot.time:.4g} s", fontsize=10)
        if not follows:
            axes.label_outer()
    for axes in panels[len(snapshots) :]:
        axes.set_visible(False)
    colours = ScalarMappable(Normalize(0.0, painter.stress), "viridis")
    figure.colorbar(colours, ax=list(panels), label="von Mises stress [Pa]", shrink=0.9)
    if maps:
        _pressure_maps(figure, list(grid[rows]), skin, snapshots, painter.pressure)
    elif painter.pressure > 0.0:
        label = f"contact pressure, at most {painter.pressure:.3g} Pa"
        figure.legend(
            handles=[Patch(color=PRESSURE, label=label)], loc="outside lower center", frameon=False
        )
    figure.suptitle(_title(result, "deformed body, true to scale"), fontsize=11)
    return figure


def centre_of_mass(result: Result) -> Figure:
    """Position and velocity of the centre of mass along the direction of the momentum."""
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, sharex=True)
    history, name = result.history, result.scene.bodies[0].name
    direction = direction_of(result)
    for axes, prefix, colour in ((above, "", _BLUE), (below, "v", _ORANGE)):
        values = np.stack([history[f"{name}.{prefix}{axis}"].values for axis in "xyz"], axis=1)
        axes.plot(history["time"], values @ direction, color=colour, linewidth=1.4)
        _mark_contact(axes, result)
    letter = _letter(direction)
    above.set_ylabel(f"position along {letter} [m]")
    below.set_ylabel(f"velocity along {letter} [m/s]")
    below.axhline(0.0, color="0.6", linewidth=0.6)
    below.set_xlabel("time [s]")
    below.set_xlim(0.0, float(history["time"][-1]))
    above.set_title(_title(result, "centre of mass (grey: contact)"))
    return figure


def direction_of(result: Result) -> Floats:
    """Direction of the momentum in the history; y if it says none."""
    given = result.history["momentum"].attrs.get("direction", (0.0, 1.0, 0.0))
    return np.asarray(given, dtype=np.float64)


def telling_layers(result: Result, most: int = 6) -> list[int]:
    """Kept layers that tell the motion: the first, some around the largest force, the last.

    Args:
        result: With fields of a solid.
        most: 4 or 6.
    """
    fields = cast("SolidFields", result.fields)
    times, force = result.history["time"].values, result.history["contact_force"].values
    if not np.isfinite(force).all() or force.max() <= 0.0:
        wanted = np.linspace(fields.times[0], fields.times[-1], 4)
    else:
        peak = int(np.argmax(force))
        quiet = np.flatnonzero(force <= 1e-6 * force[peak])
        before, after = quiet[quiet < peak], quiet[quiet > peak]
        start = times[before[-1]] if len(before) else times[0]
        end = times[after[0]] if len(after) else times[-1]
        between = [0.5 * (start + times[peak]), times[peak]]
        around = between if most < 6 else [start, *between, end]
        wanted = np.array([times[0], *around, times[-1]])
    nearest = np.abs(fields.times[None] - wanted[:, None]).argmin(axis=1)
    return [int(layer) for layer in np.unique(nearest)]


def _pressure_maps(
    figure: Figure, panels: list[Axes], skin: Skin, snapshots: list[Snapshot], largest: float
) -> None:
    """The contact faces seen square to them from outside, coloured by the contact pressure."""
    touching = np.any([s.may_touch[skin.triangles].all(axis=1) for s in snapshots], axis=0)
    faces = skin.triangles[touching]
    outward = normals(skin.points, faces).sum(axis=0)
    loaded = np.any([s.pressure > 0.0 for s in snapshots], axis=0)
    towards = outward / np.linalg.norm(outward) if np.linalg.norm(outward) > 0 else np.eye(3)[1]
    seen = normals(skin.points, faces) @ towards > 0.0
    faces = faces[seen]
    up = np.eye(3)[2] if abs(towards[2]) < 0.9 else np.eye(3)[1]
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    middle = skin.points[loaded].mean(axis=0)
    reach = 1.6 * max(
        float(np.abs((skin.points[loaded] - middle) @ axis).max()) for axis in (right, up)
    )
    reach = max(reach, 0.05 * skin.size)
    for axes, snapshot in zip(panels, snapshots, strict=True):
        place = snapshot.place - middle
        flat = Triangulation(place @ right, place @ up, faces)
        axes.tripcolor(
            flat, snapshot.pressure, shading="gouraud", cmap=_PRESSURES, vmin=0.0, vmax=largest,
            rasterized=True,
        )  # fmt: skip
        axes.triplot(flat, color="0.5", linewidth=0.2)
        axes.set_aspect("equal")
        shift = (snapshot.place[loaded].mean(axis=0) - middle) @ np.stack([right, up], axis=1)
        axes.set_xlim(shift[0] - reach, shift[0] + reach)
        axes.set_ylim(shift[1] - reach, shift[1] + reach)
        axes.set_xticks([])
        axes.set_yticks([])
    panels[0].set_ylabel(f"contact face, {2 * reach:.3g} m wide")
    colours = ScalarMappable(Normalize(0.0, largest), _PRESSURES)
    figure.colorbar(colours, ax=panels, label="contact pressure [Pa]", shrink=0.9)


def _vertical(result: Result) -> Floats:
    """What points up: against gravity, or along y without any."""
    gravity = np.asarray(result.scene.vector_gravity.at(0.0), dtype=np.float64)
    size = np.linalg.norm(gravity)
    return -gravity / size if size > 0.0 else np.eye(3)[1]


def _square(window: Floats) -> Floats:
    middle, half = window.mean(axis=1), 0.5 * np.ptp(window, axis=1).max()
    return np.stack([middle - half, middle + half], axis=1)


def _letter(direction: Floats) -> str:
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        if np.allclose(direction, axis):
            return name
    return "(" + ", ".join(f"{component:.3g}" for component in direction) + ")"


def _mark_contact(axes: Axes, result: Result) -> None:
    for first, last in result.summary["contact"]["intervals"]:
        axes.axvspan(first, last, color="0.85", linewidth=0)


def _title(result: Result, what: str) -> str:
    status = result.summary["status"]
    return f"{result.scene.title}: {what}" + (f"  [{status}]" if status != "completed" else "")
