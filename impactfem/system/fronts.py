"""The energy of a bar whose nodal values are those of two waves."""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from impactfem.scene import Bar, PiecewiseConstant
from impactfem.system.ends import end_means

Floats = NDArray[np.float64]

_EVEN = 1e-9  # share of an element by which steps and elements may differ
_ROWS = 4096  # levels whose cells are looked at together


def wave_energies(
    bar: Bar, positions: Floats, times: Floats, gap: Floats, multiplier: Floats,
    gravity: PiecewiseConstant,
) -> Floats | None:  # fmt: skip
    """Energies over rho A at the levels [m^3/s^2]: kinetic, elastic, potential; (4, layers + 1).

    The last row is the work of what drives the far end, which the potential counts.

    At courant 1 values at nodes are those of two waves with one mean in each element and layer.
    Energies of nodal values smear a front over two elements and lack h (r_1 - r_2)^2 / 16 of it (at
    the impact of K1 rho h v0^2 / 4); those of the waves do not. What leaves the wall in a layer
    follows from the way of the node and the multiplier, v - s = du_0 / dt - lambda / c; it runs
    through the bar with -p on its way and is back after 2 L/c. The only work besides that of
    gravity and of a driven end is lambda du_0 <= 0, at impacts inside layers: these energies never
    grow.

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
    levels, work = len(times), np.zeros(len(load))
    if bar.is_driven:
        given = end_means(bar, times)
        arrived = out[n : n + len(given)] - crossing[2 * n :]
        back = back.copy()
        back[n : n + len(given)] += 2.0 * given
        work = c * dt * given * (given + sign * arrived)
    found, speed = np.zeros((4, levels)), np.empty(levels)
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
    found[3, 1:] = np.cumsum(work)
    found[2] -= found[3]
    return found


def row_energies(
    bars: Sequence[Bar], elements: Sequence[int], dt: float, near: Floats, far: Floats
) -> Floats | None:
    """Kinetic and elastic energy of bars in a row at the levels [J], shape (2, layers + 1, bars).

    As `wave_energies`: at an end with the force F, v - s and v + s differ by 2 F / (rho A c), and
    what left one end in a layer is at the other one after L/c.

    Args:
        bars: In the order of the axis.
        elements: Equal elements along each bar.
        dt: Layer [s].
        near: Force on the near end of each bar, along the axis [N], (layers, bars).
        far: Force on its far end, against the axis [N], (layers, bars).

    Returns:
        None unless c dt = h in all bars and each starts with one velocity.
    """
    found = np.empty((2, len(near) + 1, len(bars)))
    for k, (bar, n) in enumerate(zip(bars, elements, strict=True)):
        c, h = bar.wave_speed, bar.length / n
        x = np.linspace(0.0, bar.length, n + 1)
        v = bar.initial_velocity(x=0.5 * (x[1:] + x[:-1])) + np.zeros(n)
        if abs(h - c * dt) > _EVEN * h or np.ptp(v) > 0.0:
            return None
        s = c * np.diff(bar.initial_displacement(x=x) + np.zeros(n + 1)) / h
        section = bar.density * bar.area
        sign = -1.0 if bar.far_end == "clamped" else 1.0
        # What left the near and the far end, the oldest first.
        out, back = np.empty((2, n + len(near)))
        out[:n], back[:n] = (v - s)[::-1], v + s
        for first in range(0, len(near), n):
            rows = slice(first, min(first + n, len(near)))
            later = slice(n + rows.start, n + rows.stop)
            out[later] = back[rows] + 2.0 * near[rows, k] / (section * c)
            back[later] = sign * out[rows] - 2.0 * far[rows, k] / (section * c)
        leaving, coming = sliding_window_view(out, n)[:, ::-1], sliding_window_view(back, n)
        for first in range(0, len(near) + 1, _ROWS):
            levels = slice(first, first + _ROWS)
            for energy, waves in zip(
                found, (coming[levels] + leaving[levels], coming[levels] - leaving[levels]),
                strict=True,
            ):  # fmt: skip
                energy[levels, k] = 0.125 * section * h * np.einsum("ij,ij->i", waves, waves)
    return found
