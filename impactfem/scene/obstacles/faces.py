"""Faces of obstacles in space, for pictures."""

import numpy as np
from numpy.typing import NDArray

type Floats = NDArray[np.float64]

AROUND, HIGH = 48, 24
"""Faces around an obstacle and along it."""


def spacing(reach: float) -> float:
    """A round distance of lines, at most 12 of them on the square of a half-space [m]."""
    power = 10.0 ** np.floor(np.log10(reach))
    return float(power * next(k for k in (0.2, 0.5, 1.0, 2.0) if 2 * reach / (k * power) <= 12))


def square_to(normal: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors square to a unit vector and to each other."""
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


def patches(places: Floats) -> Floats:
    """Triangles between neighbours of a grid of places, shape (rows, columns, 3)."""
    a, b, c, d = places[:-1, :-1], places[1:, :-1], places[1:, 1:], places[:-1, 1:]
    halves = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2)
    return halves.reshape(-1, 3, 3)


def facing(faces: Floats, outward: Floats) -> Floats:
    """Turn faces so that their normals go along given directions, shape (faces, 3)."""
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    wrong = np.einsum("ij,ij->i", normal, outward) < 0.0
    faces[wrong] = faces[wrong, ::-1]
    return faces
