"""A bar as the waves that leave its wall: what the wave kernels see."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.exact import initial
from impactfem.exact.pieces import Line
from impactfem.scene import Bar, PiecewiseConstant

Floats = NDArray[np.float64]

_LEAST_PIECES = 256  # of an initial state that is not linear
_TOLERANCE = 1e-11  # of displacements that they leave
_WHOLE = 1e-9  # share of a layer by which a transit may miss a number of layers


@dataclass(frozen=True)
class Delay:
    """A time in layers: whole ones and a share of one."""

    layers: int
    share: float

    @classmethod
    def of(cls, time: float, dt: float) -> "Delay":
        """Of a time [s], to rounding."""
        whole = math.floor(time / dt + _WHOLE)
        share = time / dt - whole
        return cls(whole, share if share > _WHOLE else 0.0)


@dataclass(frozen=True)
class Waves:
    """Arguments of `impactfem.marching.wave_kernels.conserving`, named as there."""

    mean: Floats
    rise: Floats
    past: int
    breaks: Floats
    cells: NDArray[np.int64]
    extra: Floats
    drops: Floats
    loads: Floats
    dt: float
    transit: float
    sign: float

    @classmethod
    def of_bar(cls, bar: Bar, gravity: PiecewiseConstant, dt: float, layers: int) -> "Waves":
        """Cut waves and gravity into layers.

        Args:
            bar: The bar.
            gravity: p(t) [m/s^2]; what acts is its mean over each layer.
            dt: Layer [s], at most the transit time L / c.
            layers: Number of layers.
        """
        clamped = bar.far_end == "clamped"
        once, twice = (Delay.of(k * bar.transit_time, dt) for k in (1, 2))
        past = twice.layers + 1
        breaks = np.unique([0.0, once.share, twice.share, 1.0])
        late = breaks[:-1] < twice.share  # arrives from one layer earlier
        mean, rise = np.zeros((2, past + layers))
        mean[:past], rise[:past] = lines(left_before(bar, past), dt, past, twice.share)
        # Rows repeat once gravity has been constant for two transits.
        settled = past + math.ceil(gravity.times[-1] / dt) + 1
        all_layers = np.arange(min(layers + once.layers, settled) + 1)
        edges = dt * np.arange(-past, len(all_layers) + 1)
        impulse = gravity.integral(np.maximum(edges[:-1], 0.0), np.maximum(edges[1:], 0.0))

        def since(delay: Delay) -> Floats:
            """Gravity on the way at both ends of each piece, (layers, pieces, 2)."""
            ends = np.stack([breaks[:-1], breaks[1:]], axis=-1)
            back = past + all_layers - delay.layers
            whole = gravity.integral(
                np.maximum(edges[back], 0.0), np.maximum(edges[past + all_layers], 0.0)
            )[:, None, None]
            early = (breaks[:-1] < delay.share).astype(np.int64)
            there = impulse[back[:, None] - early][:, :, None] * (ends - delay.share)
            found: Floats = whole + impulse[past + all_layers][:, None, None] * ends - there
            return found

        drops = since(twice) - 2.0 * since(once) if clamped else -since(twice)
        return cls(
            mean, rise, past, breaks, twice.layers + late.astype(np.int64),
            np.where(late, 1.0, 0.0) - twice.share, drops, impulse[past:] / dt, dt,
            bar.transit_time, -1.0 if clamped else 1.0,
        )  # fmt: skip


def left_before(bar: Bar, cells: int) -> Line:
    """Wave that left the wall in the two transits before t = 0, as if nothing had acted."""
    c = bar.wave_speed
    start = initial.sample(
        bar.length,
        c,
        lambda x: bar.initial_displacement(x=x) + np.zeros_like(x),
        lambda x: bar.initial_velocity(x=x) + np.zeros_like(x),
        max(_LEAST_PIECES, 2 * cells),
        _TOLERANCE,
    )
    u = start.displacement
    chord = 0.5 * (u[:-1] + u[1:])
    middle = chord if start.middle is None else start.middle
    strain = initial.strain(start.nodes, u, 4.0 * (middle - chord))
    return initial.wave(
        start.nodes / c, start.velocity, c * strain, clamped=bar.far_end == "clamped"
    )


def left_ends(bar: Bar, delay: Delay, dt: float) -> tuple[Floats, Floats]:
    """Waves that left both ends in the transit before t = 0, as one line a layer.

    Args:
        bar: The bar.
        delay: Its transit in layers.
        dt: Layer [s].

    Returns:
        Mean and half the rise [m/s] of the near end and the far end, (2, layers + 1) each.
    """
    wave = left_before(bar, delay.layers + 1)
    half = len(wave.left) // 2
    until = wave.border[half]
    parts = (
        Line([x - until for x in wave.border[half:]], wave.left[half:], wave.right[half:]),
        Line(wave.border[: half + 1], wave.left[:half], wave.right[:half]),
    )
    each = np.array([lines(part, dt, delay.layers + 1, delay.share) for part in parts])
    each[1] *= -1.0 if bar.far_end == "clamped" else 1.0
    return each[:, 0], each[:, 1]


def lines(wave: Line, dt: float, count: int, share: float) -> tuple[Floats, Floats]:
    """L2 projection of a wave on one line a layer, the layers counted back from its end.

    The first layer holds only the given share of the wave, if any; its line goes on beyond it.

    Returns:
        Mean and half the rise of each layer.
    """
    end = wave.border[-1]
    edges: Floats = end - dt * np.arange(count, -1, -1.0)
    edges[0] = 0.0
    mean, rise = np.zeros((2, count))
    first = 0 if share > 0.0 else 1
    line = wave.split(edges[first + 1 : -1], 0.0)
    border, left, right = np.array(line.border), np.array(line.left), np.array(line.right)
    cell = np.searchsorted(edges[1:], 0.5 * (border[1:] + border[:-1]))
    width, low, wide = np.diff(border), edges[cell], np.diff(edges)[cell]
    middle, slope = 0.5 * (left + right), right - left
    place = (border[1:] + border[:-1] - 2.0 * low) / wide - 1.0
    part = width / wide
    np.add.at(mean, cell, part * middle)
    np.add.at(rise, cell, 3.0 * part * (place * (middle - mean[cell]) + part * slope / 6.0))
    if share > 0.0:
        last = mean[0] + rise[0]
        rise[0] /= share
        mean[0] = last - rise[0]
    return mean, rise
