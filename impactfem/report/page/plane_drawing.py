"""Drawings of what moves in the plane: solids, points, rods and beams, with their obstacles."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from impactfem.arrays import Floats
from impactfem.contact.distance import signed_distance
from impactfem.report.camera import FLAT
from impactfem.report.page.numbers import constant, formulas, goings, quantity, vector
from impactfem.report.page.outlines import outline_of, supported_lines
from impactfem.report.page.sketch import (
    BODY,
    EDGE,
    GRAVITY,
    SUPPORT,
    VELOCITY,
    arrow,
    dimension,
    draw_velocity,
    empty,
    label,
    spring,
)
from impactfem.report.plane_picture import draw_obstacles
from impactfem.report.prefixes import prefix_ticks
from impactfem.report.space_picture import skin_of
from impactfem.result import Record
from impactfem.scene import Point, Scene, Solid

_NEAR = 3.0  # obstacles farther than so many sizes of what moves are not shown
_ARROW = 0.16  # length of arrows as a share of the window
_MOST_LABELS = 12


@dataclass
class _Window:
    """Places that must be seen, and the square around them."""

    places: list[Floats] = field(default_factory=list)

    def add(self, places: Any) -> None:
        self.places.append(np.atleast_2d(np.asarray(places, dtype=np.float64)))

    @property
    def size(self) -> float:
        """Largest extent [m]; 0 of a single place."""
        return float(np.ptp(np.concatenate(self.places), axis=0).max())

    def include_obstacles(self, scene: Scene) -> None:
        """Add the places of obstacles nearest to what moves, if they are not far away."""
        own = np.concatenate(self.places)
        centre, size = 0.5 * (own.min(axis=0) + own.max(axis=0)), self.size
        for obstacle in scene.rigid_obstacles:
            gap, normal = signed_distance(obstacle, [centre], 0.0)
            if size == 0.0 or abs(gap[0]) < _NEAR * size:
                self.add(centre - gap[0] * normal[0])
        # Corners of half spaces stand where their points are given.
        size = self.size
        obstacles: tuple[Any, ...] = scene.rigid_obstacles
        for obstacle in obstacles:
            if obstacle.plane_normal is not None:
                point = np.array(obstacle.point, dtype=np.float64)
                if np.hypot(*(point - centre)) < 2.0 * size:
                    self.add(point)

    def apply(self, axes: Axes, scene: Scene) -> float:
        """Set the limits; returns the size of the window."""
        own = np.concatenate(self.places)
        low, high = own.min(axis=0), own.max(axis=0)
        size = float((high - low).max()) or 1.0
        room = np.maximum(0.18 * size, 0.5 * (0.45 * size - (high - low)))
        axes.set_aspect("equal")
        pulled = 0.2 * size * np.any(scene.vector_gravity.at(0.0))  # for the arrow of gravity
        axes.set_xlim(low[0] - room[0], high[0] + room[0] + pulled)
        axes.set_ylim(low[1] - room[1], high[1] + room[1])
        return size


def draw_plane(result: Record) -> Figure | None:
    """What moves in the plane, with obstacles, supports, springs, velocities; None if unknown."""
    scene = result.scene
    solids = scene.solids
    points = scene.points
    slender = {body: ends for body in scene.bodies if (ends := body.centreline()) is not None}
    rigid = {body: cells for body in scene.bodies if (cells := body.faces()) is not None}
    outlines = _outlines(result, solids)
    if outlines is None:
        return None
    window = _Window()
    for place in (*outlines, *map(_reach, points), *slender.values(), *rigid.values()):
        window.add(np.reshape(place, (-1, 2)))
    if not window.places:  # bodies of mesh files that have no drawing
        return None
    window.include_obstacles(scene)
    figure, axes = _axes(window)
    size = window.apply(axes, scene)
    draw_obstacles(axes, scene.rigid_obstacles, 0.0)
    few = len(scene.bodies) <= _MOST_LABELS
    for solid, lines in zip(solids, outlines, strict=True):
        _draw_solid(axes, solid, lines, size, named=few)
    home = {p.name: np.array(p.position, dtype=np.float64) for p in points}
    for point in points:
        _draw_point(axes, point, home, size, named=few)
    for body, ends in slender.items():
        _draw_slender(axes, body, ends, size, named=len(scene.bodies) > 1 and few)
    for body, cells in rigid.items():
        _draw_rigid(axes, body, cells, size, named=few)
    axial = any(solid.is_axisymmetric for solid in solids)
    if axial:
        axes.axvline(0.0, color="0.5", linewidth=0.9, linestyle="-.", zorder=0.6)
    if len(scene.bodies) == len(solids) == 1 and not solids[0].supports:
        _measures(axes, outlines[0], size)
    _finish(axes, scene, size, "radius x [m]" if axial else "x [m]")
    return figure


def _draw_solid(axes: Axes, solid: Solid, lines: Floats, size: float, *, named: bool) -> None:
    if lines.shape[1] > 2:
        axes.add_collection(PolyCollection(list(lines), facecolors=BODY, edgecolors=EDGE,
                                           linewidths=1.2, zorder=2))  # fmt: skip
    else:
        axes.add_collection(LineCollection(list(lines), colors=EDGE, linewidths=1.2, zorder=2))
    low, high = lines.reshape(-1, 2).min(axis=0), lines.reshape(-1, 2).max(axis=0)
    centre = 0.5 * (low + high)
    speed = [constant(entry) for entry in solid.velocity]
    if any(value is None for value in speed):
        text = f"v = {formulas(solid.velocity, 'm/s')}"
        label(axes, centre - [0, 0.08 * size], text, VELOCITY)
    else:
        draw_velocity(axes, FLAT, centre, [value or 0.0 for value in speed], _ARROW * size, 1.4)
    if named:
        moving = np.array([value or 0.0 for value in speed])
        back = 0.07 * size * moving / (np.hypot(*moving) or 1.0)
        label(axes, centre - back, solid.name)
    for lines_of, text in supported_lines(solid):
        axes.add_collection(
            LineCollection(list(lines_of), colors=SUPPORT, linewidths=4.0, zorder=3)
        )
        face = lines_of.reshape(-1, 2).mean(axis=0)
        beyond = (face - centre) / (np.hypot(*(face - centre)) or 1.0)
        label(axes, face + 0.06 * size * beyond, text, SUPPORT)


def _draw_rigid(axes: Axes, body: Any, cells: Floats, size: float, *, named: bool) -> None:
    """A rigid body by the triangles that fill it."""
    axes.add_collection(PolyCollection(list(cells), facecolors=BODY, edgecolors=BODY, zorder=3))
    center, speed = body.box()[1], body.centre_velocity()
    draw_velocity(axes, FLAT, center, speed, _ARROW * size, 1.4)
    if named:
        back = 0.07 * size * speed / (np.hypot(*speed) or 1.0)
        label(axes, center - back, body.name)


def _draw_point(
    axes: Axes, point: Point, home: Mapping[str, Floats], size: float, *, named: bool
) -> None:
    at = home[point.name]
    for tie in point.springs:
        other = home[tie.to] if tie.to else np.array(tie.anchor, dtype=np.float64)
        spring(axes, at, other, 0.03 * size)
    if point.radius > 0.01 * size:
        axes.add_patch(Circle((at[0], at[1]), point.radius, facecolor=BODY, edgecolor=EDGE,
                              zorder=4))  # fmt: skip
    else:
        axes.plot(*at, "o", color=EDGE, markersize=8, zorder=4)
    if named:
        label(axes, at - [0.0, point.radius + 0.05 * size], point.name)
        draw_velocity(axes, FLAT, at, point.velocity or (), _ARROW * size, 1.4)


def _reach(point: Point) -> Floats:
    """Places of a point and its springs that must be seen [m], (places, 2)."""
    at = np.array(point.position, dtype=np.float64)
    ties = [tie.anchor for tie in point.springs if tie.anchor is not None]
    return np.array([at - point.radius, at + point.radius, *ties])


def _draw_slender(axes: Axes, body: Any, line: Floats, size: float, *, named: bool) -> None:
    """A slender body along its centreline; its name where there are others, else its length."""
    thick = body.line_thickness
    for start, end in pairwise(line):
        along = (end - start) / (np.linalg.norm(end - start) or 1.0)
        across = 0.5 * max(thick, 0.012 * size) * np.array([-along[1], along[0]])
        corners = np.array([start - across, end - across, end + across, start + across])
        axes.add_collection(PolyCollection([corners], facecolors=BODY, edgecolors=EDGE,
                                           zorder=3))  # fmt: skip
    along = (line[1] - line[0]) / (np.linalg.norm(line[1] - line[0]) or 1.0)
    shift = (0.07 * size + 0.5 * thick) * np.array([-along[1], along[0]])
    if named or len(line) > 2:
        label(axes, line[0] + 0.7 * shift, body.name)
    else:
        dimension(axes, line[0] + shift, line[1] + shift, quantity(body.length, "m"))
    speed = body.centre_velocity()
    if speed is not None:
        box = body.box()
        place = line.mean(axis=0) if box is None else box[1]
        draw_velocity(axes, FLAT, place, speed, _ARROW * size, 1.4)


def _outlines(result: Record, solids: Sequence[Solid]) -> list[Floats] | None:
    """For each solid polygons (1, corners, 2), or segments (segments, 2, 2) of its mesh."""
    known = [outline_of(solid) for solid in solids]
    strained = result.scene.starts_at_rest and result.fields is not None
    if all(outline is not None for outline in known) and not strained:
        return [cast("Floats", outline)[None] for outline in known]
    if result.fields is None:
        return None
    skin = skin_of(result, result.fields)
    place = skin.snapshot(0).place[:, :2]
    bodies = skin.bodies[skin.segments[:, 0]]
    return [place[skin.segments[bodies == k]] for k in range(len(solids))]


def _measures(axes: Axes, lines: Floats, size: float) -> None:
    """Width below and height left of a single solid."""
    low, high = lines.reshape(-1, 2).min(axis=0), lines.reshape(-1, 2).max(axis=0)
    side, above = low[0] - 0.08 * size, high[1] + 0.07 * size
    dimension(axes, (low[0], above), (high[0], above), quantity(high[0] - low[0], "m", 4))
    if high[1] - low[1] > 0.15 * size:
        dimension(axes, (side, low[1]), (side, high[1]), quantity(high[1] - low[1], "m", 4))


def _axes(window: _Window) -> tuple[Figure, Axes]:
    own = np.concatenate(window.places)
    width, height = np.ptp(own, axis=0) + 0.36 * (window.size or 1.0)
    share = float(np.clip(height / width, 0.35, 1.1))
    return empty(6.0, 6.0 * share)


def _finish(axes: Axes, scene: Scene, size: float, x_label: str) -> None:
    """Gravity in the corner, motions of obstacles, labels of the axes."""
    gravity = np.asarray(scene.vector_gravity.at(0.0), dtype=np.float64)
    strength = float(np.hypot(*gravity))
    if strength:
        (left, right), (_, top) = axes.get_xlim(), axes.get_ylim()
        way = _ARROW * size * gravity / strength
        start = np.array([right - 0.07 * (right - left), top - 0.05 * size])
        arrow(axes, start - np.maximum(way, 0.0), way, GRAVITY)
        place = start + np.array([-0.14 * size, 0.5 * min(way[1], 0.0)])
        label(axes, place, f"gravity\n{quantity(strength, 'm/s²', 4)}", GRAVITY)
    moving = [o for o in scene.rigid_obstacles if o.moves]
    for k, obstacle in enumerate(moving[:3]):
        text = f"{obstacle.name} {goings(obstacle)}"
        axes.text(0.01, 0.02 + 0.06 * k, text, transform=axes.transAxes, fontsize=8.5,
                  color=VELOCITY, parse_math=False, zorder=7)  # fmt: skip
    axes.locator_params(nbins=5)
    prefix_ticks(axes.xaxis, x_label)
    prefix_ticks(axes.yaxis, "y [m]")
    if not scene.vector_gravity.is_constant:
        axes.set_title(f"gravity {vector(gravity, 'm/s²')} at t = 0, changes later", fontsize=8.5)
