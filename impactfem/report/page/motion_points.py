"""The moving picture of points with their trails."""

from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.distance import on_a_line
from impactfem.report.camera import FLAT, Camera
from impactfem.report.page.chart import numbers
from impactfem.report.page.motion_data import telling_frames
from impactfem.report.page.motion_obstacles import plane_obstacles
from impactfem.report.panel import evenly
from impactfem.result import Record
from impactfem.result.shapes import as_vectors
from impactfem.scene.obstacles.rotation import placement

MOST_FRAMES = 240
"""Frames of points at most: they take little room."""

_ROWS = 1500  # of a trail
_NUMBERS = 150_000  # of all trails together
_TRAIL = 0.2  # share of the duration that is drawn behind a point on a line


def points_motion(result: Record, radii: Floats) -> dict[str, Any] | None:
    """Data of points, and their radii [m], (points,).

    Returns:
        None if no row of the history is finite.
    """
    rows, at = _rows(result)
    if not len(rows):
        return None
    own = _on_a_line(result, rows) if result.scene.dim == 1 else _in_the_plane(result, rows, at)
    time = result.rows["time"].values[rows]
    return {
        "kind": "points", "times": time[at], "at": at.tolist(), "time": numbers(time),
        "names": [body.name for body in result.scene.bodies],
        "radii": numbers(radii),
        "factors": [1.0], "factor": 1.0,
    } | own  # fmt: skip


def _rows(result: Record) -> tuple[Integers, Integers]:
    """Rows of the history for trails, and which of these are frames."""
    history, scene = result.rows, result.scene
    columns = [f"{body.name}.{c}" for body in scene.bodies for c in "xyz"[: scene.dim]]
    values = np.array([history[name].values for name in columns])
    finite = np.flatnonzero(np.isfinite(values).all(axis=0))
    if not len(finite):
        return finite, finite
    time = history["time"].values[finite]
    most = int(np.clip(_NUMBERS / len(columns), 60, _ROWS))
    frames = telling_frames(result, time, min(most, MOST_FRAMES))
    kept = np.union1d(frames, evenly(len(finite), most)) if most > len(frames) else frames
    return finite[kept], np.searchsorted(kept, frames)


def _places(result: Record, rows: Integers) -> Floats:
    """Places of all points, shape (rows, points, dim)."""
    letters = "xyz"[: result.scene.dim]
    columns = [
        [result.rows[f"{body.name}.{letter}"].values[rows] for letter in letters]
        for body in result.scene.bodies
    ]
    return np.transpose(np.array(columns), (2, 0, 1))


def _on_a_line(result: Record, rows: Integers) -> dict[str, Any]:
    """Places and obstacles over time: a paper strip that the points draw on."""
    scene, time = result.scene, result.rows["time"].values[rows]
    obstacles = []
    for obstacle in scene.rigid_obstacles:
        place, side = on_a_line(obstacle, time)
        obstacles.append({"name": obstacle.name, "place": numbers(place), "side": side})
    falls = scene.vector_gravity.at(0.0)[0] != 0.0
    return {
        "dim": 1,
        "caption": (
            "The points on their line, with the last part of their motion behind them as on a "
            "moving strip of paper; grey is the obstacle."
            if obstacles
            else "The points on their line, with the last part of their motion behind them as on "
            "a moving strip of paper."
        ),
        "places": [numbers(column) for column in _places(result, rows)[:, :, 0].T],
        "obstacles": obstacles,
        "upright": bool(falls or len(scene.bodies) == 1),
        "trail": float(_TRAIL * (time[-1] - time[0])),
    }


def _in_the_plane(result: Record, rows: Integers, at: Integers) -> dict[str, Any]:
    """Paths in the plane; those in space as a camera sees them."""
    scene = result.scene
    places = _places(result, rows)
    times = result.rows["time"].values[rows][at]
    seen: dict[str, Any]
    camera = FLAT if scene.dim == 2 else Camera.of(scene)
    if scene.dim == 2:
        seen = {"obstacles": plane_obstacles(scene.obstacles, times), "outlines": []}
        caption = "The points in the plane with the path that they have gone; grey is rigid."
    else:
        seen = {"obstacles": [], "outlines": _outlines(result, camera, places, times)}
        caption = "The points with the path that they have gone, in parallel projection."
    flat = camera.flat(as_vectors(places))
    anchors = [
        [k, numbers(camera.flat(as_vectors(spring.anchor)))]
        for k, spring in _springs(result)
        if spring.anchor is not None
    ]
    names = [body.name for body in scene.bodies]
    links = [[k, names.index(spring.to)] for k, spring in _springs(result) if spring.to is not None]
    return {
        "dim": 2, "caption": caption, "links": links, "anchors": anchors,
        "places": [numbers(column) for column in np.transpose(flat, (1, 0, 2))], **seen,
    }  # fmt: skip


def _springs(result: Record) -> list[tuple[int, Any]]:
    """Springs with the index of the point that they pull."""
    bodies: tuple[Any, ...] = result.scene.bodies
    return [(k, spring) for k, body in enumerate(bodies) for spring in body.springs]


def _outlines(
    result: Record, camera: Camera, places: Floats, times: Floats
) -> list[dict[str, Any]]:
    """Obstacles in space as lines of the picture: grids of planes, outlines of round ones."""
    low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
    centre, reach = 0.5 * (low + high), 0.7 * float(np.max(high - low)) or 1.0
    made: list[dict[str, Any]] = []
    for obstacle in result.scene.rigid_obstacles:
        faces, lines = obstacle.faces(centre, reach), obstacle.lines(centre, reach)
        placed = [placement(obstacle, float(t)) for t in times]
        if obstacle.rotation:
            each = [_drawn(camera, at.moved(faces), at.moved(lines)) for at in placed]
            made.append({"lines": each[0], "frames": each})
            continue
        made.append({"lines": _drawn(camera, faces, lines)})
        if obstacle.moves:
            ways = np.array([at.moved(np.zeros(3)) for at in placed])
            made[-1]["way"] = numbers(camera.flat(ways))
    return made


def _drawn(camera: Camera, faces: Floats, lines: Floats) -> list[list[float | None]]:
    """Lines of an obstacle as the camera sees it; of a closed one its outline."""
    shown = [*_rim(faces), *lines]
    if not shown:
        seen = np.unique(camera.flat(faces.reshape(-1, 3)).round(12), axis=0)
        hull = _hull(seen)
        return [numbers(seen[np.append(hull, hull[0])])]
    return [numbers(camera.flat(line)) for line in shown]


def _rim(faces: Floats) -> Floats:
    """Edges that belong to one triangle only, shape (edges, 2, 3)."""
    corners, index = np.unique(faces.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    triangles = index.reshape(-1, 3)
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]],
                                    triangles[:, [2, 0]]]), axis=1)  # fmt: skip
    edges = edges[edges[:, 0] != edges[:, 1]]
    found, times = np.unique(edges, axis=0, return_counts=True)
    rim: Floats = corners[found[times == 1]]
    return rim


def _hull(places: Floats) -> Integers:
    """Places in the plane (count, 2) that their convex hull goes through, in order."""
    from scipy.spatial import ConvexHull  # noqa: PLC0415  # slow to load, seldom needed

    return np.asarray(ConvexHull(places).vertices, dtype=np.int64)
