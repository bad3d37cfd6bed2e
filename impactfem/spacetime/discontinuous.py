"""The discontinuous Galerkin method: a bar on any triangulation of space-time."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.log import Progress
from impactfem.mesh.fitted import time_lines
from impactfem.mesh.spacetime import SpaceTimeMesh
from impactfem.mesh.unstructured import Triangulation, gathered, triangulate
from impactfem.result.bar_motion import BarMotion, Effort, kept_levels
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.spacetime.fitting import fit
from impactfem.spacetime.layers import initial_energies
from impactfem.spacetime.reflections import BarWaves
from impactfem.spacetime.slices import slice_states

Floats = NDArray[np.float64]

_SAMPLES = 4096  # pieces on which the energies of the initial state are integrated
_COARSE = 8  # elements of the meshes on which events are found


@dataclass(frozen=True)
class DiscontinuousSettings:
    """Numbers of the discontinuous Galerkin method.

    Attributes:
        degree: Of the polynomials: 0, 1 or 2.
        elements: Elements along the bar; the triangles have edges of about L / elements.
        fitted: Whether impacts, releases and their characteristics become lines of the mesh.
        accuracy: Wanted error of the displacement relative to its largest value; None: one mesh.
        mesh: The user's space-time mesh instead of one made here.
        window: 1: contact is decided edge by edge as the waves arrive; "all": by one primal-dual
            active set for the whole interval.
        gamma: Merit constant of the active set, dimensionless.
        tolerance: Rounding level of the gap relative to the largest displacement expected.
        max_iterations: Limit of active-set iterations.
        every: Keep the fields of every so many time levels.
    """

    degree: int = 1
    elements: int = 40
    fitted: bool = False
    accuracy: float | None = None
    mesh: SpaceTimeMesh | None = None
    window: int | str = 1
    gamma: float = 1.0
    tolerance: float = 1e-10
    max_iterations: int = 200
    every: int = 1


def first_mesh(
    comm: Any, bar: Bar, gravity: PiecewiseConstant, duration: float,
    settings: DiscontinuousSettings,
) -> Triangulation:  # fmt: skip
    """The user's mesh, or an unstructured one with the switches of gravity as lines."""
    if settings.mesh is not None:
        return gathered(settings.mesh)
    end = duration / bar.transit_time
    lines = time_lines(np.array(gravity.times) / bar.transit_time, end)
    return triangulate(comm, end, 1.0 / settings.elements, lines)


def solve_on(
    mesh: Triangulation, bar: Bar, gravity: PiecewiseConstant, settings: DiscontinuousSettings
) -> tuple[BarWaves, Effort]:
    """Solve on one mesh."""
    problem = BarWaves.of_bar(mesh, settings.degree, bar, gravity)
    tolerance = settings.tolerance * problem.scale
    if settings.window == "all":
        result = problem.iterate(settings.gamma, tolerance, settings.max_iterations)
    else:
        result = problem.decide(tolerance)
    unknowns = problem.arriving.values.size + problem.leaving.values.size
    return problem, Effort(
        unknowns, result.iterations, result.set_changes, result.converged, result.message
    )


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
        potential=length * (float(gravity(0.0)) * mean_start + work),
        mean_displacement=mean,
        mean_velocity=np.concatenate([[velocity], slices.mean_velocity / transit]),
        effort=effort,
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
        values.append(np.array([*initial_energies(bar, x), mean]))
    kinetic, elastic, velocity, mean = (4.0 * values[1] - values[0]) / 3.0
    return float(kinetic), float(elastic), float(velocity), float(mean)


def solve_discontinuous(
    comm: Any, bar: Bar, gravity: PiecewiseConstant, duration: float,
    settings: DiscontinuousSettings, progress: Progress | None = None,
) -> tuple[BarMotion, dict[str, Any]]:  # fmt: skip
    """Solve for a bar that may touch a wall at x = 0, on one mesh, fitted or refined.

    Args:
        comm: MPI communicator; Gmsh runs on its rank 0, the rest on every rank alike.
        bar: The bar with its initial state.
        gravity: p(t) [m/s^2], towards the wall.
        duration: End of the solution [s].
        settings: Mesh, degree and tolerances.
        progress: Told of every mesh.

    Returns:
        The motion in SI units, the same on every rank, and figures about how it was found.

    Raises:
        ImpactError: The mesh cannot be made, or the waves do not settle.
    """
    progress = progress or Progress()
    _check(settings)
    if settings.fitted:
        return _fitted(comm, bar, gravity, duration, settings, progress)
    progress.note("space-time mesh")
    mesh = first_mesh(comm, bar, gravity, duration, settings)
    problem, effort = solve_on(mesh, bar, gravity, settings)
    motion = motion_of_waves(problem, effort, bar, gravity, settings.elements, settings.every)
    return motion, {"triangles": len(mesh.cells)}


def _check(settings: DiscontinuousSettings) -> None:
    """Refuse settings that contradict each other."""
    if settings.degree not in {0, 1, 2}:
        raise SceneError(f"solve.degree = {settings.degree}: choose 0, 1 or 2")
    if settings.window not in {1, "all"}:
        raise SceneError(
            f'solve.window = {settings.window!r}: the method "dg" has 1 (contact is decided edge by '
            'edge) or "all" (one active set)'
        )
    if settings.fitted and settings.mesh is not None:
        raise SceneError(
            "solve.fitted = true makes its own meshes: leave out solve.mesh, or set fitted = false"
        )


def _fitted(
    comm: Any, bar: Bar, gravity: PiecewiseConstant, duration: float,
    settings: DiscontinuousSettings, progress: Progress,
) -> tuple[BarMotion, dict[str, Any]]:  # fmt: skip
    """Fit the mesh to the events of the motion."""
    efforts: list[Effort] = []

    def solve(mesh: Triangulation) -> BarWaves:
        problem, effort = solve_on(mesh, bar, gravity, settings)
        efforts.append(effort)
        return problem

    coarse = min(settings.elements, _COARSE)
    sizes = (1.0 / coarse, 1.0 / settings.elements)[coarse == settings.elements :]
    found = fit(
        comm, bar, gravity, duration / bar.transit_time, sizes, solve, progress.note
    )  # fmt: skip
    motion = motion_of_waves(
        found.problem, efforts[-1], bar, gravity, settings.elements, settings.every
    )
    events = [{"time": event.time * bar.transit_time, "kind": event.kind} for event in found.events]
    return motion, {
        "triangles": len(found.mesh.cells),
        "fits": found.fits,
        "events": events,
        "event_shift": found.shift * bar.transit_time,
        "characteristics": len(found.fronts),
    }
