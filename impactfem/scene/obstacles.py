"""Obstacles of a scene: the wall of bars, and the rigid obstacles of solids.

In 2D a sphere and a cylinder are circles, a box is a rectangle. In an axisymmetric model every
obstacle is revolved about the axis, as the body is.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.formula import Formula
from impactfem.scene.inline import Formulas, ListOf, Vector
from impactfem.scene.kinds import Choice, Name, Real
from impactfem.scene.schema import KeyedError, check_fields, key, table
from impactfem.scene.values import degrees_hint, show

type Floats = NDArray[np.float64]
type Motion = Sequence[float | str | Formula]

SIDES = ("outside", "inside")
_NAME = "name of the obstacle"
_MOTION = "displacement of the obstacle in time"
_SIDE = "where the body is"
_MOTION_KIND = Formulas(("t",))


@table('[[obstacle]] with kind = "wall"')
@dataclass(frozen=True, kw_only=True)
class Wall:
    """A rigid wall at rest, in front of the near end of a bar.

    Raises:
        SceneError: the name is not allowed.
    """

    kind: ClassVar[str] = "wall"

    name: str = key(Name(), "name of the wall", default="wall")

    def __post_init__(self) -> None:
        check_fields(self, self.kind)


class RigidObstacle:
    """What the rigid obstacles of solids have in common."""

    kind: ClassVar[str]
    name: str
    motion: tuple[Formula, ...] | None
    _vectors: ClassVar[tuple[str, ...]] = ()

    def check_dimension(self, dim: int) -> None:
        """Refuse coordinates that do not fit a body in 2D or 3D.

        Raises:
            KeyedError: naming the key of the obstacle.
        """
        for name in (*self._vectors, "motion"):
            value = getattr(self, name)
            if value is not None and len(value) != dim:
                shown = show([entry.plain for entry in value] if name == "motion" else list(value))
                text = f" = {shown} has {len(value)} entries, but the body has {dim} coordinates"
                raise KeyedError(self.kind, name, f"{text}: give {dim}.")

    def offset(self, t: float) -> Floats | None:
        """Displacement [m] of the obstacle at time t (dim,); None when it is at rest."""
        if self.motion is None:
            return None
        return np.array([float(entry(t=t)) for entry in self.motion])


@table('[[obstacle]] with kind = "half_space"')
@dataclass(frozen=True, kw_only=True)
class HalfSpace(RigidObstacle):
    """Everything behind a plane, or a line in 2D; the body is on the side the normal points to.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "half_space"
    _vectors: ClassVar[tuple[str, ...]] = ("point", "normal")

    name: str = key(Name(), _NAME, default="half_space")
    point: Sequence[float] = key(Vector((1, 2, 3)), "a point of the plane", unit="m", also="center")
    normal: Sequence[float] = key(
        Vector((1, 2, 3), nonzero=True), "direction from the plane to the body, of any length"
    )
    motion: tuple[Formula, ...] | None = key(
        Formulas(("t",), lengths=(1, 2, 3)), _MOTION, unit="m", default=None, absent="at rest"
    )

    if TYPE_CHECKING:  # type checkers learn that numbers and texts may be given for formulas

        def __init__(
            self,
            *,
            point: Sequence[float],
            normal: Sequence[float],
            name: str = "half_space",
            motion: Motion | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, self.kind)

    @property
    def unit_normal(self) -> tuple[float, ...]:
        """The normal with length 1 (dim,)."""
        return _unit(self.normal)


@table('[[obstacle]] with kind = "sphere"')
@dataclass(frozen=True, kw_only=True)
class RigidSphere(RigidObstacle):
    """A ball, or the hollow around one; a circle in 2D.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "sphere"
    _vectors: ClassVar[tuple[str, ...]] = ("center",)

    name: str = key(Name(), _NAME, default="sphere")
    center: Sequence[float] = key(Vector(), "centre", unit="m", also="point")
    radius: float = key(Real(above=0), "radius", unit="m")
    side: str = key(Choice(SIDES), _SIDE, default="outside")
    motion: tuple[Formula, ...] | None = key(
        _MOTION_KIND, _MOTION, unit="m", default=None, absent="at rest"
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            *,
            center: Sequence[float],
            radius: float,
            side: str = "outside",
            name: str = "sphere",
            motion: Motion | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, self.kind)


@table('[[obstacle]] with kind = "cylinder"')
@dataclass(frozen=True, kw_only=True)
class RigidCylinder(RigidObstacle):
    """An endless round cylinder, or the bore of one; a circle in 2D.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "cylinder"
    _vectors: ClassVar[tuple[str, ...]] = ("point",)

    name: str = key(Name(), _NAME, default="cylinder")
    point: Sequence[float] = key(Vector(), "a point of the axis", unit="m", also="center")
    axis: Sequence[float] | None = key(
        Vector((3,), nonzero=True),
        "direction of the axis, of any length; required in 3D",
        default=None,
        absent="none in 2D",
    )
    radius: float = key(Real(above=0), "radius", unit="m")
    side: str = key(Choice(SIDES), _SIDE, default="outside")
    motion: tuple[Formula, ...] | None = key(
        _MOTION_KIND, _MOTION, unit="m", default=None, absent="at rest"
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            *,
            point: Sequence[float],
            radius: float,
            axis: Sequence[float] | None = None,
            side: str = "outside",
            name: str = "cylinder",
            motion: Motion | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, self.kind)

    @property
    def unit_axis(self) -> tuple[float, ...] | None:
        """The axis with length 1 (3,); None in 2D."""
        return None if self.axis is None else _unit(self.axis)

    def check_dimension(self, dim: int) -> None:
        """As for all obstacles; a cylinder needs its axis in 3D and only there."""
        super().check_dimension(dim)
        if dim == 3 and self.axis is None:
            text = " is missing: in 3D give its direction, as [0.0, 0.0, 1.0]."
            raise KeyedError(self.kind, "axis", text)
        if dim == 2 and self.axis is not None:
            text = f" = {show(list(self.axis))}: in 2D a cylinder is a circle; remove the axis."
            raise KeyedError(self.kind, "axis", text)


@table('[[obstacle]] with kind = "box"')
@dataclass(frozen=True, kw_only=True)
class RigidBox(RigidObstacle):
    """A box (a rectangle in 2D); the body is outside.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "box"
    _vectors: ClassVar[tuple[str, ...]] = ("center", "size")

    name: str = key(Name(), _NAME, default="box")
    center: Sequence[float] = key(Vector(), "centre", unit="m", also="point")
    size: Sequence[float] = key(Vector(positive=True), "edges along x, y and z", unit="m")
    angle: float = key(
        Real(), "angle by which it is turned about its centre (about z)", unit="rad", default=0.0
    )
    motion: tuple[Formula, ...] | None = key(
        _MOTION_KIND, _MOTION, unit="m", default=None, absent="at rest"
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            *,
            center: Sequence[float],
            size: Sequence[float],
            angle: float = 0.0,
            name: str = "box",
            motion: Motion | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        degrees = degrees_hint(self.angle)
        if degrees:
            raise KeyedError(self.kind, "angle", f" = {self.angle:g} is {degrees}.")


@table('[[obstacle]] with kind = "polyline"')
@dataclass(frozen=True, kw_only=True)
class RigidPolyline(RigidObstacle):
    """A chain of straight pieces in the plane, extruded along z in 3D.

    The body is on the left of someone who walks from the first point to the last. A chain that
    ends where it began is closed.

    Raises:
        SceneError: a value is not allowed, or the chain has pieces without length or crosses
            itself.
    """

    kind: ClassVar[str] = "polyline"

    name: str = key(Name(), _NAME, default="polyline")
    points: Sequence[Sequence[float]] = key(
        ListOf(Vector((2,)), at_least=2), "corners [x, y], the body on the left", unit="m"
    )
    motion: tuple[Formula, ...] | None = key(
        _MOTION_KIND, _MOTION, unit="m", default=None, absent="at rest"
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            *,
            points: Sequence[Sequence[float]],
            name: str = "polyline",
            motion: Motion | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        for index, (start, end) in enumerate(pairwise(self.points)):
            if tuple(start) == tuple(end):
                text = f" = {show(list(end))} repeats the point before it: remove it."
                raise KeyedError(self.kind, f"points[{index + 1}]", text)
        pair = _crossing(np.array(self.points))
        if pair is not None:
            text = f": pieces {pair[0]} and {pair[1]} (from 0 on) cross: the chain has no left side"
            raise KeyedError(self.kind, "points", f"{text}; move its points.")


def _unit(vector: Sequence[float]) -> tuple[float, ...]:
    length = math.hypot(*vector)
    if not math.isfinite(length) or length < np.finfo(float).tiny:  # hypot may overflow
        scale = max(abs(entry) for entry in vector)
        return _unit([entry / scale for entry in vector])
    return tuple(entry / length for entry in vector)


def _crossing(points: Floats) -> tuple[int, int] | None:
    """Indices of two pieces of a chain (n, 2) that share more than a corner between neighbours."""
    a, b = points[:-1], points[1:]
    last, closed = len(a) - 1, bool((points[0] == points[-1]).all())
    for i in range(len(a)):
        rest = np.arange(i + 2, len(a))
        if closed and i == 0:
            rest = rest[rest != last]
        sides = [
            np.sign(_cross(b[i] - a[i], a[rest] - a[i])),
            np.sign(_cross(b[i] - a[i], b[rest] - a[i])),
            np.sign(_cross(b[rest] - a[rest], a[i] - a[rest])),
            np.sign(_cross(b[rest] - a[rest], b[i] - a[rest])),
        ]
        near = (np.minimum(a[rest], b[rest]) <= np.maximum(a[i], b[i])) & (
            np.maximum(a[rest], b[rest]) >= np.minimum(a[i], b[i])
        )
        crosses = (sides[0] * sides[1] <= 0) & (sides[2] * sides[3] <= 0) & near.all(axis=1)
        if crosses.any():
            return i, int(rest[np.argmax(crosses)])
    return None


def _cross(u: Floats, v: Floats) -> Floats:
    product: Floats = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return product
