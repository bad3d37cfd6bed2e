"""Point masses, alone or as small balls, with springs, dampers and forces by formula."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.body import BodyKind, beside
from impactfem.scene.flight import Flight
from impactfem.scene.formula import Formula
from impactfem.scene.given import MaybeFormulas, Tables
from impactfem.scene.inline import Formulas, InlineTable, ListOf, Vector
from impactfem.scene.kinds import Name, Real
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

COORDINATES = ("x", "y", "z")
STATE = ("t", *COORDINATES, "vx", "vy", "vz")
"""Variables of a force, as far as the point has such coordinates."""


@table("springs = [{ ... }]")
class Spring:
    """A spring, with a damper beside it, from a point to a place or to another point.

    With `rest_length` 0 force and damping act in all directions alike, -k (x - a) - c x'. Otherwise
    they act along the line between the ends, k (l - rest_length) + c l'.

    Raises:
        SceneError: a value is not allowed, or not just one other end is given.
    """

    heading: ClassVar[str] = "spring"

    anchor: Sequence[float] | None = key(
        Vector((1, 2, 3)), "place of the other end", unit="m", default=None, absent="none"
    )
    to: str | None = key(
        Name(), "point at the other end, instead of anchor", default=None, absent="none"
    )
    stiffness: float = key(Real(at_least=0), "stiffness k", unit="N/m", default=0.0)
    rest_length: float = key(Real(at_least=0), "length without force", unit="m", default=0.0)
    damping: float = key(Real(at_least=0), "damping c", unit="N s/m", default=0.0)

    def _check(self) -> None:
        if (self.anchor is None) == (self.to is None):
            given = "neither is" if self.anchor is None else "both are"
            text = f": {given} given; give anchor, a place, or to, the name of a point."
            raise KeyedError("spring", "anchor", text)


@table('[[body]] with kind = "point"')
class Point(BodyKind):
    """A point mass, or a ball of some radius that does not rotate, in 1 to 3 dimensions.

    Raises:
        SceneError: a value is missing or not allowed, or two have different numbers of entries.
    """

    kind: ClassVar[str] = "point"
    may_meet_nothing: ClassVar[bool] = True
    meets_alike: ClassVar[bool] = True
    is_ball: ClassVar[bool] = True
    meets_edges: ClassVar[bool] = True
    dents: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    takes_joints: ClassVar[bool] = True
    has_centre: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True
    turns_in_joints: ClassVar[bool] = False

    name: str = key(Name(), "name of the point in histories", default="point")
    mass: float = key(Real(above=0), "mass", unit="kg")
    position: Sequence[float] = key(
        Vector((1, 2, 3)), "position at t = 0, as many entries as the scene has dimensions",
        unit="m",
    )  # fmt: skip
    velocity: Sequence[float] | None = key(
        Vector((1, 2, 3)), "velocity at t = 0", unit="m/s", default=None, absent="at rest"
    )
    radius: float = key(Real(at_least=0), "radius of the ball", unit="m", default=0.0)
    force: MaybeFormulas = key(
        Formulas(STATE, lengths=(1, 2, 3)),
        "applied force besides gravity and springs",
        unit="N",
        default=None,
        absent="none",
    )
    springs: Tables[Spring] = key(ListOf(InlineTable((Spring,))), "springs and dampers", default=())

    @property
    def flight(self) -> Flight | None:
        """How it flies; None if forces or springs act on it."""
        if self.force or self.springs:
            return None
        return Flight((self.radius,) * self.dim, self.position, self.velocity or ())

    def _check(self) -> None:
        if self.velocity is None:
            object.__setattr__(self, "velocity", (0.0,) * self.dim)
        for name in ("velocity", "force"):
            value = getattr(self, name)
            if value is not None and len(value) != self.dim:
                shown = show([e.plain for e in value] if name == "force" else list(value))
                raise KeyedError(
                    self.kind, name,
                    f" = {shown} has {len(value)} entries, but position = "
                    f"{show(list(self.position))} has {self.dim}: give {self.dim}.",
                )  # fmt: skip
        self._check_force()
        for index, spring in enumerate(self.springs):
            if spring.anchor is not None and len(spring.anchor) != self.dim:
                raise KeyedError(
                    self.kind, f"springs[{index}].anchor",
                    f" = {show(list(spring.anchor))} has {len(spring.anchor)} entries, but "
                    f"position has {self.dim}: give {self.dim}.",
                )  # fmt: skip

    def check_beside(self, bodies: Sequence[Any]) -> None:
        """Refuse a place of other dimensions, and springs to what is no point.

        Raises:
            KeyedError: naming the key.
        """
        first, *_ = bodies
        if first.dim != self.dim:
            text = f" = {show(list(self.position))} has {self.dim} entries, but that of "
            text += f"{first.name} has {first.dim}: give {first.dim}."
            raise KeyedError(self.kind, "position", text)
        others = (other for other in bodies if other is not self)
        points = sorted(other.name for other in others if isinstance(other, type(self)))
        for number, spring in enumerate(self.springs):
            if spring.to is not None and spring.to not in points:
                text = f" = {show(spring.to)} is no other point: give "
                text += f"{' or '.join(map(show, points)) or 'anchor, a place'}."
                raise KeyedError(self.kind, f"springs[{number}].to", text)

    def check_on_axis(self, where: str) -> None:
        """Refuse a ball that leaves the axis.

        Raises:
            KeyedError: naming the key.
        """
        given = {"position": self.position, "velocity": self.velocity, "force": self.force}
        given |= {f"springs[{k}].anchor": spring.anchor for k, spring in enumerate(self.springs)}
        for name, entries in given.items():
            if entries is None or _is_zero(entries[0]):
                continue
            shown = show([e.plain if isinstance(e, Formula) else e for e in entries])
            text = f" = {shown}: beside axisymmetric solids a point is a ball on the axis, whose "
            text += 'first entries are 0.0: give these, or solids of model = "3d".'
            raise KeyedError(where, name, text)

    def box(self) -> tuple[Floats, Floats]:
        """Half edges and centre [m] of a box around it."""
        return np.full(self.dim, self.radius), np.asarray(self.position, dtype=np.float64)

    def centre_velocity(self) -> Floats:
        """Velocity at t = 0 [m/s], (dim,)."""
        return np.asarray(self.velocity, dtype=np.float64)

    def missed(self, place: Floats, part: str) -> str | None:  # noqa: ARG002  (it has none)
        """Joints hold it where it is."""
        own = np.asarray(self.position, dtype=np.float64)
        return f"at {show(list(self.position))}" if beside(place, own) else None

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return len(self.position)

    @property
    def state(self) -> tuple[str, ...]:
        """Names of coordinates and velocities, e.g. ``("x", "y", "vx", "vy")``."""
        names = COORDINATES[: self.dim]
        return (*names, *(f"v{name}" for name in names))

    def _check_force(self) -> None:
        """Refuse a force that needs other coordinates, or has no finite value at the start."""
        velocity = self.velocity or ()
        values = dict(zip(self.state, (*self.position, *velocity), strict=True)) | {"t": 0.0}
        for index, formula in enumerate(self.force or ()):
            where = f"force[{index}]"
            missing = sorted(formula.used.difference(values))
            if missing:
                entries = "1 entry" if self.dim == 1 else f"{self.dim} entries"
                text = f" = {show(formula.text)} uses {', '.join(missing)}, but position has "
                text += f"{entries}: use {', '.join(values)}."
                raise KeyedError(self.kind, where, text)
            if not np.isfinite(formula(**values)):
                text = f" = {show(formula.text)} has no finite value at the start: rewrite it."
                raise KeyedError(self.kind, where, text)


def _is_zero(entry: float | Formula) -> bool:
    if isinstance(entry, Formula):
        return entry.is_constant and entry() == 0.0
    return entry == 0.0
