"""The motion of points for a film: dots with their trails among obstacles, and a curve beside."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle
from matplotlib.text import Text
from numpy.typing import NDArray

from impactfem.report.film import cursor, tell_time
from impactfem.report.plane_picture import draw_obstacles
from impactfem.report.sheet import Sheet
from impactfem.report.solid_film import even_moments
from impactfem.report.vibro_figures import COLOURS, gaps, motion
from impactfem.result import Result
from impactfem.scene import HalfSpace

Floats = NDArray[np.float64]

_FRAMES = 60
_TRAIL = 0.15  # share of the duration that a trail is long
_NARROWEST = 0.25  # share of its longer side that a picture is wide or high at least
_ROOM = 0.08  # share of the extent that is left free around the points


@dataclass(frozen=True)
class PointReel:
    """Points at some rows of the history.

    Attributes:
        figure: With the panel of the points and a curve.
        times: Times of the history [s], shape (rows,).
        rows: Rows that are shown, shape (moments,).
        places: Coordinates of each point [m], shape (points, rows, dim).
        dots: One a point.
        balls: What shows the radius of points that have one, None for others.
        trails: Where each point was shortly before; none on a line.
        obstacles: Draws the obstacles that move at a time, and returns them.
        clock: Says the time.
        now: Marks the time.
        drawn: Obstacles of the last moment.
    """

    figure: Figure
    times: Floats
    rows: NDArray[np.int64]
    places: Floats
    dots: Sequence[Any]
    balls: Sequence[Circle | Rectangle | None]
    trails: Sequence[Any]
    obstacles: Callable[[float], Sequence[Artist]]
    clock: Text
    now: Line2D
    drawn: list[Artist] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Number of moments."""
        return len(self.rows)

    def show(self, moment: int) -> list[Artist]:
        """Let the figure show a row; returns what moves, from the back to the front."""
        row = int(self.rows[moment])
        time = float(self.times[row])
        for artist in self.drawn:
            artist.remove()
        self.drawn[:] = self.obstacles(time)
        for artist in self.drawn:
            artist.set_animated(True)
        begin = int(np.searchsorted(self.times, time - _TRAIL * (self.times[-1] - self.times[0])))
        for trail, way in zip(self.trails, self.places, strict=False):
            _put(trail, way[begin : row + 1])
        for dot, ball, way in zip(self.dots, self.balls, self.places, strict=True):
            _put(dot, way[row : row + 1])
            if isinstance(ball, Circle):
                ball.set_center((float(way[row, 0]), float(way[row, 1])))
            elif ball is not None:
                ball.set_x(float(way[row, 0]) - 0.5 * ball.get_width())
        balls = [ball for ball in self.balls if ball is not None]
        told = tell_time(self.clock, self.now, time)
        return [*self.drawn, *self.trails, *balls, *self.dots, *told]


def point_reel(result: Result, frames: int | None) -> PointReel | None:
    """The reel of points.

    Args:
        result: The result.
        frames: Number of moments at most; 60 if None.

    Returns:
        None if the motion is not finite.
    """
    scene, history = result.scene, result.rows
    times = history["time"].values
    places = np.array([
        np.stack([history[f"{body.name}.{c}"].values for c in "xyz"[: scene.dim]], axis=1)
        for body in scene.bodies
    ])  # fmt: skip
    if not np.isfinite(places).all():
        return None
    line = scene.dim == 1
    figure = Sheet(8.0 if line else 9.0, 4.2, dpi=90)
    panel, curve = _panels(figure, scene.dim)
    low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
    radii = [float(getattr(body, "radius", 0.0)) for body in scene.bodies]
    room = _ROOM * float(max((high - low).max(), 1e-12)) + max(radii)
    _frame(panel, low - room, high + room)
    obstacles = _obstacles(panel, result)
    balls = _balls(panel, radii, scene.dim)
    dots, trails = _marks(panel, radii, scene.dim)
    (motion if line else gaps)(curve, result)
    curve.set_title("")
    figure.suptitle(scene.title, fontsize=11)
    clock = figure.text(0.01, 0.99, "", ha="left", va="top", fontsize=9)
    clock.set_animated(True)
    # A text of the figure has no axes to be drawn by.
    clock.axes = curve
    rows = even_moments(times, frames or _FRAMES)
    return PointReel(
        figure, times, rows, places, dots, balls, trails, obstacles, clock, cursor(curve)
    )


def _panels(figure: Figure, dim: int) -> tuple[Any, Axes]:
    if dim == 1:
        above, below = figure.subplots(2, 1, height_ratios=[0.35, 1.0])
        return above, below
    left = figure.add_subplot(1, 2, 1, projection="3d" if dim == 3 else None)
    return left, figure.add_subplot(1, 2, 2)


def _frame(panel: Any, low: Floats, high: Floats) -> None:
    """Axes that hold all places."""
    if len(low) == 1:
        panel.set_xlim(low[0], high[0])
        panel.set_ylim(-1.0, 1.0)
        panel.set_yticks([])
        panel.set_xlabel("x [m]")
        return
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if len(low) == 3:
        half = np.full(3, half.max())
        panel.set_box_aspect(None, zoom=0.85)  # room for the labels, which the layout forgets
    half = np.maximum(half, _NARROWEST * half.max())
    for letter, m, h in zip("xyz", middle, half, strict=False):
        getattr(panel, f"set_{letter}lim")(m - h, m + h)
        getattr(panel, f"set_{letter}label")(f"{letter} [m]")
    if len(low) == 2:
        panel.set_aspect("equal")


def _balls(panel: Axes, radii: Sequence[float], dim: int) -> list[Circle | Rectangle | None]:
    """Circles in the plane, widths on a line, of points with a radius."""
    found: list[Circle | Rectangle | None] = []
    for k, radius in enumerate(radii):
        ball: Circle | Rectangle | None = None
        if radius > 0.0 and dim == 2:
            ball = Circle((0.0, 0.0), radius)
        elif radius > 0.0 and dim == 1:
            ball = Rectangle((0.0, -0.4), 2.0 * radius, 0.8)
        if ball is not None:
            ball.set(facecolor=COLOURS[k % len(COLOURS)], alpha=0.35, animated=True)
            panel.add_patch(ball)
        found.append(ball)
    return found


def _marks(panel: Any, radii: Sequence[float], dim: int) -> tuple[list[Any], list[Any]]:
    """Dots of all points, and the lines behind them."""
    dots, trails = [], []
    for k, radius in enumerate(radii):
        colour = COLOURS[k % len(COLOURS)]
        nowhere: list[list[float]] = [[]] * max(dim, 2)
        if dim > 1:
            trails += panel.plot(*nowhere, color=colour, linewidth=1.2, alpha=0.6)
        dots += panel.plot(*nowhere, "o", color=colour, markersize=5 if radius else 9)
    for artist in (*dots, *trails):
        artist.set_animated(True)
    return dots, trails


def _obstacles(panel: Any, result: Result) -> Callable[[float], Sequence[Artist]]:
    """Draw the obstacles that stay; the answer draws those that move."""
    scene = result.scene
    stay = [entry for entry in scene.rigid_obstacles if entry.motion is None]
    move = [entry for entry in scene.rigid_obstacles if entry.motion is not None]
    if scene.dim == 3:
        return lambda _: []
    draw = draw_obstacles if scene.dim == 2 else _walls
    draw(panel, stay, 0.0)
    return (lambda time: draw(panel, move, time)) if move else (lambda _: [])


def _walls(axes: Axes, obstacles: Sequence[Any], time: float) -> list[Artist]:
    """Half-spaces on a line, as areas on their side."""
    artists: list[Artist] = []
    for obstacle in obstacles:
        if isinstance(obstacle, HalfSpace):
            place = float(obstacle.point[0])
            if obstacle.motion is not None:
                place += float(obstacle.motion[0](t=time))
            low, high = axes.get_xlim()
            ends = (low, place) if obstacle.normal[0] > 0.0 else (place, high)
            if ends[1] > ends[0]:
                artists.append(axes.axvspan(*ends, color="0.80", linewidth=0, zorder=0.3))
            artists.append(axes.axvline(place, color="0.25", linewidth=1.5, zorder=0.4))
    return artists


def _put(line: Any, places: Floats) -> None:
    """Move a line of Matplotlib to places, shape (rows, dim)."""
    if places.shape[1] == 3:
        line.set_data_3d(*places.T)
    elif places.shape[1] == 2:
        line.set_data(*places.T)
    else:
        line.set_data(places[:, 0], np.zeros(len(places)))
