"""Outlines of plates."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.inline import ListOf, Vector
from impactfem.scene.kinds import Real
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.shapes import Block, Disc, Ring
from impactfem.scene.values import show


@table('outline = { kind = "rectangle" }')
class RectangleOutline:
    """A rectangle about the centre of the plate: edges left, right, bottom, top.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "rectangle"
    edges: ClassVar[tuple[str, ...]] = ("left", "right", "bottom", "top")

    size: Sequence[float] = key(Vector((2,), positive=True), "edges along x and y", unit="m")

    @property
    def shape(self) -> Block:
        """The same as that of a solid."""
        a, b = self.size
        return Block(size=(a, b), corner=(-0.5 * a, -0.5 * b))

    @property
    def place(self) -> tuple[float, float]:
        """A corner [m]."""
        a, b = self.size
        return 0.5 * a, 0.5 * b

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest width [m]."""
        return min(self.size), max(self.size)


@table('outline = { kind = "disc" }')
class DiscOutline:
    """A disc about the centre of the plate: edge rim.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "disc"
    edges: ClassVar[tuple[str, ...]] = ("rim",)

    radius: float = key(Real(above=0), "radius", unit="m")

    @property
    def shape(self) -> Disc:
        """The same as that of a solid."""
        return Disc(radius=self.radius)

    @property
    def place(self) -> tuple[float, float]:
        """A place on the rim [m]."""
        return self.radius, 0.0

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest width [m]."""
        return 2.0 * self.radius, 2.0 * self.radius


@table('outline = { kind = "ring" }')
class RingOutline:
    """A ring about the centre of the plate: edges outer, inner.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "ring"
    edges: ClassVar[tuple[str, ...]] = ("outer", "inner")

    inner_radius: float = key(Real(above=0), "radius of the hole", unit="m")
    radius: float = key(Real(above=0), "outer radius", unit="m")

    def _check(self) -> None:
        if not self.inner_radius < self.radius:
            text = f" = {self.inner_radius} is not below radius = {self.radius}: give a smaller "
            raise KeyedError(self.kind, "inner_radius", f"{text}one.")

    @property
    def shape(self) -> Ring:
        """The same as that of a solid."""
        return Ring(inner_radius=self.inner_radius, radius=self.radius)

    @property
    def place(self) -> tuple[float, float]:
        """A place on the rim [m]."""
        return self.radius, 0.0

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest width [m]."""
        return self.radius - self.inner_radius, 2.0 * self.radius


@table('outline = { kind = "polygon" }')
class PolygonOutline:
    """A polygon: edge_1 from the first point to the second, and so on.

    Raises:
        SceneError: a value is not allowed, or its edges cross.
    """

    kind: ClassVar[str] = "polygon"
    shape: ClassVar[None] = None

    points: Sequence[Sequence[float]] = key(
        ListOf(Vector((2,)), at_least=3), "corners in their order, from the centre", unit="m"
    )

    def _check(self) -> None:
        corners = np.array(self.points)
        count = len(corners)
        if min(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)) == 0.0:
            text = f" = {show([list(p) for p in self.points])} has the same corner twice in a row: "
            raise KeyedError(self.kind, "points", f"{text}remove one.")
        for i in range(count):
            for j in range(i + 2, count):
                if (j + 1) % count != i and _cross(corners, i, j):
                    text = f" = {show([list(p) for p in self.points])}: edge_{i + 1} and "
                    text += f"edge_{j + 1} cross; give the corners in their order."
                    raise KeyedError(self.kind, "points", text)

    @property
    def edges(self) -> tuple[str, ...]:
        """Names of its edges."""
        return tuple(f"edge_{k + 1}" for k in range(len(self.points)))

    @property
    def corners(self) -> NDArray[np.float64]:
        """Its corners [m], (corners, 2)."""
        return np.array(self.points, dtype=np.float64)

    @property
    def signed_area(self) -> float:
        """[m^2], positive if its corners go round counter-clockwise."""
        x, y = self.corners.T
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))

    @property
    def place(self) -> tuple[float, float]:
        """A corner [m]."""
        x, y = self.points[0]
        return x, y

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest width [m], about."""
        width = float(np.ptp(self.corners, axis=0).max())
        return abs(self.signed_area) / width, width


def _cross(corners: NDArray[np.float64], i: int, j: int) -> bool:
    """Whether two edges meet that have no corner in common."""
    a, b = corners[i], corners[(i + 1) % len(corners)]
    c, d = corners[j], corners[(j + 1) % len(corners)]

    def side(p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64]) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) * side(a, b, d) <= 0.0 and side(c, d, a) * side(c, d, b) <= 0.0


type AnyOutline = RectangleOutline | DiscOutline | RingOutline | PolygonOutline

OUTLINES = (RectangleOutline, DiscOutline, RingOutline, PolygonOutline)
