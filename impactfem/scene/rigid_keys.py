"""Values that only rigid bodies have: moments of inertia, and orientations in space."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, override

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.inline import Vector, entries_of
from impactfem.scene.kinds import Kind, Real
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import LEAST, NotAllowedError, is_number, number, show

_NORMAL = 1e-6  # by which the length of a quaternion may differ from 1
_LEAN = 1e-9  # share of the largest moment of inertia by which the triangle inequality may fail
_SYMMETRIC = 1e-9  # share of the largest entry by which a matrix may differ from its transpose


@dataclass(frozen=True)
class InertiaKind(Kind):
    """A number in 2D; in 3D three moments or a symmetric matrix, stored as a matrix."""

    type_name: ClassVar[str] = "number or lists of numbers"

    @property
    @override
    def allowed(self) -> str:
        return "a number in 2D, in 3D [Ixx, Iyy, Izz] or three rows of 3 numbers"

    @override
    def read(self, value: object) -> float | tuple[tuple[float, ...], ...]:
        if is_number(value):
            found = number(value)
            if found < LEAST:
                raise NotAllowedError("it must be > 0")
            return found
        entries = entries_of(value, (3,))
        if all(map(is_number, entries)):
            moments = Vector((3,), positive=True).read(entries)
            return tuple(tuple(row) for row in np.diag(moments).tolist())
        rows = np.array([Vector((3,)).read(row) for row in entries])
        if np.abs(rows - rows.T).max() > _SYMMETRIC * np.abs(rows).max():
            raise NotAllowedError("it is not symmetric")
        return tuple(tuple(row) for row in (0.5 * (rows + rows.T)).tolist())

    @override
    def write(self, value: float | tuple[tuple[float, ...], ...]) -> float | list[list[float]]:
        return [list(row) for row in value] if isinstance(value, tuple) else value


def check_forces(
    body: Any, moving: Mapping[str, float], turning: Mapping[str, float] | None = None
) -> None:
    """Refuse formulas that need other coordinates, or have no finite value at the start.

    Args:
        body: With `force` and `moment`, formulas or None.
        moving: What the first may use besides t, at the start.
        turning: What the second may; None if it has none.

    Raises:
        KeyedError: naming the key.
    """
    for name, known in (("force", moving), ("moment", turning)):
        if known is None:
            continue
        for index, formula in enumerate(getattr(body, name) or ()):
            values = {"t": 0.0, **known}
            missing = sorted(formula.used.difference(values))
            if missing:
                text = f" = {show(formula.text)} uses {', '.join(missing)}, which it does not "
                text += f"have in {body.dim} coordinates: use {', '.join(values)}."
                raise KeyedError(body.kind, f"{name}[{index}]", text)
            if not np.isfinite(formula(**values)):
                text = f" = {show(formula.text)} has no finite value at the start: rewrite it."
                raise KeyedError(body.kind, f"{name}[{index}]", text)


def inertia_fault(moments: Floats, *, thin: bool = False) -> str | None:
    """What is wrong with moments of inertia, in words; None if a body has them.

    Args:
        moments: In the plane (1, 1), in space (3, 3) [kg m^2].
        thin: Whether those of points and rods, which have none about some axes, are allowed.
    """
    own = np.linalg.eigvalsh(moments) if np.isfinite(moments).all() else np.full(1, np.nan)
    shown = " has the principal moments " + ", ".join(f"{value:.6g}" for value in own)
    most = _LEAN * abs(float(own[-1]))
    if not (own[0] >= -most if thin else own[0] > 0.0):
        return f"{shown}: all have to be {'>= 0' if thin else '> 0'}."
    if len(own) == 3 and own[2] > own[0] + own[1] + most:
        return f"{shown}: no body has one above the sum of the other two; check them."
    return None


@table("orientation = { ... }")
class Orientation:
    """A rotation: axis and angle, or a unit quaternion; in the plane an angle is enough.

    Raises:
        SceneError: a value is not allowed, or the rotation is not given just once.
    """

    heading: ClassVar[str] = "orientation"

    axis: Sequence[float] | None = key(
        Vector((3,), nonzero=True), "axis of the rotation, of any length", default=None,
        absent="along z in 2D",
    )  # fmt: skip
    angle: float | None = key(
        Real(), "angle about the axis, by the right hand", unit="rad", default=None, absent="none"
    )
    quaternion: Sequence[float] | None = key(
        Vector((4,)), "instead: unit quaternion [w, x, y, z]", default=None, absent="none"
    )

    def _check(self) -> None:
        if self.quaternion is None:
            if self.angle is None:
                text = " is missing: give axis and angle, or quaternion."
                raise KeyedError(self.heading, "angle", text)
            return
        shown = show(list(self.quaternion))
        if self.axis is not None or self.angle is not None:
            text = f" = {shown}, and axis or angle are given too: remove one of them."
            raise KeyedError(self.heading, "quaternion", text)
        length = float(np.linalg.norm(self.quaternion))
        if length == 0.0:
            text = f" = {shown} is no rotation: give [1.0, 0.0, 0.0, 0.0] for none."
            raise KeyedError(self.heading, "quaternion", text)
        if abs(length - 1.0) > _NORMAL:
            own = [round(entry / length, 12) for entry in self.quaternion]
            text = (
                f" = {shown} has length {length:.6g}, not 1: give {show(own)}, or axis and angle."
            )
            raise KeyedError(self.heading, "quaternion", text)

    def check_in_space(self, heading: str) -> None:
        """Refuse a rotation in space without an axis.

        Raises:
            KeyedError: There is none; it names the key under a heading.
        """
        if self.quaternion is None and self.axis is None:
            text = " is missing: give axis and angle, or quaternion."
            raise KeyedError(heading, "orientation.axis", text)

    @property
    def in_plane(self) -> float | None:
        """Its angle about z [rad]; None if it turns about another axis."""
        if self.quaternion is None and self.axis is None:
            return self.angle
        w, *vector = self.unit
        if abs(vector[0]) + abs(vector[1]) > _NORMAL:
            return None
        if self.quaternion is None and self.axis is not None:  # with all its turns
            return float(np.sign(self.axis[2])) * float(self.angle or 0.0)
        return 2.0 * math.atan2(vector[2], w)

    def matrix(self, dim: int) -> Floats:
        """Rotation matrix, (dim, dim)."""
        if dim == 3:
            return rotation(self.unit)
        angle = float(self.in_plane or 0.0)
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, -s], [s, c]])

    @property
    def unit(self) -> Floats:
        """Unit quaternion (w, x, y, z)."""
        if self.quaternion is not None:
            found = np.asarray(self.quaternion, dtype=np.float64)
            return np.asarray(found / np.linalg.norm(found))
        axis, angle = np.asarray(self.axis, dtype=np.float64), float(self.angle or 0.0)
        axis = axis / np.abs(axis).max()
        sine = np.sin(0.5 * angle) * axis / np.linalg.norm(axis)
        return np.array([np.cos(0.5 * angle), *sine])


def rotation(quaternion: Floats) -> Floats:
    """Matrix of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
