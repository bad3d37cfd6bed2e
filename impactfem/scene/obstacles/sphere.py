"""A ball, or the hollow around one."""

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.given import MaybeFormulas, MaybeTable
from impactfem.scene.inline import Vector
from impactfem.scene.kinds import Choice, Name, Real
from impactfem.scene.obstacles.base import MOTION, MOTION_KIND, NAME, SIDE, SIDES, Core, Field
from impactfem.scene.obstacles.faces import AROUND, HIGH, facing, patches
from impactfem.scene.obstacles.mirror import Mirror
from impactfem.scene.obstacles.rotation import ROTATION, ROTATION_KIND, Rotation
from impactfem.scene.obstacles.round import RoundObstacle, upwards
from impactfem.scene.schema import key, table


@table('[[obstacle]] with kind = "sphere"')
class RigidSphere(RoundObstacle):
    """A ball, or the hollow around one; a circle in 2D.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "sphere"
    _vectors: ClassVar[tuple[str, ...]] = ("center",)

    name: str = key(Name(), NAME, default="sphere")
    center: Sequence[float] = key(Vector(), "centre", unit="m", also="point")
    radius: float = key(Real(above=0), "radius", unit="m")
    side: str = key(Choice(SIDES), SIDE, default="outside")
    motion: MaybeFormulas = key(MOTION_KIND, MOTION, unit="m", default=None, absent="at rest")
    rotation: MaybeTable[Rotation] = key(ROTATION_KIND, ROTATION, default=None, absent="none")

    @property
    def core(self) -> Core:
        """Centre and radius."""
        return self.round_core(self.center, None)

    def is_revolved(self, place: Floats, within: float) -> bool:
        """Whether its centre lies on the vertical."""
        return bool(np.abs(np.array(self.center) - place)[[0, 2]].max() <= within)

    def gap(self, points: Floats) -> Field:
        """Distances (points,) and normals (points, dim) at rest."""
        arms = points - np.asarray(self.center, dtype=np.float64)
        return self.round_gap(arms, upwards(points.shape[1]))

    def is_image(self, other: Self, mirror: Mirror) -> bool:
        """Whether it, at rest, is the mirror image of another one of its kind."""
        same = self.radius == other.radius and self.side == other.side
        return same and mirror.near(mirror.point(self.center), np.array(other.center))

    def faces(self, centre: Floats, reach: float) -> Floats:  # noqa: ARG002  (it ends)
        """Triangles (faces, 3, 3) whose normals point to the side of the body, at rest."""
        polar = np.linspace(0.0, np.pi, HIGH + 1)[:, None]
        around = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)[None]
        x, y, z = np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)
        arms = np.stack([x, y + 0.0 * around, z], axis=2)
        middle = np.array(self.center)
        faces = patches(middle + self.radius * arms)
        return facing(faces, self.sign * (faces.mean(axis=1) - middle))

    def outline(self) -> dict[str, Any]:
        """Its outline in the plane at rest, as moving pictures take it."""
        return self.circle(self.center)
