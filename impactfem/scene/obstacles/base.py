"""What the rigid obstacles of a scene have in common.

In 2D a sphere and a cylinder are circles, a box is a rectangle. In an axisymmetric model every
obstacle is revolved about the axis, as the body is.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.closed_surface import ClosedSurface
from impactfem.scene.formula import Formula
from impactfem.scene.inline import Formulas
from impactfem.scene.obstacles.mirror import Mirror
from impactfem.scene.obstacles.rotation import Rotation
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

type Floats = NDArray[np.float64]
type Indices = NDArray[np.int64]
type Field = tuple[Floats, Floats]

ROUNDING = 1e-9
"""Share of an obstacle's size below which a distance does not say a direction."""

SIDES = ("outside", "inside")
NAME = "name of the obstacle"
MOTION = "displacement of the obstacle in time"
SIDE = "where the body is"
MOTION_KIND = Formulas(("t",))


class Plane(NamedTuple):
    """Where a flat obstacle ends, at rest: a point [m] and the unit normal to the body, (dim,)."""

    point: Sequence[float]
    normal: Sequence[float]


class Core(NamedTuple):
    """What a round obstacle is at rest.

    Attributes:
        center: Its centre, or a point of its axis [m], (dim,).
        axis: Direction of a cylinder's axis with length 1, (3,); None for a ball or a circle.
        radius: [m].
        side: 1 if the body is outside, -1 inside.
    """

    center: Floats
    axis: Floats | None
    radius: float
    side: float


class Ridges(NamedTuple):
    """Places of an obstacle in the plane that stick out.

    Attributes:
        places: At rest [m], (ridges, 2).
        first, last: Unit normals of the faces before and behind them, out of the obstacle; from
            the last to the first one it is less than half a turn to the left, (ridges, 2).
    """

    places: Floats
    first: Floats
    last: Floats


class RigidObstacle(ABC):
    """What the rigid obstacles of solids have in common.

    Attributes:
        kind: Its name in a scene.
        before_bars: Whether bars meet it on their axis.
        is_smooth: Whether its normal turns without jumps.
    """

    kind: ClassVar[str]
    before_bars: ClassVar[bool] = False
    is_smooth: ClassVar[bool] = True
    name: str
    motion: tuple[Formula, ...] | None = None
    rotation: Rotation | None = None
    _vectors: ClassVar[tuple[str, ...]] = ()

    def check_dimension(self, dim: int) -> None:
        """Refuse coordinates that do not fit a body in 2D or 3D.

        Raises:
            KeyedError: naming the key of the obstacle.
        """
        if dim == 3 and type(self).faces is RigidObstacle.faces:
            text = f" = {show(self.kind)} is one of the plane, but the body has 3 coordinates"
            raise KeyedError(self.kind, "kind", f"{text}: give another kind, or a method faces.")
        if dim == 2 and type(self).outline is RigidObstacle.outline:
            text = f" = {show(self.kind)} is one of space, but the body has 2 coordinates"
            raise KeyedError(self.kind, "kind", f"{text}: give another kind, or a method outline.")
        for name in (*self._vectors, "motion"):
            value = getattr(self, name)
            if value is not None and len(value) != dim:
                shown = show([entry.plain for entry in value] if name == "motion" else list(value))
                text = f" = {shown} has {len(value)} entries, but the body has {dim} coordinates"
                raise KeyedError(self.kind, name, f"{text}: give {dim}.")
        if self.rotation is not None and self.rotation.dim != dim:
            fitting = "point and axis with 3 entries" if dim == 3 else f"a point with {dim}"
            text = f" has {self.rotation.dim} coordinates, but the body has {dim}: "
            text += f"give {fitting}." if dim > 1 else "on a line nothing turns; remove it."
            raise KeyedError(self.kind, "rotation", text)

    @property
    def moves(self) -> bool:
        """Whether it moves or turns."""
        return self.motion is not None or self.rotation is not None

    def opened(self, folder: Path) -> Self:  # noqa: ARG002  (of those that have files)
        """The same with its file read, whose relative path starts at a folder."""
        return self

    @property
    def in_space(self) -> "RigidObstacle":
        """The same for bodies that move in space."""
        return self

    @property
    def features(self) -> float:
        """Length over which its normal changes [m]."""
        return math.inf

    @property
    def is_flat(self) -> bool:
        """Whether it has the same normal wherever a body meets it."""
        return False

    @property
    def meets_corners(self) -> bool:
        """Whether a convex body of edges and faces meets it with its corners first."""
        return self.is_flat

    @property
    def ridges(self) -> Ridges | None:
        """What sticks out of one that need not be convex, for sides of bodies in the plane."""
        return None

    @property
    def surface(self) -> ClosedSurface | None:
        """Triangles of one that may have any form, which shapes of rigid bodies in space meet."""
        return None

    @property
    def rims(self) -> Floats:
        """Straight lines on one that need not be convex, at rest, in space [m], (lines, 2, 3)."""
        return np.empty((0, 2, 3))

    def meets_sides(self, body: Any) -> bool:
        """Whether more of a body than corners meets it: sides its ridges, or what is curved."""
        there = body.dim == 2 and self.ridges is not None
        return body.is_curved or (there and (body.is_convex or not self.meets_corners))

    @property
    def corners(self) -> Floats | None:
        """Corners at rest of a convex one with flat faces that ends [m], (corners, dim)."""
        return None

    @property
    def is_convex(self) -> bool:
        """Whether edges and faces of rigid bodies may meet it."""
        return self.corners is not None or (self.core is not None and self.core.side > 0.0)

    def least_near(self, gaps: Floats, ways: Floats) -> Floats:
        """What gaps [m] fall to at most on ways [m] from where they are known, (places,) each.

        The gap from a convex one changes by no more than the way; others may change the side.
        """
        return gaps - ways if self.is_convex else np.full(len(gaps), -np.inf)

    @property
    def plane(self) -> Plane | None:
        """Where it ends if that is a plane."""
        return None

    @property
    def plane_normal(self) -> Sequence[float] | None:
        """Its normal if it is a plane: then pictures show where it is."""
        return None if self.plane is None else self.plane.normal

    @property
    def core(self) -> Core | None:
        """What it is if it is round."""
        return None

    def is_revolved(self, place: Floats, within: float) -> bool:  # noqa: ARG002
        """Whether it, at rest, is round about the vertical through a place, within a distance."""
        return False

    def runs_along_z(self, low: float, high: float) -> bool:  # noqa: ARG002
        """Whether it, at rest, is the same at all z from low to high [m]."""
        return False

    @abstractmethod
    def gap(self, points: Floats) -> Field:
        """Distances of points from it at rest, and their gradients.

        See `impactfem.contact.distance.signed_distance`.

        Args:
            points: Places [m], shape (points, dim).

        Returns:
            Distances [m], shape (points,); unit normals towards the body, shape (points, dim).
        """

    def other_gap(self, points: Floats) -> Field | None:  # noqa: ARG002
        """Distances from another face that balls may touch at once, as `gap`; None if none can.

        Infinite where a point sees but one.
        """
        return None

    def parts(self) -> "Sequence[RigidObstacle]":
        """Obstacles that it is made of, of which a place may touch several: in inward corners."""
        return (self,)

    def mirrors(self, other: "RigidObstacle", mirror: Mirror) -> bool:
        """Whether it, at rest, is the mirror image of another one."""
        return isinstance(other, type(self)) and self.is_image(other, mirror)

    @abstractmethod
    def is_image(self, other: Self, mirror: Mirror) -> bool:
        """Whether it, at rest, is the mirror image of another one of its kind."""

    def faces(self, centre: Floats, reach: float) -> Floats:  # noqa: ARG002
        """Triangles whose normals point to the side of the body, at rest, in space.

        Args:
            centre: Where the body is [m], shape (3,).
            reach: How far endless obstacles are drawn from there [m].

        Returns:
            Corners, shape (triangles, 3, 3).
        """
        return np.empty((0, 3, 3))

    def lines(self, centre: Floats, reach: float) -> Floats:  # noqa: ARG002
        """Lines on its faces, (lines, 2, 3)."""
        return np.empty((0, 2, 3))

    def outline(self) -> dict[str, Any]:
        """Its outline in the plane at rest, as moving pictures take it."""
        return {}


def unit(vector: Sequence[float]) -> tuple[float, ...]:
    """Components of a vector with length 1."""
    length = math.hypot(*vector)
    if not math.isfinite(length) or length < np.finfo(float).tiny:  # hypot may overflow
        scale = max(abs(entry) for entry in vector)
        return unit([entry / scale for entry in vector])
    return tuple(entry / length for entry in vector)


def unit_vector(vector: Floats) -> Floats:
    """A vector with length 1."""
    scaled = vector / np.abs(vector).max()  # the square of a long vector may overflow
    return np.asarray(scaled / np.linalg.norm(scaled))
