"""The time loop of a row of bars: the founding scheme in each bar, contact between end nodes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from impactfem.marching.bar_row_kernels import two_step_row
from impactfem.marching.chain import Chain
from impactfem.result.bar_motion import Effort, kept_levels
from impactfem.result.bar_row_motion import RowMotion, pair_labels
from impactfem.scene import Bar

Floats = NDArray[np.float64]


def march_row(
    bars: Sequence[Bar], elements: Sequence[int], dt: float, layers: int, *,
    wall: str | None = None, every: int = 1,
) -> RowMotion:  # fmt: skip
    """March bars that strike each other through common layers.

    Where dt = h / c in every bar the recursion carries waves from node to node and the answer at
    the nodes is exact as long as contacts begin and end on layers.

    Args:
        bars: In the order of the axis.
        elements: Equal elements along each bar.
        dt: Time step [s], at most h / c in each bar.
        layers: Number of layers.
        wall: Name of the wall that stops the first bar; None: there is none.
        every: Keep the fields of every so many levels.

    Returns:
        The motion; time and memory grow linearly with nodes times layers.
    """
    chains = [
        Chain.of_bar(bar, np.linspace(0.0, bar.length, count + 1))
        for bar, count in zip(bars, elements, strict=True)
    ]
    sections = [bar.density * bar.area for bar in bars]
    mass = np.concatenate([s * chain.mass for s, chain in zip(sections, chains, strict=True)])
    springs = [
        np.append(s * chain.stiffness, 0.0) for s, chain in zip(sections, chains, strict=True)
    ]
    start = np.concatenate([chain.displacement for chain in chains])
    velocity = np.concatenate([chain.velocity for chain in chains])
    ends = np.cumsum([0, *(count + 1 for count in elements)])
    first = 0 if wall is not None else 1
    near = ends[first:-1]
    far = ends[first:-1] - 1  # -1: the wall
    reach = np.array([bars[k - 1].length if k else 0.0 for k in range(first, len(bars))])

    kept = kept_levels(layers, every)
    displacement, rate = np.empty((2, len(kept), len(mass)))
    gap, force = np.empty((layers + 1, len(near))), np.empty((layers, len(near)))
    kinetic, elastic, mean = np.empty((3, layers + 1, len(bars)))
    displacement[0], rate[0] = start, velocity
    gap[0] = np.maximum(start[near] - reach - np.where(far >= 0, start[far], 0.0), 0.0)
    for k, (s, chain) in enumerate(zip(sections, chains, strict=True)):
        kinetic[0, k] = 0.5 * s * chain.mass @ chain.velocity**2
        elastic[0, k] = 0.5 * s * chain.stiffness @ np.diff(chain.displacement) ** 2
        mean[0, k] = chain.mass @ chain.displacement / chain.mass.sum()
    two_step_row(
        mass, np.concatenate(springs), dt, bars[-1].far_end == "clamped", velocity, ends, near, far,
        reach, start.copy(), layers, kept, displacement, rate, gap, force, kinetic, elastic, mean,
    )  # fmt: skip
    begin = [chain.mass @ chain.velocity / chain.mass.sum() for chain in chains]
    inner = ends[1:-1]
    return RowMotion(
        times=dt * np.arange(layers + 1, dtype=np.float64),
        labels=pair_labels(bars, wall),
        positions=tuple(chain.positions for chain in chains),
        kept=kept,
        displacement=tuple(np.split(displacement, inner, axis=1)),
        velocity=tuple(np.split(rate, inner, axis=1)),
        gap=gap,
        force=force,
        kinetic=kinetic,
        elastic=elastic,
        mean_displacement=mean,
        mean_velocity=np.vstack([begin, np.diff(mean, axis=0) / dt]),
        effort=Effort(len(mass) * layers, 1, (), True, "decided in each layer and pair"),
    )
