"""Rigid obstacles of moving pictures: outlines in the plane, meshes in space, with their motion."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.distance import on_a_line
from impactfem.report.page.chart import numbers
from impactfem.report.page.motion_data import packed, packed_indices
from impactfem.scene.obstacles.rotation import placement

_PLACES = ("point", "points", "normal")


def plane_obstacles(obstacles: Sequence[Any], times: Floats) -> list[dict[str, Any]]:
    """Obstacles in the plane at rest, and places of those that move; see `_way`."""
    return [_outline(obstacle) | _way(obstacle, times) for obstacle in obstacles]


def line_obstacles(obstacles: Sequence[Any], times: Floats) -> list[dict[str, Any]]:
    """Obstacles on a line as half planes, and their way, shape (frames, 2)."""
    made = []
    for obstacle in obstacles:
        places, side = on_a_line(obstacle, times)
        way = np.stack([places - places[0], np.zeros(len(times))], axis=1)
        found = {"name": obstacle.name, "shape": "half", "normal": [side, 0.0]}
        made.append(found | {"point": numbers([places[0], 0.0]), "way": numbers(way)})
    return made


def space_obstacles(
    obstacles: Sequence[Any], times: Floats, centre: Floats, reach: float
) -> list[dict[str, Any]]:
    """Surfaces of obstacles in space at rest, and places of those that move; see `_way`.

    Args:
        obstacles: Of a scene in space.
        times: Of the frames [s].
        centre: Where the bodies are [m], shape (3,).
        reach: How far endless obstacles are drawn from there [m].
    """
    made = []
    for obstacle in obstacles:
        faces, lines = obstacle.faces(centre, reach), obstacle.lines(centre, reach)
        corners, index = np.unique(
            np.round(faces.reshape(-1, 3), 12), axis=0, return_inverse=True
        )  # neighbours share corners
        made.append(
            {
                "name": obstacle.name,
                "corners": packed(corners),
                "triangles": packed_indices(index.ravel()),
                "lines": numbers(lines, 6),
            }
            | _way(obstacle, times)
        )
    return made


def _outline(obstacle: Any) -> dict[str, Any]:
    found: dict[str, Any] = obstacle.outline()
    return found | {name: numbers(found[name]) for name in _PLACES if name in found}


def _way(obstacle: Any, times: Floats) -> dict[str, Any]:
    """What places X of an obstacle at rest are at some times, turn X + way.

    Its shapes are (frames, dim, dim) and (frames, dim); no turn of those that only shift.
    """
    if not obstacle.moves:
        return {}
    placed = [placement(obstacle, float(t)) for t in times]
    dim = obstacle.rotation.dim if obstacle.rotation else len(obstacle.motion)
    found = {"way": numbers([at.moved(np.zeros(dim)) for at in placed])}
    turns = [at.turn.ravel() for at in placed if at.turn is not None]
    return found | ({"turn": numbers(turns)} if turns else {})
