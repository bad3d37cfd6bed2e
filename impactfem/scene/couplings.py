"""Springs and dampers between any two places: rows as those of joints, which hold nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np

from impactfem.scene.given import Given
from impactfem.scene.inline import ListOf, NumberOrList, Vector
from impactfem.scene.joints import GROUND, Joint
from impactfem.scene.kinds import Name, Real, SideName
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

_AXES = "xyz"
WHOLE = float("inf")
"""Radius of the region of a joint that is all of a surface."""
NEAREST = 0.0
"""The same of that of the nearest nodes that tell how it turns."""


@dataclass(frozen=True, kw_only=True)
class SpringLine(Joint):
    """A spring and damper along the line between two places, as a row that holds nothing."""

    heading: ClassVar[str] = "spring"

    @property
    def holds(self) -> bool:
        """It does not."""
        return False

    @property
    def is_driven(self) -> bool:
        """Nor does it move anything."""
        return False

    def __post_init__(self) -> None:
        """Nothing: the spring is checked."""


@dataclass(frozen=True, kw_only=True)
class SpringRow(SpringLine):
    """The same along a direction that stays.

    Attributes:
        number: Number of coordinates.
    """

    number: int

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return self.number

    @property
    def leads(self) -> bool:
        """Its direction does not turn with a body."""
        return False

    @property
    def start(self) -> float:
        """Its coordinate at t = 0 [m]: what the second has moved more than the first."""
        return 0.0


@table("[[spring]]")
class SpringElement:
    """A spring and damper between two places of bodies, or one and the ground.

    With two `points` and one stiffness it acts along the line between them; else along x, y and z.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "spring"

    name: str = key(Name(), "name of the spring in columns such as `NAME.q`", default="spring")
    between: Sequence[str] = key(
        ListOf(SideName(), at_least=2),
        'names of two bodies or surfaces (`strip/end`), or of one and "ground"; without point it '
        "acts on the mean displacement of a surface, on the centre of a rigid body or point",
    )  # fmt: skip
    point: Sequence[float] | None = key(
        Vector(), "where it acts on both at t = 0", unit="m", default=None, absent="the middle"
    )
    points: Sequence[Sequence[float]] | None = key(
        ListOf(Vector(), at_least=2), "where it acts on either at t = 0", unit="m", default=None,
        absent="one place",
    )  # fmt: skip
    stiffness: Given[tuple[float, ...], float | Sequence[float]] = key(
        NumberOrList(Real(at_least=0), 3), "one for all directions, or one for each", unit="N/m",
        default=(0.0,),
    )  # fmt: skip
    damping: Given[tuple[float, ...], float | Sequence[float]] = key(
        NumberOrList(Real(at_least=0), 3), "likewise", unit="N s/m", default=(0.0,)
    )
    rest: Given[tuple[float, ...] | None, float | Sequence[float] | None] = key(
        NumberOrList(Real(), 3),
        "length, or for each direction what the second has moved more than the first, at which it "
        "is not strained",
        unit="m", default=None, absent="that at t = 0",
    )  # fmt: skip

    def _check(self) -> None:
        if len(self.between) != 2:
            raise self._fail("between", f" has {len(self.between)} names: give two.")
        if not any(self.stiffness) and not any(self.damping):
            text = " is missing, and so is damping: a spring without either does nothing; give one."
            raise KeyedError(self.heading, "stiffness", text)
        if self.point is not None and self.points is not None:
            raise self._fail("point", " and points are given: give one of them.")
        same = self.between[0] == self.between[1]
        if same and (self.points is None or self.between[0] == GROUND):
            text = " is one place twice: a spring needs two; give others, or two points of a body."
            raise self._fail("between", text)
        if self.points is not None:
            self._check_points(self.points)

    def _check_points(self, points: Sequence[Sequence[float]]) -> None:
        if len(points) != 2 or len(points[0]) != len(points[1]):
            raise self._fail("points", " are not two places of as many numbers: give these.")
        if points[0] == points[1] and (self.is_a_line or self.between[0] == self.between[1]):
            text = " are one place, where a spring has no direction: give two, or point instead, "
            raise self._fail("points", text + "for a spring along x, y and z.")

    def check_in(self, where: str, dim: int) -> None:
        """Refuse what has not as many numbers as a scene has coordinates.

        Raises:
            KeyedError: naming the key.
        """
        given = {"point": self.point} if self.point is not None else {}
        given |= {f"points[{k}]": place for k, place in enumerate(self.points or ())}
        several = {} if self.is_a_line else {"rest": self.rest}
        each = {"stiffness": self.stiffness, "damping": self.damping} | several
        given |= {n: v for n, v in each.items() if v is not None and (n == "rest" or len(v) > 1)}
        for name, value in given.items():
            if len(value) != dim:
                text = f" = {show(list(value))} has {len(value)} numbers, the bodies have {dim} "
                raise KeyedError(where, name, f"{text}coordinates: give {dim}.")

    @property
    def has_places(self) -> bool:
        """Whether it says where it acts."""
        return self.point is not None or self.points is not None

    @property
    def is_a_line(self) -> bool:
        """Whether it acts along the line between its two points."""
        each = self.stiffness, self.damping, self.rest or (0.0,)
        return self.points is not None and all(len(value) == 1 for value in each)

    def rows(self, dim: int) -> tuple[Joint, ...]:
        """It as rows: one along its line, or one for each direction in which it acts."""
        common: dict[str, Any] = {"between": self.between, "point": self.point}
        common |= {"points": self.points, "radius": None}
        if not self.has_places:
            common["radius"] = WHOLE
        if self.is_a_line:
            rest = None if self.rest is None else self.rest[0]
            return (
                SpringLine(
                    name=self.name, kind="distance", stiffness=self.stiffness[0],
                    damping=self.damping[0], rest=rest, **common,
                ),
            )  # fmt: skip
        stiffness, damping = (
            np.broadcast_to(value, dim).tolist() for value in (self.stiffness, self.damping)
        )
        return tuple(
            SpringRow(
                name=f"{self.name}_{_AXES[k]}", kind="prismatic", number=dim,
                axis=tuple(np.eye(dim)[k].tolist()), stiffness=stiffness[k], damping=damping[k],
                rest=None if self.rest is None else self.rest[k], **common,
            )
            for k in range(dim)
            if stiffness[k] or damping[k]
        )  # fmt: skip

    def _fail(self, name: str, text: str) -> KeyedError:
        value = cast("Any", getattr(self, name))
        plain = [list(each) if isinstance(each, tuple) else each for each in value]
        return KeyedError(self.heading, name, f" = {show(plain)}{text}")
