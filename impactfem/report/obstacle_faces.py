"""Faces of rigid obstacles in space, for pictures."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_AROUND, _HIGH = 48, 24  # faces around an obstacle and along it


def faces_of(obstacle: Any, centre: Floats, reach: float) -> Floats:
    """Triangles whose normals point to the side of the body, at rest.

    Args:
        obstacle: Sphere, cylinder, box or polyline in space.
        centre: Where the body is [m], shape (3,).
        reach: How far endless obstacles are drawn from there [m].

    Returns:
        Corners, shape (triangles, 3, 3).
    """
    return _FACES[obstacle.kind](obstacle, centre, reach)


def grid_of_plane(
    obstacle: Any, shift: Floats, centre: Floats, reach: float
) -> tuple[Floats, Floats]:
    """A square of a half space's plane below a body, with lines at round distances.

    Args:
        obstacle: The half space.
        shift: Its displacement [m], shape (3,).
        centre: Where the body is [m].
        reach: Half the edge of the square [m].

    Returns:
        Corners (4, 3) and lines (lines, 2, 3), which are `spacing` apart.
    """
    normal = np.array(obstacle.unit_normal)
    first, second = square_to(normal)
    origin = np.array(obstacle.point, dtype=np.float64) + shift
    step = spacing(reach)
    # Lines stand still while the body moves along the plane.
    u, v = (centre - origin) @ first, (centre - origin) @ second
    lines = []
    for along, across, a, b in ((first, second, u, v), (second, first, v, u)):
        for k in range(int(np.ceil((b - reach) / step)), int((b + reach) // step) + 1):
            base = origin + k * step * across
            lines.append([base + (a - reach) * along, base + (a + reach) * along])
    corners = [
        origin + (u + i * reach) * first + (v + j * reach) * second
        for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return np.array(corners), np.array(lines)


def spacing(reach: float) -> float:
    """A round distance of lines, at most 12 of them on the square of `grid_of_plane` [m]."""
    power = 10.0 ** np.floor(np.log10(reach))
    return float(power * next(k for k in (0.2, 0.5, 1.0, 2.0) if 2 * reach / (k * power) <= 12))


def square_to(normal: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors square to a unit vector and to each other."""
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


def _patches(places: Floats) -> Floats:
    """Triangles between neighbours of a grid of places, shape (rows, columns, 3)."""
    a, b, c, d = places[:-1, :-1], places[1:, :-1], places[1:, 1:], places[:-1, 1:]
    halves = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2)
    return halves.reshape(-1, 3, 3)


def _facing(faces: Floats, outward: Floats) -> Floats:
    """Turn faces so that their normals go along given directions, shape (faces, 3)."""
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    wrong = np.einsum("ij,ij->i", normal, outward) < 0.0
    faces[wrong] = faces[wrong, ::-1]
    return faces


def _sphere(obstacle: Any, _: Floats, __: float) -> Floats:
    polar = np.linspace(0.0, np.pi, _HIGH + 1)[:, None]
    around = np.linspace(0.0, 2.0 * np.pi, _AROUND + 1)[None]
    x, y, z = np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)
    arms = np.stack([x, y + 0.0 * around, z], axis=2)
    centre = np.array(obstacle.center)
    faces = _patches(centre + obstacle.radius * arms)
    return _facing(faces, _side(obstacle) * (faces.mean(axis=1) - centre))


def _cylinder(obstacle: Any, centre: Floats, reach: float) -> Floats:
    axis, point = np.array(obstacle.unit_axis), np.array(obstacle.point)
    first, second = square_to(axis)
    middle = point + ((centre - point) @ axis) * axis
    around = np.linspace(0.0, 2.0 * np.pi, _AROUND + 1)
    ring = obstacle.radius * (np.outer(np.cos(around), first) + np.outer(np.sin(around), second))
    along = np.linspace(-reach, reach, _HIGH + 1)[:, None, None] * axis
    faces = _patches(middle + along + ring)
    arms = faces.mean(axis=1) - middle
    arms -= np.outer(arms @ axis, axis)
    return _facing(faces, _side(obstacle) * arms)


def _box(obstacle: Any, _: Floats, __: float) -> Floats:
    cosine, sine = np.cos(obstacle.angle), np.sin(obstacle.angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    faces = []
    steps = np.linspace(-0.5, 0.5, 9)
    for axis in range(3):
        for side in (-0.5, 0.5):
            places = np.full((9, 9, 3), side)
            places[:, :, (axis + 1) % 3], places[:, :, (axis + 2) % 3] = np.meshgrid(steps, steps)
            patches = _patches(places)
            faces.append(_facing(patches, np.tile(np.sign(side) * np.eye(3)[axis], (128, 1))))
    placed: Floats = np.concatenate(faces) * np.array(obstacle.size) @ turn.T
    return placed + np.array(obstacle.center, dtype=np.float64)


def _polyline(obstacle: Any, centre: Floats, reach: float) -> Floats:
    """The chain extruded along z; the body is on its left."""
    faces = []
    heights = centre[2] + np.linspace(-reach, reach, _HIGH + 1)
    for start, end in zip(obstacle.points[:-1], obstacle.points[1:], strict=True):
        places = np.empty((9, _HIGH + 1, 3))
        places[:, :, :2] = np.linspace(start, end, 9)[:, None]
        places[:, :, 2] = heights
        left = np.array([start[1] - end[1], end[0] - start[0], 0.0])
        patches = _patches(places)
        faces.append(_facing(patches, np.tile(left, (len(patches), 1))))
    return np.concatenate(faces)


def _side(obstacle: Any) -> float:
    return -1.0 if obstacle.side == "inside" else 1.0


_FACES: dict[str, Callable[[Any, Floats, float], Floats]] = {
    "sphere": _sphere,
    "cylinder": _cylinder,
    "box": _box,
    "polyline": _polyline,
}
