"""The energy of a bar whose nodal values are those of two waves."""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from impactfem.arrays import Floats
from impactfem.scene import Bar
from impactfem.system.chain import Chain

_EVEN = 1e-9  # share of an element by which steps and elements may differ
_ROWS = 4096  # levels whose cells are looked at together


def starts_as_waves(bar: Bar, chain: Chain, times: Floats) -> bool:
    """Whether nodal values are those of two waves with one mean in each element and layer.

    That is where elements and layers are equal, with c dt = h, and the bar starts with one velocity
    (others are weighted with hat functions, which is no such wave).
    """
    h, dt = np.diff(chain.travel), np.diff(times)
    step = bar.wave_speed * dt[0]
    off = max(np.abs(h - step).max(), bar.wave_speed * np.abs(dt - dt[0]).max())
    return bool(off <= _EVEN * step and np.ptp(element_speeds(bar, chain)) == 0.0)


def element_speeds(bar: Bar, chain: Chain) -> Floats:
    """Velocity of each element at t = 0, in its middle [m/s], (elements,)."""
    middles = bar.places(0.5 * (chain.travel[1:] + chain.travel[:-1]))
    return np.asarray(bar.initial_velocity(x=middles) + np.zeros(len(middles)))


def speeds_at_levels(start: Floats, sums: Floats) -> Floats:
    """Velocities of elements at the levels [m/s], (layers + 1, ...), of bars that start as waves.

    Energies of nodal values smear a front over two elements and lack h (r_1 - r_2)^2 / 16 of it (at
    the impact of K1 rho h v0^2 / 4); those of the waves do not. What leaves a node in a layer is
    twice its velocity less what arrives, whatever its impedances: so r + q of an element, twice
    its velocity at a level, are twice those of its nodes in the layer less what they were at the
    level before; gravity and loads on the way cancel. The only work besides theirs and that of a
    driven end is lambda du_0 <= 0, at impacts inside layers: these energies never grow.

    Args:
        start: At t = 0, (...).
        sums: Of the velocities of both nodes in each layer, (layers, ...).
    """
    signs = np.where(np.arange(len(sums) + 1) % 2, -1.0, 1.0)[(...,) + (None,) * (sums.ndim - 1)]
    found: Floats = np.cumsum(signs * np.concatenate([start[None], sums]), axis=0)
    return signs * found


def row_energies(
    bars: Sequence[Bar], elements: Sequence[int], dt: float, near: Floats, far: Floats
) -> Floats | None:
    """Kinetic and elastic energy of bars in a row at the levels [J], shape (2, layers + 1, bars).

    As `speeds_at_levels`, for the same reason: at an end with the force F, v - s and v + s differ
    by 2 F / (rho A c), and what left one end in a layer is at the other one after L/c.

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
        section = bar.section
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
