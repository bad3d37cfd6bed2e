"""The spring of a wall that a bar meets: lambda = spring u where u < 0, in the mean of layers.

The multiplier is constant in a layer T_m and tests the contact condition there: it is the integral
over T_m of u - lambda / spring that is not negative beside lambda <= 0, a Robin condition where
contact is active. With u linear in a layer that is the trapezoidal rule: energy goes to the spring
and back to rounding, but for layers in which contact begins or ends (of second order in dt).
"""

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Bar


def wall_gap(bar: Bar, gap: Floats, multiplier: Floats) -> Floats:
    """What is not negative beside the multiplier [m], (layers,).

    Args:
        bar: The bar.
        gap: u at the wall at the levels [m], (layers + 1,).
        multiplier: [m^2/s^2], (layers,).

    Returns:
        The gap at the end of each layer; of a wall that gives way its mean over the layer, counted
        from where the force has pressed the wall.
    """
    if bar.wall_stiffness is None:
        return gap[1:].copy()
    return 0.5 * (gap[1:] + gap[:-1]) - multiplier / bar.wall_spring


def wall_energy(bar: Bar, gap: Floats, *, levels: bool) -> Floats:
    """Energy of the spring over rho A [m^3/s^2], (layers + 1,); 0 of a rigid wall.

    Args:
        bar: The bar.
        gap: u at the wall at the levels [m], (layers + 1,).
        levels: Whether it is that at the levels, or in the middles of the layers before them.
    """
    places = gap if levels else 0.5 * (gap + np.concatenate([gap[:1], gap[:-1]]))
    return np.asarray(0.5 * bar.wall_spring * np.minimum(places, 0.0) ** 2)
