"""A box, or a rectangle in the plane."""

import math
from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.given import MaybeFormulas, MaybeTable
from impactfem.scene.inline import Vector
from impactfem.scene.kinds import Name, Real
from impactfem.scene.obstacles.base import MOTION, MOTION_KIND, NAME, ROUNDING, Field, RigidObstacle
from impactfem.scene.obstacles.faces import facing, patches
from impactfem.scene.obstacles.mirror import EQUAL, Mirror
from impactfem.scene.obstacles.rotation import ROTATION, ROTATION_KIND, Rotation
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import degrees_hint


@table('[[obstacle]] with kind = "box"')
class RigidBox(RigidObstacle):
    """A box (a rectangle in 2D); the body is outside.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "box"
    is_smooth: ClassVar[bool] = False
    _vectors: ClassVar[tuple[str, ...]] = ("center", "size")

    name: str = key(Name(), NAME, default="box")
    center: Sequence[float] = key(Vector(), "centre", unit="m", also="point")
    size: Sequence[float] = key(Vector(positive=True), "edges along x, y and z", unit="m")
    angle: float = key(
        Real(), "angle by which it is turned about its centre (about z)", unit="rad", default=0.0
    )
    motion: MaybeFormulas = key(MOTION_KIND, MOTION, unit="m", default=None, absent="at rest")
    rotation: MaybeTable[Rotation] = key(ROTATION_KIND, ROTATION, default=None, absent="none")

    def _check(self) -> None:
        degrees = degrees_hint(self.angle)
        if degrees:
            raise KeyedError(self.kind, "angle", f" = {self.angle:g} is {degrees}.")

    @property
    def features(self) -> float:
        """Its shortest edge [m]."""
        return min(self.size)

    @property
    def corners(self) -> Floats:
        """Its corners at rest [m], (4 or 8, dim)."""
        dim = len(self.size)
        turn = np.eye(dim)
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        turn[:2, :2] = [[cosine, -sine], [sine, cosine]]
        arms = (np.array(list(np.ndindex(*(2,) * dim))) - 0.5) * np.asarray(self.size, dtype=float)
        return np.asarray(arms @ turn.T + np.asarray(self.center, dtype=np.float64))

    def runs_along_z(self, low: float, high: float) -> bool:
        """Whether it reaches from low to high."""
        half = self.size[2] / 2
        return self.center[2] - half <= low and high <= self.center[2] + half

    def gap(self, points: Floats) -> Field:
        """Distances (points,) and normals (points, dim) at rest."""
        dim = points.shape[1]
        turn = np.eye(dim)
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        turn[:2, :2] = [[cosine, -sine], [sine, cosine]]
        half = 0.5 * np.asarray(self.size, dtype=np.float64)
        local = (points - np.asarray(self.center, dtype=np.float64)) @ turn
        signs = np.where(local < 0.0, -1.0, 1.0)
        beyond = np.abs(local) - half
        outer = np.maximum(beyond, 0.0)
        distance = np.sqrt(np.einsum("ij,ij->i", outer, outer))
        deepest = beyond.max(axis=1)
        rounding = ROUNDING * float(half.max())
        outside = distance > rounding
        order = np.array([1, 0, 2][:dim])
        nearest = order[np.argmax(beyond[:, order] >= (deepest - rounding)[:, None], axis=1)]
        normal = np.where(
            outside[:, None],
            outer / np.where(outside, distance, 1.0)[:, None],
            np.eye(dim)[nearest],
        )
        return np.where(deepest > 0.0, distance, deepest), (signs * normal) @ turn.T

    def is_image(self, other: Self, mirror: Mirror) -> bool:
        """Whether it, at rest, is the mirror image of another one of its kind."""
        angle = self.angle if mirror.axis == 2 else -self.angle
        turned = abs(math.remainder(angle - other.angle, math.pi)) > EQUAL
        same = np.array_equal(self.size, other.size) and not turned
        return same and mirror.near(mirror.point(self.center), np.array(other.center))

    def faces(self, centre: Floats, reach: float) -> Floats:  # noqa: ARG002  (it ends)
        """Triangles (faces, 3, 3) whose normals point to the side of the body, at rest."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        faces = []
        steps = np.linspace(-0.5, 0.5, 9)
        for axis in range(3):
            for side in (-0.5, 0.5):
                places = np.full((9, 9, 3), side)
                places[:, :, (axis + 1) % 3], places[:, :, (axis + 2) % 3] = np.meshgrid(
                    steps, steps
                )
                parts = patches(places)
                faces.append(facing(parts, np.tile(np.sign(side) * np.eye(3)[axis], (128, 1))))
        placed: Floats = np.concatenate(faces) * np.array(self.size) @ turn.T
        return placed + np.array(self.center, dtype=np.float64)

    def outline(self) -> dict[str, Any]:
        """Its outline in the plane at rest, as moving pictures take it."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        turn = np.array([[cosine, -sine], [sine, cosine]])
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) / 2
        places = corners * np.array(self.size[:2]) @ turn.T + np.array(self.center[:2])
        return {"shape": "chain", "points": places, "closed": True, "inside": False}
