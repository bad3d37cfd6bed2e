"""The time loop of a row of bars: the founding scheme in each bar, or its waves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.marching.bar_row_kernels import two_step_row
from impactfem.marching.row_wave_kernels import conserving_row
from impactfem.marching.waves import Delay, left_ends
from impactfem.result.bar_motion import Effort, kept_levels
from impactfem.result.bar_row_motion import RowMotion, pair_labels
from impactfem.scene import Bar
from impactfem.system.chain import Chain
from impactfem.system.fronts import row_energies


@dataclass(frozen=True)
class _Record:
    """What a time loop fills, named as in `RowMotion`; fields of all bars side by side."""

    ends: NDArray[np.int64]
    kept: NDArray[np.int64]
    displacement: Floats
    rate: Floats
    gap: Floats
    force: Floats
    kinetic: Floats
    elastic: Floats
    mean: Floats
    momentum: Floats


def march_row(
    bars: Sequence[Bar], elements: Sequence[int], dt: float, layers: int, *,
    wall: str | None = None, every: int = 1, method: str = "galerkin",
) -> RowMotion:  # fmt: skip
    """March bars that strike each other through common layers.

    Args:
        bars: In the order of the axis.
        elements: Equal elements along each bar.
        dt: Time step [s], at most h / c in each bar.
        layers: Number of layers.
        wall: Name of the wall that stops the first bar; None: there is none.
        every: Keep the fields of every so many levels.
        method: "galerkin" or "conserving".

    Returns:
        The motion; time and memory grow linearly with nodes times layers.
    """
    chains = [
        Chain.of_bar(bar, np.linspace(0.0, bar.length, count + 1))
        for bar, count in zip(bars, elements, strict=True)
    ]
    start = np.concatenate([chain.displacement for chain in chains])
    ends = np.cumsum([0, *(count + 1 for count in elements)])
    first = 0 if wall is not None else 1
    far = ends[first:-1] - 1  # -1: the wall
    reach = np.array([bars[k - 1].length if k else 0.0 for k in range(first, len(bars))])
    kept, pairs, count = kept_levels(layers, every), len(bars) - first, len(bars)
    displacement, rate = np.empty((2, len(kept), len(start)))
    gap, force = np.empty((layers + 1, pairs)), np.empty((layers, pairs))
    kinetic, elastic, mean, momentum = np.empty((4, layers + 1, count))
    record = _Record(
        ends, kept, displacement, rate, gap, force, kinetic, elastic, mean, momentum
    )  # fmt: skip
    record.displacement[0] = start
    record.rate[0] = np.concatenate([chain.velocity for chain in chains])
    before = np.where(far >= 0, start[far], 0.0)
    record.gap[0] = np.maximum(start[ends[first:-1]] - reach - before, 0.0)
    effort = _FILLED[method](bars, chains, dt, layers, wall is not None, reach, record)
    inner = ends[1:-1]
    return RowMotion(
        times=dt * np.arange(layers + 1, dtype=np.float64),
        labels=pair_labels(bars, wall),
        positions=tuple(chain.positions for chain in chains),
        kept=kept,
        displacement=tuple(np.split(record.displacement, inner, axis=1)),
        velocity=tuple(np.split(record.rate, inner, axis=1)),
        gap=record.gap,
        force=record.force,
        kinetic=record.kinetic,
        elastic=record.elastic,
        mean_displacement=record.mean,
        mean_velocity=record.momentum,
        effort=effort,
    )


def _by_nodes(
    bars: Sequence[Bar], chains: Sequence[Chain], dt: float, layers: int,
    has_wall: bool, reach: Floats, record: _Record,
) -> Effort:  # fmt: skip
    """Petrov-Galerkin recursion: exact at the nodes if dt = h / c and events fall on layers."""
    sections = [bar.section for bar in bars]
    mass = np.concatenate([s * chain.mass for s, chain in zip(sections, chains, strict=True)])
    springs = [
        np.append(s * chain.stiffness, 0.0) for s, chain in zip(sections, chains, strict=True)
    ]
    near = record.ends[0 if has_wall else 1 : -1]
    for k, (s, chain) in enumerate(zip(sections, chains, strict=True)):
        record.kinetic[0, k] = 0.5 * s * chain.mass @ chain.velocity**2
        record.elastic[0, k] = 0.5 * s * chain.stiffness @ np.diff(chain.displacement) ** 2
        record.mean[0, k] = chain.mass @ chain.displacement / chain.mass.sum()
        record.momentum[0, k] = chain.mass @ chain.velocity / chain.mass.sum()
    two_step_row(
        mass, np.concatenate(springs), dt, bars[-1].far_end == "clamped", record.rate[0].copy(),
        record.ends, near, near - 1, reach, record.displacement[0].copy(), layers, record.kept,
        record.displacement, record.rate, record.gap, record.force, record.kinetic, record.elastic,
        record.mean,
    )  # fmt: skip
    record.momentum[1:] = np.diff(record.mean, axis=0) / dt
    none = np.zeros((layers, 1))  # on the far end of all, and the near end without a wall
    pushed = record.force if has_wall else np.hstack([none, record.force])
    waves = row_energies(
        bars, (np.diff(record.ends) - 1).tolist(), dt, pushed, np.hstack([pushed[:, 1:], none])
    )
    if waves is not None:
        record.kinetic[:], record.elastic[:] = waves
    return Effort(len(mass) * layers, 1, (), True, "decided in each time step and pair")


def _by_waves(
    bars: Sequence[Bar], chains: Sequence[Chain], dt: float, layers: int,
    has_wall: bool, reach: Floats, record: _Record,  # noqa: ARG001  (as `_by_nodes`)
) -> Effort:  # fmt: skip
    """Waves carried exactly and kept as one line a layer: any dt, energy and momentum stay."""
    delays = [Delay.of(bar.transit_time, dt) for bar in bars]
    past = max(delay.layers for delay in delays) + 1
    mean, rise = np.zeros((2, 2 * len(bars), past + layers))
    for k, (bar, delay) in enumerate(zip(bars, delays, strict=True)):
        own = slice(2 * k, 2 * k + 2), slice(past - delay.layers - 1, past)
        mean[own], rise[own] = left_ends(bar, delay, dt)
    speeds = np.array([bar.wave_speed for bar in bars])
    counts = np.diff(record.ends)
    conserving_row(
        mean, rise, past, np.array([delay.layers for delay in delays]),
        np.array([delay.share for delay in delays]), np.array([bar.transit_time for bar in bars]),
        np.array([bar.impedance for bar in bars]),
        has_wall, bars[-1].far_end == "clamped", record.gap[0].copy(),
        record.displacement[0, record.ends[:-1]].copy(), dt, layers,
        np.concatenate([chain.positions for chain in chains]) / np.repeat(speeds, counts),
        record.ends, record.gap, record.force, record.kinetic, record.elastic, record.mean,
        record.momentum, record.kept, record.displacement, record.rate,
    )  # fmt: skip
    return Effort(4 * len(bars) * layers, 1, (), True, "closed form in each time step and pair")


_FILLED = {"galerkin": _by_nodes, "conserving": _by_waves}
