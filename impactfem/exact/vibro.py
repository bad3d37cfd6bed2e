"""Closed forms of vibro-impact: Zeno's ball, grazing, elastic corners.

Source: Paoli and Schatzman, Ill-posedness in vibro-impact and its numerical consequences (2000).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import SceneError
from impactfem.exact.initial import finite, positive

type Array = NDArray[np.float64]

_ROUNDING = 1e-12


@dataclass(frozen=True)
class ZenoBall:
    """A ball dropped from rest, whose rebounds accumulate.

    Attributes:
        height: h > 0 [m].
        restitution: e in [0, 1).
        gravity: g > 0 [m/s^2].

    Raises:
        SceneError: A value is out of range.
    """

    height: float
    restitution: float
    gravity: float

    def __post_init__(self) -> None:
        positive("height", self.height)
        positive("gravity", self.gravity)
        _within("restitution", self.restitution, 0.0, 1.0, closed=False)

    @property
    def fall_time(self) -> float:
        """Time of the first impact, sqrt(2h/g) [s]."""
        return math.sqrt(2.0 * self.height / self.gravity)

    @property
    def stopping_time(self) -> float:
        """Time at which the rebounds end, sqrt(2h/g) (1+e)/(1-e) [s]."""
        return self.fall_time * (1.0 + self.restitution) / (1.0 - self.restitution)


def grazing_impact(depth: float) -> tuple[float, float]:
    """Impact speed and period of x'' = -x, x(0) = 1, with a wall at -(1 - d) and e = 1.

    Both have infinite slope at d = 0, so that rounding of the wall is magnified there.

    Args:
        depth: d in [0, 1].

    Returns:
        sqrt(1 - (1-d)^2), written without cancellation, and 2 (pi - acos(1-d)).
    """
    _within("depth", depth, 0.0, 1.0)
    speed = math.sqrt(depth * (2.0 - depth))
    return speed, 2.0 * (math.pi - 2.0 * math.asin(math.sqrt(0.5 * depth)))


@dataclass(frozen=True)
class CornerExit:
    """How a point leaves a corner.

    Attributes:
        velocity: Outgoing velocity [m/s], shape (2,).
        hits: Number of impacts.
    """

    velocity: Array
    hits: int


def elastic_corner(angle: float, velocity: ArrayLike, first: int) -> CornerExit:
    """Elastic reflections in the corner between the rays at 0 (wall 0) and ``angle`` (wall 1).

    A wall turns the direction psi into -psi or 2 angle - psi, by turns, until psi lies inside
    the corner: unfolded, a straight line crosses images of the corner.

    Args:
        angle: Opening in (0, pi) [rad].
        velocity: Incoming velocity [m/s], shape (2,).
        first: Wall that is hit first, 0 or 1.

    Raises:
        SceneError: The point does not move towards that wall, or a value is out of range.
    """
    v, wall = _incoming(angle, velocity, first)
    psi, hits = math.atan2(v[1], v[0]), 0
    while _normal(angle, wall) @ (math.cos(psi), math.sin(psi)) < -_ROUNDING:
        psi = 2.0 * angle * wall - psi
        hits, wall = hits + 1, 1 - wall
    speed = float(np.hypot(*v))
    return CornerExit(speed * np.array([math.cos(psi), math.sin(psi)]), hits)


def _within(name: str, value: float, low: float, high: float, *, closed: bool = True) -> None:
    number = float(finite(name, value, ()))
    inside = low <= number <= high if closed else low <= number < high
    if not inside:
        raise SceneError(f"{name} = {value}: give a number from {low:g} to {high:.9g}")


def _normal(angle: float, wall: int) -> Array:
    """Unit normal of a wall, into the corner."""
    return np.array([math.sin(angle), -math.cos(angle)] if wall else [0.0, 1.0])


def _incoming(angle: float, velocity: ArrayLike, first: int) -> tuple[Array, int]:
    _within("angle", angle, 0.0, math.pi, closed=False)
    positive("angle", angle)
    v = finite("velocity", velocity, (2,))
    if first not in {0, 1}:
        raise SceneError(f"first = {first}: the walls are 0 and 1")
    if _normal(angle, first) @ v >= 0.0:
        raise SceneError(f"velocity = {v.tolist()} does not approach wall {first}")
    return v, first
