"""Closed forms of vibro-impact: Zeno's ball, grazing, penalty, corners, vibrating table, rod.

Source: Paoli and Schatzman, Ill-posedness in vibro-impact and its numerical consequences (2000);
Holmes, The dynamics of repeated impacts with a sinusoidally vibrating table, J. Sound Vib. 84
(1982) 173-189.
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

    def impact_times(self, count: int) -> Array:
        """Times of the first impacts, sqrt(2h/g) (1 + 2e + ... + 2e^n) [s], shape (count,)."""
        powers = self.restitution ** np.arange(1.0, count)
        return self.fall_time * (1.0 + 2.0 * np.concatenate([[0.0], np.cumsum(powers)])[:count])

    def rebound_speeds(self, count: int) -> Array:
        """Speeds after the first impacts, e^n sqrt(2gh) [m/s], shape (count,)."""
        first = math.sqrt(2.0 * self.gravity * self.height)
        return first * self.restitution ** np.arange(1.0, count + 1.0)


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


def penalty_restitution(damping: float) -> float:
    """Restitution of u'' + 2 alpha sqrt(k) u' + k u = 0 on u < 0 as k grows.

    It is exp(-pi alpha / sqrt(1 - alpha^2)) for alpha < 1, and 0 from alpha = 1 on: then the mass
    creeps back.

    Args:
        damping: alpha >= 0.
    """
    if not finite("damping", damping, ()) >= 0.0:
        raise SceneError(f"damping = {damping}: give a number >= 0")
    if damping >= 1.0:
        return 0.0
    return math.exp(-math.pi * damping / math.sqrt((1.0 - damping) * (1.0 + damping)))


def penalty_damping(restitution: float) -> float:
    """The least alpha whose `penalty_restitution` is e in [0, 1]; 1 for e = 0."""
    _within("restitution", restitution, 0.0, 1.0)
    if restitution == 0.0:
        return 1.0
    loss = -math.log(restitution)
    return loss / math.hypot(math.pi, loss)


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


def corner_is_continuous(angle: float) -> bool:
    """Whether both orders of impacts leave with one velocity: angle = pi/n."""
    _within("angle", angle, 0.0, math.pi, closed=False)
    turns = math.pi / angle
    return abs(turns - round(turns)) <= _ROUNDING * turns


def anelastic_corner(angle: float, velocity: ArrayLike, first: int) -> tuple[Array, Array]:
    """Velocities along the first wall, P1 v, and past the vertex, for restitution 0.

    Moreau's rule, which is also the limit of the over-damped penalty. In an obtuse corner a point
    that slides into the vertex goes on along the second wall with P2 P1 v; in a right or acute one
    it stays. If it slides away from the vertex, P1 v lasts. (Founding paper, section 3.2: its
    angle is there that between the normals, pi minus this one.)

    Args:
        angle: Opening in (0, pi) [rad].
        velocity: Incoming velocity [m/s], shape (2,).
        first: Wall that is hit first, 0 or 1.

    Raises:
        SceneError: The point does not move towards that wall, or a value is out of range.
    """
    v, wall = _incoming(angle, velocity, first)
    one, two = (_along(angle, w) for w in (wall, 1 - wall))
    slide = (v @ one) * one
    if v @ one >= 0.0:  # away from the vertex
        return slide, slide
    return slide, max(float(slide @ two), 0.0) * two


def table_gamma(amplitude: float, frequency: float, restitution: float, gravity: float) -> float:
    """Forcing gamma = 2 w^2 (1+e) A / g of a ball on a table that moves by A sin(w t)."""
    return 2.0 * frequency**2 * (1.0 + restitution) * amplitude / gravity


def table_existence(restitution: float, order: int = 1) -> float:
    """Least gamma at which the ball can bounce once in n periods: 2 pi n (1 - e).

    Velocities before and after are -U and U = g T/2, with T = 2 pi n / w, so that the table must
    move at (1-e)/(1+e) U <= A w. The same holds for the simplified map.
    """
    _within("restitution", restitution, 0.0, 1.0)
    return 2.0 * math.pi * order * (1.0 - restitution)


def table_flip(restitution: float, order: int = 1, *, simplified: bool = False) -> float:
    """Value of gamma at which the motion of `table_existence` loses stability by doubling.

    Simplified (high bounces, impacts at height 0): phi' = phi + v, v' = e v + gamma cos phi', of
    determinant e and trace 1 + e - gamma sin phi: gamma sin phi = 2 (1+e). Exactly: with the
    height of the table, t' = t + tau, the linearised map has determinant e^2 and trace
    1 + e^2 - (1+e)^2 A w^2 sin phi / g: gamma sin phi = 4 (1+e^2)/(1+e). In both,
    gamma cos phi = 2 pi n (1-e).
    """
    e = restitution
    sine = 2.0 * (1.0 + e) if simplified else 4.0 * (1.0 + e * e) / (1.0 + e)
    return math.hypot(table_existence(e, order), sine)


def rod_end_mass(mass: float, inclination: float) -> float:
    """Effective mass m/(1 + 3 cos^2 th) [kg] of a uniform free rod hit at its end.

    The arm is (L/2) cos th and the moment of inertia m L^2/12.

    Args:
        mass: m > 0 [kg].
        inclination: th between rod and floor [rad].
    """
    return positive("mass", mass) / (1.0 + 3.0 * math.cos(inclination) ** 2)


def rod_end_impulse(mass: float, inclination: float, speed: float, restitution: float) -> float:
    """Normal impulse (1+e) |v_n| m/(1 + 3 cos^2 th) [N s]; the end leaves with e |v_n|."""
    _within("restitution", restitution, 0.0, 1.0)
    return (1.0 + restitution) * abs(speed) * rod_end_mass(mass, inclination)


def _within(name: str, value: float, low: float, high: float, *, closed: bool = True) -> None:
    number = float(finite(name, value, ()))
    inside = low <= number <= high if closed else low <= number < high
    if not inside:
        raise SceneError(f"{name} = {value}: give a number from {low:g} to {high:.9g}")


def _normal(angle: float, wall: int) -> Array:
    """Unit normal of a wall, into the corner."""
    return np.array([math.sin(angle), -math.cos(angle)] if wall else [0.0, 1.0])


def _along(angle: float, wall: int) -> Array:
    """Unit vector along a wall, away from the vertex."""
    return np.array([math.cos(angle), math.sin(angle)] if wall else [1.0, 0.0])


def _incoming(angle: float, velocity: ArrayLike, first: int) -> tuple[Array, int]:
    _within("angle", angle, 0.0, math.pi, closed=False)
    positive("angle", angle)
    v = finite("velocity", velocity, (2,))
    if first not in {0, 1}:
        raise SceneError(f"first = {first}: the walls are 0 and 1")
    if _normal(angle, first) @ v >= 0.0:
        raise SceneError(f"velocity = {v.tolist()} does not approach wall {first}")
    return v, first
