"""Energies, momentum and fields of a displacement given on a grid of layers and nodes."""

import numpy as np
from numpy.typing import NDArray

from impactfem.result.bar_motion import BarMotion, Effort, kept_levels
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.system.ends import end_work
from impactfem.system.fronts import wave_energies

Floats = NDArray[np.float64]


def lumped_mass(positions: Floats) -> Floats:
    """Mass of each node per rho A [m], shape (nodes,): half of each neighbouring element."""
    mass = np.zeros(len(positions))
    h = np.diff(positions)
    mass[:-1] += 0.5 * h
    mass[1:] += 0.5 * h
    return mass


def layer_energies(
    times: Floats, positions: Floats, displacement: Floats, wave_speed: float
) -> tuple[Floats, Floats]:
    """Kinetic and elastic energy of each layer, per rho A [m^3/s^2], each of shape (layers,).

    P1 on right triangles is the leapfrog scheme M (u^{m+1} - 2 u^m + u^{m-1}) + dt^2 K u^m = f,
    and what it conserves without contact and load is (Hairer, Lubich, Wanner, Geometric Numerical
    Integration, section I.1)

        E = v^T M v / 2 + (u^m)^T K u^{m+1} / 2,   v = (u^{m+1} - u^m) / dt.

    With w the mean of both layers, (u^m)^T K u^{m+1} = w^T K w - dt^2 v^T K v / 4. The elastic
    part is w^T K w / 2 and the kinetic part the rest; at c dt <= h it is not negative.

    Args:
        times: [s], shape (layers + 1,).
        positions: [m], shape (nodes,).
        displacement: [m], shape (layers + 1, nodes).
        wave_speed: c [m/s].
    """
    dt = np.diff(times)[:, None]
    velocity = np.diff(displacement, axis=0) / dt
    middle = 0.5 * (displacement[1:] + displacement[:-1])
    stiffness = wave_speed**2 / np.diff(positions)
    elastic = 0.5 * (np.diff(middle, axis=1) ** 2 @ stiffness)
    dispersion = 0.125 * dt[:, 0] ** 2 * (np.diff(velocity, axis=1) ** 2 @ stiffness)
    kinetic = 0.5 * (velocity**2 @ lumped_mass(positions)) - dispersion
    return kinetic, elastic


def layer_loads(times: Floats, gravity: PiecewiseConstant) -> Floats:
    """Gravity that acts on each row of nodes [m/s^2], shape (layers,).

    A test function of row m spans the two layers beside it: the mean of both means (row 0: one).
    """
    means = gravity.integral(times[:-1], times[1:]) / np.diff(times)
    return np.concatenate([means[:1], 0.5 * (means[1:] + means[:-1])])


def gravity_potential(times: Floats, mean: Floats, gravity: PiecewiseConstant) -> Floats:
    """Potential of gravity per mass in the middle of each layer, row 0 at t = 0 [m^2/s^2].

    p(0) u(0) minus the work done since, so that a load that is switched does not make energy out
    of nothing. The work is that of the discrete equations: between the middles of two layers the
    load of the node row between them acts over the path between the middles.

    Args:
        times: [s], shape (layers + 1,).
        mean: Displacement of the centre of mass [m], shape (layers + 1,).
        gravity: p(t).
    """
    middle = 0.5 * (mean[1:] + mean[:-1])
    path = np.diff(np.concatenate([mean[:1], middle]))
    start = gravity(0.0) * mean[0]
    return np.concatenate([[start], start + np.cumsum(layer_loads(times, gravity) * path)])


def initial_energies(bar: Bar, positions: Floats) -> tuple[float, float, float]:
    """Kinetic and elastic energy per rho A, and mean velocity, of the state at t = 0."""
    x, mass = positions, lumped_mass(positions)
    velocity = bar.initial_velocity(x=x) + np.zeros_like(x)
    displacement = bar.initial_displacement(x=x) + np.zeros_like(x)
    kinetic = 0.5 * float(mass @ velocity**2)
    elastic = 0.5 * bar.wave_speed**2 * float(np.sum(np.diff(displacement) ** 2 / np.diff(x)))
    return kinetic, elastic, float(mass @ velocity) / bar.length


def motion_of_layers(
    bar: Bar,
    gravity: PiecewiseConstant,
    times: Floats,
    positions: Floats,
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
        positions: [m], shape (nodes,).
        displacement: [m], shape (layers + 1, nodes).
        multiplier: [m^2/s^2], shape (layers,).
        active: Shape (layers,).
        effort: How it was computed.
        every: Keep the fields of every so many levels.
        waves: Whether the solution is that of two waves where c dt = h (see `wave_energies`).
    """
    mass = lumped_mass(positions)
    kinetic, elastic = layer_energies(times, positions, displacement, bar.wave_speed)
    kinetic_0, elastic_0, velocity_0 = initial_energies(bar, positions)
    kinetic = np.concatenate([[kinetic_0], kinetic])
    elastic = np.concatenate([[elastic_0], elastic])
    mean = displacement @ mass / bar.length
    potential = bar.length * gravity_potential(times, mean, gravity)
    driven = np.zeros_like(times)
    if bar.is_driven:
        loads = layer_loads(times, gravity)
        driven = end_work(bar, times, positions, displacement[:, -2:], loads)
    gap = displacement[:, 0]
    found = wave_energies(bar, positions, times, gap, multiplier, gravity) if waves else None
    if found is not None:
        kinetic, elastic, potential, driven = found
    else:
        potential = potential - driven
    dt = np.diff(times)
    rates = np.diff(displacement, axis=0) / dt[:, None]
    kept = kept_levels(len(dt), every)
    # The velocity at a level is the mean of the two layers beside it.
    sides = np.concatenate([rates[:1], rates, rates[-1:]])
    return BarMotion(
        times=times,
        positions=positions,
        kept=kept,
        displacement=displacement[kept],
        velocity=0.5 * (sides[kept + 1] + sides[kept]),
        gap=gap,
        multiplier=multiplier,
        active=active,
        kinetic=kinetic,
        elastic=elastic,
        potential=potential,
        mean_displacement=mean,
        mean_velocity=np.concatenate([[velocity_0], np.diff(mean) / dt]),
        effort=effort,
        end_work=driven,
    )
