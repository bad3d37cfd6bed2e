"""What drives the far end of a bar in layers: forces, ways, and the work of both, over rho A."""

from functools import lru_cache

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Bar, Formula, PiecewiseConstant
from impactfem.scene.means import mean_of
from impactfem.system.chain import Chain
from impactfem.system.fronts import speeds_at_levels
from impactfem.system.sections import node_loads

_PLACES = 33  # at which a load is looked at for its size


def end_means(bar: Bar, times: Floats) -> Floats:
    """Mean of force over impedance, or of its speed, of the far end in each layer [m/s].

    Args:
        bar: The bar.
        times: Levels [s], (..., layers + 1).

    Returns:
        Shape (..., layers).
    """
    if bar.far_end == "clamped":
        dt = np.diff(times)
        return np.divide(end_ways(bar, times), dt, out=np.zeros_like(dt), where=dt > 0.0)
    force = _means(bar.end_force, np.shape(times), np.asarray(times, float).tobytes())
    return np.asarray(force / bar.impedance)


@lru_cache(maxsize=4)
def _means(formula: Formula, shape: tuple[int, ...], levels: bytes) -> Floats:
    """Means between levels, kept: sizes, loads and works of one run ask for the same."""
    times = np.frombuffer(levels).reshape(shape)
    return np.asarray(mean_of(formula, times[..., :-1], times[..., 1:]))


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


def end_work(
    bar: Bar, chain: Chain, times: Floats, far: Floats, loads: Floats, forces: Floats
) -> Floats:
    """Work of what drives the far end, up to the middle of each layer [m^3/s^2], (layers + 1,).

    The force of each row over the path between the middles of its layers; where a motion is given
    it is the reaction that the row of the last node has.

    Args:
        bar: The bar.
        times: Levels [s], (layers + 1,).
        chain: Its elements.
        far: Displacement of the last two nodes [m], (layers + 1, 2).
        loads: Gravity of each row [m/s^2], (layers,).
        forces: Of the load on the last node in each row [m^2/s^2], (layers,).
    """
    dt = np.diff(times)
    end = far[:, 1]
    if bar.far_end == "clamped":
        speed = np.diff(end) / dt
        # A row spans half of both layers beside it; the first one half a layer, from rest.
        wide = 0.5 * (dt + np.concatenate([[0.0], dt[:-1]]))
        change = np.diff(np.concatenate([[0.0], speed])) / wide
        pull = chain.stiffness[-1] * (end - far[:, 0])[:-1]
        force = chain.mass[-1] * (change + loads) + pull - forces
    else:
        force = end_pushes(bar, times)
    middle = 0.5 * (end[1:] + end[:-1])
    path = np.diff(np.concatenate([end[:1], middle]))
    if bar.end_damping:  # by the speed of each row: the first one is half a layer
        wide = 0.5 * (dt + np.concatenate([[0.0], dt[:-1]]))
        force = force - bar.end_damping / bar.section * path / wide
    return np.concatenate([[0.0], np.cumsum(force * path)])


def end_work_at_levels(
    bar: Bar, chain: Chain, times: Floats, far: Floats, pulls: Floats, start: float
) -> Floats:
    """As `end_work`, up to the levels, of bars that start as waves (`system.fronts`).

    Args:
        bar: The bar.
        chain: Its elements.
        times: Levels [s], (layers + 1,).
        far: Displacement of the last two nodes [m], (layers + 1, 2).
        pulls: Gravity less the load on the last element in each layer [m/s^2], (layers,).
        start: Its velocity at t = 0 [m/s].
    """
    dt, way = np.diff(times), np.diff(far[:, 1])
    if bar.far_end == "clamped":
        rates = np.diff(far, axis=0) / dt[:, None]
        speed = speeds_at_levels(np.asarray(start), rates.sum(axis=1))[:-1]
        # What arrives in a layer has had gravity on its way for half of it.
        impedance = 2.0 * chain.mass[-1] / dt
        pull = chain.stiffness[-1] * np.diff(far, axis=1)[:-1, 0]
        force = impedance * (rates[:, 1] - speed + 0.5 * dt * pulls) + pull
    else:
        force = bar.wave_speed * end_means(bar, times) - bar.end_damping / bar.section * way / dt
    return np.concatenate([[0.0], np.cumsum(force * way)])


def displacement_scale(
    bar: Bar, gravity: PiecewiseConstant, travel: Floats, times: Floats
) -> float:
    """Largest displacement that the data suggest within a transit [m]; tolerances are shares of it.

    Args:
        bar: The bar; its gap, its initial state, its load and what drives its far end count.
        gravity: p(t) [m/s^2].
        travel: Where the initial state is looked at, as in `Bar.places` [m].
        times: Levels, from 0 on [s], (layers + 1,); loads are looked at in the means between them.
    """
    transit, dt, places = bar.transit_time, np.diff(times), bar.places(travel)
    given = [
        bar.initial_displacement(x=places),
        bar.initial_velocity(x=places) * transit,
        np.array(gravity.values) * transit**2,
        np.finfo(float).tiny,
    ]
    steps = []  # what each layer adds to the way in a transit
    if bar.is_driven:
        steps.append(end_means(bar, times) * dt)
    if bar.is_loaded:
        forces = node_loads(bar, times, np.linspace(0.0, bar.length, _PLACES))
        steps.append(np.abs(forces).sum(axis=1) / bar.length * dt * transit)
    starts = np.unique(times // transit, return_index=True)[1]
    for step in steps:
        way = np.concatenate([[0.0], np.cumsum(step)])
        given += [step, np.maximum.reduceat(way, starts) - np.minimum.reduceat(way, starts)]
    return max(float(np.abs(each).max()) for each in given)
