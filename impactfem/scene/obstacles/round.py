"""What round obstacles have in common."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.obstacles.base import ROUNDING, Core, Field, RigidObstacle


class RoundObstacle(RigidObstacle):
    """A sphere, a cylinder, or the hollow around one."""

    radius: float
    side: str

    @property
    def features(self) -> float:
        """Its radius [m]."""
        return self.radius

    @property
    def sign(self) -> float:
        """1 if the body is outside, else -1."""
        return -1.0 if self.side == "inside" else 1.0

    @property
    def meets_corners(self) -> bool:
        """A hollow one does."""
        return self.sign < 0.0

    def round_core(self, center: Sequence[float], axis: Sequence[float] | None) -> Core:
        """What it is at rest, with its centre and axis."""
        direction = None if axis is None else np.asarray(axis)
        return Core(np.asarray(center, dtype=float), direction, self.radius, self.sign)

    def round_gap(self, arms: Floats, fallback: Floats) -> Field:
        """Distances and normals.

        Args:
            arms: From its centre or axis to the points [m], shape (points, dim).
            fallback: Normal where an arm has no length, shape (dim,).
        """
        length = np.sqrt(np.einsum("ij,ij->i", arms, arms))
        centred = length <= ROUNDING * self.radius
        normal = arms / np.where(centred, 1.0, length)[:, None]
        normal[centred] = fallback
        return self.sign * (length - self.radius), self.sign * normal

    def circle(self, centre: Sequence[float]) -> dict[str, Any]:
        """Outline in the plane."""
        inside = self.side == "inside"
        return {"shape": "circle", "point": centre[:2], "radius": self.radius, "inside": inside}


def upwards(dim: int) -> Floats:
    """Unit vector along y."""
    up: Floats = np.zeros(dim)
    up[1] = 1.0
    return up
