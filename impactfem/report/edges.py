"""Normals of faces, and edges of surfaces: where two meet at an angle or a surface ends."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats, Integers

_SHARP = np.cos(np.radians(40.0))
_SAME = 1e-9  # of the size: nodes nearer to each other are one


def normals(points: Floats, triangles: Integers) -> Floats:
    """Normals of triangles, as long as twice their areas; shape (triangles, 3)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def unit_normals(corners: Floats) -> Floats:
    """Unit normals of faces given by their corners (faces, 3 or more, 3), shape (faces, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None])


def feature_edges(
    points: Floats, triangles: Integers, groups: NDArray[Any] | None = None
) -> tuple[Integers, Integers]:
    """Edges that tell the shape of a surface.

    Args:
        points: Nodes [m], shape (nodes, 3); nodes at one place, as on a plane of symmetry, are one.
        triangles: With their normals outward, shape (triangles, 3).
        groups: Of the triangles: where two meet there is an edge too, shape (triangles,).

    Returns:
        The ends of each edge, shape (edges, 2), and the one or two triangles beside it, (edges, 2).
    """
    none = np.empty((0, 2), dtype=np.int64)
    if not len(triangles):
        return none, none
    size = float(np.ptp(points, axis=0).max()) or 1.0
    place = np.unique(np.round(points / (_SAME * size)), axis=0, return_inverse=True)[1].ravel()
    ordered = np.sort(place[triangles], axis=1)
    proper = np.flatnonzero((np.diff(ordered, axis=1) > 0).all(axis=1))
    normal = unit_normals(points[triangles])
    ends = triangles[proper][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    owners = np.repeat(proper, 3)
    keys = np.sort(place[ends], axis=1)
    order = np.lexsort(keys.T)
    keys, ends, owners = keys[order], ends[order], owners[order]
    new = np.append(True, (keys[1:] != keys[:-1]).any(axis=1))
    first = np.flatnonzero(new)
    count = np.diff(np.append(first, len(keys)))
    second = first + np.minimum(count, 2) - 1
    beside = np.stack([owners[first], owners[second]], axis=1)
    sharp = np.einsum("ij,ij->i", normal[beside[:, 0]], normal[beside[:, 1]]) < _SHARP
    if groups is not None:
        sharp |= groups[beside[:, 0]] != groups[beside[:, 1]]
    shown = (count == 1) | ((count == 2) & sharp)
    return ends[first][shown], beside[shown]
