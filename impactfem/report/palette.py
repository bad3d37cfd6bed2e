"""Colours of bodies in all pictures, by what they stand for."""

from functools import cache

import numpy as np
from matplotlib.colors import to_rgb

from impactfem.arrays import Floats
from impactfem.report.panel import colour

STRESS = "YlGnBu"
"""Colours of solids, by their stress."""
PRESSURES = "YlOrBr"
"""Colours of maps of the contact pressure."""
PRESSURE, FORCE = "#d95f02", "#b2182b"
"""Contact pressure and contact forces."""
HELD = "#7b3294"
"""Supports and joints."""
OBSTACLE, OBSTACLE_EDGE, FLOOR, GRID = "0.80", "0.25", "0.90", "0.70"
"""Rigid obstacles in the plane, their edges, planes in space and the lines on them."""
EDGE = "black"
"""Edges of solids."""

_PALE = 0.62  # share of white in what a body is filled with


@cache
def tint(k: int) -> Floats:
    """Colour of the k-th body: of its edges and marks, of its axis; shape (3,)."""
    return np.array(to_rgb(colour(k)))


@cache
def fill(k: int) -> Floats:
    """Colour that the k-th body is filled with if it has no stress, shape (3,)."""
    return np.asarray((1.0 - _PALE) * tint(k) + _PALE)
