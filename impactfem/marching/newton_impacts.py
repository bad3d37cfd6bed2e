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

from impactfem.arrays import Floats
from impactfem.contact.speed_law import returned

_SHARE = 1e-3  # of a step, over which speeds of obstacles are measured


def way_ahead(
    speed: Floats, restitution: Floats, rebound: Floats | float, step: float, gained: Floats | float
) -> Floats:
    """What the law adds to the increments [m], (gaps, ways).

    Args:
        speed: Of the gaps at the start of the step, normal and tangential [m/s], (gaps, ways).
        restitution: Newton's e, (gaps,).
        rebound: That of the slip where nodes arrive, (gaps,).
        step: [s].
        gained: What impacts that came one after the other changed of the speeds, (gaps, ways).
    """
    back = speed + gained
    back[:, 0] = returned(back[:, 0], restitution)
    back[:, 1:] *= np.reshape(rebound, (-1, 1))
    return np.asarray(0.5 * step * (back - speed))


def slow(speed: Floats, free: Floats, step: float) -> Floats:
    """Speeds that forces could make in a step, beyond which gaps arrive or leave [m/s], (gaps,).

    Args:
        speed: Normal speeds at its start [m/s], (gaps,).
        free: Normal increments if contact forces stay as they were [m], (gaps,).
        step: [s].
    """
    return np.asarray(2.0 * np.abs(free / step - speed))


def obstacle_speed(shift: Callable[[float], Floats], start: float, step: float) -> Floats:
    """Velocities of the obstacles of gaps at the start of a step [m/s], (gaps, dim)."""
    low, high = max(0.0, start - _SHARE * step), start + _SHARE * step
    return (shift(high) - shift(low)) / (high - low)
