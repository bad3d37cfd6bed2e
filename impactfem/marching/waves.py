"""A bar as the waves that leave its wall: what the wave kernels see."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.exact import initial
from impactfem.exact.pieces import Line
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.system.ends import end_means

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
    """Arguments of `impactfem.marching.wave_kernels.conserving`, named as there, and two more.

    Attributes:
        given: What a driven far end gives to the wave that arrives at the near end (half of what it
            adds), at both ends of each piece of each layer [m/s], shape of `drops`.
        felt: Gravity on the way to the far end that this wave has had [m/s], likewise.
    """

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
    given: Floats
    felt: Floats

    @property
    def arguments(self) -> tuple[Any, ...]:
        """Those of the kernel."""
        return tuple(vars(self).values())[:-2]

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
        # Rows repeat once gravity has been constant for two transits, if nothing else changes.
        settled = past + math.ceil(gravity.times[-1] / dt) + 1
        rows = layers + once.layers
        all_layers = np.arange((rows if bar.is_driven else min(rows, settled)) + 1)
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
        given = felt = np.zeros_like(drops)
        if bar.is_driven:
            left = dt * (all_layers[:, None] + breaks) - bar.transit_time  # the far end
            given, felt = _lines_of_end(bar, left), since(twice) - since(once)
        return cls(
            mean, rise, past, breaks, twice.layers + late.astype(np.int64),
            np.where(late, 1.0, 0.0) - twice.share, drops + 2.0 * given, impulse[past:] / dt, dt,
            bar.transit_time, -1.0 if clamped else 1.0, given, felt,
        )  # fmt: skip

    def end_work(self, times: Floats) -> Floats:
        """Work of what drives the far end over rho A c, up to some times [m^2/s^2 s], (times,).

        The integral of f (f + sign q), q the wave that comes to the far end: lines, all of them.

        Args:
            times: Borders of layers [s].
        """
        layers, pieces = self.given.shape[:2]
        cell = np.arange(layers)[:, None] - self.cells + self.past
        shift = 2.0 * self.extra - 1.0
        mean, rise = self.mean[cell], self.rise[cell]
        q = np.stack(
            [mean + (shift + 2.0 * at) * rise for at in (self.breaks[:-1], self.breaks[1:])],
            axis=-1,
        )
        f = self.given
        own = f + self.sign * (q - self.felt)
        # The integral of the product of two lines.
        crossed = f[..., 0] * own[..., 1] + f[..., 1] * own[..., 0]
        power = (2.0 * (f * own).sum(axis=-1) + crossed) / 6.0
        width = self.dt * np.diff(self.breaks)
        done = np.concatenate([[0.0], np.cumsum(width * power)])
        ends = self.dt * (np.arange(layers)[:, None] + self.breaks[:-1]).ravel() - self.transit
        found: Floats = np.interp(times, np.append(ends, ends[-1] + width[pieces - 1]), done)
        return found


def _lines_of_end(bar: Bar, borders: Floats) -> Floats:
    """A line for what a far end gives (`Bar.end_speed`), in pieces between times of each layer.

    Each has the means of both its halves; before t = 0 nothing is given.

    Args:
        bar: The bar.
        borders: [s], (layers, pieces + 1).

    Returns:
        Its values at both ends of each piece [m/s], (layers, pieces, 2).
    """
    low, width = borders[:, :-1], np.diff(borders, axis=1)
    times = np.maximum(np.stack([low, low + 0.5 * width, low + width], axis=-1), 0.0)
    halves = end_means(bar, times.reshape(-1, 3)).reshape(*low.shape, 2)
    halves *= np.diff(times) / (0.5 * width[..., None])
    mean, half = halves.mean(axis=-1), halves[..., 1] - halves[..., 0]
    return np.stack([mean - half, mean + half], axis=-1)


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
