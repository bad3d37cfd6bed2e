"""The motion of a bar, in SI units, from its waves on a triangulation of space-time."""

import numpy as np

from impactfem.result.bar_motion import BarMotion, Effort, kept_levels
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.spacetime.layers import initial_energies
from impactfem.spacetime.reflections import BarWaves
from impactfem.spacetime.slices import slice_states
from impactfem.system.chain import Chain

_SAMPLES = 4096  # pieces on which the energies of the initial state are integrated


def motion_of_waves(
    problem: BarWaves,
    effort: Effort,
    bar: Bar,
    gravity: PiecewiseConstant,
    elements: int,
    every: int,
) -> BarMotion:
    """Bring a solution to SI units, at the times of the wall's nodes and at uniform positions.

    u(t, x) is the gap plus the integral of u_x along the slice; the energies are integrals along
    slices. Both are exact for the discrete fields.
    """
    wall, transit, length = problem.wall, bar.transit_time, bar.length
    layers = len(wall.cells)
    kept = kept_levels(layers, every)
    positions = np.linspace(0.0, 1.0, elements + 1)
    slices = slice_states(
        problem.field, problem.arriving.values, problem.leaving.values, wall.end, kept[1:] - 1,
        positions,
    )  # fmt: skip
    times = transit * np.concatenate([[0.0], wall.end])
    gap = np.concatenate([[problem.gap], problem.gaps])
    x = length * positions
    start = bar.initial_displacement(x=x) + np.zeros_like(x)
    kinetic, elastic, velocity, mean_start = _start(bar)
    mean = np.concatenate([[mean_start], problem.gaps + slices.mean_stretch])
    load = gravity.integral(times[:-1], times[1:]) / np.diff(times)
    work = np.concatenate([[0.0], np.cumsum(load * np.diff(mean))])
    driven = problem.end_work(times / transit) if bar.is_driven else np.zeros_like(times)
    rate = length / transit**2  # [m^2] per rho A and dimensionless x -> [m^3/s^2]
    return BarMotion(
        times=times,
        positions=x,
        kept=kept,
        displacement=np.concatenate([start[None], gap[kept[1:], None] + slices.stretch]),
        velocity=np.concatenate(
            [(bar.initial_velocity(x=x) + np.zeros_like(x))[None], slices.velocity / transit]
        ),
        gap=gap,
        multiplier=problem.multiplier * bar.wave_speed**2 / length,
        active=problem.active.copy(),
        kinetic=np.concatenate([[kinetic], rate * slices.kinetic]),
        elastic=np.concatenate([[elastic], rate * slices.elastic]),
        potential=length * (float(gravity(0.0)) * mean_start + work) - rate * driven,
        mean_displacement=mean,
        mean_velocity=np.concatenate([[velocity], slices.mean_velocity / transit]),
        effort=effort,
        end_work=rate * driven,
    )


def _start(bar: Bar) -> tuple[float, float, float, float]:
    """Kinetic and elastic energy per rho A, mean velocity and mean displacement at t = 0.

    Extrapolated from two uniform divisions, so that smooth data have an error of fourth order.
    """
    values = []
    for pieces in (_SAMPLES // 2, _SAMPLES):
        x = np.linspace(0.0, bar.length, pieces + 1)
        u = bar.initial_displacement(x=x) + np.zeros_like(x)
        mean = float(np.trapezoid(u, x)) / bar.length
        values.append(np.array([*initial_energies(bar, Chain.of_bar(bar, x)), mean]))
    kinetic, elastic, velocity, mean = (4.0 * values[1] - values[0]) / 3.0
    return float(kinetic), float(elastic), float(velocity), float(mean)
