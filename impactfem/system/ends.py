"""What drives the far end of a bar in layers: forces, ways, and the work of both, over rho A."""

import numpy as np
from numpy.typing import NDArray

from impactfem.scene import Bar
from impactfem.scene.means import mean_of

Floats = NDArray[np.float64]


def end_means(bar: Bar, times: Floats) -> Floats:
    """Mean speed that the far end gives to waves in each layer (`Bar.end_speed`) [m/s].

    Args:
        bar: The bar.
        times: Levels [s], (..., layers + 1).

    Returns:
        Shape (..., layers).
    """
    if bar.far_end == "clamped":
        dt = np.diff(times)
        return np.divide(end_ways(bar, times), dt, out=np.zeros_like(dt), where=dt > 0.0)
    force = mean_of(bar.far_end_force, times[..., :-1], times[..., 1:])
    return np.asarray(force / (bar.density * bar.area * bar.wave_speed))


def end_ways(bar: Bar, times: Floats) -> Floats:
    """Ways of a far end that is held, or is given a motion, in each layer [m], (layers,)."""
    return np.diff(bar.far_end_displacement(t=times) + np.zeros_like(times))


def end_pushes(bar: Bar, times: Floats) -> Floats:
    """Force on the far end in each row of nodes [m^2/s^2], (layers,).

    A test function of a row spans the two layers beside it: the mean of both means (row 0: one).
    """
    if bar.far_end == "clamped":
        return np.zeros(len(times) - 1)
    means = bar.wave_speed * end_means(bar, times)
    return np.concatenate([means[:1], 0.5 * (means[1:] + means[:-1])])


def end_work(bar: Bar, times: Floats, positions: Floats, far: Floats, loads: Floats) -> Floats:
    """Work of what drives the far end, up to the middle of each layer [m^3/s^2], (layers + 1,).

    The force of each row over the path between the middles of its layers; where a motion is given
    it is the reaction that the row of the last node has.

    Args:
        bar: The bar.
        times: Levels [s], (layers + 1,).
        positions: Nodes [m].
        far: Displacement of the last two nodes [m], (layers + 1, 2).
        loads: Gravity of each row [m/s^2], (layers,).
    """
    dt, h = np.diff(times), positions[-1] - positions[-2]
    end = far[:, 1]
    if bar.far_end == "clamped":
        speed = np.diff(end) / dt
        # A row spans half of both layers beside it; the first one half a layer, from rest.
        wide = 0.5 * (dt + np.concatenate([[0.0], dt[:-1]]))
        change = np.diff(np.concatenate([[0.0], speed])) / wide
        pull = bar.wave_speed**2 / h * (end - far[:, 0])[:-1]
        force = 0.5 * h * (change + loads) + pull
    else:
        force = end_pushes(bar, times)
    middle = 0.5 * (end[1:] + end[:-1])
    path = np.diff(np.concatenate([end[:1], middle]))
    return np.concatenate([[0.0], np.cumsum(force * path)])
