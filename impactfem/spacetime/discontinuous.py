"""The discontinuous Galerkin method: a bar on any triangulation of space-time."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.log import Progress
from impactfem.mesh.fitted import time_lines
from impactfem.mesh.spacetime import SpaceTimeMesh
from impactfem.mesh.unstructured import Triangulation, gathered, triangulate
from impactfem.result.bar_motion import BarMotion, Effort
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.scene.values import show
from impactfem.spacetime.adaptive import MAX_TRIANGLES, Level, refine_until, refined
from impactfem.spacetime.fitting import fit
from impactfem.spacetime.motion import motion_of_waves
from impactfem.spacetime.reflections import BarWaves

_COARSE = 8  # elements of the meshes on which events are found


@dataclass(frozen=True)
class DiscontinuousSettings:
    """Numbers of the discontinuous Galerkin method.

    Attributes:
        degree: Of the polynomials: 0, 1 or 2.
        elements: Elements along the bar; the triangles have edges of about L / elements.
        fitted: Whether impacts, releases and their characteristics become lines of the mesh.
        accuracy: Wanted error of the displacement relative to its largest value; None: one mesh.
        events: Times of impacts and releases that are known beforehand [s], for a fitted mesh.
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
    events: tuple[float, ...] = ()
    mesh: SpaceTimeMesh | None = None
    window: int | str = 1
    gamma: float = 1.0
    tolerance: float = 1e-10
    max_iterations: int = 200
    every: int = 1


def solve_discontinuous(
    comm: Any, bar: Bar, gravity: PiecewiseConstant, duration: float,
    settings: DiscontinuousSettings, progress: Progress | None = None,
) -> tuple[BarMotion, dict[str, Any]]:  # fmt: skip
    """Solve for a bar that may touch a wall at x = 0, on one mesh, on fitted or on refined ones.

    Args:
        comm: MPI communicator; Gmsh runs on its rank 0, the rest on every rank alike.
        bar: The bar with its initial state.
        gravity: p(t) [m/s^2], towards the wall.
        duration: End of the solution [s].
        settings: Mesh, degree and tolerances.
        progress: Told of every mesh.

    Returns:
        The motion in SI units, the same on every rank, and figures: "triangles"; if fitted "fits",
        "events" (time [s] and kind), "event_shift" [s] and "characteristics"; if an accuracy is
        asked for "estimated_error" and "levels".

    Raises:
        ImpactError: The mesh cannot be made, or the waves do not settle.
    """
    _check(settings)
    run = _Run(comm, bar, gravity, duration / bar.transit_time, settings, progress or Progress())
    levels: list[Level] = []
    if settings.accuracy is None:
        problem = next(run.problems())
        reached = True
    else:
        problem, levels, reached = refine_until(
            settings.accuracy, run.problems(), run.progress.note
        )
    effort = run.effort
    if not reached:
        effort = replace(
            effort,
            converged=False,
            message=f"estimated error {levels[-1].estimate} on {levels[-1].triangles} triangles, "
            f"above accuracy = {settings.accuracy:g}; use fitted = true or a larger accuracy",
        )
    motion = motion_of_waves(problem, effort, bar, gravity, settings.elements, settings.every)
    figures: dict[str, Any] = {"triangles": len(problem.field.first), **run.figures}
    if levels:
        figures |= {
            "estimated_error": levels[-1].estimate,
            "levels": [asdict(level) for level in levels],
        }
    return motion, figures


def switches(bar: Bar, gravity: PiecewiseConstant, duration: float) -> Floats:
    """Times [s] at which gravity, or what drives the far end, changes: lines of meshes."""
    return np.union1d(gravity.times[1:], [stop.after for stop in bar.end_breaks(duration)])


def first_mesh(
    comm: Any, bar: Bar, gravity: PiecewiseConstant, duration: float,
    settings: DiscontinuousSettings,
) -> Triangulation:  # fmt: skip
    """The user's mesh, or an unstructured one with the switches as lines.

    Args:
        comm: MPI communicator; Gmsh runs on its rank 0.
        bar: The bar.
        gravity: p(t) [m/s^2].
        duration: Dimensionless.
        settings: Mesh or elements.
    """
    if settings.mesh is not None:
        return gathered(settings.mesh)
    transit = bar.transit_time
    lines = time_lines(switches(bar, gravity, duration * transit) / transit, duration)
    return triangulate(comm, duration, 1.0 / settings.elements, lines)


@dataclass
class _Run:
    """What all meshes of one solution have in common.

    Attributes:
        duration: Dimensionless.
        effort: Of the last problem solved.
        figures: Of the last fit.
    """

    comm: Any
    bar: Bar
    gravity: PiecewiseConstant
    duration: float
    settings: DiscontinuousSettings
    progress: Progress
    effort: Effort = field(default_factory=Effort)
    figures: dict[str, Any] = field(default_factory=dict)

    def solve(self, mesh: Triangulation) -> BarWaves:
        """Solve on one mesh."""
        settings = self.settings
        problem = BarWaves.of_bar(mesh, settings.degree, self.bar, self.gravity)
        tolerance = settings.tolerance * problem.scale
        if settings.window == "all":
            result = problem.iterate(settings.gamma, tolerance, settings.max_iterations)
        else:
            result = problem.decide(tolerance)
        unknowns = problem.arriving.values.size + problem.leaving.values.size
        self.effort = Effort(
            unknowns, result.iterations, result.set_changes, result.converged, result.message
        )
        return problem

    def problems(self) -> Iterator[BarWaves]:
        """Solved problems on ever finer meshes, as far as these may be made."""
        if self.settings.fitted:
            elements, triangles = self.settings.elements, 0
            while 4 * triangles <= MAX_TRIANGLES:
                problem = self._fitted(elements)
                triangles = len(problem.field.first)
                elements *= 2
                yield problem
            return
        self.progress.note("space-time mesh")
        mesh = first_mesh(self.comm, self.bar, self.gravity, self.duration, self.settings)
        while True:
            problem = self.solve(mesh)
            yield problem
            if len(mesh.cells) > MAX_TRIANGLES:
                return
            mesh = refined(problem)

    def _fitted(self, elements: int) -> BarWaves:
        """A problem on a mesh that is fitted to the events of its motion."""
        sizes = (1.0 / _COARSE, 1.0 / elements) if elements > _COARSE else (1.0 / elements,)
        transit = self.bar.transit_time
        found = fit(
            self.comm, self.bar, self.gravity, self.duration, sizes, self.solve, self.progress.note,
            [time / transit for time in self.settings.events],
        )  # fmt: skip
        self.figures = {
            "fits": found.fits,
            "events": [{"time": e.time * transit, "kind": e.kind} for e in found.events],
            "event_shift": found.shift * transit,
            "characteristics": len(found.fronts),
        }
        return found.problem


def _check(settings: DiscontinuousSettings) -> None:
    """Refuse settings that contradict each other."""
    if settings.degree not in {0, 1, 2}:
        raise SceneError(f"solve.degree = {settings.degree}: choose 0, 1 or 2")
    if settings.window not in {1, "all"}:
        raise SceneError(
            f'solve.window = {show(settings.window)}: the method "dg" has 1 (contact decided edge '
            'by edge) or "all" (one active set)'
        )
    if settings.fitted and settings.mesh is not None:
        raise SceneError(
            "solve.fitted = true makes its own meshes: leave out solve.mesh, or set fitted = false"
        )
    if settings.accuracy is not None and not settings.accuracy > 0.0:
        raise SceneError(f"solve.accuracy = {settings.accuracy}: give a relative error > 0")
