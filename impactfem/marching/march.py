"""The time loop of bars: schemes by name, windows of layers, and what is kept of the motion."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.contact.active_set import ActiveSetResult, primal_dual_active_set
from impactfem.marching import kernels, negative_control, wave_kernels
from impactfem.marching.schemes import BarScheme
from impactfem.marching.waves import Waves
from impactfem.result.bar_motion import BarMotion, Effort, kept_levels
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.system.chain import Chain
from impactfem.system.ends import displacement_scale, end_pushes, end_ways
from impactfem.system.fronts import element_speeds, starts_as_waves
from impactfem.system.sections import node_loads, row_loads
from impactfem.system.spring_wall import wall_energy, wall_gap
from impactfem.system.works import works

_ONE_STEP: Mapping[Any, Any] = {"newmark": negative_control.newmark}
"""Kernels that advance (u, v), by name; schemes of users bring theirs."""


@dataclass(frozen=True)
class Marching:
    """Numbers of a march.

    Attributes:
        dt: Time step [s].
        layers: Number of layers.
        window: Layers solved by one active-set loop (two_step schemes); 1 decides layer by layer.
        gamma: Dimensionless merit constant of the active set.
        tolerance: Relative rounding level of the merit.
        max_iterations: Limit of active-set iterations of a window.
        every: Keep the fields of every so many levels.
        marks: Sets of the layers, where they are known (`kernels.DECIDE`: they are not), (layers,);
            None: all are found, window by window. For galerkin.
    """

    dt: float
    layers: int
    window: int = 1
    gamma: float = 1.0
    tolerance: float = 1e-13
    max_iterations: int = 200
    every: int = 1
    marks: NDArray[np.int8] | None = None

    @property
    def times(self) -> Floats:
        """Levels [s], (layers + 1,)."""
        return np.asarray(self.dt * np.arange(self.layers + 1, dtype=np.float64))


class _Record:
    """Arrays that the kernels fill."""

    def __init__(self, chain: Chain, numbers: Marching) -> None:
        levels, nodes = numbers.layers + 1, len(chain.positions)
        self.kept = kept_levels(numbers.layers, numbers.every)
        self.displacement = np.empty((len(self.kept), nodes))
        self.rate = np.empty((len(self.kept), nodes))
        self.gap = np.empty(levels)
        self.far = np.empty((levels, 2))
        self.multiplier = np.empty(numbers.layers)
        self.kinetic = np.empty(levels)
        self.elastic = np.empty(levels)
        self.mean = np.empty(levels)
        self.work = np.zeros(levels)
        self.momentum = np.empty(levels)
        mass, u, v = chain.mass, chain.displacement, chain.velocity
        self.displacement[0], self.rate[0] = u, v
        self.gap[0], self.far[0] = u[0], u[-2:]
        self.kinetic[0] = 0.5 * mass @ v**2
        self.elastic[0] = 0.5 * chain.stiffness @ np.diff(u) ** 2
        self.mean[0] = mass @ u / mass.sum()
        self.momentum[0] = mass @ v / mass.sum()


def march(
    bar: Bar, gravity: PiecewiseConstant, travel: Floats, scheme: BarScheme, numbers: Marching
) -> BarMotion:
    """March a bar through its layers.

    Args:
        bar: The bar.
        gravity: p(t) [m/s^2].
        travel: Nodes as in `Bar.places`: of uniform bars their positions [m], shape (nodes,).
        scheme: Time scheme.
        numbers: Steps, window and tolerances.

    Returns:
        The motion; time and memory grow linearly with nodes times layers.
    """
    chain = Chain.of_bar(bar, travel)
    times = numbers.times
    means = gravity.integral(times[:-1], times[1:]) / numbers.dt
    record = _Record(chain, numbers)
    scale = displacement_scale(bar, gravity, travel, times)
    tolerance = numbers.tolerance * scale
    driven = np.zeros_like(times)
    if scheme.kernel == "two_step":
        effort, potential, driven = _two_step(chain, numbers, means, tolerance, record, bar)
    else:
        if scheme.kernel == "conserving":
            effort, driven = _waves(bar, gravity, chain.positions, numbers, means, record)
        else:
            kernel = _ONE_STEP.get(scheme.kernel, scheme.kernel)
            effort = _one_step(kernel, chain, numbers, means, tolerance, record)
        # Work of gravity: load of the layer times its path, as the schemes have it.
        work = np.cumsum(means * np.diff(record.mean))
        potential = bar.length * (means[0] * record.mean[0] + np.concatenate([[0.0], work]))
    return BarMotion(
        times=times,
        positions=chain.positions,
        kept=record.kept,
        displacement=record.displacement,
        velocity=record.rate,
        gap=record.gap,
        multiplier=record.multiplier,
        active=record.multiplier < 0.0,
        kinetic=record.kinetic,
        elastic=record.elastic,
        potential=potential - driven - record.work,
        mean_displacement=record.mean,
        mean_velocity=record.momentum,
        effort=effort,
        end_work=driven + record.work,
    )


def _one_step(
    kernel: Any, chain: Chain, numbers: Marching, means: Floats, tolerance: float, record: _Record
) -> Effort:
    """A scheme that advances (u, v); gravity is that of the layer."""
    u, v = chain.displacement.copy(), chain.velocity.copy()
    kernel(
        chain.mass, chain.stiffness, numbers.dt, chain.clamped, means, tolerance, u, v,
        numbers.layers, record.kept, record.displacement, record.rate, record.gap,
        record.multiplier, record.kinetic, record.elastic, record.mean, record.momentum,
    )  # fmt: skip
    unknowns = len(chain.positions) * numbers.layers
    return Effort(unknowns, 1, (), True, "decided in each time step")


def _waves(
    bar: Bar, gravity: PiecewiseConstant, positions: Floats, numbers: Marching, means: Floats,
    record: _Record,
) -> tuple[Effort, Floats]:  # fmt: skip
    """The scheme that follows waves, in layers of at most a transit; and the work at its end."""
    parts = max(1, math.ceil(numbers.dt / bar.transit_time - 1e-9))
    layers, c = parts * numbers.layers, bar.wave_speed
    if parts > 1 and not gravity.is_constant:  # one load in all parts, as the energy counts it
        gravity = PiecewiseConstant(tuple(numbers.dt * np.arange(numbers.layers)), tuple(means))
    waves = Waves.of_bar(bar, gravity, numbers.dt / parts, layers)
    wave_kernels.conserving(
        *waves.arguments, positions / c, layers, parts,
        record.gap, record.multiplier, record.kinetic, record.elastic, record.mean,
        record.momentum, record.kept, record.displacement, record.rate,
    )  # fmt: skip
    record.multiplier *= c
    record.kinetic *= c
    record.elastic *= c
    work = np.zeros(numbers.layers + 1)
    if bar.is_driven:
        work = c * waves.end_work(numbers.times)
    return Effort(2 * layers, 1, (), True, "closed form in each time step"), work


def _two_step(
    chain: Chain, numbers: Marching, means: Floats, tolerance: float, record: _Record, bar: Bar,
) -> tuple[Effort, Floats, Floats]:  # fmt: skip
    """The Petrov-Galerkin recursion, window by window; potential of gravity, work at the end."""
    # A test function of row m spans the two layers beside it.
    loads = row_loads(means[:, None], len(means))[:, 0]
    times = numbers.times
    pushes, ways = end_pushes(bar, times), end_ways(bar, times)
    forces = node_loads(bar, times, chain.travel)
    levels = starts_as_waves(bar, chain, times)
    speeds = element_speeds(bar, chain) if levels else np.zeros(0)
    if levels:
        record.kinetic[0] = 0.5 * chain.element_mass @ speeds**2
    state = _State(chain.displacement.copy(), np.zeros_like(chain.displacement), 0.0, speeds.copy())

    def sweep(start: "_State", first: int, marks: NDArray[np.int8]) -> "_State":
        end = start.copy()
        end.push = kernels.two_step(
            chain.mass, chain.stiffness, chain.element_mass, bar.wall_spring, numbers.dt,
            chain.clamped, chain.velocity, loads, forces, pushes, ways,
            bar.end_damping / bar.section, end.now, end.step, end.push, end.speeds,
            first, first + len(marks), marks, record.kept, record.displacement, record.rate,
            record.gap, record.far, record.multiplier, record.kinetic, record.elastic, record.mean,
            record.work,
        )  # fmt: skip
        return end

    worst: ActiveSetResult | None = None
    if numbers.window == 1 or numbers.marks is not None:
        decided = np.full(numbers.layers, kernels.DECIDE, dtype=np.int8)
        sweep(state, 0, decided if numbers.marks is None else numbers.marks)
    else:
        # The multiplier in metres, so that gamma is dimensionless.
        metres = bar.length / bar.wave_speed**2
        for first in range(0, numbers.layers, numbers.window):
            size = min(numbers.window, numbers.layers - first)
            result, state = _window(
                sweep, state, first, size, metres, numbers, tolerance, record, bar
            )
            if worst is None or not result.converged or result.iterations > worst.iterations:
                worst = result
            if not result.converged:
                _forget(record, first + size)
                break
    # Beyond the stability limit numbers overflow; what is not finite is reported by the caller.
    with np.errstate(over="ignore", invalid="ignore"):
        record.momentum[1:] = np.diff(record.mean) / numbers.dt
        record.elastic += wall_energy(bar, record.gap, levels=levels)
        potential, driven = works(
            bar, chain, times, means, record.mean, record.far, forces, levels=levels
        )
    unknowns = len(chain.positions) * numbers.layers
    if worst is None:
        return Effort(unknowns, 1, (), True, "decided in each time step"), potential, driven
    return (
        Effort(
            unknowns,
            worst.iterations,
            worst.set_changes,
            worst.converged,
            worst.message,
            iterates=worst.iterates,
        ),
        potential,
        driven,
    )


@dataclass
class _State:
    """Where the recursion stands: the level, the step to it, the last multiplier, speeds."""

    now: Floats
    step: Floats
    push: float
    speeds: Floats

    def copy(self) -> "_State":
        return _State(self.now.copy(), self.step.copy(), self.push, self.speeds.copy())


def _window(
    sweep: Callable[[_State, int, NDArray[np.int8]], _State], state: _State, first: int,
    size: int, metres: float, numbers: Marching, tolerance: float, record: _Record, bar: Bar,
) -> tuple[ActiveSetResult, _State]:  # fmt: skip
    """Active-set loop over some layers; each linear solve is one sweep."""
    end = state
    layers = slice(first, first + size)

    def solve(active: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        nonlocal end
        end = sweep(state, first, active.astype(np.int8))
        multiplier = record.multiplier[layers]
        gap = wall_gap(bar, record.gap[first : first + size + 1], multiplier)
        return gap, metres * multiplier

    result = primal_dual_active_set(
        solve,
        size,
        gamma=numbers.gamma,
        tolerance=tolerance,
        max_iterations=numbers.max_iterations,
        keep=Effort.KEPT if size == numbers.layers else 0,
    )
    return result, end


def _forget(record: _Record, level: int) -> None:
    """Mark what comes after a window that did not settle as not computed."""
    for values in (record.gap, record.kinetic, record.elastic, record.mean):
        values[level + 1 :] = np.nan
    record.multiplier[level:] = np.nan
    record.displacement[record.kept > level] = np.nan
    record.rate[record.kept > level] = np.nan
