"""A meshed surface as plain arrays, for the contact of two bodies: faces, sides, directions."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats, Integers
from impactfem.contact.line_kernels import line_vectors

Kind = Literal["interval", "triangle", "quadrilateral"]


class FaceKind(NamedTuple):
    """What is so of all faces of a kind.

    Nodes stand in DOLFINx's order: corners, then middles of sides, then the centre.

    Attributes:
        corners: Number of corners.
        parts: By degree from 1 on, nodes around each flat part in the sense of the reference face.
        places: Places of the nodes in the reference face, those of degree 2.
        across: Places in a flat part of the ends of the two vectors that span it, in space.
        bilinear: Whether shape functions are products of those of two sides.
    """

    corners: int
    parts: tuple[list[list[int]], list[list[int]]]
    places: list[list[float]]
    across: tuple[tuple[int, int], ...] = ()
    bilinear: bool = False


_FACES: Mapping[Kind, FaceKind] = {
    "interval": FaceKind(2, ([[0, 1]], [[0, 2], [2, 1]]), [[0.0], [1.0], [0.5]]),
    "triangle": FaceKind(
        3,
        ([[0, 1, 2]], [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]]),
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5], [0.0, 0.5], [0.5, 0.0]],
        ((0, 1), (0, 2)),
    ),
    "quadrilateral": FaceKind(
        4,
        ([[0, 1, 3, 2]], [[0, 4, 8, 5], [4, 1, 6, 8], [5, 8, 7, 2], [8, 6, 3, 7]]),
        [
            [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0],
            [0.5, 0.0], [0.0, 0.5], [1.0, 0.5], [0.5, 1.0], [0.5, 0.5],
        ],
        ((0, 2), (1, 3)),
        bilinear=True,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Surface:
    """Faces of a body's outside with their nodes; make it with `surface`.

    Attributes:
        points: Places of the nodes [m], shape (nodes, dim).
        faces: Nodes of each face in the order of the mesh, shape (faces, nodes per face).
        kind: Kind of the faces; intervals in the plane, the others in space.
        sides: 1 where the normal that follows from the order of the nodes points outwards, -1
            elsewhere, shape (faces,). That normal is (t_y, -t_x) for a tangent t in the plane and
            x_r cross x_s in space.
    """

    points: Floats
    faces: Integers
    kind: Kind
    sides: Floats

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return int(self.points.shape[1])

    @property
    def degree(self) -> int:
        """Degree of the faces, 1 or 2."""
        return 1 + _nodes(self.kind).index(self.faces.shape[1])

    @property
    def corners(self) -> Integers:
        """Corners of each face, shape (faces, corners)."""
        return self.faces[:, : _FACES[self.kind].corners]

    @property
    def bilinear(self) -> bool:
        """Whether shape functions are products of those of two sides."""
        return _FACES[self.kind].bilinear

    @property
    def parts(self) -> Integers:
        """Nodes around each flat part of a face, shape (parts, corners)."""
        return _parts(self.kind, self.degree)

    @property
    def places(self) -> Floats:
        """Places of those nodes in the reference face, shape (parts, corners, dim - 1)."""
        return np.array(_FACES[self.kind].places)[self.parts]

    def moved(self, points: ArrayLike) -> "Surface":
        """The same surface with its nodes elsewhere, shape (nodes, dim)."""
        return replace(self, points=np.ascontiguousarray(points, dtype=np.float64))

    @cached_property
    def vectors(self) -> Floats:
        """Outward normals of the flat parts times their area, shape (faces, parts, dim)."""
        if self.dim == 2:
            return np.asarray(line_vectors(self.points, self.faces, self.sides, self.parts))
        x = self.points[self.faces][:, self.parts]  # (faces, parts, corners, dim)
        one, two = (x[:, :, b] - x[:, :, a] for a, b in _FACES[self.kind].across)
        return np.asarray(0.5 * np.cross(one, two) * self.sides[:, None, None])


def surface(
    points: ArrayLike, faces: ArrayLike, kind: Kind, outward: ArrayLike | None = None
) -> Surface:
    """Make a surface from arrays, such as those of a `Boundary`.

    Args:
        points: Places of the nodes [m], shape (nodes, dim).
        faces: Nodes of each face, shape (faces, nodes per face); degree 1 or 2.
        kind: "interval", "triangle" or "quadrilateral".
        outward: Directions roughly out of the body, shape (faces, dim); None if the order of the
            nodes says so.

    Raises:
        ValueError: The arrays do not fit the kind.
    """
    places = np.ascontiguousarray(points, dtype=np.float64)
    nodes = np.ascontiguousarray(faces, dtype=np.int64)
    dim = 1 + len(_FACES[kind].places[0])
    if nodes.ndim != 2 or nodes.shape[1] not in _nodes(kind) or places.shape[1:] != (dim,):
        raise ValueError(
            f"a surface of faces of kind {kind!r} takes points of shape (nodes, {dim}) and faces "
            f"of {_nodes(kind)} nodes, not {places.shape} and {nodes.shape}"
        )
    found = Surface(places, nodes, kind, np.ones(len(nodes)))
    if outward is None:
        return found
    along = np.einsum("fd,fd->f", found.vectors.sum(axis=1), np.asarray(outward))
    return replace(found, sides=np.where(along < 0.0, -1.0, 1.0))


@cache
def _parts(kind: Kind, degree: int) -> Integers:
    """Nodes around each flat part of a face, shape (parts, corners)."""
    return np.array(_FACES[kind].parts[degree - 1], dtype=np.int64)


def _nodes(kind: Kind) -> tuple[int, int]:
    """Nodes of a face of degree 1 and 2."""
    return _FACES[kind].corners, len(_FACES[kind].places)


def unit(vectors: Floats) -> Floats:
    """Vectors along the last axis, made of length 1 (those of length 0 stay)."""
    length = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


class Overlap(NamedTuple):
    """Integrals over the overlaps of pairs of faces, for some pairs.

    With psi_i the linear functions of the carrier's corners and phi_j the shape functions:

    Attributes:
        carrier: Integrals of psi_i phi_j of the carrier, shape (pairs, corners, nodes per face).
        other: Integrals of psi_i phi_k of the other surface at the points opposite, likewise.
        vectors: Integrals of psi_i times the carrier's outward normal, (pairs, corners, dim).
        cover: Share of the carrier's face that is overlapped, shape (pairs,).
        gap: Mean distance along the carrier's normal [m], shape (pairs,).
    """

    carrier: Floats
    other: Floats
    vectors: Floats
    cover: Floats
    gap: Floats
