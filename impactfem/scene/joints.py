"""Joints between bodies, or with the ground: what they hold, and what acts in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from impactfem.scene.formula import Formula
from impactfem.scene.given import AFormula, MaybeFormula, MaybeFormulas, MaybeTable
from impactfem.scene.inline import Formulas, InlineTable, ListOf, Vector
from impactfem.scene.kinds import Choice, FormulaOf, Name, Real, SideName
from impactfem.scene.laws import side_of
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

GROUND = "ground"
"""Name in ``between`` of what does not move."""


@dataclass(frozen=True)
class JointKind:
    """What a kind of joint needs.

    Attributes:
        dims: Numbers of coordinates in which it is one.
        axis: Whether it has an axis in the plane, and in space.
        unit: Of its coordinate; none: it has no single one.
        given: The key that says where it is.
        crosses: Whether it has a second axis.
        yields: Whether it holds nothing where something acts along its coordinate.
        pins: Whether it holds places of what does not turn, as points.
        turns: Whether what it joins turns about its place.
    """

    dims: tuple[int, ...] = (2, 3)
    axis: tuple[bool, bool] = (False, False)
    unit: str | None = None
    given: str = "point"
    crosses: bool = False
    yields: bool = False
    pins: bool = False
    turns: bool = False


JOINTS: Mapping[str, JointKind] = {
    "fixed": JointKind(pins=True),
    "revolute": JointKind(axis=(False, True), unit="rad", turns=True),
    "prismatic": JointKind(axis=(True, True), unit="m", pins=True),
    "universal": JointKind((3,), (False, True), crosses=True, turns=True),
    "ball": JointKind((3,), pins=True, turns=True),
    "planar": JointKind((3,), (False, True), pins=True),
    "cylindrical": JointKind((3,), (False, True), "m"),
    "distance": JointKind(unit="m", given="points", yields=True, pins=True, turns=True),
    "gear": JointKind(given="joints"),
}


@table("soft = { ... }")
class Soft:
    """A joint that gives way, as game engines have it: a control.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "soft"

    erp: float = key(
        Real(at_least=0), "fraction of its error that a step mends, 0 to 1", default=0.2
    )
    cfm: float = key(
        Real(at_least=0), "speed with which it gives way by unit force", unit="m/(N s)", default=0.0
    )

    def _check(self) -> None:
        if self.erp > 1.0:
            text = f" = {show(self.erp)} is not allowed: a step mends all of an error at most; "
            raise KeyedError(self.heading, "erp", text + "give a number from 0 to 1.")


@table("[[joint]]")
class Joint:
    """What holds two bodies together, or one to the ground.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "joint"

    name: str = key(Name(), "name of the joint in columns such as `NAME.q`", default="joint")
    kind: str = key(Choice(tuple(JOINTS)), "what it leaves free")
    between: Sequence[str] | None = key(
        ListOf(SideName(), at_least=2),
        "names of two rigid bodies, points, beams, ends of bars (`bar`, `bar/far_end`), masses of "
        "springs, plates, links of mechanisms (`arm/hand`) or surfaces of springs and solids "
        '(`block/top`), or "ground" and one; not of a gear',
        default=None, absent="none",
    )  # fmt: skip
    joints: Sequence[str] | None = key(
        ListOf(Name(), at_least=2), "names of the two joints of a gear", default=None, absent="none"
    )
    ratio: float | None = key(
        Real(), "of a gear: the second coordinate changes by so many times the first", default=None,
        absent="none",
    )  # fmt: skip
    point: Sequence[float] | None = key(
        Vector(), "where it is at t = 0", unit="m", default=None, absent="none"
    )
    points: Sequence[Sequence[float]] | None = key(
        ListOf(Vector(), at_least=2), "of a distance: where it holds either body at t = 0",
        unit="m", default=None, absent="none",
    )  # fmt: skip
    radius: float | None = key(
        Real(above=0),
        "of the region about its place that it holds of a surface, in the mean; nodes there do not "
        "touch", unit="m", default=None,
        absent="a sixth of the surface's size, at most half way to its nearest edge",
    )  # fmt: skip
    axis: Sequence[float] | None = key(
        Vector(nonzero=True), "its axis at t = 0, of any length", default=None,
        absent="none, in the plane across it",
    )  # fmt: skip
    second_axis: Sequence[float] | None = key(
        Vector((3,), nonzero=True), "of a universal joint: that of the second body", default=None,
        absent="any perpendicular one",
    )  # fmt: skip
    position: AFormula = key(
        FormulaOf(("t",)), "its coordinate at t = 0, or by a formula of time, which drives it",
        unit="rad or m", default=0.0,
    )  # fmt: skip
    motion: MaybeFormulas = key(
        Formulas(("t",)), "displacement of the ground where it holds it, from t = 0 on", unit="m",
        default=None, absent="none",
    )  # fmt: skip
    limits: Sequence[float] | None = key(
        Vector((2,)), "least and largest coordinate; a distance with limits is free between them",
        unit="rad or m", default=None, absent="none",
    )  # fmt: skip
    restitution: float = key(Real(at_least=0), "of its limits, 0 to 1", default=0.0)
    stiffness: float = key(Real(at_least=0), "of a spring", unit="N m or N/m", default=0.0)
    rest: float | None = key(
        Real(), "coordinate at which the spring is not strained", unit="rad or m", default=None,
        absent="that at t = 0",
    )  # fmt: skip
    damping: float = key(Real(at_least=0), "force by its rate", unit="N m s or N s/m", default=0.0)
    friction: float = key(
        Real(at_least=0), "largest force of dry friction", unit="N m or N", default=0.0
    )
    motor: MaybeFormula = key(
        FormulaOf(("t", "q", "v")), "force along its coordinate, of time, coordinate and rate",
        unit="N m or N", default=None, absent="none",
    )  # fmt: skip
    preload: float | None = key(
        Real(above=0),
        "of a fixed joint along axis, or of the spring of a prismatic one: with what it draws the "
        "second side against its axis, reached by a static start and then held",
        unit="N", default=None, absent="none",
    )  # fmt: skip
    soft: MaybeTable[Soft] = key(
        InlineTable((Soft,)), "gives way, to compare", default=None, absent="holds to rounding"
    )

    def _check(self) -> None:
        self._check_given()
        self._check_directions()
        self._check_laws()

    @property
    def kind_of(self) -> JointKind:
        """What its kind needs."""
        return JOINTS[self.kind]

    @property
    def dim(self) -> int | None:
        """Number of coordinates; None of a gear."""
        given = self.points[0] if self.points is not None else self.point
        return None if given is None else len(given)

    @property
    def bodies(self) -> frozenset[str]:
        """Names of the bodies that it is between, and of the ground."""
        return frozenset(side_of(name)[0] for name in self.between or ())

    @property
    def places(self) -> tuple[Sequence[float], Sequence[float]]:
        """Where it holds the one and the other body at t = 0 [m]; of a gear nowhere."""
        if self.points is not None:
            return self.points[0], self.points[1]
        return self.point or (), self.point or ()

    @property
    def holds(self) -> bool:
        """Whether it is a constraint: a distance with something that acts along it is none."""
        acting = self.limits is not None or self.motor is not None or self.is_driven
        acting = acting or bool(self.stiffness or self.damping or self.friction)
        return not (self.kind_of.yields and acting)

    @property
    def is_driven(self) -> bool:
        """Whether its coordinate is given in time."""
        return not self.position.is_constant

    @property
    def leads(self) -> bool:
        """Whether directions of its coordinate turn with its first body."""
        return True

    @property
    def moves(self) -> bool:
        """Whether it has a coordinate that may change."""
        return self.kind_of.unit is not None and not (self.kind_of.yields and self.holds)

    def of_part(self, share: float) -> Self:
        """It with a share of what acts in it, as it acts on a part of a symmetric whole."""
        acting = "stiffness", "damping", "friction", "preload"
        forces = {name: value * share for name in acting if (value := getattr(self, name))}
        if self.motor is not None:
            forces["motor"] = Formula(f"{share!r} * f", ("f",)).composed(f=self.motor)
        if self.soft is not None:
            forces["soft"] = replace(self.soft, cfm=self.soft.cfm / share)
        return replace(self, **forces) if forces and share != 1.0 else self

    def _fail(self, name: str, text: str) -> KeyedError:
        value = getattr(self, name)
        if isinstance(value, Formula):
            value = value.plain
        if isinstance(value, tuple):
            value = [list(e) if isinstance(e, tuple) else e for e in value]
        return KeyedError(self.heading, name, f" = {show(value)}{text}")

    def _needs(self, name: str, *others: str) -> None:
        """Refuse it without a key, or with others that do not go with it."""
        if getattr(self, name) is None:
            raise KeyedError(
                self.heading, name, f" is missing: a {self.kind} joint needs it; add it."
            )
        for other in others:
            if getattr(self, other) is not None:
                raise self._fail(
                    other, f" does not go with a {self.kind} joint: give {name}, remove it."
                )

    def _check_given(self) -> None:
        """Refuse what is missing or too much."""
        given = self.kind_of.given
        self._needs(given, *{"point", "points", "joints"} - {given})
        if self.joints is None:
            self._needs("between", "ratio")
        else:
            self._needs("ratio", "between", "axis", "second_axis", "soft")
            if not self.ratio:
                raise self._fail("ratio", " holds the second joint alone: give a number but 0.")
        name = "between" if self.joints is None else "joints"
        two = self.between or self.joints or ()
        if len(two) != 2:
            raise self._fail(name, f" has {len(two)} names: give two.")
        if two[0] == two[1]:
            raise self._fail(name, " names one twice: give two.")

    def _check_directions(self) -> None:
        """Refuse what does not fit the number of coordinates."""
        dim, kind = self.dim, self.kind_of
        if dim is None:
            return
        if dim not in kind.dims:
            raise self._fail("kind", ' is for bodies in space: give "revolute" in the plane.')
        if self.points is not None:
            if len(self.points) != 2 or len(self.points[1]) != dim:
                raise self._fail("points", f" are not two places of {dim} numbers: give these.")
            if self.points[0] == self.points[1]:
                raise self._fail("points", " are one place: give two, or another kind.")
        self._check_axes(dim)

    def _check_axes(self, dim: int) -> None:
        """Refuse axes that it has not, and those that contradict."""
        wanted = self.kind_of.axis[dim - 2]
        if wanted and self.axis is None:
            text = f" is missing: a {self.kind} joint has one; give {dim} numbers."
            raise KeyedError(self.heading, "axis", text)
        taut = self.preload is not None and self.kind == "fixed"
        if taut and self.axis is None:
            text = f" is missing: preload acts along it; give {dim} numbers."
            raise KeyedError(self.heading, "axis", text)
        if self.axis is not None and not (wanted or taut):
            of = "in the plane turns about the axis across it" if dim == 2 else "has no axis"
            raise self._fail("axis", f": a {self.kind} joint {of}; remove it.")
        if self.axis is not None and len(self.axis) != dim:
            raise self._fail("axis", f" has {len(self.axis)} entries, point has {dim}: give {dim}.")
        if self.second_axis is None or self.axis is None:
            return
        if not self.kind_of.crosses:
            raise self._fail("second_axis", f": a {self.kind} joint has no second axis; remove it.")
        one, two = (np.asarray(a) / np.abs(a).max() for a in (self.axis, self.second_axis))
        if abs(one @ two) > _SQUARE * np.linalg.norm(one) * np.linalg.norm(two):
            raise self._fail("second_axis", " is not perpendicular to axis: give one that is.")

    def _check_laws(self) -> None:
        """Refuse laws of a coordinate that there is not, and limits that contradict."""
        self._check_driven()
        self._check_preload()
        given = [name for name in _ACTING if getattr(self, name)]
        given += ["position"] * bool(self.position.plain)
        given += [name for name in ("limits", "rest", "motor") if getattr(self, name) is not None]
        if given and self.kind_of.unit is None:
            able = " or ".join(name for name, kind in JOINTS.items() if kind.unit)
            text = f": a {self.kind} joint has no single coordinate; remove it, or take {able}."
            raise self._fail(given[0], text)
        if self.points is not None and self.position.plain and not self.is_driven:
            raise self._fail("position", ": the coordinate of a distance is its length; remove it.")
        if self.rest is not None and not self.stiffness:
            raise self._fail("rest", " is that of a spring: give stiffness, or remove it.")
        if self.restitution > 1.0:
            text = " is not allowed: an impact would gain energy; give a number from 0 to 1."
            raise self._fail("restitution", text)
        if self.restitution and self.limits is None:
            raise self._fail("restitution", " is that of limits: give these, or remove it.")
        if self.soft is not None and not self.holds:
            raise self._fail("soft", " is for what holds: remove it.")
        if self.limits is None:
            return
        if not self.limits[0] < self.limits[1]:
            raise self._fail("limits", " are not a lower and a higher number: give these.")
        at = self.start
        if not self.limits[0] <= at <= self.limits[1]:
            text = f" leave out the coordinate {at:.6g} of t = 0: widen them, or give position."
            raise self._fail("limits", text)

    def _check_preload(self) -> None:
        """Refuse a preload that nothing would hold."""
        if self.preload is None:
            return
        if self.kind not in {"fixed", "prismatic"}:
            text = f": a {self.kind} joint has none; give it to a fixed or prismatic one."
            raise self._fail("preload", text)
        if self.kind == "prismatic" and not self.stiffness:
            text = ": nothing holds it along the axis of a prismatic joint; give stiffness, or "
            raise self._fail("preload", f'{text}kind = "fixed" with axis.')
        if self.rest is not None:
            raise self._fail("rest", ": the preload says where the spring rests; remove one.")
        if self.soft is not None:
            raise self._fail("preload", ": soft gives way under it; remove one.")

    def _check_driven(self) -> None:
        """Refuse motions that do not begin where bodies are, and what acts along a driven one."""
        if self.motion is not None:
            if self.between is None or GROUND not in self.between:
                text = f': it moves the ground; give "{GROUND}" in between, or remove it.'
                raise self._fail("motion", text)
            if len(self.motion) != self.dim:
                text = f" has {len(self.motion)} entries, point has {self.dim}: give {self.dim}."
                raise self._fail("motion", text)
        if not self.is_driven:
            return
        begin, at = float(self.position(t=0.0)), self.start
        if not abs(begin - at) <= _BEGINS * abs(at):
            text = f" is {begin:.6g} at t = 0, where the distance is {at:.6g}: begin there."
            raise self._fail("position", text)
        acting = [n for n in (*_ACTING, "limits", "rest", "motor", "soft") if getattr(self, n)]
        if acting:
            text = ": position drives the coordinate, whatever else acts along it; remove one."
            raise self._fail(acting[0], text)

    @property
    def start(self) -> float:
        """Its coordinate at t = 0 [rad or m]."""
        if self.points is None:
            return float(self.position(t=0.0))
        one, two = (np.asarray(point, dtype=float) for point in self.points)
        return float(np.linalg.norm(two - one))


_ACTING = ("restitution", "stiffness", "damping", "friction")
_BEGINS = 1e-12  # share of a distance by which its formula may begin elsewhere
_SQUARE = 1e-9  # cosine by which the axes of a universal joint may lean
