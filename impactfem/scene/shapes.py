"""Shapes of solids: what Gmsh shall draw, with the names of its surfaces and its volume.

A shape is turned by `angle` about its centre first (in 3D about the line through the centre along
z), then cut: `symmetry` keeps the part with x (y, z) not below the centre. Names of surfaces turn
with the shape. With `axisymmetric` a shape lies in the plane of r = x >= 0 and the axis y; one
centred at r = 0 is cut there, and what lies at r = 0 is the surface "axis".
"""

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, override

from impactfem.scene.inline import Vector
from impactfem.scene.kinds import Choices, Real
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.shape import AXES, FLAT, MODELS, REVOLVED, Figure, Shape
from impactfem.scene.values import show

_SYMMETRY = Choices(AXES)
_ANGLE = "angle by which it is turned about its centre, counter-clockwise seen from +z"
_CUT = "directions in which only the half beyond its centre is modelled; held by symmetry supports"


def _origin(instance: Shape, name: str, dim: int) -> None:
    if getattr(instance, name) is None:
        object.__setattr__(instance, name, (0.0,) * dim)


@table('shape = { kind = "block" }')
class Block(Shape):
    """A rectangle (2D) or a box (3D): surfaces left, right, bottom, top, in 3D back and front.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "block"
    models: ClassVar[tuple[str, ...]] = MODELS
    place: ClassVar[str] = "corner"
    has_sides: ClassVar[bool] = True

    size: Sequence[float] = key(Vector(positive=True), "edges along x, y and z", unit="m")
    corner: Sequence[float] = key(
        Vector(), "corner with the least coordinates", unit="m", default=None, absent="origin"
    )
    angle: float = key(Real(), _ANGLE, unit="rad", default=0.0)
    symmetry: Sequence[str] = key(_SYMMETRY, _CUT, default=())

    def _check(self) -> None:
        _origin(self, "corner", len(self.size))
        if len(self.corner) != len(self.size):
            value, size = show(list(self.corner)), show(list(self.size))
            text = f" = {value} does not fit size = {size}: give {len(self.size)} entries."
            raise KeyedError(self.kind, "corner", text)
        self._check_cut()

    @property
    @override
    def dim(self) -> int:
        return len(self.size)

    @property
    @override
    def centre(self) -> tuple[float, ...]:
        return tuple(c + s / 2 for c, s in zip(self.corner, self.size, strict=True))

    @property
    @override
    def figure(self) -> Figure:
        return Figure(tuple(self.corner), tuple(self._faces), edges=tuple(self.size))

    @property
    @override
    def _whole(self) -> float:
        return math.prod(self.size)

    @property
    @override
    def half_extents(self) -> tuple[float, ...]:
        c, s = abs(math.cos(self.angle)), abs(math.sin(self.angle))
        a, b = self.size[0] / 2, self.size[1] / 2
        return (c * a + s * b, s * a + c * b, *(edge / 2 for edge in self.size[2:]))

    @property
    @override
    def _faces(self) -> Mapping[str, tuple[float, ...] | None]:
        names = ("left", "right", "bottom", "top", "back", "front")[: 2 * self.dim]
        normals = [
            tuple(sign * (axis == i) for i in range(self.dim))
            for axis in range(self.dim)
            for sign in (-1.0, 1.0)
        ]
        return dict(zip(names, normals, strict=True))

    @property
    @override
    def symmetric_turns(self) -> float:
        return math.pi / 4 if self.size[0] == self.size[1] else math.pi / 2


class _Round:
    """What discs, rings and balls have in common."""

    radius: float
    center: Sequence[float]

    @property
    def dim(self) -> int:
        return len(self.center)

    @property
    def centre(self) -> tuple[float, ...]:
        return tuple(self.center)

    @property
    def half_extents(self) -> tuple[float, ...]:
        return (self.radius,) * self.dim

    @property
    def symmetric_turns(self) -> float:
        return 0.0


@table('shape = { kind = "disc" }')
class Disc(_Round, Shape):
    """A disc (2D); in an axisymmetric model a ball (center at r = 0) or a torus. Surface: rim.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "disc"
    models: ClassVar[tuple[str, ...]] = FLAT

    radius: float = key(Real(above=0), "radius", unit="m")
    center: Sequence[float] = key(Vector((2,)), "centre", unit="m", default=None, absent="origin")
    angle: float = key(Real(), _ANGLE, unit="rad", default=0.0)
    symmetry: Sequence[str] = key(_SYMMETRY, _CUT, default=())

    def _check(self) -> None:
        _origin(self, "center", 2)

    @property
    @override
    def figure(self) -> Figure:
        return Figure(self.centre, radii={"rim": self.radius})

    @property
    @override
    def _whole(self) -> float:
        return math.pi * self.radius**2

    @property
    @override
    def revolved_volume(self) -> float:
        if self.center[0] == 0.0:
            return 4 / 3 * math.pi * self.radius**3 / 2.0 ** len(self.symmetry)
        return super().revolved_volume

    @property
    @override
    def _faces(self) -> Mapping[str, tuple[float, ...] | None]:
        return {"rim": None}


@table('shape = { kind = "ring" }')
class Ring(_Round, Shape):
    """A ring (2D); axisymmetric: a hollow ball or torus. Surfaces: outer, inner.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "ring"
    models: ClassVar[tuple[str, ...]] = FLAT

    inner_radius: float = key(Real(above=0), "radius of the hole", unit="m")
    radius: float = key(Real(above=0), "outer radius", unit="m")
    center: Sequence[float] = key(Vector((2,)), "centre", unit="m", default=None, absent="origin")
    angle: float = key(Real(), _ANGLE, unit="rad", default=0.0)
    symmetry: Sequence[str] = key(_SYMMETRY, _CUT, default=())

    def _check(self) -> None:
        _origin(self, "center", 2)
        if not self.inner_radius < self.radius:
            text = (
                f" = {self.inner_radius} is not below radius = {self.radius}: give a smaller one."
            )
            raise KeyedError(self.kind, "inner_radius", text)

    @property
    @override
    def figure(self) -> Figure:
        return Figure(self.centre, radii={"outer": self.radius, "inner": self.inner_radius})

    @property
    @override
    def _whole(self) -> float:
        return math.pi * (self.radius - self.inner_radius) * (self.radius + self.inner_radius)

    @property
    @override
    def revolved_volume(self) -> float:
        if self.center[0] == 0.0:
            whole = 4 / 3 * math.pi * (self.radius**3 - self.inner_radius**3)
            return whole / 2.0 ** len(self.symmetry)
        return super().revolved_volume

    @property
    @override
    def _faces(self) -> Mapping[str, tuple[float, ...] | None]:
        return {"outer": None, "inner": None}


@table('shape = { kind = "cylinder" }')
class Cylinder(Shape):
    """A cylinder whose axis points along y (3D or axisymmetric). Surfaces: side, bottom, top.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "cylinder"
    models: ClassVar[tuple[str, ...]] = REVOLVED

    radius: float = key(Real(above=0), "radius", unit="m")
    height: float = key(Real(above=0), "length along its axis", unit="m")
    center: Sequence[float] = key(
        Vector(), "centre of its base", unit="m", default=None, absent="origin (3D)"
    )
    angle: float = key(Real(), _ANGLE, unit="rad", default=0.0)
    symmetry: Sequence[str] = key(_SYMMETRY, _CUT, default=())

    def _check(self) -> None:
        _origin(self, "center", 3)
        self._check_cut()

    @property
    @override
    def dim(self) -> int:
        return len(self.center)

    @property
    @override
    def centre(self) -> tuple[float, ...]:
        x, y, *z = self.center
        return (x, y + self.height / 2, *z)

    @property
    @override
    def figure(self) -> Figure:
        base = tuple(self.center)
        if self.dim == 2:  # its half in the plane of r >= 0
            return Figure(base, ("", "side", "bottom", "top"), edges=(self.radius, self.height))
        return Figure(base, ("bottom", "top"), radii={"side": self.radius}, height=self.height)

    @property
    @override
    def _whole(self) -> float:
        if self.dim == 2:  # its half in the plane of r >= 0
            return self.radius * self.height
        return math.pi * self.radius**2 * self.height

    @property
    @override
    def revolved_volume(self) -> float:
        return math.pi * self.radius**2 * self.height / 2.0 ** len(self.symmetry)

    @property
    @override
    def half_extents(self) -> tuple[float, ...]:
        c, s = abs(math.cos(self.angle)), abs(math.sin(self.angle))
        r, half = self.radius, self.height / 2
        return (c * r + s * half, s * r + c * half, r)[: self.dim]

    @property
    @override
    def _faces(self) -> Mapping[str, tuple[float, ...] | None]:
        down, up = (0.0, -1.0, 0.0)[: self.dim], (0.0, 1.0, 0.0)[: self.dim]
        return {"side": None, "bottom": down, "top": up}

    @property
    @override
    def symmetric_turns(self) -> float:
        return math.pi / 2

    @override
    def _check_radius(self) -> None:
        _check_on_axis(self)
        super()._check_radius()


@table('shape = { kind = "sphere" }')
class Sphere(_Round, Shape):
    """A ball (3D or axisymmetric). Surface: surface.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "sphere"
    models: ClassVar[tuple[str, ...]] = REVOLVED

    radius: float = key(Real(above=0), "radius", unit="m")
    center: Sequence[float] = key(Vector(), "centre", unit="m", default=None, absent="origin (3D)")
    angle: float = key(Real(), _ANGLE, unit="rad", default=0.0)
    symmetry: Sequence[str] = key(_SYMMETRY, _CUT, default=())

    def _check(self) -> None:
        _origin(self, "center", 3)

    @property
    @override
    def figure(self) -> Figure:
        return Figure(self.centre, radii={"surface": self.radius})

    @property
    @override
    def _whole(self) -> float:
        if self.dim == 2:  # its half in the plane of r >= 0
            return math.pi * self.radius**2 / 2
        return 4 / 3 * math.pi * self.radius**3

    @property
    @override
    def revolved_volume(self) -> float:
        return 4 / 3 * math.pi * self.radius**3 / 2.0 ** len(self.symmetry)

    @property
    @override
    def _faces(self) -> Mapping[str, tuple[float, ...] | None]:
        return {"surface": None}

    @override
    def _check_radius(self) -> None:
        _check_on_axis(self)
        super()._check_radius()


def _check_on_axis(shape: Cylinder | Sphere) -> None:
    if shape.center[0] != 0.0:
        text = f" = {show(list(shape.center))}: in an axisymmetric model its r is 0; give [0.0, y]."
        raise KeyedError(shape.kind, "center", text)


SHAPES: tuple[type[Shape], ...] = (Block, Disc, Ring, Cylinder, Sphere)
