"""Energies, momentum and fields of a displacement given on a grid of layers and nodes."""

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.result.bar_motion import BarMotion, Effort, kept_levels
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.system.chain import Chain
from impactfem.system.fronts import element_speeds, speeds_at_levels, starts_as_waves
from impactfem.system.sections import node_loads, row_loads
from impactfem.system.spring_wall import wall_energy
from impactfem.system.works import works


def layer_energies(times: Floats, chain: Chain, displacement: Floats) -> tuple[Floats, Floats]:
    """Kinetic and elastic energy of each layer, per rho A [m^3/s^2], each of shape (layers,).

    P1 on right triangles is the leapfrog scheme M (u^{m+1} - 2 u^m + u^{m-1}) + dt^2 K u^m = f,
    and what it conserves without contact and load is (Hairer, Lubich, Wanner, Geometric Numerical
    Integration, section I.1)

        E = v^T M v / 2 + (u^m)^T K u^{m+1} / 2,   v = (u^{m+1} - u^m) / dt.

    With w the mean of both layers, (u^m)^T K u^{m+1} = w^T K w - dt^2 v^T K v / 4. The elastic
    part is w^T K w / 2 and the kinetic part the rest; at c dt <= h it is not negative.

    Args:
        times: [s], shape (layers + 1,).
        chain: The elements.
        displacement: [m], shape (layers + 1, nodes).
    """
    dt = np.diff(times)[:, None]
    velocity = np.diff(displacement, axis=0) / dt
    middle = 0.5 * (displacement[1:] + displacement[:-1])
    stiffness = chain.stiffness
    elastic = 0.5 * (np.diff(middle, axis=1) ** 2 @ stiffness)
    dispersion = 0.125 * dt[:, 0] ** 2 * (np.diff(velocity, axis=1) ** 2 @ stiffness)
    kinetic = 0.5 * (velocity**2 @ chain.mass) - dispersion
    return kinetic, elastic


def initial_energies(bar: Bar, chain: Chain) -> tuple[float, float, float]:
    """Kinetic and elastic energy per rho A, and mean velocity, of the state at t = 0."""
    velocity = bar.initial_velocity(x=chain.positions) + np.zeros_like(chain.positions)
    kinetic = 0.5 * float(chain.mass @ velocity**2)
    elastic = 0.5 * float(chain.stiffness @ np.diff(chain.displacement) ** 2)
    return kinetic, elastic, float(chain.mass @ velocity) / bar.length


def motion_of_layers(
    bar: Bar,
    gravity: PiecewiseConstant,
    times: Floats,
    chain: Chain,
    displacement: Floats,
    multiplier: Floats,
    active: NDArray[np.bool_],
    effort: Effort,
    every: int = 1,
    *,
    waves: bool = False,
) -> BarMotion:
    """Complete the motion of a displacement that is known on all layers.

    Args:
        bar: The bar.
        gravity: p(t) [m/s^2].
        times: [s], shape (layers + 1,).
        chain: The elements.
        displacement: [m], shape (layers + 1, nodes).
        multiplier: [m^2/s^2], shape (layers,).
        active: Shape (layers,).
        effort: How it was computed.
        every: Keep the fields of every so many levels.
        waves: Whether the solution is that of two waves where c dt = h (see `system.fronts`).
    """
    dt, far = np.diff(times), displacement[:, -2:]
    rates = np.diff(displacement, axis=0) / dt[:, None]
    mean = displacement @ chain.mass / bar.length
    kinetic_0, elastic_0, velocity_0 = initial_energies(bar, chain)
    forces = node_loads(bar, times, chain.travel)
    means = gravity.integral(times[:-1], times[1:]) / dt
    levels = waves and starts_as_waves(bar, chain, times)
    if levels:
        sums = rates[:, 1:] + rates[:, :-1]
        kinetic = 0.5 * speeds_at_levels(element_speeds(bar, chain), sums) ** 2 @ chain.element_mass
        elastic = 0.5 * np.diff(displacement, axis=1) ** 2 @ chain.stiffness
        pushes, paths = forces, np.diff(displacement, axis=0)
    else:
        kinetic, elastic = layer_energies(times, chain, displacement)
        kinetic = np.concatenate([[kinetic_0], kinetic])
        elastic = np.concatenate([[elastic_0], elastic])
        middles = 0.5 * (displacement[1:] + displacement[:-1])
        paths = np.diff(np.concatenate([displacement[:1], middles]), axis=0)
        pushes = row_loads(forces, len(dt))
    elastic = elastic + wall_energy(bar, displacement[:, 0], levels=levels)
    work = np.zeros_like(times)
    if bar.is_loaded:
        work[1:] = np.cumsum((pushes * paths).sum(axis=1))
    potential, driven = works(bar, chain, times, means, mean, far, forces, levels=levels)
    kept = kept_levels(len(dt), every)
    # The velocity at a level is the mean of the two layers beside it.
    sides = np.concatenate([rates[:1], rates, rates[-1:]])
    return BarMotion(
        times=times,
        positions=chain.positions,
        kept=kept,
        displacement=displacement[kept],
        velocity=0.5 * (sides[kept + 1] + sides[kept]),
        gap=displacement[:, 0],
        multiplier=multiplier,
        active=active,
        kinetic=kinetic,
        elastic=elastic,
        potential=potential - driven - work,
        mean_displacement=mean,
        mean_velocity=np.concatenate([[velocity_0], np.diff(mean) / dt]),
        effort=effort,
        end_work=driven + work,
    )
