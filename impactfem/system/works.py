"""Work of gravity and of what drives the far end of a bar in layers."""

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Bar
from impactfem.system.chain import Chain
from impactfem.system.ends import end_work, end_work_at_levels
from impactfem.system.fronts import element_speeds
from impactfem.system.sections import row_loads


def works(
    bar: Bar, chain: Chain, times: Floats, means: Floats, mean: Floats, far: Floats,
    forces: Floats, *, levels: bool,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Potential of gravity, and the work of what drives the far end, over rho A [m^3/s^2].

    The potential is p(0) u(0) minus the work done since, so that a load that is switched does not
    make energy out of nothing. That is the work of the discrete equations: up to levels the load of
    each layer over its path; up to the middles of layers the load of the row of nodes between two
    of them over the path between these.

    Args:
        bar: The bar.
        chain: Its elements.
        times: Levels [s], (layers + 1,).
        means: Gravity in each layer [m/s^2], (layers,).
        mean: Displacement of the centre of mass [m], (layers + 1,).
        far: Displacement of the last two nodes [m], (layers + 1, 2).
        forces: Of the load along the bar, as `node_loads` has them.
        levels: Whether energies are those of levels (`impactfem.system.fronts`).

    Returns:
        Shape (layers + 1,) each.
    """
    driven = np.zeros_like(times)
    if levels:
        done = means * np.diff(mean)
        if bar.is_driven:
            pulls = means - (forces[:, -1] / chain.mass[-1] if len(forces) else 0.0)
            start = element_speeds(bar, chain)[-1]
            driven = end_work_at_levels(bar, chain, times, far, pulls, start)
    else:
        rows = row_loads(means[:, None], len(means))[:, 0]
        middle = 0.5 * (mean[1:] + mean[:-1])
        done = rows * np.diff(np.concatenate([mean[:1], middle]))
        if bar.is_driven:
            pushed = row_loads(forces[:, -1:], len(means))[:, 0]
            driven = end_work(bar, chain, times, far, rows, pushed)
    start = means[0] * mean[0]
    return bar.length * (start + np.concatenate([[0.0], np.cumsum(done)])), driven
