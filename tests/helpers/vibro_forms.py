"""Closed forms of vibro-impact that only tests ask: rebounds, penalty, corners, tables, rods.

Source: Paoli and Schatzman, Ill-posedness in vibro-impact and its numerical consequences (2000);
Holmes, The dynamics of repeated impacts with a sinusoidally vibrating table, J. Sound Vib. 84
(1982) 173-189.
"""

import math

import numpy as np

from impactfem.exact.vibro import _ROUNDING, _incoming


def impact_times(ball, count):
    """Times of the first impacts, sqrt(2h/g) (1 + 2e + ... + 2e^n) [s], shape (count,)."""
    powers = ball.restitution ** np.arange(1.0, count)
    return ball.fall_time * (1.0 + 2.0 * np.concatenate([[0.0], np.cumsum(powers)])[:count])


def rebound_speeds(ball, count):
    """Speeds after the first impacts, e^n sqrt(2gh) [m/s], shape (count,)."""
    first = math.sqrt(2.0 * ball.gravity * ball.height)
    return first * ball.restitution ** np.arange(1.0, count + 1.0)


def penalty_restitution(damping):
    """Restitution of u'' + 2 alpha sqrt(k) u' + k u = 0 on u < 0 as k grows.

    It is exp(-pi alpha / sqrt(1 - alpha^2)) for alpha < 1, and 0 from alpha = 1 on: then the mass
    creeps back.

    Args:
        damping: alpha >= 0.
    """
    if damping >= 1.0:
        return 0.0
    return math.exp(-math.pi * damping / math.sqrt((1.0 - damping) * (1.0 + damping)))


def corner_is_continuous(angle):
    """Whether both orders of impacts leave with one velocity: angle = pi/n."""
    turns = math.pi / angle
    return abs(turns - round(turns)) <= _ROUNDING * turns


def anelastic_corner(angle, velocity, first):
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


def table_gamma(amplitude, frequency, restitution, gravity):
    """Forcing gamma = 2 w^2 (1+e) A / g of a ball on a table that moves by A sin(w t)."""
    return 2.0 * frequency**2 * (1.0 + restitution) * amplitude / gravity


def table_existence(restitution, order=1):
    """Least gamma at which the ball can bounce once in n periods: 2 pi n (1 - e).

    Velocities before and after are -U and U = g T/2, with T = 2 pi n / w, so that the table must
    move at (1-e)/(1+e) U <= A w. The same holds for the simplified map.
    """
    return 2.0 * math.pi * order * (1.0 - restitution)


def table_flip(restitution, order=1, *, simplified=False):
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


def _along(angle, wall):
    """Unit vector along a wall, away from the vertex."""
    return np.array([math.cos(angle), math.sin(angle)] if wall else [1.0, 0.0])


def end_impulse(mass, inclination, speed, restitution):
    """Impact of one end of a uniform free rod, which does not turn, on a horizontal floor.

    The arm is (L/2) cos th and the moment of inertia m L^2/12, so that the end has the effective
    mass m_e = m/(1 + 3 cos^2 th), gets the impulse (1 + e) m_e v and leaves with e v.

    Returns:
        The impulse [N s], and the share of the kinetic energy that is lost.
    """
    effective = mass / (1.0 + 3.0 * math.cos(inclination) ** 2)
    return (1.0 + restitution) * effective * speed, (1.0 - restitution**2) * effective / mass
