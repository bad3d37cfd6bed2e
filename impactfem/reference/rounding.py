"""The error of exact solutions, which are their own reference: rounding and sampling."""

import numpy as np

from impactfem.exact import ExactBarRow
from impactfem.exact.row_bar import PIECES
from impactfem.reference.bar import Errors, exact_bar, in_units, root_of_squares
from impactfem.reference.bar_row import exact_row
from impactfem.scene import Scene

_OTHER_UNITS = 0.7310585786300049, 1.6180339887498949  # metres and seconds of the second solution
_OTHER_PIECES = {"pieces": 300, "tolerance": 2e-12, "resolution": 4096}
_TIMES, _PLACES = 500, 41
OTHER_ROW = 1009
"""Pieces: a prime, so that no jump inside a piece is at the same place of both."""


def rounding_of_exact(scene: Scene) -> Errors:
    """Difference of the characteristics solution from that of the same problem in other units.

    With other units all roundings differ, and the second solution takes an initial state in other,
    shorter pieces and keeps more breakpoints. So the difference is what rounding, sampling and
    merging leave, grown from contact to contact; that the solution itself is right is tested
    against closed forms.
    """
    bar, (metre, second) = scene.bar, _OTHER_UNITS
    exact = exact_bar(scene)
    other = in_units(bar, scene.axial_gravity, scene.duration, metre, second, **_OTHER_PIECES)
    # Not on the grid of the events: a jump has two values.
    t = scene.duration * (np.arange(_TIMES) + 0.5123) / (_TIMES + 1)
    x = bar.length * np.linspace(0.0, 1.0, _PLACES)
    u = exact.displacement(t[:, None], x)
    du = other.displacement(second * t[:, None], metre * x) / metre - u
    force = exact.multiplier(t)
    missed = other.multiplier(second * t) * (second / metre) ** 2 - force
    return Errors(
        "same characteristics in other units and other pieces: the rounding level",
        float(np.abs(du).max() / (np.abs(u).max() or 1.0)),
        root_of_squares(du) / (root_of_squares(u) or 1.0),
        float(np.abs(missed).sum() / (np.abs(force).sum() or 1.0)),
    )


def sampling_of_row(scene: Scene, exact: ExactBarRow) -> Errors:
    """What the pieces of initial states leave in a row, by the solution on other pieces.

    Of second order in the width of a piece: the difference of both, extrapolated. A jump of
    velocity inside a piece leaves an error of first order, which this exceeds.
    """
    other = exact_row(scene, exact.duration, OTHER_ROW)
    left = 1.0 - (PIECES / OTHER_ROW) ** 2
    times = exact.duration * np.linspace(0.0, 1.0, _TIMES + 1)
    t = 0.5 * (times[1:] + times[:-1])[:, None]
    ways, wrong = [], []
    for k, bar in enumerate(scene.bars):
        x = bar.length * np.linspace(0.0, 1.0, _PLACES)
        u = exact.displacement(k, t, x)
        ways.append(u - exact.displacement(k, 0.0, x))
        wrong.append((other.displacement(k, t, x) - u) / left)
    force = np.array([exact.mean_force(j, times) for j in range(len(exact.contacts))])
    missed = np.array([other.mean_force(j, times) for j in range(len(exact.contacts))]) - force
    return Errors(
        f"same characteristics on {OTHER_ROW} instead of {PIECES} pieces of each bar",
        float(np.abs(wrong).max() / (np.abs(ways).max() or 1.0)),
        root_of_squares(np.array(wrong)) / (root_of_squares(np.array(ways)) or 1.0),
        float(np.abs(missed / left).sum() / (np.abs(force).sum() or 1.0)),
    )
