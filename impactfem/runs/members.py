"""Starts and laws of the members of an ensemble of one rigid body, read and checked."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.marching.rigid_kernels import frames
from impactfem.marching.rigid_sums import about_axes
from impactfem.scene import Contact
from impactfem.system.rigid import in_space

_UNIT = 1e-6  # by which the length of quaternions may differ from 1


@dataclass(frozen=True)
class Members:
    """Starts in space, and laws.

    Attributes:
        centre, speed: [m], [m/s], (n, 3).
        angles: In the plane angles [rad], (n, 1), in space unit quaternions, (n, 4).
        spin: Along the axes of the body [rad/s], (n, 3).
        laws: Friction, restitution and tangential restitution, (n, J) each.
    """

    centre: Floats
    angles: Floats
    speed: Floats
    spin: Floats
    laws: tuple[Floats, Floats, Floats]

    def rotated(self, way: Floats) -> Floats:
        """A direction along the axes of the body, in space, (n, 3)."""
        return np.asarray(frames(self.angles) @ way)


def read_members(body: Any, laws: Sequence[Contact | None], **given: ArrayLike | None) -> Members:
    """Members by what is given of each, and the body and laws for all else.

    Args:
        body: The rigid body.
        laws: Of each plane.
        **given: See `impactfem.runs.ensemble.solve_ensemble`.

    Raises:
        SceneError: A value or shape is not allowed.
    """
    dim, turns, planes = body.dim, body.turns, len(laws)
    widths = {
        "position": (dim,), "angle": (), "orientation": (4,), "velocity": (dim,),
        "angular_velocity": () if dim == 2 else (3,),
    }  # fmt: skip
    wrong = "orientation" if dim == 2 else "angle"
    if given.pop(wrong) is not None:
        other = "angle" if dim == 2 else "orientation"
        raise SceneError(f"{wrong}: a body with {dim} coordinates has none; give {other}")
    values = {
        name: np.array(value, dtype=float) for name, value in given.items() if value is not None
    }
    if not values:
        raise SceneError("solve_ensemble: nothing differs; give position, velocity or the like")
    n = len(next(iter(values.values()))) if next(iter(values.values())).ndim else 0
    for name, value in values.items():
        shapes = [(n, *widths[name])] if name in widths else [(n,), (n, planes)]
        if n == 0 or value.shape not in shapes:
            texts = " or ".join(str(shape).replace(f"({n},", "(n,", 1) for shape in shapes)
            counts = f", with n = {n} as of {next(iter(values))}" if n else ", with n > 0"
            raise SceneError(f"{name} has shape {value.shape}; give it as {texts}{counts}")
        _check(name, value)

    def of(name: str, usual: Floats) -> Floats:
        found = values.get(name)
        return np.tile(usual, (n, *(1,) * usual.ndim)) if found is None else found

    start = body.start_velocity
    if dim == 2:
        angles = of("angle", np.array(body.angle)).reshape(n, 1)
        spin = about_axes(of("angular_velocity", np.array(start[2])).reshape(n, turns))
    else:
        angles = of("orientation", body.quaternion)
        angles = angles / np.linalg.norm(angles, axis=1, keepdims=True)
        spin = of("angular_velocity", start[3:])
        spin = np.einsum("nij,ni->nj", frames(angles), spin)
    each = []
    for key in ("friction_coefficient", "restitution", "tangential_restitution"):
        found = of(key, np.array([getattr(law, key, 0.0) for law in laws]))
        found = found[:, None] if found.ndim == 1 else found
        each.append(np.ascontiguousarray(np.broadcast_to(found, (n, planes))))
    centre, speed = of("position", body.center), of("velocity", start[:dim])
    return Members(
        in_space(centre).copy(), np.ascontiguousarray(angles), in_space(speed).copy(),
        np.ascontiguousarray(spin), (each[0], each[1], each[2]),
    )  # fmt: skip


def _check(name: str, value: Floats) -> None:
    """Refuse values of members that cannot be."""
    flat, rule = value.reshape(len(value), -1), "finite numbers"
    fine = np.isfinite(flat)
    if name == "orientation":
        fine, rule = np.abs(np.linalg.norm(flat, axis=1) - 1.0)[:, None] <= _UNIT, "length 1"
    elif name == "restitution":
        fine, rule = fine & (flat >= 0.0) & (flat <= 1.0), "numbers from 0 to 1"
    elif name == "friction_coefficient":
        fine, rule = fine & (flat >= 0.0), "finite numbers >= 0"
    bad = np.flatnonzero(~fine.all(axis=1))
    if len(bad):
        raise SceneError(f"member {bad[0]}: {name} = {flat[bad[0]].tolist()}; give {rule}")
