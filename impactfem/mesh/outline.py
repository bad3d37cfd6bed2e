"""What is drawn for a shape: in its own frame, before it is turned, and of a size near 1.

A mesh generator's decisions depend on the last digits of coordinates. Shapes are therefore meshed
about a fixed place, of size 1 and in numbers without their last digits, and scaled, moved and
turned afterwards: a turned body has the turned mesh, and one of other size or units the scaled one.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats

NEAR = 1e-7
"""Distance, for a body of size 1, within which a node of the generator lies on a surface."""

_DIGITS = 12  # of lengths over the largest one: division by it rounds the last ones of a number


def told(lengths: Any, largest: float) -> Floats:
    """Lengths as shares of the largest one, the same numbers for all bodies of a form."""
    return np.asarray(np.round(np.divide(lengths, largest), _DIGITS))


@dataclass(frozen=True)
class Frame:
    """From the frame of the drawing to that of the scene.

    Attributes:
        scale: Metres of one unit of the drawing, a power of two so that scaling rounds nothing.
        origin: Origin of the drawing in the unturned body [m], shape (dim,).
        pivot: Point of the scene that turning keeps [m], shape (dim,).
        angle: Angle about z by which the body is turned [rad].
    """

    scale: float
    origin: Floats
    pivot: Floats
    angle: float

    @property
    def rotation(self) -> Floats:
        """Matrix of the turn, shape (dim, dim); exact for quarter turns."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        if min(abs(c), abs(s)) < 1e-15:
            c, s = float(round(c)), float(round(s))
        matrix = np.eye(len(self.origin))
        matrix[:2, :2] = [[c, -s], [s, c]]
        return matrix

    def to_scene(self, points: Floats) -> Floats:
        """Points of the drawing in the scene [m], shape (points, dim)."""
        placed: Floats = self.origin + self.scale * points
        if self.angle == 0.0:
            return placed
        turned: Floats = self.pivot + (placed - self.pivot) @ self.rotation.T
        return turned

    def to_drawing(self, points: Floats) -> Floats:
        """The inverse of `to_scene`."""
        turned: Floats = self.pivot + (points - self.pivot) @ self.rotation
        return (turned - self.origin) / self.scale


@dataclass(frozen=True)
class Plane:
    """The points with normal . x = offset (unit normal)."""

    normal: Floats
    offset: float

    def holds(self, points: Floats) -> NDArray[np.bool_]:
        """Which points lie on it."""
        return np.asarray(np.abs(points @ self.normal - self.offset) < NEAR)

    def moved(self, points: Floats) -> Floats:
        """Points beside it, put on it."""
        axis = int(np.argmax(np.abs(self.normal)))
        if np.abs(self.normal[axis]) == 1.0:
            on = points.copy()
            on[:, axis] = self.offset * self.normal[axis]
            return on
        off: Floats = points - np.outer(points @ self.normal - self.offset, self.normal)
        return off


@dataclass(frozen=True)
class Round:
    """The points at a distance from the origin, measured along some axes: circle, tube, sphere."""

    axes: tuple[int, ...]
    radius: float

    def holds(self, points: Floats) -> NDArray[np.bool_]:
        """Which points lie on it."""
        away = np.linalg.norm(points[:, self.axes], axis=1)
        return np.asarray(np.abs(away - self.radius) < NEAR)

    def moved(self, points: Floats) -> Floats:
        """Points beside it, put on it."""
        on = points.copy()
        away = np.linalg.norm(points[:, self.axes], axis=1, keepdims=True)
        on[:, self.axes] *= self.radius / away
        return on


@dataclass(frozen=True)
class Polygon:
    """A convex polygon in the plane (x, y), in 3D between two heights z.

    Attributes:
        corners: Counter-clockwise, shape (corners, 2).
        heights: Least and greatest z; None in 2D.
    """

    corners: Floats
    heights: tuple[float, float] | None

    def told(self, largest: float) -> "Polygon":
        """The same in shares of the largest length."""
        return Polygon(told(self.corners, largest), _told(self.heights, largest))


@dataclass(frozen=True)
class Sector:
    """Quarters of a disc or ring: in the plane (x, y), or in 3D in (z, x) between two heights y.

    Attributes:
        radius: Outer radius.
        inner: Radius of the hole, 0 for none.
        first: First quarter, counted from the first axis of the plane to the second.
        count: Number of quarters: 4, 2 or 1.
        heights: Least and greatest y; None in 2D.
    """

    radius: float
    inner: float
    first: int
    count: int
    heights: tuple[float, float] | None

    def told(self, largest: float) -> "Sector":
        """The same in shares of the largest length."""
        radius, inner = told((self.radius, self.inner), largest).tolist()
        heights = _told(self.heights, largest)
        return replace(self, radius=radius, inner=inner, heights=heights)


def _told(heights: tuple[float, float] | None, largest: float) -> tuple[float, float] | None:
    if heights is None:
        return None
    low, high = told(heights, largest).tolist()
    return low, high


@dataclass(frozen=True)
class Ball:
    """A ball about the origin, or the part where some coordinates have a sign.

    Attributes:
        radius: Radius.
        signs: For each axis 1 or -1 if only coordinates of that sign are kept, else 0.
    """

    radius: float
    signs: tuple[int, int, int]

    def told(self, largest: float) -> "Ball":
        """The same in shares of the largest length."""
        return replace(self, radius=float(told(self.radius, largest)))


@dataclass(frozen=True)
class Outline:
    """A shape to be meshed.

    Attributes:
        frame: Its way into the scene.
        largest: Length of the drawing by which bodies of one form differ.
        drawing: What is drawn.
        places: Where the named surfaces lie in the drawing; planes first, as a facet of a curved
            surface can have its vertices on the rim of a plane one but not the reverse.
        levels: Axis and coordinate [m] of cuts and of the axis, on which nodes lie exactly.
    """

    frame: Frame
    largest: float
    drawing: Polygon | Sector | Ball
    places: tuple[tuple[str, Plane | Round], ...]
    levels: tuple[tuple[int, float], ...]

    @property
    def measure(self) -> float:
        """Area or volume of the drawing."""
        d = self.drawing
        if isinstance(d, Ball):
            return 4 / 3 * math.pi * d.radius**3 / 2.0 ** sum(map(abs, d.signs))
        if isinstance(d, Sector):
            area = math.pi * (d.radius**2 - d.inner**2) * d.count / 4
        else:
            x, y = d.corners.T
            area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        return area * (d.heights[1] - d.heights[0] if d.heights else 1.0)


def outline(shape: Any, *, axisymmetric: bool) -> Outline:
    """Draw a shape of `impactfem.scene.shapes`.

    Args:
        shape: Block, disc, ring, cylinder or sphere.
        axisymmetric: Whether x is the radius r >= 0; a body centred at r = 0 is cut there.
    """
    dim = shape.dim
    centre = np.array(shape.centre, dtype=np.float64)
    at_axis = bool(axisymmetric and centre[0] == 0.0)
    cuts = [*dict.fromkeys([*("xyz".index(axis) for axis in shape.symmetry), *[0] * at_axis])]
    frame = _frame(shape, centre, cut=bool(cuts))
    middle = frame.to_drawing(centre[None])[0]
    normals = {axis: _rounded(frame.rotation[axis]) for axis in cuts}
    planes = {axis: Plane(n, float(n @ middle)) for axis, n in normals.items()}
    drawing, faces = _drawn(shape, frame.scale, list(planes.values()))
    levels = [(axis, float(centre[axis])) for axis in cuts]
    places: list[tuple[str, Plane | Round]] = []
    if axisymmetric:
        levels.append((0, 0.0))
        normal = _rounded(frame.rotation[0])
        axis_at = frame.to_drawing(np.zeros((1, dim)))[0]
        places.append(("axis", Plane(normal, float(normal @ axis_at))))
    places += [(f"symmetry_{axis}", planes["xyz".index(axis)]) for axis in shape.symmetry]
    places += sorted(faces.items(), key=lambda item: isinstance(item[1], Round))
    largest = shape.figure.largest / frame.scale
    return Outline(frame, largest, drawing, tuple(places), tuple(levels))


def _frame(shape: Any, centre: Floats, *, cut: bool) -> Frame:
    """Shapes are drawn from the origin of their figure: put down on a plane they lie on it."""
    figure = shape.figure
    # A round body that is cut looks the same however it is turned.
    angle = 0.0 if cut and not shape.symmetric_turns else float(shape.angle)
    origin = np.array(figure.origin, dtype=np.float64)
    return Frame(2.0 ** round(math.log2(figure.largest)), origin, centre, angle)


def _drawn(
    shape: Any, scale: float, cuts: Sequence[Plane]
) -> tuple[Polygon | Sector | Ball, dict[str, Plane | Round]]:
    """The drawing of a shape in its frame, and its faces but for the cuts."""
    figure = shape.figure
    normals = [plane.normal for plane in cuts]
    if figure.edges:
        return _block(np.array(figure.edges) / scale, figure.faces, cuts)
    radii = {name: radius / scale for name, radius in figure.radii.items()}
    radius, *holes = radii.values()
    if figure.height is not None:
        (side,) = radii
        return _cylinder(radius, figure.height / scale, (*figure.faces, side), normals)
    if shape.dim == 3:
        signs = sum(normals, np.zeros(3))
        ball = Ball(radius, (int(signs[0]), int(signs[1]), int(signs[2])))
        return ball, {name: Round((0, 1, 2), r) for name, r in radii.items()}
    sector = Sector(radius, sum(holes), *_quarters(normals, (0, 1)), None)
    return sector, {name: Round((0, 1), r) for name, r in radii.items()}


def _rounded(normal: Floats) -> Floats:
    """A normal, exactly along an axis if it nearly is: angles are given to some digits only."""
    whole = np.round(normal)
    return whole + 0.0 if np.abs(normal - whole).max() < 1e-8 else normal


def _block(
    size: Floats, names: Sequence[str], cuts: Sequence[Plane]
) -> tuple[Polygon, dict[str, Plane | Round]]:
    """A rectangle or box from the origin, without what lies behind the cuts."""
    dim = len(size)
    corners = np.array([[0.0, 0.0], [size[0], 0.0], [size[0], size[1]], [0.0, size[1]]])
    low, high = 0.0, float(size[2]) if dim == 3 else 0.0
    for plane in cuts:
        if dim == 3 and plane.normal[2] != 0.0:
            low = plane.offset
        else:
            corners = _clipped(corners, plane.normal[:2], plane.offset)
    faces: dict[str, Plane | Round] = {
        name: Plane(np.eye(dim)[k // 2], k % 2 * float(size[k // 2]))
        for k, name in enumerate(names)
        if name
    }
    return Polygon(corners, (low, high) if dim == 3 else None), faces


def _clipped(corners: Floats, normal: Floats, offset: float) -> Floats:
    """The part of a convex polygon where normal . x >= offset."""
    over = corners @ normal - offset
    over[np.abs(over) < NEAR] = 0.0
    kept: list[Floats] = []
    for k, corner in enumerate(corners):
        after = (k + 1) % len(corners)
        if over[k] >= 0.0:
            kept.append(corner)
        if over[k] * over[after] < 0.0:
            share = over[k] / (over[k] - over[after])
            kept.append(corner + share * (corners[after] - corner))
    return np.array(kept)


def _cylinder(
    radius: float, height: float, names: tuple[str, str, str], normals: Iterable[Floats]
) -> tuple[Sector, dict[str, Plane | Round]]:
    """A cylinder about the y axis; its base lies at y = 0."""
    low, high = 0.0, height
    for normal in normals:
        if normal[1] > 0.0:
            low = height / 2
        elif normal[1] < 0.0:
            high = height / 2
    first, count = _quarters(normals, (2, 0))
    up = np.array([0.0, 1.0, 0.0])
    faces = Plane(up, 0.0), Plane(up, height), Round((0, 2), radius)
    return Sector(radius, 0.0, first, count, (low, high)), dict(zip(names, faces, strict=True))


def _quarters(normals: Iterable[Floats], axes: tuple[int, int]) -> tuple[int, int]:
    """First of the quarters that lie on the inner side of all cuts, and their number."""
    middles = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    kept = np.ones(4, dtype=bool)
    for normal in normals:
        kept &= middles @ normal[list(axes)] >= 0.0
    count = int(kept.sum())
    first = next(k for k in range(4) if kept[k] and (count == 4 or not kept[k - 1]))
    return first, count
