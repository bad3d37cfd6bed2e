"""Impacts between nodes with mass in steps that are solved by iterates.

With increments w and s of a step and speeds a and b before and after it, w = (w_a + w_b) dt / 2.
Moreau's and Jean's rule, where a gap is closed at the start,

    0 <= Lambda  _|_  w_b + e w_a >= 0,   tangentially Coulomb's law with s_b,

is one of w - (1 - e) w_a dt / 2 and s - (1 - e_t) s_a dt / 2, with e_t of the slip where nodes
arrive. Its work Lambda w is never positive: for nodes that leave (w_a > 0) e = 1 stands in, where
it is 0.
"""

from collections.abc import Callable

import numpy as np

from impactfem.arrays import Booleans, Floats

_SHARE = 1e-3  # of a step, over which speeds of obstacles are measured


def way_ahead(speed: Floats, restitution: Floats, rebound: Floats | float, step: float) -> Floats:
    """What the law adds to the increments [m], (gaps, ways).

    Args:
        speed: Of the gaps at the start of the step, normal and tangential [m/s], (gaps, ways).
        restitution: Newton's e, (gaps,).
        rebound: That of the slip where nodes arrive, (gaps,).
        step: [s].
    """
    share = np.ones_like(speed)
    share[:, 0] = np.where(speed[:, 0] > 0.0, 0.0, 1.0 - restitution)
    share[:, 1:] -= np.reshape(rebound, (-1, 1))
    found: Floats = -0.5 * step * share * speed
    return found


def arriving(speed: Floats, free: Floats, step: float) -> Booleans:
    """Gaps that close faster than forces could make them in a step, (gaps,).

    Args:
        speed: Normal speeds at its start [m/s], (gaps,).
        free: Normal increments if contact forces stay as they were [m], (gaps,).
        step: [s].
    """
    found: Booleans = speed < -2.0 * np.abs(free / step - speed)
    return found


def obstacle_speed(shift: Callable[[float], Floats], start: float, step: float) -> Floats:
    """Velocities of the obstacles of gaps at the start of a step [m/s], (gaps, dim)."""
    low, high = max(0.0, start - _SHARE * step), start + _SHARE * step
    return (shift(high) - shift(low)) / (high - low)
