"""Whether one obstacle at rest is the mirror image of another."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.obstacles import (
    HalfSpace,
    RigidBox,
    RigidCylinder,
    RigidPolyline,
    RigidSphere,
)
from impactfem.scene.scene import Rigid

Floats = NDArray[np.float64]

_EQUAL = 1e-9


def signs(axis: int, dim: int) -> Floats:
    """Factors (dim,) by which a reflection across an axis changes the components of a vector."""
    found = np.ones(dim)
    found[axis : axis + 1] = -1.0
    return found


@dataclass(frozen=True)
class Mirror:
    """A plane across an axis.

    Attributes:
        axis: 0, 1 or 2.
        place: Its coordinate on this axis [m].
        size: Length [m] to which distances are small or not.
    """

    axis: int
    place: float
    size: float

    def point(self, point: Sequence[float]) -> Floats:
        """Image of a point."""
        image = np.array(point, dtype=np.float64)
        image[self.axis : self.axis + 1] *= -1.0
        image[self.axis : self.axis + 1] += 2.0 * self.place
        return image

    def direction(self, vector: Sequence[float]) -> Floats:
        """Image of a vector."""
        return np.array(vector, dtype=np.float64) * signs(self.axis, len(vector))

    def near(self, left: Floats, right: Floats) -> bool:
        """Whether points are the same up to rounding."""
        return bool(np.abs(left - right).max() <= _EQUAL * self.size)


def is_image(one: Rigid, other: Rigid, mirror: Mirror) -> bool:
    """Whether one obstacle at rest is the mirror image of another."""
    return type(one) is type(other) and _IMAGES[type(one)](one, other, mirror)


def _planes(one: HalfSpace, other: HalfSpace, mirror: Mirror) -> bool:
    normal = np.array(other.unit_normal)
    apart = float(normal @ (mirror.point(one.point) - np.array(other.point)))
    turned = float(np.abs(mirror.direction(one.unit_normal) - normal).max())
    return abs(apart) <= _EQUAL * mirror.size and turned < 1e-12


def _spheres(one: RigidSphere, other: RigidSphere, mirror: Mirror) -> bool:
    same = one.radius == other.radius and one.side == other.side
    return same and mirror.near(mirror.point(one.center), np.array(other.center))


def _cylinders(one: RigidCylinder, other: RigidCylinder, mirror: Mirror) -> bool:
    apart = mirror.point(one.point) - np.array(other.point)
    parallel = True
    if one.unit_axis is not None and other.unit_axis is not None:
        along = np.array(other.unit_axis)
        parallel = abs(float(mirror.direction(one.unit_axis) @ along)) > 1.0 - 1e-12
        apart = apart - (apart @ along) * along
    same = one.radius == other.radius and one.side == other.side
    return parallel and same and mirror.near(apart, np.zeros_like(apart))


def _boxes(one: RigidBox, other: RigidBox, mirror: Mirror) -> bool:
    angle = one.angle if mirror.axis == 2 else -one.angle
    turned = abs(math.remainder(angle - other.angle, math.pi)) > _EQUAL
    same = np.array_equal(one.size, other.size) and not turned
    return same and mirror.near(mirror.point(one.center), np.array(other.center))


def _polylines(one: RigidPolyline, other: RigidPolyline, mirror: Mirror) -> bool:
    if mirror.axis == 2:  # extruded along z
        return one.points == other.points
    if len(one.points) != len(other.points):
        return False
    # A mirrored chain has its left on the right: it is walked backwards.
    image = np.array([mirror.point(point) for point in one.points])[::-1]
    return mirror.near(image, np.array([list(point) for point in other.points]))


_IMAGES: Mapping[type, Callable[[Any, Any, Mirror], bool]] = {
    HalfSpace: _planes,
    RigidSphere: _spheres,
    RigidCylinder: _cylinders,
    RigidBox: _boxes,
    RigidPolyline: _polylines,
}
