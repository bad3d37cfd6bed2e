"""The motion of bodies in the plane or in space for a film, with a curve beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import override

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from impactfem.arrays import Floats, Integers
from impactfem.report.film import Reel, cursor, film_moments, force_beside
from impactfem.report.painter import Painter
from impactfem.report.palette import STRESS
from impactfem.report.panel import colour
from impactfem.report.panel_figure import draw_panel
from impactfem.report.panels import gap
from impactfem.report.prefixes import prefix_ticks
from impactfem.report.sheet import Sheet
from impactfem.report.skin import Skin
from impactfem.report.slender_picture import tracks
from impactfem.report.solid_figures import (
    FLAT,
    LABEL,
    drawn_skin,
    forces_key,
    scale_of,
    survey,
)
from impactfem.result import Record, Snapshots

_MOST, _LEAST = 60, 12  # frames
_TRIANGLES = 600_000  # drawn in all frames together: some seconds
_TRACK = 0.15  # share of the duration that the track of a point is long


@dataclass(frozen=True)
class BodyReel(Reel):
    """The bodies at some layers.

    Attributes:
        layers: Layers of the fields, shape (moments,).
        skin: What is seen of the bodies.
        painter: Draws them.
        panel: Where they are drawn.
        above: What stays above them.
        ways: Where points are in the picture at all layers [m], (layers, points, 2).
        trails: Their tracks as drawn.
        drawn: What the last moment drew.
    """

    layers: Integers
    skin: Skin
    painter: Painter
    panel: Axes
    above: Sequence[Artist]
    ways: Floats
    trails: LineCollection
    drawn: list[Artist] = field(default_factory=list)

    @override
    def move(self, moment: int, time: float) -> Sequence[Artist]:
        snapshot = self.skin.snapshot(int(self.layers[moment]))
        for artist in self.drawn:
            artist.remove()
        self.drawn.clear()
        if snapshot.is_finite:
            self.drawn.extend(self.painter.draw(self.panel, snapshot))
        for artist in self.drawn:
            artist.set_animated(True)
        self.trails.set_segments(tracks(self.skin.fields.times, self.ways, time, _TRACK))
        return [*self.drawn, self.trails, *self.above]


def body_reel(result: Record, fields: Snapshots, frames: int | None) -> BodyReel | None:
    """The reel of bodies in the plane or in space, true to scale.

    Args:
        result: The result.
        fields: Its fields.
        frames: Number of moments at most; fewer for large meshes if None.

    Returns:
        None if nothing of the motion is finite.
    """
    skin = drawn_skin(result, fields)
    if frames is None:
        frames = int(np.clip(_TRIANGLES // max(1, len(skin.triangles)), _LEAST, _MOST))
    layers = film_moments(result, fields.times, frames)
    painter, extents = survey(result, skin, (skin.snapshot(int(layer)) for layer in layers))
    if not extents:
        return None
    window = painter.window(extents)
    aspect = float(np.ptp(window[1]) / np.ptp(window[0]))
    figure = Sheet(*_size(aspect), dpi=90)
    if aspect < FLAT:
        left, right = figure.subplots(2, 1, height_ratios=[0.3 + 1.8 * aspect, 0.7])
    else:
        left, right = figure.subplots(1, 2, width_ratios=[1.3, 1.0])
    above = painter.prepare(left, window, float(fields.times[layers[0]]))
    if skin.is_stressed.any():
        colours = ScalarMappable(Normalize(*painter.stress), STRESS)
        prefix_ticks(figure.colorbar(colours, ax=left, shrink=0.9).ax.yaxis, LABEL)
    told = [scale_of(skin)] if skin.relief is not None else []
    told += [f"arrows: {forces_key(painter)}"] if painter.force > 0.0 else []
    left.set_title("\n".join(told), fontsize=9)
    now = _beside(right, result)
    figure.suptitle(result.scene.title, fontsize=11)
    clock = left.text(0.02, 0.98, "", transform=left.transAxes, va="top", zorder=5, fontsize=9)
    ways = _ways(skin, painter)
    tints = [colour(k) for k in skin.bodies[skin.balls]]
    trails = LineCollection([], colors=tints or "none", linewidths=1.2, alpha=0.6, zorder=4)
    left.add_collection(trails, autolim=False)
    for artist in (*above, clock, trails):
        artist.set_animated(True)
    return BodyReel(figure, fields.times[layers], clock, now, layers, painter.skin, painter,
                    left, above, ways, trails)  # fmt: skip


def _beside(axes: Axes, result: Record) -> Line2D:
    """The curve beside the motion: the force, or the gaps where there is none."""
    if result.rows["contact_force"].values.any():
        return force_beside(axes, result)
    draw_panel(axes, gap(result))
    return cursor(axes)


def _ways(skin: Skin, painter: Painter) -> Floats:
    """Where points are in the picture at all layers [m], shape (layers, points, 2)."""
    if not len(skin.balls) or skin.relief is not None:
        return np.empty((len(skin.fields), 0, 2))
    own = skin.balls[skin.balls < len(skin.points) >> len(skin.mirrors)]
    first, last = int(own.min()), int(own.max()) + 1
    moved = skin.fields.over_time("displacement", slice(first, last))[:, own - first]
    return painter.camera.flat(skin.points[own] + moved)


def _size(aspect: float) -> tuple[float, float]:
    """Size of a frame [inches] in which the bodies' panel fits its height over width."""
    if aspect < FLAT:
        return 8.0, 4.2 + 6.0 * aspect
    return 9.0, float(np.clip(4.0 * aspect + 1.0, 3.2, 6.0))
