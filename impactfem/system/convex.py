"""Convex bodies as contact sees them: a core of corners, edges and faces, and a radius around it.

A round cylinder is a prism that is turned about its axis, layer by layer, so that one of its edges
is the line, or its end the rim's place, that looks at what it meets. An ellipsoid is the ball that
touches it from inside where it is met: with the least radius of curvature it fits everywhere. The
next way from its centre to what is met tells the next place, until they are the same (A. Lin,
S.-P. Han, SIAM J. Optim. 13 (2002) 298-308).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from impactfem.arrays import Booleans, Floats, Integers

type Placed = tuple[Floats, Floats, Booleans, Integers, Integers, Integers, Floats, float]
"""Corners, normals of faces, which are flat, starts of their loops, corners of these, edges,
directions of edges, radius: as `impactfem.contact.convex_kernels` takes a body."""

_SAME = 1e-9  # share of the size, or difference of normals, that is none
_AROUND = 8  # sides of the prism of a cylinder
_LEVEL = 1e-6  # sine of the angle to the axis below which a cylinder is met end-on
_END_ON = 0.95  # cosine of it from which a cylinder stands, and does not roll


@dataclass(frozen=True)
class Convex:
    """A convex body, along its own axes; in the plane z is 0.

    Attributes:
        vertices: Corners of the core [m], (corners, 3).
        normals: Outward ones of its faces, in the plane of its edges, (faces, 3).
        flat: Which faces are those of the body, and not of a prism only, (faces,).
        starts: Where the loops of faces begin in `loop`, (faces + 1,).
        loop: Corners around each face, seen from outside.
        edges: Pairs of corners, (edges, 2).
        ways: Their directions, each once, (ways, 3).
        radius: Around the core [m].
        axis: Of a round cylinder, (3,).
        girth: Radius of that cylinder [m].
        radii: Half axes of an ellipsoid [m], (3,).
    """

    vertices: Floats
    normals: Floats
    flat: Booleans
    starts: Integers
    loop: Integers
    edges: Integers
    ways: Floats
    radius: float
    axis: Floats | None = None
    girth: float = 0.0
    radii: Floats | None = None

    @classmethod
    def of(cls, points: Floats, radius: float = 0.0) -> "Convex":
        """The hull of points (points, 2 or 3), at least one, and what is within a radius of it."""
        dim = points.shape[1]
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if len(points) < 3 or spread[1] <= _SAME * spread[0]:
            return cls._line(points, radius)
        return cls._polygon(points, radius) if dim == 2 else cls._polyhedron(points, radius)

    @classmethod
    def _line(cls, points: Floats, radius: float) -> "Convex":
        """A point, or a line; a line in the plane has two sides."""
        dim, found = points.shape[1], _in_space(points)
        if len(points) == 1:
            return cls._made(found, [], np.zeros((0, 3)), np.zeros((0, 2)), radius)
        edges = np.array([[0, 1]])
        if dim == 3:
            return cls._made(found, [], np.zeros((0, 3)), edges, radius)
        way = _unit(found[1] - found[0])
        side = np.array([way[1], -way[0], 0.0])
        sides = [np.array([0, 1]), np.array([1, 0])]
        return cls._made(found, sides, np.array([side, -side]), edges, radius)

    @classmethod
    def _polygon(cls, points: Floats, radius: float) -> "Convex":
        around = ConvexHull(points).vertices  # counterclockwise
        found = _in_space(points[around])
        edges = np.stack([np.arange(len(found)), np.roll(np.arange(len(found)), -1)], axis=1)
        ways = found[edges[:, 1]] - found[edges[:, 0]]
        normals = np.stack([ways[:, 1], -ways[:, 0], 0.0 * ways[:, 0]], axis=1)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        return cls._made(found, list(edges), normals, edges, radius)

    @classmethod
    def _polyhedron(cls, points: Floats, radius: float) -> "Convex":
        hull = ConvexHull(points)
        size, used = float(np.ptp(points, axis=0).max()), hull.vertices
        found, planes = points[used], hull.equations
        loops: list[Integers] = []
        normals: list[Floats] = []
        for plane in planes:
            if any(plane[:3] @ normal > 1.0 - _SAME for normal in normals):
                continue  # a triangle of a face that is known
            on = np.flatnonzero(np.abs(found @ plane[:3] + plane[3]) <= _SAME * size)
            corners = found[on]
            first = _unit(corners[1] - corners[0])
            arms = corners - corners.mean(axis=0)
            angle = np.arctan2(arms @ np.cross(plane[:3], first), arms @ first)
            loops.append(on[np.argsort(angle)])
            corners = found[loops[-1]]
            # From the longest sides, where it is exact for blocks.
            normals.append(_unit(_area(corners)))
        edges = {
            tuple(sorted((int(i), int(j))))
            for loop in loops
            for i, j in zip(loop, np.roll(loop, -1), strict=True)
        }
        return cls._made(found, loops, np.array(normals), np.array(sorted(edges)), radius)

    @classmethod
    def cylinder(cls, ends: Floats, girth: float) -> "Convex":
        """A round cylinder between the middles of its ends [m], (2, 3), with a radius."""
        axis = _unit(ends[1] - ends[0])
        first, second = _across(axis)
        angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
        ring = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
        prism = cls._polyhedron(np.concatenate([end + girth * ring for end in ends]), 0.0)
        flat = np.abs(prism.normals @ axis) > 1.0 - _SAME
        ways = axis[None]
        return cls(
            prism.vertices, prism.normals, flat, prism.starts, prism.loop, prism.edges, ways, 0.0,
            axis, girth,
        )  # fmt: skip

    @classmethod
    def ellipsoid(cls, radii: Floats) -> "Convex":
        """An ellipsoid about the origin with half axes [m], (3,)."""
        ball = cls.of(np.zeros((1, 3)), float(radii.min() ** 2 / radii.max()))
        return replace(ball, radii=radii)

    @classmethod
    def _made(
        cls, points: Floats, loops: list[Integers], normals: Floats, edges: Any, radius: float
    ) -> "Convex":
        edges = np.asarray(edges, dtype=np.int64)
        ways: list[Floats] = []
        for i, j in edges if np.ptp(points[:, 2]) > 0.0 or not loops else ():
            way = _unit(points[j] - points[i])
            if not any(abs(way @ other) > 1.0 - _SAME for other in ways):
                ways.append(way)
        starts = np.cumsum([0, *map(len, loops)])
        loop = np.concatenate([np.zeros(0), *loops]).astype(np.int64)
        flat = np.ones(len(loops), dtype=bool)
        return cls(
            points, normals, flat, starts, loop, edges, np.array(ways).reshape(-1, 3), radius
        )

    @cached_property
    def reach(self) -> float:
        """How far it reaches from the origin of its axes [m]."""
        if self.radii is not None:
            return float(self.radii.max())
        return float(np.linalg.norm(self.vertices, axis=1).max()) + self.radius

    @property
    def thickness(self) -> float:
        """Least width through its middle [m]."""
        if self.radii is not None:
            return 2.0 * float(self.radii.min())
        inner = self.vertices.mean(axis=0)
        corners = self.vertices[self.loop[self.starts[:-1]]] if len(self.normals) else None
        width = np.zeros(0) if corners is None else ((corners - inner) * self.normals).sum(axis=1)
        return 2.0 * float(width.min(initial=np.inf) if len(width) else 0.0) + 2.0 * self.radius

    @cached_property
    def corners(self) -> int:
        """How many places may touch at once on one of its faces."""
        return int(np.diff(self.starts).max()) if len(self.normals) else len(self.vertices)

    @cached_property
    def beside(self) -> Floats:
        """Normals of the faces that meet at each edge, 0 without any, (edges, 2, 3).

        The first one is that of the face to the left of the edge, seen from outside.
        """
        found = np.zeros((len(self.edges), 2, 3))
        place = {(int(i), int(j)): k for k, (i, j) in enumerate(self.edges)}
        for loop, normal in zip(np.split(self.loop, self.starts[1:-1]), self.normals, strict=False):
            for i, j in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True):
                found[place[min(i, j), max(i, j)], int(i > j)] = normal
        return found

    @cached_property
    def simplices(self) -> Integers:
        """Triangles of its faces, in the plane their lines; without faces its line or point."""
        if not len(self.normals):
            return np.arange(len(self.vertices))[None]
        loops = np.split(self.loop, self.starts[1:-1])
        if np.ptp(self.vertices[:, 2]) == 0.0:
            return np.array(loops)
        return np.array([[loop[0], *two] for loop in loops for two in pairwise(loop[1:])])

    @property
    def rounds(self) -> bool:
        """Whether it rolls."""
        return self.radius > 0.0 or self.axis is not None

    def placed(self, centre: Floats, turn: Floats, aim: Floats | None = None) -> Placed:
        """The body in space.

        Args:
            centre: Where the origin of its axes is [m], (3,).
            turn: Its rotation, (3, 3).
            aim: Of a cylinder, along its axes, where one edge of the prism looks, (3,); of an
                ellipsoid where it is met.
        """
        vertices, normals = self.vertices, self.normals
        if aim is not None and self.radii is not None:
            out = self.radii * aim
            vertices = (self.radii * out / np.linalg.norm(out) - self.radius * aim)[None]
        if aim is not None and self.axis is not None:
            inner = vertices.mean(axis=0)
            spin = _turn(self.axis, vertices[0] - inner, aim)
            vertices, normals = inner + (vertices - inner) @ spin.T, normals @ spin.T
        return (
            centre + vertices @ turn.T, normals @ turn.T, self.flat, self.starts, self.loop,
            self.edges, self.ways @ turn.T, self.radius,
        )  # fmt: skip

    def spine(self, centre: Floats, turn: Floats) -> Placed:
        """The axis of a cylinder in space; of other bodies the whole of it."""
        if self.axis is None:
            return self.placed(centre, turn)
        inner = self.vertices.mean(axis=0)
        half = float(((self.vertices - inner) @ self.axis).max())
        ends = inner + np.array([[-half], [half]]) * self.axis
        return Convex.of(ends, self.girth).placed(centre, turn)

    @property
    def aims(self) -> bool:
        """Whether its core hangs on where it is met."""
        return self.axis is not None or self.radii is not None

    def aim(self, n: Floats) -> Floats | None:
        """Where the edge of a cylinder's prism looks that is lowest along a direction, (3,).

        Of an ellipsoid the direction itself, down.
        """
        if self.radii is not None:
            return -n
        if self.axis is None:
            return None
        down = (n @ self.axis) * self.axis - n
        length = float(np.linalg.norm(down))
        return _across(self.axis)[0] if length <= _LEVEL else down / length

    def seen(self, aim: Floats, way: Floats) -> Floats:
        """Its normal where a way leaves an ellipsoid from the ball that is aimed, (3,).

        Where that is the way itself, nothing of it is nearer to what lies there.

        Args:
            aim: Where the ball touches it, along its axes, (3,).
            way: Direction along its axes, (3,).
        """
        radii = np.asarray(self.radii)
        scaled = radii * aim
        start = scaled / np.linalg.norm(scaled) - self.radius * aim / radii
        along = way / radii
        a, b, c = along @ along, along @ start, start @ start - 1.0
        out = (start + (np.sqrt(max(0.0, b * b - a * c)) - b) / a * along) / radii
        return np.asarray(out / np.linalg.norm(out))

    def core(self, place: Floats, n: Floats) -> Floats:
        """The place that moves with the body, by one on its surface; the way between them does not.

        What rolls touches with other material at each time, below the same place of its core.

        Args:
            place: Along its axes [m], (places, 3).
            n: Directions across which they touch, towards the body, (3,) or (places, 3).
        """
        if self.axis is None:
            return place + self.radius * n
        inner = self.vertices.mean(axis=0)
        below = inner + ((place - inner) @ self.axis)[:, None] * self.axis
        return np.where(np.abs(n @ self.axis)[..., None] > _END_ON, place, below)


@dataclass(frozen=True)
class Carrier:
    """A convex shape that moves with a rigid body, and the contact nodes that stand for all of it.

    Attributes:
        shape: Along the axes of the body, from the place of the first marker.
        markers: Contact nodes: there, at a unit along each of these axes, and if it rolls followers
            of the first one, with arms along the axes of space (`impactfem.contact.convex_pairs`).
        unit: Arm of these [m].
        partners: Bodies and obstacles whose edges and faces, or that its own may meet.
        part: Name in contact laws of the part of the body that it is; "" for all of it.
    """

    shape: Convex
    markers: Integers
    unit: float
    partners: frozenset[str]
    part: str = ""

    @staticmethod
    def arms(count: int, dim: int, unit: float) -> tuple[Floats, Floats]:
        """Arms of so many markers along the axes of the body, and of space [m], (count, 3) each."""
        turning, following = np.zeros((2, count, 3))
        turning[1 : dim + 1] = unit * np.eye(3)[:dim]
        following[dim + 1 :] = unit * np.eye(3)[: count - dim - 1]
        return turning, following

    def meets(self, partner: str, surfaces: Sequence[str] | None) -> bool:
        """Whether it may meet another one, by a law that names some parts of its body, or all."""
        named = not surfaces or "" in surfaces or self.part in surfaces
        return named and partner in self.partners


def _in_space(points: Floats) -> Floats:
    return np.pad(points, [(0, 0), (0, 3 - points.shape[1])])


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


def _area(corners: Floats) -> Floats:
    """Area of a polygon as a vector along its normal."""
    arms = corners - corners[0]
    return np.asarray(0.5 * np.cross(arms[1:-1], arms[2:]).sum(axis=0))


def _across(axis: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors across an axis and each other."""
    first = _unit(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]))
    return first, np.cross(axis, first)


def _turn(axis: Floats, point: Floats, aim: Floats) -> Floats:
    """Rotation about an axis that turns a point's direction from it to another one, (3, 3)."""
    arm = _unit(point - (point @ axis) * axis)
    other = np.cross(axis, arm)
    cosine, sine = float(aim @ arm), float(aim @ other)
    skew = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(cosine * np.eye(3) + sine * skew + (1.0 - cosine) * np.outer(axis, axis))
