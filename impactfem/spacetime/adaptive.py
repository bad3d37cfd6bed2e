"""Refinement of space-time meshes until the estimated error of the displacement is small enough."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.fem import dolfinx_mesh
from impactfem.forms.discontinuous import PARALLEL
from impactfem.mesh.unstructured import Triangulation
from impactfem.spacetime.reflections import BarWaves
from impactfem.spacetime.slices import slice_states

MAX_TRIANGLES = 600_000
"""Largest mesh of a refinement."""

_BULK = 0.7  # share of the squared indicator that is marked
_TIMES, _PLACES = 160, 24  # intervals of the grid on which levels are compared
# Limits for the observed ratio of the changes of two levels. Bisecting towards jumps gives ratios
# of 0.6 to 0.75; single ratios scatter, so their mean is taken and small ones are not believed.
_RATIOS = (0.65, 0.85)
_SAFETY = 1.5  # without it the true errors of the test cases were up to 2.8 times the estimate
_MEMORY = 3  # ratios of which the geometric mean is taken


@dataclass(frozen=True)
class Level:
    """One mesh of a refinement.

    Attributes:
        triangles: Their number.
        change: Largest change of the displacement since the level before, relative to the largest
            displacement; None on the first level.
        estimate: Estimated error of the displacement, in the same measure.
    """

    triangles: int
    change: float | None
    estimate: float | None


def refine_until(
    accuracy: float, problems: Iterator[BarWaves], observe: Callable[[str], None]
) -> tuple[BarWaves, list[Level], bool]:
    """Go through ever finer problems until the estimated error is below the accuracy.

    With d_j the largest change of u from level j - 1 to j and q the mean of the last ratios
    d_j / d_{j-1}, the error of level j is estimated as 1.5 times that of a geometric sequence,
    d_j q / (1 - q).

    Args:
        accuracy: Wanted relative error of the displacement.
        problems: Solved problems, each on a finer mesh than the one before.
        observe: Told of every level.

    Returns:
        The last problem, the levels, and whether the accuracy is reached.
    """
    levels: list[Level] = []
    before: Floats | None = None
    changes: list[float] = []
    problem = None
    for problem in problems:
        now = sampled(problem)
        if before is not None:
            largest = float(np.abs(now).max())
            changes.append(float(np.abs(now - before).max()) / (largest if largest > 0.0 else 1.0))
        before = now
        estimate = _estimate(changes) if changes else None
        levels.append(Level(len(problem.field.first), changes[-1] if changes else None, estimate))
        observe(f"level {len(levels)}: {levels[-1].triangles} triangles, error {estimate}")
        if estimate is not None and estimate <= accuracy:
            return problem, levels, True
    if problem is None:
        raise ValueError("no problems")
    return problem, levels, False


def _estimate(changes: list[float]) -> float:
    """Error left after a sequence of changes."""
    steps = [step for step in changes[-_MEMORY - 1 :] if step > 0.0]
    mean = (steps[-1] / steps[0]) ** (1.0 / (len(steps) - 1)) if len(steps) > 1 else _RATIOS[1]
    ratio = min(max(mean, _RATIOS[0]), _RATIOS[1])
    return _SAFETY * changes[-1] * ratio / (1.0 - ratio)


def sampled(problem: BarWaves) -> Floats:
    """U on a grid of times and positions [m], shape (times, places)."""
    times = np.linspace(0.0, problem.field.duration, _TIMES + 1)[1:]
    states = slice_states(
        problem.field, problem.arriving.values, problem.leaving.values, times,
        np.arange(len(times)), np.linspace(0.0, 1.0, _PLACES + 1),
    )  # fmt: skip
    return np.asarray(problem.gap_at(times)[:, None] + states.stretch)


def indicators(problem: BarWaves) -> Floats:
    """Energy that upwinding takes away at the edges of each cell, shape (cells,) [m^2].

    Integrals of |n_t -+ n_x| [w]^2 / 4 over its edges inside the mesh, half of each to either cell.
    Their sum, with the same jumps at the start and where waves are reflected, is exactly what the
    discrete energy loses without contact.
    """
    field = problem.field
    corners, nodes = field.corners, field.nodes
    sides = np.sort(nodes[:, [[1, 2], [0, 2], [0, 1]]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(nodes)), 3)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    same = np.all(sides[order[1:]] == sides[order[:-1]], axis=1)
    one, other = owner[order[:-1][same]], owner[order[1:][same]]
    place = np.empty((int(nodes.max()) + 1, 2))
    place[nodes.ravel()] = corners.reshape(-1, 2)
    ends = place[sides[order[:-1][same]]]
    along = ends[:, 1] - ends[:, 0]
    gauss, weights = np.polynomial.legendre.leggauss(field.degree + 1)
    points = ends[:, :1] + 0.5 * (1.0 + gauss)[:, None] * along[:, None]
    values = np.zeros(len(nodes))
    phi_one, phi_other = field.basis(one, points), field.basis(other, points)
    for wave, speed in ((problem.arriving, -1.0), (problem.leaving, 1.0)):
        # The normal (t, x) times the length of the edge is (along_x, -along_t).
        through = np.abs(along[:, 1] - speed * along[:, 0])
        through[through <= PARALLEL * np.abs(along).max(axis=1)] = 0.0
        jump = np.einsum("epd,ed->ep", phi_one, wave.values[one]) - np.einsum(
            "epd,ed->ep", phi_other, wave.values[other]
        )
        lost = 0.0625 * through * (jump**2 @ weights)
        np.add.at(values, one, lost)
        np.add.at(values, other, lost)
    return values


def refined(problem: BarWaves) -> Triangulation:
    """Bisect the cells that hold most of the indicator, and their neighbours where needed."""
    values = indicators(problem)
    order = np.argsort(-values, kind="stable")
    total = np.cumsum(values[order])
    number = int(np.searchsorted(total, _BULK * total[-1])) + 1
    mesh = problem.field.mesh
    mesh.topology.create_entities(1)
    mesh.topology.create_connectivity(2, 1)
    mesh.topology.create_connectivity(1, 2)
    cells = np.sort(order[:number]).astype(np.int32)
    edges = dolfinx_mesh.compute_incident_entities(mesh.topology, cells, 2, 1)
    finer = fem.refine_edges(mesh, edges.astype(np.int32))
    return Triangulation(finer.geometry.x[:, :2].copy(), fem.cell_nodes(finer).astype(np.int64))
