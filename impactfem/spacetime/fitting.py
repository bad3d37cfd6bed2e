"""Meshes fitted to the motion: impacts and releases are found, and their characteristics drawn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.mesh.fitted import Front, distinct, fitted_lines
from impactfem.mesh.unstructured import Triangulation, triangulate
from impactfem.scene import Bar, Formula, PiecewiseConstant
from impactfem.scene.grammar import NUMPY_FUNCTIONS
from impactfem.spacetime.events import Event, wall_events
from impactfem.spacetime.reflections import BarWaves

_STILL = 1e-10  # dimensionless distance of an event from its characteristic in the mesh
_SAMPLES = 4001
_BISECTIONS = 60
_REPEATS = 3  # fits of one event before its distance is taken for the error of the method
_SPARE_FITS = 30
_LEAK = 0.5  # events are trusted until so long before the first unfitted wave returns


@dataclass
class Fit:
    """A mesh fitted to the events of its own solution.

    Attributes:
        problem: Solved on the last mesh.
        mesh: That mesh.
        fronts: Where its characteristics start.
        events: Events of that solution.
        fits: Meshes that were made.
        shift: Largest dimensionless distance of an event from the lines of the mesh.
    """

    problem: BarWaves
    mesh: Triangulation
    fronts: list[Front]
    events: list[Event] = field(default_factory=list)
    fits: int = 0
    shift: float = 0.0


def fit(
    comm: Any, bar: Bar, gravity: PiecewiseConstant, duration: float, sizes: tuple[float, ...],
    solve: Callable[[Triangulation], BarWaves], observe: Callable[[str], None],
    expected: Sequence[float] = (),
) -> Fit:  # fmt: skip
    """Solve, find the events, draw their characteristics, and solve again until nothing moves.

    The first event that is not on a line of the mesh is known exactly, and so are those in the
    2 L/c after it, until its wave returns: all of them become lines of the next mesh. For data
    that the polynomials cannot represent the events move with the mesh; they are followed a few
    times and what is left is reported as ``shift``.

    Args:
        comm: MPI communicator for Gmsh.
        bar: The bar.
        gravity: p(t).
        duration: Dimensionless duration.
        sizes: Dimensionless sizes of the triangles: a coarse one to find the events, a fine one.
        solve: Solves on a mesh.
        observe: Told of every fit.
        expected: Dimensionless times of events that are known beforehand; with all of them the
            first mesh is the last. What the solution on it does not confirm is found anew.

    Raises:
        ConvergenceError: New events keep appearing.
    """
    switches = np.array(gravity.times[1:]) / bar.transit_time
    stops = [stop.after / bar.transit_time for stop in bar.end_breaks(duration * bar.transit_time)]
    given = initial_fronts(bar, switches)
    given += [Front(0.0, 1.0, -1)] if bar.is_driven and bar.far_end == "free" else []
    given += [Front(stop, 1.0, -1) for stop in stops]
    events: list[Event] = []
    places, fits = list(expected), 0
    for size in sizes[-1:] if places else sizes:
        slack, last, repeats = _STILL, -1, 0
        for _ in range(int(duration) + _SPARE_FITS):
            fronts = distinct(given + [Front(time, 0.0) for time in places])
            lines = fitted_lines(fronts, np.union1d(switches, stops), duration)
            mesh = triangulate(comm, duration, size, lines)
            problem = solve(mesh)
            fits += 1
            events = wall_events(problem, switches)
            away = [_distance(event.time, fronts) for event in events]
            observe(f"fit {fits}: {len(events)} events")
            moved = next((k for k, d in enumerate(away) if d > slack), None)
            if moved is None:
                break
            repeats = repeats + 1 if moved == last else 0
            if repeats >= _REPEATS:
                slack = 2.0 * away[moved]
            last = moved
            until = events[moved].time + 2.0 - _LEAK
            events = [event for event in events if event.time < until]
            places = [event.time for event in events]
        else:
            raise ConvergenceError(
                f"the events at the wall do not stand still after {fits} fitted meshes (near "
                f"t = {events[-1].time * bar.transit_time:.6g} s); use fitted = false"
            )
    return Fit(problem, mesh, fronts, events, fits, max(away, default=0.0))


def _distance(time: float, fronts: list[Front]) -> float:
    """Distance of a wall time from the nearest characteristic that has started."""
    begun = [front for front in fronts if front.time <= time + 1e-6]
    if not begun:
        return 2.0
    apart = np.abs(np.array([front.phase for front in begun]) - time % 2.0)
    return float(np.minimum(apart, 2.0 - apart).min())


def initial_fronts(bar: Bar, switches: Floats) -> list[Front]:
    """Characteristics that start in the data: from corners, kinks of formulas, and held ends."""
    fronts = []
    uniform = bar.velocity.is_constant and bar.displacement.is_constant
    clamped = bar.far_end == "clamped"
    if not uniform:
        fronts.append(Front(0.0, 0.0))
    if clamped or not uniform:
        fronts.append(Front(0.0, 1.0, -1))
    if clamped:
        fronts += [Front(float(t), 1.0, -1) for t in switches]
    for x in np.union1d(kinks(bar.velocity, bar.length), kinks(bar.displacement, bar.length)):
        fronts += [Front(0.0, float(x), -1), Front(0.0, float(x), 1)]
    return fronts


def kinks(formula: Formula, length: float) -> Floats:
    """Places in (0, 1) x/L at which `where`, `abs`, `min` or `max` of a formula change branch.

    Args:
        formula: Of x [m].
        length: L [m].
    """
    recorded: list[Floats] = []

    def noting(name: str) -> Callable[..., Any]:
        def function(*values: Any) -> Any:
            difference = values[0] - values[1] if len(values) == 2 else values[0]
            recorded.append(np.asarray(difference, dtype=np.float64))
            return NUMPY_FUNCTIONS[name](*values)

        return function

    names = ("abs", "min", "max", "lt", "le", "gt", "ge")
    functions = {**NUMPY_FUNCTIONS, **{name: noting(name) for name in names}}

    def branches(x: Floats) -> Floats:
        recorded.clear()
        with np.errstate(all="ignore"):
            formula.apply(functions, x=length * x)
        return np.array([np.broadcast_to(values, x.shape) for values in recorded])

    x = np.linspace(0.0, 1.0, _SAMPLES)
    signs = np.sign(branches(x))
    if signs.size == 0:
        return np.empty(0)
    found = [x[1:-1][np.any((signs[:, 1:-1] == 0) & (signs[:, :-2] * signs[:, 2:] <= 0), axis=0)]]
    for k, at in zip(*np.nonzero(signs[:, 1:] * signs[:, :-1] < 0), strict=True):
        low, high = x[at], x[at + 1]
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if np.sign(branches(np.array([middle]))[k, 0]) == signs[k, at]:
                low = middle
            else:
                high = middle
        found.append(np.array([high]))
    return np.unique(np.concatenate(found))
