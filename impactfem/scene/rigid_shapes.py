"""Shapes that only rigid bodies have: capsules, ellipsoids and convex hulls of points."""

from collections.abc import Sequence
from typing import ClassVar

from impactfem.scene.inline import ListOf, Vector
from impactfem.scene.kinds import Real
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.shape import Shape
from impactfem.scene.shapes import SHAPES
from impactfem.scene.values import show


@table('shape = { kind = "capsule" }')
class Capsule:
    """A cylinder with half balls at its ends (rigid bodies, 3D); in 2D a strip with half discs.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "capsule"

    radius: float = key(Real(above=0), "radius", unit="m")
    length: float = key(Real(above=0), "distance of the centres of its ends", unit="m")
    center: Sequence[float] = key(Vector(), "centre", unit="m", default=(0.0, 0.0, 0.0))
    axis: Sequence[float] | None = key(
        Vector(nonzero=True), "direction of its axis, of any length", default=None, absent="along y"
    )

    def _check(self) -> None:
        if self.axis is not None and len(self.axis) != self.dim:
            text = f" = {show(list(self.axis))} does not fit center = {show(list(self.center))}: "
            raise KeyedError(self.kind, "axis", f"{text}give {self.dim} entries.")

    @property
    def dim(self) -> int:
        """Number of coordinates, 2 or 3."""
        return len(self.center)

    @property
    def half_extents(self) -> tuple[float, ...]:
        """Half the edges of a box that holds it in any direction [m], (dim,)."""
        return (self.length / 2 + self.radius,) * self.dim


@table('shape = { kind = "hull" }')
class Hull:
    """The convex hull of some points (rigid bodies): a polygon, in 3D a polyhedron.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "hull"

    points: Sequence[Sequence[float]] = key(
        ListOf(Vector((2, 3)), at_least=3), "points; those inside do not matter", unit="m"
    )

    def _check(self) -> None:
        for index, point in enumerate(self.points):
            if len(point) != self.dim:
                text = f" = {show(list(point))} has {len(point)} entries, but points[0] has "
                raise KeyedError(
                    self.kind, f"points[{index}]", f"{text}{self.dim}: give {self.dim}."
                )

    @property
    def dim(self) -> int:
        """Number of coordinates, 2 or 3."""
        return len(self.points[0])

    @property
    def half_extents(self) -> tuple[float, ...]:
        """Half the edges of its bounding box [m], (dim,)."""
        return tuple((max(x) - min(x)) / 2 for x in zip(*self.points, strict=True))


@table('shape = { kind = "ellipsoid" }')
class Ellipsoid:
    """What is round with three radii, along the axes in which it is drawn (rigid bodies, 3D).

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "ellipsoid"
    dim: ClassVar[int] = 3

    radii: Sequence[float] = key(Vector((3,)), "half axes along x, y and z", unit="m")
    center: Sequence[float] = key(Vector((3,)), "centre", unit="m", default=(0.0, 0.0, 0.0))

    def _check(self) -> None:
        least, most = min(self.radii), max(self.radii)
        if not least > 0.0 or most > _FLATTEST * least:
            text = f" = {show(list(self.radii))} are not all above 0, or one is more than "
            text += f"{_FLATTEST:g} times another: give lengths, or of what is flatter a hull."
            raise KeyedError(self.kind, "radii", text)

    @property
    def half_extents(self) -> tuple[float, ...]:
        """Half the edges of a box that holds it in any direction [m], (3,)."""
        return (max(self.radii),) * 3


_FLATTEST = 20.0  # half axes by the smallest one from which places of contact converge slowly

type RigidShape = Shape | Capsule | Ellipsoid | Hull

RIGID_SHAPES = (*SHAPES, Capsule, Ellipsoid, Hull)
