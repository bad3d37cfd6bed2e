"""Surfaces for the tests of mortar contact: lines, squares and spheres, of degree 1 and 2."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay

from impactfem.contact.mortar_surface import Kind, Surface, surface

Floats = NDArray[np.float64]
SIDES = {"interval": [[0, 1]], "triangle": [[1, 2], [0, 2], [0, 1]],
         "quadrilateral": [[0, 1], [0, 2], [1, 3], [2, 3]]}  # fmt: skip


def raised(points: Floats, faces: NDArray[np.int64], kind: Kind, degree: int) -> Surface:
    """Give faces middles (and centres), numbered after the corners."""
    if degree == 2:
        ends = np.sort(faces[:, SIDES[kind]], axis=2)
        edges, place = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
        middles = len(points) + place.reshape(ends.shape[:2])
        parts = [points, points[edges].mean(axis=1)]
        columns = [faces, middles]
        if kind == "quadrilateral":
            columns.append((len(points) + len(edges) + np.arange(len(faces)))[:, None])
            parts.append(points[faces].mean(axis=1))
        points, faces = np.concatenate(parts), np.concatenate(columns, axis=1)
    return surface(points, faces, kind)


def facing(side: Surface, outward: Floats) -> Surface:
    """The same surface with its outside towards some directions, (dim,) or (faces, dim)."""
    towards = np.broadcast_to(outward, (len(side.faces), side.dim))
    return surface(side.points, side.faces, side.kind, towards)


def cuts(rng: np.random.Generator, count: int, low: float = 0.0, high: float = 1.0) -> Floats:
    """Irregular places from low to high, no two close together."""
    steps = np.cumsum(0.3 + rng.random(count))
    return np.concatenate([[low], low + (high - low) * steps / steps[-1]])


def segment(x: Floats, degree: int = 1, *, height: float = 0.0, up: bool = True) -> Surface:
    """A straight line along the first axis, with its outside up or down."""
    points = np.stack([x, np.full(len(x), height)], axis=1)
    faces = np.stack([np.arange(len(x) - 1), np.arange(1, len(x))], axis=1)
    made = raised(points, faces, "interval", degree)
    return facing(made, np.array([0.0, 1.0 if up else -1.0]))


def square(
    kind: Kind,
    x: Floats,
    y: Floats,
    degree: int = 1,
    *,
    height: float = 0.0,
    up: bool = True,
    bend: Callable[[Floats], Floats] | None = None,
) -> Surface:
    """A grid of faces across the third axis; bend moves its corners in the plane."""
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(grid)).reshape(len(x), len(y))
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]], axis=-1)
    faces = quads.reshape(-1, 4)
    if kind == "triangle":
        faces = np.concatenate([faces[:, [0, 1, 3]], faces[:, [0, 2, 3]]])
    plane = grid if bend is None else bend(grid)
    points = np.concatenate([plane, np.full((len(grid), 1), height)], axis=1)
    return facing(raised(points, faces, kind, degree), np.array([0, 0, 1.0 if up else -1.0]))


def cloud(
    rng: np.random.Generator, count: int, degree: int = 1, *, height: float = 0.0, up: bool = True
) -> Surface:
    """A unit square of irregular triangles across the third axis."""
    side = np.linspace(0, 1, 4)
    rim = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    rim = rim[(rim % 1.0 == 0.0).any(axis=1)]
    plane = np.concatenate([rim, 0.1 + 0.8 * rng.random((count, 2))])
    points = np.concatenate([plane, np.full((len(plane), 1), height)], axis=1)
    faces = Delaunay(plane).simplices.astype(np.int64)
    return facing(raised(points, faces, "triangle", degree), np.array([0, 0, 1.0 if up else -1.0]))


def sphere(count: int, radius: float, centre: Floats, degree: int = 1) -> Surface:
    """A sphere of triangles with all nodes on it (spiral of Fibonacci)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    points = np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], 1)
    faces = ConvexHull(points).simplices.astype(np.int64)
    made = raised(points, faces, "triangle", degree)
    on = made.points / np.linalg.norm(made.points, axis=1)[:, None]
    return facing(made.moved(centre + radius * on), on[faces].mean(axis=1))


def loads(side: Surface) -> Floats:
    """Areas of the shape functions of flat faces with straight sides, shape (nodes,).

    Quadrilaterals of degree 1 may have any shape: the integral of (1 - r)(1 - s) over one of them,
    with the linear Jacobian J, by Simpson's rule in both directions, which is exact.
    """
    x = side.points[side.corners]
    if side.kind == "interval":
        area = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)[:, None]
        parts = area * np.array([[1 / 2, 1 / 2], [1 / 6, 1 / 6, 2 / 3]][side.degree - 1])
    elif side.kind == "triangle":
        area = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)[:, None] / 2
        parts = area * np.array([[1 / 3] * 3, [0, 0, 0, 1 / 3, 1 / 3, 1 / 3]][side.degree - 1])
    else:
        corner = [np.cross(x[:, b] - x[:, a], x[:, c] - x[:, a]) for a, b, c in
                  ((0, 1, 2), (1, 3, 0), (2, 0, 3), (3, 2, 1))]  # fmt: skip
        jacobian = np.linalg.norm(corner, axis=2).T  # bilinear, in fact linear, of r and s
        if side.degree == 1:
            line = np.array([[2, 1], [1, 2]]) / 6
            parts = jacobian @ np.kron(line, line)
        else:
            one = np.array([1, 4, 1]) / 6  # functions at 0, 1/2, 1 of a rectangle
            order = [0, 2, 6, 8, 1, 3, 5, 7, 4]
            parts = jacobian.mean(axis=1)[:, None] * np.outer(one, one).ravel()[order]
    return np.bincount(side.faces.ravel(), parts.ravel(), minlength=len(side.points))


def turned(side: Surface, rotation: Floats, shift: Floats) -> Surface:
    """The same surface after a rigid motion."""
    return side.moved(side.points @ rotation.T + shift)
