"""What a rigid body's shape amounts to: its mass, and what of it can touch.

Second moments S = int x x^T dV about the centre of volume give the inertia tr(S) I - S. Those of
polygons and polyhedra are sums over triangles and tetrahedra (0, a, b, ...) with the signed
determinant of their corners, int x x^T = det / (d + 2)! (sum of a a^T, and s s^T of s = a + b ...).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.scene.closed_surface import ClosedSurface
from impactfem.scene.rigid_shapes import Capsule, Ellipsoid, Hull
from impactfem.scene.schema import KeyedError
from impactfem.scene.shapes import Block, Cylinder, Disc, Ring, Sphere
from impactfem.scene.values import show

_FLAT = 1e-9  # volume of a hull, as a share of that of a cube of its size, that counts as none
_THIN = 1e-12  # side of a block, as a share of its size or place, that rounding spoils
_BULGE = 1e-4  # share by which the hull of a convex body may be larger: files round
_ROUND = 48  # corners of circles in pictures
_ALONG_RIM = 8  # places of a rim that can touch at once: its lowest one, and others beside it


@dataclass(frozen=True)
class Form:
    """A shape, before the body is turned.

    Attributes:
        volume: Area [m^2] or volume [m^3].
        centre: Of the volume [m], (dim,).
        second: Second moments about it, [m^4] or [m^5], (dim, dim).
        nodes: What can touch [m], (nodes, dim): corners, and centres of balls and of rims.
        radius: Of balls around the nodes [m], (nodes,).
        points: Of a picture [m], (points, dim).
        cells: Triangles, in space tetrahedra, of the picture, (cells, dim + 1).
        rim: Of places on circles around the nodes, from the lowest one on: radius [m] times cosine
            and sine of the angle, (nodes, 2); empty without any.
        axis: Of the circles, (nodes, 3); empty without any.
        convex: Whether it, or each of its parts, is its own convex hull.
        radii: Half axes of an ellipsoid [m], (3,), whose node is in a ball around it; else empty.
        curved: Whether it, or a part, is one: nodes do not tell what touches.
    """

    volume: float
    centre: Floats
    second: Floats
    nodes: Floats
    radius: Floats
    points: Floats
    cells: Integers
    rim: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    axis: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    convex: bool = True
    radii: Floats = field(default_factory=lambda: np.zeros(0))
    curved: bool = False

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return len(self.centre)

    @property
    def reach(self) -> Floats:
        """How far nodes with their balls and rims reach from the centre [m], (nodes,)."""
        around = np.linalg.norm(self.rim, axis=1) if len(self.rim) else 0.0
        apart = np.linalg.norm(self.nodes - self.centre, axis=1)
        return np.asarray(np.hypot(apart, around) + self.radius)

    def turned(self, angle: float) -> "Form":
        """Turned about the line through its centre along z."""
        if angle == 0.0:
            return self
        turn = np.eye(self.dim)
        turn[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        about = self.centre
        return replace(
            self,
            second=turn @ self.second @ turn.T,
            nodes=about + (self.nodes - about) @ turn.T,
            points=about + (self.points - about) @ turn.T,
            axis=self.axis @ turn.T if self.dim == 3 else self.axis,
        )

    @classmethod
    def joined(cls, parts: Sequence["Form"]) -> "Form":
        """Of several parts of one body; what two of them share counts twice.

        Corners that are none of the hull of all are left out, as of bodies from files: see
        `form_of_surface`.
        """
        if len(parts) == 1:
            return parts[0]
        volumes = np.array([part.volume for part in parts])
        volume = float(volumes.sum())
        centre = volumes @ [part.centre for part in parts] / volume
        arms = np.array([part.centre - centre for part in parts])
        second = sum(part.second for part in parts) + np.einsum("p,pi,pj", volumes, arms, arms)
        first = np.cumsum([0, *(len(part.points) for part in parts)])
        rows = np.vstack([*map(_touching, parts)])
        dim, rows = len(centre), rows[_outer(rows, len(centre))]
        nodes, radius, rim, axis = np.split(rows, [dim, dim + 1, dim + 3], axis=1)
        circles = {"rim": rim, "axis": axis} if rim.any() else {}
        return cls(
            volume, centre, second, nodes, radius[:, 0],
            np.vstack([part.points for part in parts]),
            np.vstack([part.cells + k for part, k in zip(parts, first, strict=False)]),
            convex=all(part.convex for part in parts),
            curved=any(part.curved for part in parts), **circles,
        )  # fmt: skip


def _touching(part: Form) -> Floats:
    """Nodes with their balls and circles, those of corners of no radius, (nodes, dim + 6)."""
    none = np.zeros((len(part.nodes), 2)), np.tile([0.0, 1.0, 0.0], (len(part.nodes), 1))
    rim, axis = (part.rim, part.axis) if len(part.rim) else none
    return np.column_stack([part.nodes, part.radius, rim, axis])


def _outer(rows: Floats, dim: int) -> Integers:
    """Which corners and circles are on the hull of all, and all balls; rows of `_touching`."""
    nodes, radius, rim, axis = np.split(rows, [dim, dim + 1, dim + 3], axis=1)
    of = np.arange(len(rows))
    if rim.any():
        ways = np.linalg.svd(axis[:, None])[2][:, 1:]  # across each axis
        angles = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
        circles = np.einsum("ka,rkd->rad", [np.cos(angles), np.sin(angles)], ways)
        size = np.linalg.norm(rim, axis=1)[:, None, None]
        nodes, of = (nodes[:, None] + size * circles).reshape(-1, 3), np.repeat(of, _ROUND)
    hull = _qhull(nodes)
    found = of if hull is None else np.concatenate([of[hull.vertices], np.flatnonzero(radius)])
    return np.unique(found)


def form_of(shape: Any) -> Form:
    """What a shape amounts to.

    Raises:
        KeyedError: It has no volume.
    """
    return _FORMS[type(shape)](shape).turned(getattr(shape, "angle", 0.0))


def form_of_surface(surface: ClosedSurface, place: Sequence[float] | None) -> Form:
    """What a closed surface amounts to, its origin at a place [m].

    What it may touch, half-spaces and hollow round obstacles, it touches with corners of its convex
    hull: distances from these are concave, least over a body at such a corner.
    """
    points = surface.points + (0.0 if place is None else np.asarray(place, dtype=float))
    volume, centre, second = polytope(points, surface.simplices)
    hull = _hull_of(points[np.unique(surface.simplices)])
    nodes, convex = hull.nodes, hull.volume <= volume * (1.0 + _BULGE)
    cells = surface.cells
    if cells is None:
        fan = np.full((len(surface.simplices), 1), len(points))
        cells, points = np.hstack([fan, surface.simplices]), np.vstack([points, centre])
    return Form(
        volume, centre, second, nodes, np.zeros(len(nodes)), points, cells, convex=convex
    )  # fmt: skip


def polytope(corners: Floats, simplices: Integers) -> tuple[float, Floats, Floats]:
    """Volume, centre and second moments about it of what a closed surface bounds.

    Args:
        corners: [m], (corners, dim).
        simplices: Lines or triangles between them, in one sense of orientation, (simplices, dim).
    """
    dim, start = corners.shape[1], corners.mean(axis=0)
    each = corners[simplices] - start  # (simplices, corner, dim)
    det, total = np.linalg.det(each), each.sum(axis=1)
    volume = float(det.sum()) / math.factorial(dim)
    if volume == 0.0:
        return 0.0, start, np.zeros((dim, dim))
    centre = det @ total / math.factorial(dim + 1) / volume
    second = np.einsum("s,ski,skj->ij", det, each, each) + np.einsum("s,si,sj", det, total, total)
    second = second / math.factorial(dim + 2) - volume * np.outer(centre, centre)
    return abs(volume), start + centre, second * np.sign(volume)


def _cornered(corners: Floats, hull: Integers) -> Form:
    """A convex polygon or polyhedron; `hull` has the simplices of its boundary, oriented."""
    volume, centre, second = polytope(corners, hull)
    used = np.unique(hull)
    fan = np.hstack([np.full((len(hull), 1), len(corners)), hull])
    count = len(used)
    return Form(
        volume, centre, second, corners[used], np.zeros(count),
        np.vstack([corners, centre]), fan,
    )  # fmt: skip


def _block(shape: Block) -> Form:
    corner, size = np.asarray(shape.corner, dtype=float), np.asarray(shape.size, dtype=float)
    unit = np.array(list(np.ndindex(*(2,) * shape.dim)), dtype=float)
    corners = corner + size * unit
    if size.min() < _THIN * np.abs(np.vstack([corners, size])).max():
        text = f" = {show(size.tolist())} has a side that rounding spoils at corner = "
        raise KeyedError(shape.kind, "size", f"{text}{show(corner.tolist())}: give a thicker one.")
    volume = float(size.prod())
    second = volume / 12.0 * np.diag(size**2)  # closed forms: no rounding breaks its symmetries
    hull = _hull_of(unit)  # that of a thin block would be lost to rounding in Qhull
    form = _cornered(corners, hull.cells[:, 1:])
    return replace(form, volume=volume, centre=corner + 0.5 * size, second=second)


def _round(
    centre: Floats, second: Floats, volume: float, radius: float, inner: float = 0.0
) -> Form:
    """A disc, ring or ball."""
    dim = len(centre)
    if dim == 2:
        angle = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        points = np.vstack([centre + radius * circle, centre + inner * circle])
        one, two = np.arange(_ROUND), np.roll(np.arange(_ROUND), -1)
        cells = np.stack([one + _ROUND, one, two], axis=1)
        if inner > 0.0:
            cells = np.vstack([cells, np.stack([one + _ROUND, two, two + _ROUND], axis=1)])
    else:
        seen = _unit_ball()
        points, cells = centre + radius * seen.points, seen.cells
    return Form(
        volume, centre, second, centre[None], np.array([radius]),
        points, cells,
    )  # fmt: skip


def _disc(shape: Disc | Ring) -> Form:
    outer, inner = shape.radius, getattr(shape, "inner_radius", 0.0)
    area = math.pi * (outer**2 - inner**2)
    second = area * (outer**2 + inner**2) / 4.0 * np.eye(2)
    return _round(np.asarray(shape.center, dtype=float), second, area, outer, inner)


def _ball(shape: Sphere) -> Form:
    volume = 4.0 / 3.0 * math.pi * shape.radius**3
    second = volume * shape.radius**2 / 5.0 * np.eye(3)
    return _round(np.asarray(shape.center, dtype=float), second, volume, shape.radius)


def _cylinder(shape: Cylinder) -> Form:
    r, height, centre = shape.radius, shape.height, np.asarray(shape.centre, dtype=float)
    volume = math.pi * r**2 * height
    second = volume * np.diag([r**2 / 4.0, height**2 / 12.0, r**2 / 4.0])
    ends = centre + 0.5 * height * np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    angle = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    circle = r * np.stack([np.cos(angle), np.zeros(_ROUND), np.sin(angle)], axis=1)
    seen = _hull_of(np.vstack([end + circle for end in ends]))
    around = 2.0 * np.pi * np.arange(_ALONG_RIM) / _ALONG_RIM
    rim = r * np.stack([np.cos(around), np.sin(around)], axis=1)
    nodes = np.repeat(ends, _ALONG_RIM, axis=0)
    return Form(
        volume, centre, second, nodes, np.zeros(len(nodes)), seen.points, seen.cells,
        np.tile(rim, (2, 1)), np.tile([0.0, 1.0, 0.0], (len(nodes), 1)),
    )  # fmt: skip


def _capsule(shape: Capsule) -> Form:
    r, length, dim = shape.radius, shape.length, shape.dim
    along = np.array([0.0, 1.0, 0.0][:dim] if shape.axis is None else shape.axis, dtype=float)
    along /= np.linalg.norm(along)
    # The ends together are a disc or ball; a half has its centre `off` from the flat side.
    middle = 2.0 * r * length if dim == 2 else math.pi * r**2 * length
    caps = math.pi * r**2 if dim == 2 else 4.0 / 3.0 * math.pi * r**3
    off = 4.0 * r / (3.0 * math.pi) if dim == 2 else 3.0 * r / 8.0
    own = r**2 / (dim + 2)  # mean square of a coordinate in a disc or ball
    across = middle * r**2 / (3.0 if dim == 2 else 4.0) + caps * own
    lengthwise = middle * length**2 / 12.0 + caps * (own + length**2 / 4.0 + length * off)
    second = across * np.eye(dim) + (lengthwise - across) * np.outer(along, along)
    centre = np.asarray(shape.center, dtype=float)
    ends = centre + 0.5 * length * np.stack([-along, along])
    angle = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    ball = np.stack([np.cos(angle), np.sin(angle)], axis=1) if dim == 2 else _sphere()
    seen = _hull_of(np.vstack([end + r * ball for end in ends]))
    return Form(
        middle + caps, centre, second, ends, np.full(2, r),
        seen.points, seen.cells,
    )  # fmt: skip


def _ellipsoid(shape: Ellipsoid) -> Form:
    radii, centre = (np.asarray(each, dtype=float) for each in (shape.radii, shape.center))
    volume, seen = 4.0 / 3.0 * math.pi * float(radii.prod()), _unit_ball()
    return Form(
        volume, centre, volume / 5.0 * np.diag(radii**2), centre[None], radii[None].max(axis=1),
        centre + radii * seen.points, seen.cells, radii=radii, curved=True,
    )  # fmt: skip


def _hull(shape: Hull) -> Form:
    points = np.asarray(shape.points, dtype=float)
    size = float(np.ptp(points, axis=0).max())
    found = _hull_of(points)
    if not found.volume > _FLAT * size**shape.dim:
        what = "line" if shape.dim == 2 else "plane"
        shown = show([list(point) for point in shape.points[:4]])
        text = f" = {shown}{', ...' * (len(points) > 4)} lie in one {what}: give points that "
        raise KeyedError(
            shape.kind, "points", f"{text}span {'an area' if shape.dim == 2 else 'a volume'}."
        )
    return found


def _hull_of(points: Floats) -> Form:
    """The convex hull of points; of no volume where they lie in a line or plane."""
    found = _qhull(points)
    if found is None:
        return _cornered(points, np.zeros((0, points.shape[1]), dtype=np.int64))
    simplices = found.simplices.astype(np.int64)
    inner = points[found.vertices].mean(axis=0)
    inwards = np.linalg.det(points[simplices] - inner) < 0.0
    simplices[inwards] = simplices[inwards][:, ::-1]
    return _cornered(points, simplices)


def _qhull(points: Floats) -> Any:
    """Qhull's answer; None where points lie in a line or plane, or are not finite."""
    from scipy.spatial import ConvexHull, QhullError  # noqa: PLC0415  (only rigid bodies need it)

    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None


def hull_corners(points: Floats) -> Floats:
    """Those of points that are corners of their hull, shape (corners, dim); all if it is flat."""
    found = _qhull(points)
    return points if found is None else np.asarray(points[found.vertices])


@lru_cache(maxsize=1)
def _unit_ball() -> Form:
    """Hull of `_sphere`: found once, as balls may be many."""
    return _hull_of(_sphere())


def _sphere() -> Floats:
    """Places on the unit sphere, evenly spread (Fibonacci's lattice)."""
    count = 4 * _ROUND
    k = np.arange(count) + 0.5
    high, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + math.sqrt(5.0)) * k
    wide = np.sqrt(1.0 - high**2)
    return np.stack([wide * np.cos(angle), wide * np.sin(angle), high], axis=1)


_FORMS: Mapping[type, Callable[[Any], Form]] = {
    Block: _block,
    Cylinder: _cylinder,
    Disc: _disc,
    Ring: _disc,
    Sphere: _ball,
    Capsule: _capsule,
    Ellipsoid: _ellipsoid,
    Hull: _hull,
}
"""Forms of shapes: the place to add one."""
