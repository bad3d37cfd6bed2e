"""History and fields of a space-time solution of a bar."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from impactfem.result import BodyMotion, Fields, make_history
from impactfem.result.history import Columns
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.spacetime.solution import SpaceTimeSolution, layer_energies, lumped_mass

Floats = NDArray[np.float64]


def bar_history(solution: SpaceTimeSolution, bar: Bar, gravity: PiecewiseConstant) -> xr.Dataset:
    """History of a solution: row 0 is the initial state, row m belongs to layer (t_{m-1}, t_m].

    Gap and position are those at t_m. Force, velocity, momentum and energies are those of the
    layer, for which the P1 displacement defines them.
    """
    x, t, u = solution.positions, solution.times, solution.displacement
    section = bar.density * bar.area
    mass = section * lumped_mass(x)
    velocity = np.diff(u, axis=0) / np.diff(t)[:, None]
    kinetic, elastic = layer_energies(solution, bar.wave_speed)
    initial_velocity = bar.initial_velocity(x=x) + np.zeros_like(x)
    h = np.diff(x)
    kinetic_0 = 0.5 * mass @ initial_velocity**2
    elastic_0 = 0.5 * section * bar.wave_speed**2 * np.sum(np.diff(u[0]) ** 2 / h)
    mean = u @ mass / bar.mass
    momentum = np.concatenate([[mass @ initial_velocity], velocity @ mass])
    position = mean + x @ mass / bar.mass
    force = np.concatenate([[0.0], -section * solution.multiplier])
    return make_history(
        Columns(
            time=t,
            gap=u[:, 0],
            contact_force=force + 0.0,  # no negative zeros
            kinetic_energy=np.concatenate([[kinetic_0], section * kinetic]),
            elastic_energy=np.concatenate([[elastic_0], section * elastic]),
            potential_energy=bar.mass * _potential(t, mean, gravity),
            momentum=momentum,
            active=np.concatenate([[0], solution.active.astype(np.int64)]),
            bodies={bar.name: BodyMotion.along_axis(position, momentum / bar.mass)},
        )
    )


def _potential(t: Floats, mean: Floats, gravity: PiecewiseConstant) -> Floats:
    """Potential of gravity per mass in the middle of each layer, row 0 at t = 0 [m^2/s^2].

    p(0) u(0) minus the work done since, so that a load that is switched does not make energy out
    of nothing. The work is that of the discrete equations: between the middles of two layers the
    load of the node row between them acts over the path between the middles.
    """
    layer = gravity.integral(t[:-1], t[1:]) / np.diff(t)
    row = np.concatenate([layer[:1], 0.5 * (layer[1:] + layer[:-1])])
    middle = 0.5 * (mean[1:] + mean[:-1])
    path = np.diff(np.concatenate([mean[:1], middle]))
    start = gravity(0.0) * mean[0]
    return np.concatenate([[start], start + np.cumsum(row * path)])


def bar_fields(solution: SpaceTimeSolution, every: int) -> Fields:
    """Displacement and velocity at every ``every``-th layer and the last one.

    The velocity at a layer is the mean of the two layers beside it.
    """
    u, t = solution.displacement, solution.times
    rates = np.diff(u, axis=0) / np.diff(t)[:, None]
    rates = np.concatenate([rates[:1], rates, rates[-1:]])
    velocity = 0.5 * (rates[1:] + rates[:-1])
    chosen = np.unique(np.append(np.arange(0, len(t), every), len(t) - 1))
    return Fields(t[chosen], solution.positions, u[chosen], velocity[chosen])
