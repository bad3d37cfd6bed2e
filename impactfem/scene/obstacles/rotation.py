"""How obstacles turn: the keys of a rotation, and where an obstacle is at a time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.scene.given import AFormula
from impactfem.scene.inline import InlineTable, Vector
from impactfem.scene.kinds import FormulaOf
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.obstacles.base import RigidObstacle

type Floats = NDArray[np.float64]

ROTATION = "rotation of the obstacle in time, about a point that goes along with motion"


@table("rotation = { ... }")
class Rotation:
    """How an obstacle turns in time.

    Raises:
        SceneError: a value is not allowed, or point and axis do not fit.
    """

    heading: ClassVar[str] = "rotation"

    point: Sequence[float] = key(Vector(), "a point of the axis, at rest", unit="m")
    axis: Sequence[float] | None = key(
        Vector((3,), nonzero=True), "its direction, of any length; required in 3D", default=None,
        absent="along z in 2D",
    )  # fmt: skip
    angle: AFormula = key(
        FormulaOf(("t",)), "turned since the place that the other keys give, by the right hand",
        unit="rad",
    )  # fmt: skip

    def _check(self) -> None:
        if (self.axis is None) != (len(self.point) == 2):
            shown = f" = {show(list(self.point))}"
            if self.axis is None:
                text = f" is missing: with point{shown} give its direction, as [0.0, 0.0, 1.0]."
                raise KeyedError(self.heading, "axis", text)
            text = f"{shown} has 2 entries, but an axis is given: give 3, or in 2D no axis."
            raise KeyedError(self.heading, "point", text)

    @property
    def dim(self) -> int:
        """Number of coordinates, 2 or 3."""
        return len(self.point)

    def matrix(self, t: float) -> Floats:
        """Of the rotation at a time [s], (dim, dim)."""
        angle = float(self.angle(t=t))
        c, s = (math.cos(angle), math.sin(angle)) if math.isfinite(angle) else (math.nan, math.nan)
        if self.axis is None:
            return np.array([[c, -s], [s, c]])
        scaled = np.asarray(self.axis, dtype=np.float64)
        x, y, z = scaled / np.abs(scaled).max() / np.linalg.norm(scaled / np.abs(scaled).max())
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        along = np.outer([x, y, z], [x, y, z])
        return np.asarray(along + c * (np.eye(3) - along) + s * cross)


ROTATION_KIND = InlineTable((Rotation,))


@dataclass(frozen=True)
class Placement:
    """Where an obstacle is at a time: x = point + turn (X - point) + shift of a place X at rest.

    Attributes:
        shift: [m], (dim,); 0 without any.
        turn: Rotation, (dim, dim); None without any.
        point: About which it turns [m], (dim,).
    """

    shift: Floats | float
    turn: Floats | None = None
    point: Floats | float = 0.0

    def moved(self, places: Floats) -> Floats:
        """Where places at rest (..., dim) are."""
        if self.turn is None:
            return places + self.shift
        return np.asarray((places - self.point) @ self.turn.T + self.point + self.shift)

    def since(self, first: "Placement", places: Floats) -> Floats | float:
        """How far places at rest (..., dim) have moved since an earlier placement [m]."""
        way = self.shift - first.shift
        if self.turn is None or first.turn is None:
            return way
        return np.asarray((places - self.point) @ (self.turn - first.turn).T + way)

    def back(self, places: Floats) -> Floats:
        """Where places (..., dim) are when the obstacle is at rest."""
        if self.turn is None:
            return places - self.shift
        return np.asarray((places - self.shift - self.point) @ self.turn + self.point)

    def turned(self, directions: Floats) -> Floats:
        """Directions (..., dim) that an obstacle at rest has."""
        return directions if self.turn is None else np.asarray(directions @ self.turn.T)


AT_REST = Placement(0.0)


def placement(obstacle: "RigidObstacle | Any", t: float) -> Placement:
    """Where an obstacle is at a time [s].

    Raises:
        SceneError: Its motion or rotation is not finite.
    """
    motion, rotation = obstacle.motion, obstacle.rotation
    if motion is None and rotation is None:
        return AT_REST
    shift: Floats | float = 0.0
    if motion is not None:
        shift = np.array([formula(t=t) for formula in motion], dtype=np.float64)
    found = Placement(shift)
    if rotation is not None:
        found = Placement(shift, rotation.matrix(t), np.asarray(rotation.point, dtype=np.float64))
    for name, value, given in (
        ("motion", found.shift, motion and [formula.text for formula in motion]),
        ("rotation.angle", found.turn, rotation and rotation.angle.text),
    ):
        if value is not None and not np.isfinite(value).all():
            raise SceneError(
                f"obstacle {obstacle.name!r}: {name} = {given} is not finite at t = {t:g} s; "
                "change the formula or the duration"
            )
    return found


def gap_at(obstacle: "RigidObstacle | Any", points: Floats, t: float) -> tuple[Floats, Floats]:
    """Distances [m] of points (points, dim) from an obstacle at a time [s], and their gradients."""
    at = placement(obstacle, t)
    gap, normal = obstacle.gap(at.back(points))
    return gap, at.turned(normal)
