"""The motion of a rod or beam for a film: its axis, with the contact force beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, override

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from impactfem.arrays import Floats
from impactfem.report.film import BLUE, Reel, film_moments, force_beside
from impactfem.report.prefixes import prefix_ticks
from impactfem.report.sheet import Sheet
from impactfem.result import Record, Snapshots
from impactfem.result.shapes import LINE

_FRAMES = 60
_OBSTACLE = "0.80"
_VISIBLE = 0.05  # share of the length from which motion is seen at true scale


@dataclass(frozen=True)
class AxisReel(Reel):
    """The axis at some of its rows.

    Attributes:
        curves: What the panel shows of the nodes, shape (moments, nodes, 2).
        line: The axis as drawn.
    """

    curves: Floats
    line: Line2D

    @override
    def move(self, moment: int, time: float) -> Sequence[Artist]:
        self.line.set_data(*self.curves[moment].T)
        return [self.line]


def moves_little(result: Record, fields: Snapshots) -> bool:
    """Whether a true picture of a single rod or beam above a plane would show no motion."""
    layout = fields.layout
    if set(layout.types) != {LINE} or len(layout.names) > 1:
        return False
    planes = bool(_planes(result))
    way = float(np.nanmax(np.abs(fields.over_time("displacement"))))
    return planes and way < _VISIBLE * float(np.ptp(layout.points, axis=0).max())


def _planes(result: Record) -> list[Any]:
    """Obstacles that have one normal and one point."""
    return [o for o in result.scene.rigid_obstacles if o.plane_normal is not None]


def axis_reel(result: Record, fields: Snapshots, frames: int | None) -> AxisReel | None:
    """The reel of a beam that moves and bends by far less than its length.

    Shown is how far each point of its axis has come along the normal of the first obstacle, above
    what is left of the way to it.

    Args:
        result: The result.
        fields: Its fields.
        frames: Number of moments at most; 60 if None.

    Returns:
        None if the motion is not finite.
    """
    places = fields.places(fields.names[0])[:, :, :2]
    if not np.isfinite(places).all():
        return None
    moments = film_moments(result, fields.times, frames or _FRAMES)
    figure = Sheet(9.0, 4.0, dpi=90)
    left, right = figure.subplots(1, 2, width_ratios=[1.2, 1.0])
    curves = _way(left, result, places)
    (line,) = left.plot([], [], "o-", color=BLUE, linewidth=2.0, markersize=3.5)
    clock = left.text(0.02, 0.98, "", transform=left.transAxes, va="top", fontsize=9)
    line.set_animated(True)
    clock.set_animated(True)
    now = force_beside(right, result)
    figure.suptitle(result.scene.title, fontsize=11)
    return AxisReel(figure, fields.times[moments], clock, now, curves[moments], line)


def _way(panel: Axes, result: Record, places: Floats) -> Floats:
    """Ways along a normal over the axis, above what would touch the obstacle."""
    pieces = np.hypot.reduce(np.diff(places[0], axis=0), axis=1)
    stations = np.append(0.0, np.cumsum(pieces))
    planes = _planes(result)
    normal = np.asarray(planes[0].unit_normal, dtype=float)
    way = (places - places[0]) @ normal
    touch = -((places[0] - np.asarray(planes[0].point, dtype=float)) @ normal)
    low, high = float(way.min()), float(way.max())
    room = 0.1 * max(high - low, 1e-300)
    panel.set_xlim(stations[0] - 0.03 * stations[-1], 1.03 * stations[-1])
    panel.set_ylim(low - 2.0 * room, high + room)
    panel.fill_between(stations, touch, low - 1e3 * (high - low), color=_OBSTACLE, linewidth=0)
    panel.plot(stations, touch, color="0.25", linewidth=1.0, label=planes[0].name)
    prefix_ticks(panel.xaxis, "distance from the first end [m]")
    prefix_ticks(panel.yaxis, f"displacement along the normal of {planes[0].name} [m]")
    curves = np.empty((*way.shape, 2))
    curves[..., 0], curves[..., 1] = stations, way
    return curves
