"""The energy of a bar whose nodal values are those of two waves."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from impactfem.scene import Bar, PiecewiseConstant

Floats = NDArray[np.float64]

_EVEN = 1e-9  # share of an element by which steps and elements may differ
_ROWS = 4096  # levels whose cells are looked at together


def wave_energies(
    bar: Bar, positions: Floats, times: Floats, gap: Floats, multiplier: Floats,
    gravity: PiecewiseConstant,
) -> Floats | None:  # fmt: skip
    """Kinetic, elastic and potential energy over rho A at the levels [m^3/s^2], (3, layers + 1).

    At courant 1 values at nodes are those of two waves with one mean in each element and layer.
    Energies of nodal values smear a front over two elements and lack h (r_1 - r_2)^2 / 16 of it (at
    the impact of K1 rho h v0^2 / 4); those of the waves do not. What leaves the wall in a layer
    follows from the way of the node and the multiplier, v - s = du_0 / dt - lambda / c; it runs
    through the bar with -p on its way and is back after 2 L/c. The only work besides that of
    gravity is lambda du_0 <= 0, at impacts inside layers: these energies never grow.

    Args:
        bar: The bar.
        positions: Nodes [m], (n + 1,).
        times: Levels [s], (layers + 1,).
        gap: u_0 at the levels [m], (layers + 1,).
        multiplier: lambda of the layers [m^2/s^2], (layers,).
        gravity: p(t) [m/s^2].

    Returns:
        None unless layers and elements are equal, with c dt = h, and the bar starts with one
        velocity (others are weighted with hat functions, which is no such wave).
    """
    c, n, dt = bar.wave_speed, len(positions) - 1, times[1] - times[0]
    h = np.diff(positions)
    off = max(np.abs(h - c * dt).max(), c * np.abs(np.diff(times) - dt).max())
    v = bar.initial_velocity(x=0.5 * (positions[1:] + positions[:-1])) + np.zeros(n)
    if off > _EVEN * c * dt or np.ptp(v) > 0.0:
        return None
    u = bar.initial_displacement(x=positions) + np.zeros_like(positions)
    s = c * np.diff(u) / h
    load = gravity.integral(times[:-1], times[1:])
    felt = np.concatenate([[0.0], np.cumsum(load)])
    crossing = np.concatenate([np.zeros(2 * n), 0.5 * (felt[1:] + felt[:-1])])
    sign = -1.0 if bar.far_end == "clamped" else 1.0
    # What left the wall, the oldest first, as if gravity had not acted since t = 0: that of before
    # is at t = 0 on its way back, or still on its way.
    before = np.concatenate([sign * (v + s), (v - s)[::-1]])
    out = np.concatenate([before, np.diff(gap) / dt - multiplier / c]) + crossing
    back = out if sign > 0 else np.append(2.0 * crossing[n:], np.zeros(n)) - out
    levels = len(times)
    found, speed = np.empty((3, levels)), np.empty(levels)
    leaving = sliding_window_view(out, n)[n:, ::-1]
    coming = sliding_window_view(back, n)
    for first in range(0, levels, _ROWS):
        rows = slice(first, min(first + _ROWS, levels))
        a, b = leaving[rows], coming[rows]
        moving = 0.5 * (a + b) - felt[rows, None]
        found[0, rows] = 0.5 * h[0] * np.einsum("ij,ij->i", moving, moving)
        found[1, rows] = 0.125 * h[0] * np.einsum("ij,ij->i", b - a, b - a)
        speed[rows] = moving.mean(axis=1)
    start = float(gravity(0.0)) * np.mean(0.5 * (u[1:] + u[:-1]))
    path = 0.5 * (speed[1:] + speed[:-1])
    found[2] = bar.length * (start + np.concatenate([[0.0], np.cumsum(load * path)]))
    return found
