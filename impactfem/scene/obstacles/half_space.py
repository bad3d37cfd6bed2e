"""Everything behind a plane."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.given import MaybeFormulas, MaybeTable
from impactfem.scene.inline import Formulas, Vector
from impactfem.scene.kinds import Name
from impactfem.scene.obstacles.base import (
    MOTION,
    NAME,
    Field,
    Plane,
    RigidObstacle,
    unit,
    unit_vector,
)
from impactfem.scene.obstacles.faces import spacing, square_to
from impactfem.scene.obstacles.mirror import EQUAL, Mirror
from impactfem.scene.obstacles.rotation import ROTATION, ROTATION_KIND, Rotation
from impactfem.scene.schema import key, table


@table('[[obstacle]] with kind = "half_space"')
class HalfSpace(RigidObstacle):
    """Everything behind a plane, or a line in 2D; the body is on the side the normal points to.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "half_space"
    _vectors: ClassVar[tuple[str, ...]] = ("point", "normal")

    name: str = key(Name(), NAME, default="half_space")
    point: Sequence[float] = key(Vector((1, 2, 3)), "a point of the plane", unit="m", also="center")
    normal: Sequence[float] = key(
        Vector((1, 2, 3), nonzero=True), "direction from the plane to the body, of any length"
    )
    motion: MaybeFormulas = key(
        Formulas(("t",), lengths=(1, 2, 3)), MOTION, unit="m", default=None, absent="at rest"
    )
    rotation: MaybeTable[Rotation] = key(ROTATION_KIND, ROTATION, default=None, absent="none")

    @property
    def unit_normal(self) -> tuple[float, ...]:
        """The normal with length 1 (dim,)."""
        return unit(self.normal)

    @property
    def is_flat(self) -> bool:
        """Always: it has one normal."""
        return True

    @property
    def plane(self) -> Plane:
        """Where it ends."""
        return Plane(self.point, self.unit_normal)

    def is_revolved(self, place: Floats, within: float) -> bool:  # noqa: ARG002  (it has no middle)
        """Whether it is level."""
        return abs(self.unit_normal[1]) > 1.0 - 1e-12

    def runs_along_z(self, low: float, high: float) -> bool:  # noqa: ARG002  (it has no end)
        """Whether it is upright along z."""
        return abs(self.unit_normal[2]) < 1e-12

    def gap(self, points: Floats) -> Field:
        """Distances (points,) and normals (points, dim) at rest."""
        point, normal = self._own
        return (points - point) @ normal, np.full(points.shape, normal)

    @cached_property
    def _own(self) -> tuple[Floats, Floats]:
        """Point and normal as arrays, (dim,): asked for in every step."""
        normal = unit_vector(np.asarray(self.normal, dtype=np.float64))
        return np.asarray(self.point, dtype=np.float64), normal

    def is_image(self, other: Self, mirror: Mirror) -> bool:
        """Whether it, at rest, is the mirror image of another one of its kind."""
        normal = np.array(other.unit_normal)
        apart = float(normal @ (mirror.point(self.point) - np.array(other.point)))
        turned = float(np.abs(mirror.direction(self.unit_normal) - normal).max())
        return abs(apart) <= EQUAL * mirror.size and turned < 1e-12

    def faces(self, centre: Floats, reach: float) -> Floats:
        """A square below the body, as two triangles."""
        corners = self.grid(centre, reach)[0]
        found: Floats = corners[np.array([[0, 1, 2], [0, 2, 3]])]
        return found

    def lines(self, centre: Floats, reach: float) -> Floats:
        """Lines at round distances on that square, (lines, 2, 3)."""
        return self.grid(centre, reach)[1]

    def outline(self) -> dict[str, Any]:
        """Its outline in the plane at rest, as moving pictures take it."""
        return {"shape": "half", "point": self.point, "normal": self.unit_normal}

    def grid(self, centre: Floats, reach: float) -> tuple[Floats, Floats]:
        """A square of its plane below a body, with lines at round distances.

        Args:
            centre: Where the body is [m], as the plane at rest sees it.
            reach: Half the edge of the square [m].

        Returns:
            Corners (4, 3) and lines (lines, 2, 3), which are `spacing` apart.
        """
        normal = np.array(self.unit_normal)
        first, second = square_to(normal)
        origin = np.array(self.point, dtype=np.float64)
        step = spacing(reach)
        # Lines stand still while the body moves along the plane.
        u, v = (centre - origin) @ first, (centre - origin) @ second
        lines = []
        for along, across, a, b in ((first, second, u, v), (second, first, v, u)):
            for k in range(int(np.ceil((b - reach) / step)), int((b + reach) // step) + 1):
                base = origin + k * step * across
                lines.append([base + (a - reach) * along, base + (a + reach) * along])
        corners = [
            origin + (u + i * reach) * first + (v + j * reach) * second
            for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        return np.array(corners), np.array(lines)
