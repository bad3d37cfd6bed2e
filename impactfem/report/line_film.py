"""The motion of bars and points on a line for a film, with the force or the paths below."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, override

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from impactfem.arrays import Floats, Integers
from impactfem.contact.distance import on_a_line
from impactfem.report.film import Reel, cursor, film_moments, force_beside
from impactfem.report.line_panels import magnified
from impactfem.report.motion_panels import motion
from impactfem.report.panel import colour
from impactfem.report.panel_figure import draw_panel
from impactfem.report.prefixes import prefix_ticks
from impactfem.report.sheet import Sheet
from impactfem.result import Fields, Record, Snapshots

_FRAMES = 60
_PIECES = 400  # coloured pieces of all bars together
_COLOURED = 0.99  # share of the stresses within the colours
_ROOM = 0.08  # share of the extent that is left free around points
_DOT = 0.01  # of the extent: radius of points that have none


@dataclass(frozen=True)
class LineReel(Reel):
    """Bars or points on their line at some layers.

    Attributes:
        near, far: Places of the ends of the pieces in the picture [m], (moments, pieces).
        first: First piece of each body, shape (bodies,).
        pieces: The pieces as drawn.
        outlines: The outlines of the bodies.
        walls: Draws the obstacles that move at a time, and returns them.
        stress: Stress of the pieces of bars, tension positive [Pa], (moments, pieces).
        drawn: Obstacles of the last moment.
    """

    near: Floats
    far: Floats
    first: Integers
    pieces: PolyCollection
    outlines: LineCollection
    walls: Callable[[float], Sequence[Artist]]
    stress: Floats | None = None
    drawn: list[Artist] = field(default_factory=list)

    @override
    def move(self, moment: int, time: float) -> Sequence[Artist]:
        a, b = self.near[moment], self.far[moment]
        for artist in self.drawn:
            artist.remove()
        self.drawn[:] = self.walls(time)
        for artist in self.drawn:
            artist.set_animated(True)
        self.pieces.set_verts(_boxes(a, b))
        if self.stress is not None:
            self.pieces.set_array(self.stress[moment])
        ends = a[self.first], b[np.append(self.first[1:], len(b)) - 1]
        self.outlines.set_segments(_boxes(*ends)[:, [0, 1, 2, 3, 0]])
        return [*self.drawn, self.pieces, self.outlines]


def line_reel(result: Record, fields: Snapshots, frames: int | None) -> LineReel | None:
    """The reel of bars, or of points on a line.

    Args:
        result: The result.
        fields: Its fields.
        frames: Number of moments at most; 60 if None.

    Returns:
        None if the motion is not finite.
    """
    moments = film_moments(result, fields.times, frames or _FRAMES)
    if isinstance(fields, Fields):
        return _bars(result, fields, moments)
    return _bodies(result, fields, moments)


def _bars(result: Record, fields: Fields, moments: Integers) -> LineReel | None:
    """Stress in colours; motion and gaps of stiff bars are magnified, as in their world lines."""
    if not np.isfinite(fields.displacement[moments]).all():
        return None
    near, far, moduli, first = _pieces(result, fields)
    place, factor = magnified(fields, moments)
    u, x = fields.displacement[moments], fields.positions
    stress = moduli * (u[:, far] - u[:, near]) / (x[far] - x[near])
    figure, above, below = _sheet(result)
    wall = bool(result.scene.obstacles)
    low, high = float(place.min()), float(place.max())
    room = 0.04 * (high - low)
    low = min(low, 0.0) if wall else low
    above.set_xlim(low - room, high + room)
    prefix_ticks(above.xaxis, "x [m]")
    if factor > 1.0:
        text = f"motion and gaps magnified {factor:g} times"
        above.text(0.01, 0.95, text, transform=above.transAxes, va="top", fontsize=9)
    if wall:
        above.axvspan(low - room, 0.0, color="0.45", alpha=0.5, hatch="//", linewidth=0)
    # A spot, as the edge of a wave, shall not spoil the colours.
    most = float(np.quantile(np.abs(stress).max(axis=1), _COLOURED)) or 1.0
    pieces = PolyCollection(
        [], cmap="coolwarm", norm=Normalize(-most, most), linewidths=0, antialiaseds=False
    )
    prefix_ticks(figure.colorbar(pieces, ax=above, aspect=8).ax.yaxis, "stress [Pa]")
    ends = place[:, near], place[:, far]
    return _reel(figure, fields.times[moments], ends, first, pieces, _none, stress,
                 (above, force_beside(below, result)))  # fmt: skip


def _bodies(result: Record, fields: Snapshots, moments: Integers) -> LineReel | None:
    """Points and bars as wide as they are, with the obstacles and the paths of all below."""
    places, layout = fields.places()[moments, :, 0], fields.layout
    if not np.isfinite(places).all():
        return None
    figure, above, below = _sheet(result)
    first, last = layout.starts[:-1], layout.starts[1:] - 1
    radius = np.maximum(layout.radius[first], layout.radius[last])
    low, high = float((places[:, first] - radius).min()), float((places[:, last] + radius).max())
    extent = max(high - low, 1e-12)
    above.set_xlim(low - _ROOM * extent, high + _ROOM * extent)
    prefix_ticks(above.xaxis, "x [m]")
    half = np.where((radius > 0.0) | (last > first), radius, _DOT * extent)
    listed = [body.name for body in result.scene.bodies]  # as the paths below are coloured
    tints = [colour(listed.index(name)) for name in layout.names]
    pieces = PolyCollection([], facecolors=tints, linewidths=0)
    stay = [entry for entry in result.scene.rigid_obstacles if not entry.moves]
    move = [entry for entry in result.scene.rigid_obstacles if entry.moves]
    _walls(above, stay, 0.0)
    if (panel := motion(result)) is not None:
        draw_panel(below, panel)
    ends = places[:, first] - half, places[:, last] + half
    return _reel(figure, fields.times[moments], ends, np.arange(len(half)), pieces,
                 lambda time: _walls(above, move, time), None, (above, cursor(below)))  # fmt: skip


def _sheet(result: Record) -> tuple[Figure, Axes, Axes]:
    figure = Sheet(8.0, 4.0, dpi=90)
    above, below = figure.subplots(2, 1, height_ratios=[0.8, 1.0])
    above.set_ylim(-2.2, 2.2)
    above.set_yticks([])
    figure.suptitle(result.scene.title, fontsize=11)
    return figure, above, below


def _reel(
    figure: Figure,
    times: Floats,
    ends: tuple[Floats, Floats],
    first: Integers,
    pieces: PolyCollection,
    walls: Callable[[float], Sequence[Artist]],
    stress: Floats | None,
    panel_and_now: tuple[Axes, Line2D],
) -> LineReel:
    panel, now = panel_and_now
    outlines = LineCollection([], colors="0.25", linewidths=0.8)
    for drawn in (pieces, outlines):
        drawn.set_animated(True)
        panel.add_collection(drawn, autolim=False)
    clock = panel.text(0.99, 0.95, "", transform=panel.transAxes, ha="right", va="top", fontsize=9)
    clock.set_animated(True)
    return LineReel(figure, times, clock, now, *ends, first, pieces, outlines, walls, stress)


def _none(_: float) -> Sequence[Artist]:
    return []


def _walls(axes: Axes, obstacles: Sequence[Any], time: float) -> list[Artist]:
    """Obstacles on a line, as areas on their side."""
    artists: list[Artist] = []
    low, high = axes.get_xlim()
    for obstacle in obstacles:
        where, side = on_a_line(obstacle, np.array([time]))
        place = float(where[0])
        begin, end = (low, place) if side > 0.0 else (place, high)
        if end > begin:
            artists.append(axes.axvspan(begin, end, color="0.80", linewidth=0, zorder=0.3))
        artists.append(axes.axvline(place, color="0.25", linewidth=1.5, zorder=0.4))
    axes.set_xlim(low, high)
    return artists


def _boxes(near: Floats, far: Floats) -> Any:
    """Corners of boxes between two ends each, shape (boxes, 4, 2): the types know no arrays."""
    across = np.broadcast_to([-1.0, -1.0, 1.0, 1.0], (len(near), 4))
    return np.stack([np.column_stack([near, far, far, near]), across], axis=2)


def _pieces(result: Record, fields: Fields) -> tuple[Integers, Integers, Floats, Integers]:
    """First and last nodes of the pieces, Young's moduli [Pa], and the first piece of each bar."""
    counts = fields.counts or (len(fields.positions),)
    starts = np.cumsum([0, *counts])
    most = max(2, _PIECES // len(counts))
    near, far, moduli = [], [], []
    for k, bar in enumerate(result.scene.bars):
        nodes = np.linspace(starts[k], starts[k + 1] - 1, min(counts[k], most + 1)).astype(int)
        near.append(nodes[:-1])
        far.append(nodes[1:])
        x = fields.positions[nodes]
        moduli.append(bar.at("youngs_modulus", 0.5 * (x[1:] + x[:-1])))
    first = np.cumsum([0, *(len(part) for part in near[:-1])])
    return np.concatenate(near), np.concatenate(far), np.concatenate(moduli), first
