"""The rigid rod in the plane, u = (x, y, theta), whose ends meet half-spaces.

M = diag(m, m, m L^2 / 12), f = (m g_x, m g_y, 0). The gap of an end with sign s = -1 or +1 is

    phi(u) = n . (c + s (L/2) (cos theta, sin theta) - p) - r.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.generalized import GeneralizedSystem


def planes(half_spaces: HalfSpace | Sequence[HalfSpace]) -> tuple[Floats, Floats]:
    """Unit normals n (planes, 2) and levels n . p [m] (planes,) of half-spaces at rest.

    Raises:
        SceneError: There is none, one is not in the plane, or one moves.
    """
    given = tuple(half_spaces) if isinstance(half_spaces, Sequence) else (half_spaces,)
    if not given:
        raise SceneError("half_spaces is empty: give at least one half_space")
    for entry in given:
        entry.check_dimension(2)
        if entry.moves:
            raise SceneError(
                f'half_space "{entry.name}": motion is not available for rods and beams; remove it'
            )
    normals = np.array([entry.normal for entry in given], dtype=float)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = np.array([entry.point for entry in given], dtype=float)
    return normals, np.sum(normals * points, axis=1)


def rod_system(
    mass: float,
    length: float,
    half_spaces: HalfSpace | Sequence[HalfSpace],
    gravity: Sequence[float] = (0.0, 0.0),
    restitution: float | Sequence[float] = 0.0,
    radius: float = 0.0,
) -> GeneralizedSystem:
    """A slender rigid rod among half-spaces, with coordinates x, y [m], theta [rad].

    Constraints: for each half-space the end at -L/2, then that at +L/2.

    Args:
        mass: m [kg].
        length: L between the centres of the ends [m].
        half_spaces: Obstacles at rest.
        gravity: Acceleration (2,) [m/s^2].
        restitution: Newton's e: a number, or one for each constraint.
        radius: r of the rounded ends [m].

    Raises:
        SceneError: A value is not allowed.
    """
    for name, value, least in (("mass", mass, 0.0), ("length", length, 0.0)):
        if not (math.isfinite(value) and value > least):
            raise SceneError(f"rod: {name} = {value} is not allowed: give a finite number > 0")
    if not (math.isfinite(radius) and radius >= 0.0):
        raise SceneError(f"rod: radius = {radius} is not allowed: give a number >= 0")
    pull = np.asarray(gravity, dtype=float)
    if pull.shape != (2,) or not np.isfinite(pull).all():
        raise SceneError(f"rod: gravity = {gravity} is not allowed: give two numbers")
    normals, levels = planes(half_spaces)
    rows, signs = np.repeat(normals, 2, axis=0), np.tile([-1.0, 1.0], len(normals))
    levels, arm = np.repeat(levels, 2) + radius, 0.5 * length * signs
    weight = np.array([mass * pull[0], mass * pull[1], 0.0])

    def gaps(u: ArrayLike) -> ArrayLike:
        x, y, theta = np.asarray(u)
        across = rows[:, 0] * (x + arm * np.cos(theta))
        return np.asarray(across + rows[:, 1] * (y + arm * np.sin(theta)) - levels)

    def jacobian(u: Floats) -> Floats:
        turn = arm * (rows[:, 1] * math.cos(u[2]) - rows[:, 0] * math.sin(u[2]))
        return np.column_stack((rows, turn))

    return GeneralizedSystem(
        mass=np.array([mass, mass, mass * length**2 / 12.0]),
        force=lambda _t, _u, _v: weight,
        constraints=gaps,
        restitution=restitution,
        jacobian=jacobian,
        potential=lambda _, u: -float(weight @ u),
        names=("x", "y", "theta"),
    )
