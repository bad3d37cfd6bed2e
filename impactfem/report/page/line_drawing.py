"""Drawings of what moves along a line: bars and their wall, points with stops and springs."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Rectangle

from impactfem.contact.distance import on_a_line
from impactfem.report.page.numbers import constant, formula, quantity
from impactfem.report.page.sketch import (
    BODY,
    EDGE,
    GRAVITY,
    OBSTACLE,
    SMALL,
    SUPPORT,
    VELOCITY,
    arrow,
    dimension,
    empty,
    label,
    spring,
)
from impactfem.report.prefixes import prefix_ticks
from impactfem.scene import Scene

_MOST_LABELS = 8
_ROOM = 0.12  # share of the width left and right
_SEEN = 0.03  # share of the width from which a length has room for its dimension


def draw_bars(scene: Scene) -> Figure:
    """Bars along their axis with the wall, gaps, lengths and velocities at t = 0."""
    figure, axes = empty(8.0, 2.4)
    ends = [
        (float(bar.initial_displacement(x=0.0)),
         bar.length + float(bar.initial_displacement(x=bar.length)))
        for bar in scene.bars
    ]  # fmt: skip
    low = 0.0 if scene.obstacles else min(a for a, _ in ends)
    width = max(b for _, b in ends) - low
    axes.set_xlim(low - _ROOM * width, low + (1 + _ROOM) * width)
    axes.set_ylim(-1.25, 1.25)
    if scene.obstacles:
        _solid_side(axes, low - _ROOM * width, 0.0, scene.obstacles[0].name)
    edge = 0.0 if scene.obstacles else None
    for k, (bar, (near, far)) in enumerate(zip(scene.bars, ends, strict=True)):
        axes.add_patch(
            Rectangle((near, -0.3), far - near, 0.6, facecolor=BODY, edgecolor=EDGE, zorder=3)
        )
        middle = 0.5 * (near + far)
        if len(scene.bars) > 1 and far - near > 0.06 * width:
            label(axes, (middle, 0.0), bar.name)
        if far - near > _SEEN * width and len(scene.bars) <= _MOST_LABELS:
            dimension(axes, (near, -0.5), (far, -0.5), quantity(bar.length, "m"), below=0.1)
        _bar_velocity(axes, bar.velocity, middle, width)
        if edge is not None and near - edge > 1e-12 * width:
            _gap(axes, edge, near, width, k)
        edge = far
        if bar.far_end == "clamped":
            _solid_side(axes, far, far + 0.5 * _ROOM * width, "held")
    value = float(scene.axial_gravity(0.0))
    if value:
        start = low + (0.95 if value > 0 else 0.8) * width
        arrow(axes, (start, 1.0), (-np.sign(value) * 0.15 * width, 0.0), GRAVITY)
        more = "" if scene.axial_gravity.is_constant else " at t = 0"
        text = f"gravity {quantity(abs(value), 'm/s²')}{more}"
        label(axes, (low + 0.6 * width, 1.0), text, GRAVITY)
    _finish(axes, "distance from the wall [m]" if len(scene.bars) == 1 else "x [m]")
    return figure


def _bar_velocity(axes: Axes, velocity: object, middle: float, width: float) -> None:
    speed = constant(velocity)  # type: ignore[arg-type]
    if speed is None:
        label(axes, (middle, 0.65), f"v = {formula(velocity, 'm/s')}", VELOCITY)  # type: ignore[arg-type]
    elif speed:
        way = np.sign(speed) * 0.12 * width
        arrow(axes, (middle - 0.5 * way, 0.48), (way, 0.0), VELOCITY)
        label(axes, (middle, 0.75), quantity(abs(speed), "m/s"), VELOCITY)


def _gap(axes: Axes, left: float, right: float, width: float, index: int) -> None:
    """A gap with its size; one too small to be seen is pointed at."""
    text = quantity(right - left, "m", 4)
    if right - left > _SEEN * width:
        dimension(axes, (left, -0.5), (right, -0.5), text, below=0.1)
    elif index <= _MOST_LABELS:
        axes.plot([0.5 * (left + right)] * 2, [-0.35, -0.9], color="0.3", linewidth=0.8, zorder=2)
        # Beside the pointer: the name of a wall stands on its other side.
        label(axes, (0.5 * (left + right) + 0.07 * width, -0.95), f"gap {text}")


def draw_on_line(scene: Scene) -> Figure:
    """What moves on a line, with stops, springs, velocities and gravity at t = 0."""
    figure, axes = empty(8.0, 2.4)
    points, boxes = scene.points, [body.centreline() for body in scene.bodies]
    sides = [on_a_line(obstacle, np.zeros(1)) for obstacle in scene.obstacles]
    stops = [float(place[0]) for place, _ in sides]
    anchors = [s.anchor[0] for p in points for s in p.springs if s.anchor is not None]
    ends = [p.position[0] + side * p.radius for p in points for side in (-1, 1)]
    ends += [float(x) for box in boxes if box is not None for x in box.ravel()]
    places = [*stops, *anchors, *ends]
    low, width = min(places), float(np.ptp(places))
    if not width:  # a single place says no scale
        low, width = low - 0.5, 1.0
    axes.set_xlim(low - _ROOM * width, low + (1 + _ROOM) * width)
    axes.set_ylim(-1.25, 1.25)
    left, right = axes.get_xlim()
    for obstacle, stop, (_, side) in zip(scene.obstacles, stops, sides, strict=True):
        inside = (left, stop) if side > 0.0 else (stop, right)
        _solid_side(axes, *inside, obstacle.name)
        if obstacle.motion is not None:
            text = f"{obstacle.name} moves by {formula(obstacle.motion[0], 'm')}"
            axes.text(0.01, 0.93, text, transform=axes.transAxes, fontsize=SMALL, color=VELOCITY,
                      parse_math=False, zorder=7)  # fmt: skip
    home = {p.name: p.position[0] for p in points}
    few = len(scene.bodies) <= _MOST_LABELS
    for k, body in enumerate(scene.bodies):
        _draw_body(axes, body, home, width, -0.55 - 0.25 * (k % 2) if few else None)
    value = float(scene.vector_gravity.at(0.0)[0])
    if value:
        start = low + (0.95 if value < 0 else 0.8) * width
        arrow(axes, (start, 1.0), (np.sign(value) * 0.15 * width, 0.0), GRAVITY)
        text = f"gravity {quantity(abs(value), 'm/s²')}"
        label(axes, (low + 0.6 * width, 1.0), text, GRAVITY)
    _finish(axes, "x [m]")
    return figure


def _draw_body(
    axes: Axes, body: Any, home: Mapping[str, float], width: float, below: float | None
) -> None:
    """A bar or a point with its springs; its name below it if it has no room, None: without."""
    ends = body.centreline()
    if ends is not None:
        x, radius = float(ends.mean()), 0.5 * float(np.ptp(ends))
        axes.add_patch(Rectangle((x - radius, -0.3), 2 * radius, 0.6, facecolor=BODY,
                                 edgecolor=EDGE, zorder=3))  # fmt: skip
        if not body.surface_names:  # its far end meets nothing: it is held
            axes.plot([x + radius] * 2, [-0.5, 0.5], color=SUPPORT, linewidth=4.0, zorder=3.5)
    else:
        x, radius = body.position[0], body.radius
        for tie in body.springs:
            end = tie.anchor[0] if tie.anchor is not None else home.get(tie.to or "", x)
            spring(axes, np.array([x, 0.0]), np.array([end, 0.0]), 0.4)
        _ball(axes, (x, 0.0), radius)
    if below is not None:
        label(axes, (x, 0.0 if radius > 0.02 * width else below), body.name)
    speed = body.centre_velocity()
    if speed is not None and speed[0]:
        way = float(np.sign(speed[0]))
        arrow(axes, (x, 0.82), (way * 0.12 * width, 0.0), VELOCITY)
        label(axes, (x + way * 0.06 * width, 1.06), quantity(abs(speed[0]), "m/s"), VELOCITY)


def _ball(axes: Axes, place: tuple[float, float], radius: float) -> None:
    """A ball as wide as it is (the line has no height to scale), or a dot."""
    if not radius:
        axes.plot(*place, "o", color=EDGE, markersize=9, zorder=4)
        return
    # A circle on paper: height and width have other scales here.
    box = axes.get_position()
    size = axes.figure.get_size_inches()  # type: ignore[union-attr]
    inches = box.width * size[0] / np.ptp(axes.get_xlim()), box.height * size[1] / 2.5
    tall = min(1.5, 2 * radius * inches[0] / inches[1])
    axes.add_patch(Ellipse(place, 2 * radius, tall, facecolor=BODY, edgecolor=EDGE, zorder=4))


def _solid_side(axes: Axes, left: float, right: float, name: str) -> None:
    """A rigid part of the line, hatched."""
    axes.axvspan(left, right, facecolor=OBSTACLE, edgecolor="0.45", hatch="///", linewidth=0,
                 zorder=1)  # fmt: skip
    label(axes, (0.5 * (left + right), -1.05), name)


def _finish(axes: Axes, text: str) -> None:
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    prefix_ticks(axes.xaxis, text)
