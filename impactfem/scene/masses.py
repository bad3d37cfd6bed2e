"""Masses on bodies: points that the body carries, by the joint that holds a point to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from impactfem.scene.couplings import NEAREST, WHOLE
from impactfem.scene.inline import Vector
from impactfem.scene.joints import Joint
from impactfem.scene.kinds import Name, Real
from impactfem.scene.nearest import meant
from impactfem.scene.points import Point
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.content import Content


@dataclass(frozen=True, kw_only=True)
class Attached(Point):
    """The point of a mass: it meets nothing, and moves at t = 0 as the body does there.

    Attributes:
        side: What carries it, as joints name it.
        region: Radius of the region of a surface that does [m]; None of what has none.
    """

    attached: ClassVar[bool] = True

    side: str
    region: float | None

    def __post_init__(self) -> None:
        """Nothing: the mass is checked."""

    @property
    def own_joints(self) -> tuple[Joint, ...]:
        """What holds it."""
        held = Joint(
            name=self.name, kind="fixed", between=[self.side, self.name], point=self.position,
        )  # fmt: skip
        object.__setattr__(held, "radius", self.region)  # as no scene gives it
        return (held,)


@table("[[point_mass]]")
class PointMass:
    """A mass on a body, which carries and weighs it: at a place, or on the mean of a surface.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "point_mass"

    name: str = key(Name(), "name of the mass in columns such as `NAME.x`", default="mass")
    body: str = key(Name(), "name of the body that carries it")
    point: Sequence[float] | None = key(
        Vector(), "where it is at t = 0", unit="m", default=None, absent="the middle of surface"
    )
    surface: str | None = key(
        Name(), "surface of a solid or of springs whose mean carries it, as a rigid tip",
        default=None, absent="the place alone",
    )  # fmt: skip
    mass: float = key(Real(above=0), "mass", unit="kg")

    def _check(self) -> None:
        if self.point is None and self.surface is None:
            text = " is missing, and so is surface: give where the mass is."
            raise KeyedError(self.heading, "point", text)

    def carried(self, scene: "Content", where: str) -> Attached:
        """The point that it is.

        Raises:
            KeyedError: naming the key.
        """
        bodies = {body.name: body for body in scene.bodies if not body.attached}
        body = bodies.get(self.body)
        if body is None:
            text = f" = {show(self.body)}: there is no such body; {meant(self.body, bodies)}."
            raise KeyedError(where, "body", text)
        if self.name in {*bodies, *(obstacle.name for obstacle in scene.obstacles)}:
            text = f" = {show(self.name)} is the name of something else: give another."
            raise KeyedError(where, "name", text)
        if not body.takes_joints or body.dim == 1 or body.has_links:
            text = f" = {show(self.body)} is a {body.kind}{' on a line' * (body.dim == 1)}, which "
            raise KeyedError(where, "body", f"{text}carries none: {_INSTEAD}.")
        if self.surface is not None and body.parts_in_joints != "surfaces":
            text = f" = {show(self.surface)}: {self.body} is a {body.kind}, a mass is carried by "
            raise KeyedError(where, "surface", f"{text}one of its places; give point instead.")
        at = self.point if self.point is not None else self._middle(body, where)
        if len(at) != body.dim:
            text = f" = {show(list(at))} has {len(at)} numbers, {self.body} has {body.dim} "
            raise KeyedError(where, "point", f"{text}coordinates: give {body.dim}.")
        place, region = np.asarray(at, dtype=float), NEAREST if body.kind == "plate" else None
        if self.surface is not None:
            side, region = f"{self.body}/{self.surface}", WHOLE
        else:
            parts = "", *(body.joint_parts or ())
            each = {part: body.missed(place, part) for part in parts}
            part = next((part for part, held in each.items() if held is None), None)
            if part is None:
                known = " or ".join(dict.fromkeys(str(held) for held in each.values()))
                text = f" = {show(list(at))} is not on {self.body}, which carries masses {known}: "
                raise KeyedError(where, "point", f"{text}give a place there.")
            side = self.body + f"/{part}" * bool(part)
        return Attached(
            name=self.name, mass=self.mass * 0.5 ** len(body.cuts),
            position=tuple(place.tolist()), side=side, velocity=(0.0,) * body.dim, region=region,
        )  # fmt: skip

    def _middle(self, body: Any, where: str) -> Sequence[float]:
        """Of the surface."""
        shape = getattr(body, "shape", None)
        middle = None if shape is None else shape.middle_of(self.surface)
        if middle is None:
            text = f" is missing: the middle of {self.body}/{self.surface} is not known here; give "
            raise KeyedError(where, "point", f"{text}it.")
        return tuple(map(float, middle))


_INSTEAD = (
    "give a beam, a solid, a plate, springs or a rigid body, in the plane or in space, to a bar "
    "there by point and axis; links have masses in their file"
)
