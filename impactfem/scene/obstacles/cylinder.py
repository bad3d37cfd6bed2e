"""An endless round cylinder, or the bore of one."""

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.given import MaybeFormulas, MaybeTable
from impactfem.scene.inline import Vector
from impactfem.scene.kinds import Choice, Name, Real
from impactfem.scene.obstacles.base import (
    MOTION,
    MOTION_KIND,
    NAME,
    SIDE,
    SIDES,
    Core,
    Field,
    unit,
    unit_vector,
)
from impactfem.scene.obstacles.faces import AROUND, HIGH, facing, patches, square_to
from impactfem.scene.obstacles.mirror import Mirror
from impactfem.scene.obstacles.rotation import ROTATION, ROTATION_KIND, Rotation
from impactfem.scene.obstacles.round import RoundObstacle, upwards
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show


@table('[[obstacle]] with kind = "cylinder"')
class RigidCylinder(RoundObstacle):
    """An endless round cylinder, or the bore of one; a circle in 2D.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "cylinder"
    _vectors: ClassVar[tuple[str, ...]] = ("point",)

    name: str = key(Name(), NAME, default="cylinder")
    point: Sequence[float] = key(Vector(), "a point of the axis", unit="m", also="center")
    axis: Sequence[float] | None = key(
        Vector((3,), nonzero=True),
        "direction of the axis, of any length; required in 3D",
        default=None,
        absent="none in 2D",
    )
    radius: float = key(Real(above=0), "radius", unit="m")
    side: str = key(Choice(SIDES), SIDE, default="outside")
    motion: MaybeFormulas = key(MOTION_KIND, MOTION, unit="m", default=None, absent="at rest")
    rotation: MaybeTable[Rotation] = key(ROTATION_KIND, ROTATION, default=None, absent="none")

    @property
    def unit_axis(self) -> tuple[float, ...] | None:
        """The axis with length 1 (3,); None in 2D."""
        return None if self.axis is None else unit(self.axis)

    @property
    def core(self) -> Core:
        """Axis and radius."""
        return self.round_core(self.point, self.unit_axis)

    def check_dimension(self, dim: int) -> None:
        """As for all obstacles; a cylinder needs its axis in 3D and only there."""
        super().check_dimension(dim)
        if dim == 3 and self.axis is None:
            text = " is missing: in 3D give its direction, as [0.0, 0.0, 1.0]."
            raise KeyedError(self.kind, "axis", text)
        if dim == 2 and self.axis is not None:
            text = f" = {show(list(self.axis))}: in 2D a cylinder is a circle; remove the axis."
            raise KeyedError(self.kind, "axis", text)

    def is_revolved(self, place: Floats, within: float) -> bool:
        """Whether its axis is the vertical."""
        upright = self.unit_axis is not None and abs(self.unit_axis[1]) > 1.0 - 1e-12
        return upright and bool(np.abs(np.array(self.point) - place)[[0, 2]].max() <= within)

    def runs_along_z(self, low: float, high: float) -> bool:  # noqa: ARG002  (it has no end)
        """Whether its axis does."""
        return self.unit_axis is not None and abs(self.unit_axis[2]) > 1.0 - 1e-12

    def gap(self, points: Floats) -> Field:
        """Distances (points,) and normals (points, dim) at rest."""
        dim = points.shape[1]
        arms = points - np.asarray(self.point, dtype=np.float64)
        if dim == 2:
            return self.round_gap(arms, upwards(dim))
        axis = unit_vector(np.asarray(self.axis, dtype=np.float64))
        arms -= np.outer(arms @ axis, axis)
        # On the axis: square to it and as near to y as can be, or to x if it runs along y.
        start = np.eye(dim)[0 if abs(axis[1]) > np.sqrt(0.5) else 1]
        return self.round_gap(arms, unit_vector(start - (start @ axis) * axis))

    def is_image(self, other: Self, mirror: Mirror) -> bool:
        """Whether it, at rest, is the mirror image of another one of its kind."""
        apart = mirror.point(self.point) - np.array(other.point)
        parallel = True
        if self.unit_axis is not None and other.unit_axis is not None:
            along = np.array(other.unit_axis)
            parallel = abs(float(mirror.direction(self.unit_axis) @ along)) > 1.0 - 1e-12
            apart = apart - (apart @ along) * along
        same = self.radius == other.radius and self.side == other.side
        return parallel and same and mirror.near(apart, np.zeros_like(apart))

    def faces(self, centre: Floats, reach: float) -> Floats:
        """Triangles (faces, 3, 3) whose normals point to the side of the body, at rest."""
        axis, point = np.array(self.unit_axis), np.array(self.point)
        first, second = square_to(axis)
        middle = point + ((centre - point) @ axis) * axis
        around = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
        ring = self.radius * (np.outer(np.cos(around), first) + np.outer(np.sin(around), second))
        along = np.linspace(-reach, reach, HIGH + 1)[:, None, None] * axis
        faces = patches(middle + along + ring)
        arms = faces.mean(axis=1) - middle
        arms -= np.outer(arms @ axis, axis)
        return facing(faces, self.sign * arms)

    def outline(self) -> dict[str, Any]:
        """Its outline in the plane at rest, as moving pictures take it."""
        return self.circle(self.point)
