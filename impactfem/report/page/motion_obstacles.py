"""Rigid obstacles of moving pictures: outlines in the plane, meshes in space, with their motion."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.distance import translation
from impactfem.report.obstacle_faces import faces_of, grid_of_plane
from impactfem.report.page.chart import numbers
from impactfem.report.page.motion_data import packed, packed_indices
from impactfem.scene import HalfSpace, RigidBox, RigidCylinder, RigidPolyline, RigidSphere

Floats = NDArray[np.float64]


def plane_obstacles(obstacles: Sequence[Any], times: Floats) -> list[dict[str, Any]]:
    """Obstacles in the plane at rest, and the way of those that move, shape (frames, 2)."""
    return [_outline(obstacle) | _way(obstacle, times) for obstacle in obstacles]


def space_obstacles(
    obstacles: Sequence[Any], times: Floats, centre: Floats, reach: float
) -> list[dict[str, Any]]:
    """Surfaces of obstacles in space at rest, and the way of those that move, shape (frames, 3).

    Args:
        obstacles: Of a scene in space.
        times: Of the frames [s].
        centre: Where the bodies are [m], shape (3,).
        reach: How far endless obstacles are drawn from there [m].
    """
    made = []
    for obstacle in obstacles:
        if isinstance(obstacle, HalfSpace):
            corners, lines = grid_of_plane(obstacle, np.zeros(3), centre, reach)
            faces = corners[np.array([[0, 1, 2], [0, 2, 3]])]
        else:
            faces, lines = faces_of(obstacle, centre, reach), np.empty((0, 2, 3))
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
    if isinstance(obstacle, HalfSpace):
        normal = numbers(obstacle.unit_normal)
        return {"shape": "half", "point": numbers(obstacle.point), "normal": normal}
    if isinstance(obstacle, RigidSphere | RigidCylinder):
        centre = obstacle.center if isinstance(obstacle, RigidSphere) else obstacle.point
        return {
            "shape": "circle", "point": numbers(centre[:2]), "radius": obstacle.radius,
            "inside": obstacle.side == "inside",
        }  # fmt: skip
    if isinstance(obstacle, RigidBox):
        cosine, sine = np.cos(obstacle.angle), np.sin(obstacle.angle)
        turn = np.array([[cosine, -sine], [sine, cosine]])
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) / 2
        places = corners * np.array(obstacle.size[:2]) @ turn.T + np.array(obstacle.center[:2])
        return {"shape": "chain", "points": numbers(places), "closed": True, "inside": False}
    if isinstance(obstacle, RigidPolyline):
        places = np.array(obstacle.points)
        closed = bool((places[0] == places[-1]).all())
        x, y = places.T
        turning = float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))  # > 0: the left is inside
        return {
            "shape": "chain", "points": numbers(places), "closed": closed,
            "inside": closed and turning > 0.0,
        }  # fmt: skip
    raise TypeError(f"no outline of {obstacle!r}")


def _way(obstacle: Any, times: Floats) -> dict[str, Any]:
    if obstacle.motion is None:
        return {}
    return {"way": numbers([np.atleast_1d(translation(obstacle, float(t))) for t in times])}
