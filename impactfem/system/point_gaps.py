"""Gaps of points: to obstacles and to each other."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene import Formula, Point, Scene
from impactfem.scene.affine import affine_parts
from impactfem.scene.signal import Signal


@dataclass(frozen=True)
class Gap:
    """One gap phi(u) - b(t) between a point and an obstacle, or between two points.

    Attributes:
        own: Coordinates of the point in u.
        other: Coordinates of the other point; None for an obstacle.
        normal: Row of the constraint if phi = normal . u + offset, shape (d,); else None.
        offset: See `normal` [m].
        center: Centre of a sphere, or point of a cylinder's axis, shape (dim,).
        axis: Unit vector of a cylinder's axis, shape (dim,); None for a sphere.
        reach: Distance of the centres in contact [m].
        side: 1 outside, -1 inside.
        motion: b(t), way of the obstacle along the normal [m].
    """

    own: slice
    other: slice | None = None
    normal: Floats | None = None
    offset: float = 0.0
    center: Floats | None = None
    axis: Floats | None = None
    reach: float = 0.0
    side: float = 1.0
    motion: Signal = field(default_factory=Signal)

    def distance(self, u: Floats) -> Any:  # float, complex for complex steps
        """The part phi(u) [m]."""
        if self.normal is not None:
            return self.normal @ u + self.offset
        arm = self._arm(u)
        return self.side * (np.sqrt(arm @ arm) - self.reach)

    def gradient(self, u: Floats) -> Floats:
        """Gradient of phi, shape (d,); zero where two centres coincide."""
        if self.normal is not None:
            return self.normal
        arm = self._arm(u)
        length = float(np.sqrt(arm @ arm))
        row = np.zeros(len(u))
        if length > 0.0:
            row[self.own] = self.side * arm / length
            if self.other is not None:
                row[self.other] = -row[self.own]
        return row

    def _arm(self, u: Floats) -> Floats:
        """From the other centre to the point, square to the axis of a cylinder."""
        center = u[self.other] if self.other is not None else self.center
        arm: Floats = u[self.own] if center is None else u[self.own] - center
        return arm if self.axis is None else arm - (arm @ self.axis) * self.axis


def make_gap(points: Sequence[Point], scene: Scene, pair: tuple[str, str]) -> Gap:
    """Make the gap of a pair of names, a point first.

    Raises:
        SceneError: Two points start at the same place.
    """
    places = {point.name: index for index, point in enumerate(points)}
    point, dim = points[places[pair[0]]], scene.dim
    own = slice(places[pair[0]] * dim, (places[pair[0]] + 1) * dim)
    if pair[1] in places:
        index = places[pair[1]]
        return _of_two(points, (places[pair[0]], index), own, slice(index * dim, (index + 1) * dim))
    obstacle = next(entry for entry in scene.rigid_obstacles if entry.name == pair[1])
    plane, core = obstacle.plane, obstacle.core
    if plane is not None:
        row = np.zeros(dim * len(points))
        row[own] = plane.normal
        level = float(np.dot(plane.normal, plane.point))
        motion = _motion(plane.normal, obstacle.motion)
        return Gap(own, normal=row, offset=-level - point.radius, motion=motion)
    if core is None:
        raise SceneError(f"{obstacle.name}: points do not meet a {obstacle.kind}; give half-spaces")
    reach = core.radius + core.side * point.radius
    return Gap(own, center=core.center, axis=core.axis, reach=reach, side=core.side)


def _of_two(points: Sequence[Point], pair: tuple[int, int], own: slice, other: slice) -> Gap:
    one, two = points[pair[0]], points[pair[1]]
    if one.position == two.position:
        raise SceneError(
            f"{one.name} and {two.name}: both start at {list(one.position)}, so that their contact "
            "has no direction; move one"
        )
    reach = one.radius + two.radius
    if one.dim > 1:
        return Gap(own, other, reach=reach)
    # On a line points keep their order.
    row = np.zeros(len(points))
    row[own] = np.sign(one.position[0] - two.position[0])
    row[other] = -row[own]
    return Gap(own, other, normal=row, offset=-reach)


def _motion(normal: Sequence[float], motion: Sequence[Formula] | None) -> Signal:
    """Way of a half-space along its normal."""
    total = Signal()
    for share, formula in zip(normal, motion or (), strict=False):
        parts = affine_parts(formula, ())
        exact = parts is not None and parts[1].is_exact
        whole = parts[1] if parts is not None and exact else Signal(formulas=((1.0, formula),))
        total = total.plus(whole.times(share))
    return total
