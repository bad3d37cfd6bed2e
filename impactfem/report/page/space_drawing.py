"""Drawings of what moves in space: solids by the painter of the pictures, points by projection."""

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from impactfem.arrays import Floats, Integers
from impactfem.contact.distance import signed_distance
from impactfem.report.camera import Camera
from impactfem.report.marks import Marks
from impactfem.report.page.numbers import constant, quantity
from impactfem.report.page.sketch import EDGE, GRAVITY, arrow, draw_velocity, empty, label
from impactfem.report.page.space_supports import draw_supports
from impactfem.report.skin import Skin
from impactfem.report.solid_figures import survey
from impactfem.report.space_picture import SpacePainter, skin_of
from impactfem.result import Record
from impactfem.scene import Scene

_ARROW = 0.22


def draw_solids_in_space(result: Record) -> Figure | None:
    """Solids in space with obstacles and velocities; None if their fields were not kept."""
    if result.fields is None:
        return None
    skin = skin_of(result, result.fields)
    snapshot = skin.snapshot(0)
    painter, extents = survey(result, skin, [snapshot])
    if not isinstance(painter, SpacePainter) or not extents:
        return None
    painter = replace(painter, plain=True, force=0.0, marks=Marks(painter.marks.pins))
    window = painter.window(extents)
    window[:, 0] -= 0.12 * skin.size
    window[:, 1] += 0.12 * skin.size
    aspect = float(np.clip(np.ptp(window[1]) / np.ptp(window[0]), 0.4, 1.3))
    figure, axes = empty(5.5, 5.5 * aspect)
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)
    painter.prepare(axes, window, 0.0)
    painter.draw(axes, snapshot)
    camera = painter.camera
    draw_supports(axes, camera, result.scene, skin, snapshot.place)
    for solid in result.scene.solids:
        own = snapshot.place[_own(skin, solid.name)]
        centre = camera.flat(0.5 * (own.min(axis=0) + own.max(axis=0)))
        speed = [constant(entry) or 0.0 for entry in solid.velocity]
        draw_velocity(axes, camera, centre, speed, _ARROW * skin.size, 1.2)
        back = camera.flat(np.array(speed) / (np.linalg.norm(speed) or 1.0))
        label(axes, centre - 0.08 * skin.size * back, solid.name)
    for body in (body for body in result.scene.bodies if body.faces() is not None):
        middle, way = body.box(), body.centre_velocity()
        if middle is not None and way is not None:
            flat = camera.flat(middle[1])
            label(axes, flat, body.name)
            draw_velocity(axes, camera, flat, way, _ARROW * skin.size, 1.2)
    for plate in result.scene.plates:
        x, y = camera.flat(snapshot.place[_own(skin, plate.name)].mean(axis=0))
        label(axes, (float(x) - 0.2 * skin.size, float(y)), plate.name)
    for point in result.scene.points:
        flat = camera.flat(np.array(point.position, dtype=np.float64))
        axes.plot(*flat, "o", color=EDGE, markersize=9, zorder=4)
        label(axes, flat - [0.0, 0.06 * skin.size], point.name)
        draw_velocity(axes, camera, flat, point.velocity or (), _ARROW * skin.size, 1.2)
    _gravity(axes, camera, result.scene, window, skin.size)
    return figure


def _own(skin: Skin, name: str) -> Integers:
    """Seen nodes of a body."""
    return skin.solid_nodes[skin.names.index(name)]


def draw_points_in_space(scene: Scene) -> Figure:
    """Points in space with the planes around them, in parallel projection."""
    points = scene.points
    places = np.array([point.position for point in points], dtype=np.float64)
    gravity = np.asarray(scene.vector_gravity.at(0.0), dtype=np.float64)
    vertical = -gravity / np.linalg.norm(gravity) if gravity.any() else np.eye(3)[1]
    obstacles: tuple[Any, ...] = scene.rigid_obstacles
    planes = [o for o in obstacles if o.plane_normal is not None]
    camera = Camera.facing(vertical, [np.array(plane.unit_normal) for plane in planes])
    centre = places.mean(axis=0)
    feet = [centre - gap[0] * normal[0] for gap, normal in
            (signed_distance(o, [centre], 0.0) for o in scene.rigid_obstacles)]  # fmt: skip
    reach = float(np.ptp([*places, *feet], axis=0).max()) or 1.0
    figure, axes = empty(5.5, 4.4)
    axes.set_aspect("equal")
    axes.set_axis_off()
    for plane in planes:
        corners, lines = plane.grid(centre, 0.8 * reach)
        axes.add_collection(PolyCollection([camera.flat(corners)], facecolors="0.92",
                                           edgecolors="0.7", alpha=0.7, zorder=0.5))  # fmt: skip
        axes.add_collection(LineCollection(list(camera.flat(lines)), colors="0.8", linewidths=0.5,
                                           zorder=0.6))  # fmt: skip
    for point, place in zip(points, places, strict=True):
        flat = camera.flat(place)
        axes.plot(*flat, "o", color=EDGE, markersize=9, zorder=4)
        label(axes, flat - [0.0, 0.06 * reach], point.name)
        draw_velocity(axes, camera, flat, point.velocity or (), _ARROW * reach, 1.2)
    axes.autoscale_view()
    window = np.array([axes.get_xlim(), axes.get_ylim()])
    _gravity(axes, camera, scene, window, reach)
    return figure


def _gravity(axes: Axes, camera: Camera, scene: Scene, window: Floats, size: float) -> None:
    gravity = np.asarray(scene.vector_gravity.at(0.0), dtype=np.float64)
    strength = float(np.linalg.norm(gravity))
    if strength:
        start = np.array([window[0, 1] - 0.12 * np.ptp(window[0]), window[1, 1] - 0.05 * size])
        way = 0.8 * _ARROW * size * camera.flat(gravity / strength)
        arrow(axes, start, way, GRAVITY)
        label(axes, start + 1.35 * way, quantity(strength, "m/s²", 4), GRAVITY)
