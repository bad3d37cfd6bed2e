"""Supports and loads of bodies in space, for the drawing of a scene."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.report.camera import Camera
from impactfem.report.edges import feature_edges, normals, unit_normals
from impactfem.report.page.outlines import told_surfaces
from impactfem.report.page.sketch import SUPPORT, arrow, label
from impactfem.report.skin import Skin
from impactfem.scene import Scene, Solid
from impactfem.scene.plate import Plate

_SQUARE, _AT = 0.95, 1e-3  # cosine, and share of the size, by which a face is that of an axis
_ARROW = 0.16  # length of arrows, as a share of the size
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 97)
_HELD = {
    "clamped": "clamped",
    "simply_supported": "simply supported",
    "soft_support": "supported",
    "elastic": "elastic",
}


def draw_supports(axes: Axes, camera: Camera, scene: Scene, skin: Skin, place: Floats) -> None:
    """Draw what holds and loads the bodies: edges of faces, arrows of pressures, and words.

    Args:
        axes: Where.
        camera: From where they are seen.
        scene: With the bodies.
        skin: Of the bodies.
        place: Of its nodes at t = 0 [m], shape (nodes, 3).
    """
    for solid in scene.solids:
        _draw_solid(axes, camera, solid, skin, place)
    for plate in scene.plates:
        _draw_plate(axes, camera, plate, skin.size)


def surface_triangles(solid: Solid, skin: Skin, name: str) -> Integers:
    """Triangles of a face of a solid by its name; none if a mesh file has it."""
    none = np.empty((0, 3), dtype=np.int64)
    if solid.shape is None or solid.name not in skin.names:
        return none
    own = skin.triangles[skin.bodies[skin.triangles[:, 0]] == skin.names.index(solid.name)]
    figure, centre = solid.shape.figure, np.array(solid.shape.centre)
    cosine, sine = np.cos(solid.shape.angle), np.sin(solid.shape.angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    points = (skin.points - centre) @ turn
    corners = points[own]
    normal, middle = unit_normals(corners), corners.mean(axis=1)
    plane = {
        face: _is_end(middle, normal, 1 if figure.height is not None else k // 2, 2 * (k % 2) - 1)
        for k, face in enumerate(figure.faces)
    }
    if name in plane:
        return np.asarray(own[plane[name]])
    if name in figure.radii:
        about = [0, 2] if figure.height is not None else [0, 1, 2]
        apart = np.linalg.norm(corners[:, :, about], axis=2) - figure.radii[name]
        return np.asarray(own[(np.abs(apart) < _AT * figure.largest).all(axis=1)])
    return none


def _is_end(middle: Floats, normal: Floats, axis: int, sign: int) -> Booleans:
    along = sign * middle[:, axis]
    near = along > along.max(initial=-np.inf) - _AT * float(np.ptp(middle, axis=0).max())
    return np.asarray(near & (sign * normal[:, axis] > _SQUARE))


def _draw_solid(axes: Axes, camera: Camera, solid: Solid, skin: Skin, place: Floats) -> None:
    for name, text in told_surfaces(solid):
        faces = surface_triangles(solid, skin, name)
        if not len(faces):
            continue
        ends, _ = feature_edges(place, faces)
        _lines(axes, camera.flat(place[ends]))
        outward = normals(place, faces).sum(axis=0)
        size = float(np.linalg.norm(outward)) or 1.0
        flat = camera.flat(place[np.unique(faces)])
        is_round = solid.shape is not None and name in solid.shape.figure.radii
        middle = flat[np.argmin(flat[:, 0])] if is_round else flat.mean(axis=0)
        if text.startswith("pressure"):
            way = _ARROW * skin.size * camera.flat(outward / size)
            arrow(axes, middle + way, -way, SUPPORT)
            middle = middle + 1.3 * way
        label(axes, middle, text, SUPPORT)


def _draw_plate(axes: Axes, camera: Camera, plate: Plate, size: float) -> None:
    centre, frame = plate.frame
    edges = {} if plate.outline is None else _edges(plate.outline)
    told: dict[str, list[Floats]] = {}
    for support in plate.supports:
        if support.edge in edges and (word := _HELD.get(support.kind)):
            places = centre + edges[support.edge] @ frame[:2]
            _lines(axes, camera.flat(places)[None])
            told.setdefault(word, []).append(places.mean(axis=0) if len(places) == 2 else places[0])
    for word, middles in told.items():  # one word for all edges that are held alike
        lowest = min(middles, key=lambda place: float(camera.flat(place)[1]))
        label(axes, camera.flat(centre + 1.08 * (lowest - centre)), word, SUPPORT)
    for pressure in plate.pressures:
        way = (_ARROW if pressure.face == "top" else -_ARROW) * size * frame[2]
        arrow(axes, camera.flat(centre + way), -camera.flat(way), SUPPORT)
        text = f"pressure on the {pressure.face}"
        label(axes, camera.flat(centre + 1.3 * way), text, SUPPORT)


def _edges(outline: Any) -> dict[str, Floats]:
    """Edges of the outline of a plate by name, places (2 or more, 2) [m]."""
    if hasattr(outline, "corners"):
        after = np.roll(outline.corners, -1, axis=0)
        pairs = np.stack([outline.corners, after], axis=1)
        return dict(zip(outline.edges, pairs, strict=True))
    if hasattr(outline, "size"):
        a, b = 0.5 * np.array(outline.size)
        low = [(-a, -b), (-a, b)], [(a, -b), (a, b)], [(-a, -b), (a, -b)], [(-a, b), (a, b)]
        return dict(zip(outline.edges, map(np.array, low), strict=True))
    circle = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=1)
    radii = (outline.radius, getattr(outline, "inner_radius", 0.0))
    return {name: r * circle for name, r in zip(outline.edges, radii, strict=False)}


def _lines(axes: Axes, lines: Floats) -> None:
    collection = LineCollection(list(lines), colors=SUPPORT, linewidths=2.5, zorder=3)
    axes.add_collection(collection, autolim=False)
