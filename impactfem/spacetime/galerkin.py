"""The founding method: Petrov-Galerkin in space-time with one primal-dual active set."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.contact.active_set import primal_dual_active_set
from impactfem.contact.snes_vi import solve_bounded
from impactfem.fem import dolfinx_fem, ufl
from impactfem.forms.galerkin import galerkin_forms
from impactfem.log import Progress
from impactfem.mesh.spacetime import SpaceTimeMesh
from impactfem.result.bar_motion import BarMotion, Effort
from impactfem.scene import Bar, Formula, PiecewiseConstant
from impactfem.spacetime.layers import motion_of_layers
from impactfem.spacetime.numbering import number
from impactfem.spacetime.system import CoupledSystem, Equations, assemble, paired_load
from impactfem.system.chain import Chain
from impactfem.system.ends import displacement_scale, end_means
from impactfem.system.sections import node_loads, weighted_velocity
from impactfem.system.spring_wall import wall_gap

_INWARDS = 1e-12


@dataclass(frozen=True)
class GalerkinSettings:
    """Numbers of the active-set loop.

    Attributes:
        active_set: "pdas" (coupled primal-dual system) or "snes_vi" (PETSc, bounds on u).
        gamma: Merit constant, dimensionless: merit = gamma (L/c^2) lambda + gap.
        tolerance: Rounding level of the merit relative to the largest displacement expected.
        max_iterations: Limit of linear solves.
    """

    active_set: str = "pdas"
    gamma: float = 1.0
    tolerance: float = 1e-10
    max_iterations: int = 200


@dataclass(frozen=True)
class _Problem:
    """What both solvers of the contact conditions start from."""

    space: SpaceTimeMesh
    bar: Bar
    gravity: PiecewiseConstant
    equations: Equations
    scale: float  # displacement to which tolerances are relative [m]
    every: int


def solve_galerkin(
    space: SpaceTimeMesh,
    bar: Bar,
    gravity: PiecewiseConstant,
    settings: GalerkinSettings,
    progress: Progress | None = None,
    every: int = 1,
    *,
    marks: NDArray[np.int8] | None = None,
) -> BarMotion:
    """Solve equation (3) of the slides for a bar that may touch a wall at x = 0.

    Args:
        space: Dimensionless space-time mesh.
        bar: The bar with its initial state.
        gravity: p(t) [m/s^2], towards the wall.
        settings: Numbers of the active-set loop.
        progress: Told of every iteration.
        every: Keep the fields of every so many layers.
        marks: Sets of the wall's intervals, where they are known (1 active, 0 not, negative: they
            are not), (pairs,); None: all are found. By the coupled system.

    Returns:
        The motion in SI units; the same on every rank. ``effort.converged`` is False if the
        active set did not settle.

    Raises:
        ConvergenceError: A linear system could not be solved.
    """
    equations = _equations(space, bar, gravity)
    numbering = equations.numbering
    travel = bar.length * numbering.points[numbering.fixed, 1]
    times = bar.transit_time * numbering.points[numbering.far, 0]
    scale = displacement_scale(bar, gravity, travel, times)
    problem = _Problem(space, bar, gravity, equations, scale, every)
    if settings.active_set == "snes_vi" and marks is None:
        return _by_snes_vi(problem, settings, progress or Progress())
    return _by_active_set(problem, settings, progress or Progress(), marks)


def _equations(space: SpaceTimeMesh, bar: Bar, gravity: PiecewiseConstant) -> Equations:
    """Assemble the equations on a space-time mesh."""
    mesh = space.mesh
    nodes = dolfinx_fem.functionspace(mesh, ("Lagrange", 1))
    wall, entity_maps = fem.facet_submesh(mesh, space.facets("wall"))
    multipliers = dolfinx_fem.functionspace(wall, ("DG", 0))
    numbering = number(space, nodes, multipliers, clamped=bar.far_end == "clamped")
    forms = galerkin_forms(
        nodes,
        multipliers,
        ufl.Measure("ds", domain=mesh, subdomain_data=space.facet_tags),
        space.layout.tags,
        weights=_cell_weights(space, bar),
        velocity=bar.initial_velocity if numbering.grid is None else Formula("0"),
        velocity_scale=bar.transit_time,
        length=bar.length,
        gravity=_cell_means(mesh, gravity, bar.transit_time, layered=numbering.grid is not None),
    )
    x = bar.places(bar.length * numbering.points[numbering.fixed, 1])
    given = bar.initial_displacement(x=x) + np.zeros_like(x)
    far = numbering.far
    if bar.far_end == "clamped":
        held, times_of = np.isin(numbering.fixed, far), bar.transit_time * numbering.points[:, 0]
        given[held] += bar.far_end_displacement(t=times_of[numbering.fixed[held]])
    equations = assemble(mesh.comm, forms, entity_maps, numbering, given, (nodes, multipliers))
    spring = bar.wall_spring * bar.length / bar.wave_speed**2
    equations, load = replace(equations, spring=spring), equations.load.copy()
    if bar.is_driven and bar.far_end != "clamped":  # half of each interval to both of its nodes
        dt = np.diff(numbering.points[far, 0])
        levels = bar.transit_time * numbering.points[far, 0]
        half = 0.5 * bar.transit_time * dt * end_means(bar, levels)
        load[far[:-1]] += half
        load[far[1:]] += half
    times, positions = space.layout.times, space.layout.nodes
    if numbering.grid is None or times is None or positions is None:
        return replace(equations, load=load)
    load[numbering.grid[:-1]] += _row_loads(bar, gravity, times, bar.length * positions)
    return replace(equations, load=load)


def _row_loads(bar: Bar, gravity: PiecewiseConstant, times: Floats, travel: Floats) -> Floats:
    """Loads [m] of the test nodes before t = T on layers, shape (layers, elements + 1).

    Those of gravity and of a load along the bar by the trapezoidal rule in x, exact means in time.
    The P1 hats of right triangles would give a node at the wall 1/3 of one layer and 2/3 of the
    other, and at t = 0 a third too much or too little. At t = 0 the initial velocity.

    Args:
        bar: The bar.
        gravity: p(t) [m/s^2].
        times: Dimensionless levels, (layers + 1,).
        travel: Nodes as in `Bar.places`.
    """
    chain, transit, levels = Chain.of_bar(bar, travel), bar.transit_time, bar.transit_time * times
    dt = np.diff(levels)
    half = -0.5 * np.outer(gravity.integral(levels[:-1], levels[1:]), chain.mass)
    if bar.is_loaded:
        half += 0.5 * dt[:, None] * node_loads(bar, levels, travel)
    found: Floats = (
        transit / bar.length * (half + np.concatenate([np.zeros_like(half[:1]), half[:-1]]))
    )
    found[0] += transit / bar.length * weighted_velocity(bar, travel)
    return found


def _cell_weights(space: SpaceTimeMesh, bar: Bar) -> Any:
    """Impedance of each cell over the mean, as a P0 function."""
    mesh = space.mesh
    found = dolfinx_fem.Function(dolfinx_fem.functionspace(mesh, ("DG", 0)))
    found.x.array[:] = 1.0
    if space.layout.nodes is not None:
        nodes = space.layout.nodes
        middles = mesh.geometry.x[fem.cell_nodes(mesh)][:, :, 1].mean(axis=1)
        weights = bar.weights(bar.length * nodes)
        found.x.array[:] = weights[np.searchsorted(nodes, middles) - 1]
    return found


def _cell_means(
    mesh: Any, gravity: PiecewiseConstant, transit_time: float, *, layered: bool
) -> Any:
    """P (L/c)^2 averaged over each cell's span of time, as a P0 function; 0 on layers.

    A jump of p inside a cell is integrated without quadrature error this way.
    """
    means = dolfinx_fem.Function(dolfinx_fem.functionspace(mesh, ("DG", 0)))
    if layered:
        return means
    t = transit_time * mesh.geometry.x[fem.cell_nodes(mesh)][:, :, 0]
    first, last = t.min(axis=1), t.max(axis=1)
    values = transit_time**2 * gravity.integral(first, last) / (last - first)
    means.x.array[:] = values  # one dof per cell, numbered as the cells
    return means


def _by_active_set(
    problem: _Problem, settings: GalerkinSettings, progress: Progress,
    marks: NDArray[np.int8] | None = None,
) -> BarMotion:  # fmt: skip
    """Coupled primal-dual system, one active set for the whole interval."""
    equations, pairs = problem.equations, len(problem.equations.numbering.multipliers)
    system, bar = CoupledSystem(equations), problem.bar
    start, metres = float(bar.initial_displacement(x=0.0)), bar.length / bar.wave_speed**2

    def solve(active: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        known = active if marks is None else np.where(marks < 0, active, marks == 1)
        u, multiplier = system.solve(known)
        return wall_gap(bar, np.append(start, u), multiplier / metres), multiplier

    try:
        result = primal_dual_active_set(
            solve,
            pairs,
            gamma=settings.gamma,
            tolerance=settings.tolerance * problem.scale,
            max_iterations=settings.max_iterations,
            keep=Effort.KEPT,
            observe=lambda k, changes: progress.note(f"active set {k}: {changes} changes"),
            start=None if marks is None else marks == 1,
        )
        u, unknowns = system.displacement(), system.num_unknowns
    finally:
        system.destroy()
    effort = Effort(
        unknowns, result.iterations, result.set_changes, result.converged, result.message,
        iterates=result.iterates,
    )  # fmt: skip
    return _motion(problem, u, result.multiplier, result.active, effort)


def _by_snes_vi(problem: _Problem, settings: GalerkinSettings, progress: Progress) -> BarMotion:
    """The same equations as a variational inequality: u_m >= 0 _|_ residual of test node m-1.

    The multiplier is then a force on test nodes, not on intervals: where an active interval ends
    its half force on the next test node is missing, so the answers differ at release.
    """
    equations = problem.equations
    numbering, comm = equations.numbering, equations.comm
    size, ranges = equations.num_nodes, equations.node_ranges
    local = int(ranges[comm.rank + 1] - ranges[comm.rank])
    test, node, value = equations.stiffness
    rows, columns, values = numbering.row[test], node, value
    if comm.rank == 0:
        ones = np.ones(len(numbering.fixed))
        rows = np.concatenate([rows, numbering.fixed])
        columns = np.concatenate([columns, numbering.fixed])
        values = np.concatenate([values, ones])
    matrix = fem.sparse_matrix(comm, local, size)
    fem.set_entries(matrix, rows, columns, values, add=True)
    load, solution = matrix.createVecLeft(), matrix.createVecRight()
    first = int(ranges[comm.rank])
    load.array[:] = paired_load(equations)[first : first + local]
    solution.set(0.0)
    progress.note("PETSc SNES vinewtonrsls")
    bounded = numbering.wall[1:]
    result = solve_bounded(
        matrix, load, solution, bounded.astype(np.int32),
        tolerance=settings.tolerance * problem.scale, max_iterations=settings.max_iterations,
    )  # fmt: skip
    residual = load.duplicate()
    matrix.mult(solution, residual)
    residual.axpy(-1.0, load)
    u = fem.gather(comm, solution.array.copy())
    force = fem.gather(comm, residual.array.copy())[bounded]
    for item in (matrix, load, solution, residual):
        item.destroy()
    # Slot m holds the residual of test node m-1, whose hat covers half of two intervals
    # (the first one half of one).
    t = numbering.points[numbering.wall, 0]
    weight = 0.5 * (t[1:] - np.concatenate([[t[0]], t[:-2]]))
    multiplier = -force / weight
    active = multiplier < -settings.tolerance * problem.scale
    effort = Effort(size, result.iterations, (), result.converged, result.message)
    # Its multiplier is a force on nodes, no mean of a layer.
    return _motion(problem, u, multiplier, active, effort, waves=False)


def _motion(
    problem: _Problem, u: Floats, multiplier: Floats, active: NDArray[np.bool_], effort: Effort,
    *, waves: bool = True,
) -> BarMotion:  # fmt: skip
    """Bring the solution to SI units and a grid of layers."""
    numbering, layout = problem.equations.numbering, problem.space.layout
    waves = waves and numbering.grid is not None
    if numbering.grid is not None and layout.times is not None and layout.nodes is not None:
        times, positions, displacement = layout.times, layout.nodes, u[numbering.grid]
    else:
        times = numbering.points[numbering.wall, 0]
        start = numbering.points[numbering.fixed]
        positions = np.unique(start[start[:, 0] < 0.5 * times[-1], 1])
        displacement = _sample(problem.space, numbering.points, u, times, positions)
    bar = problem.bar
    return motion_of_layers(
        bar,
        problem.gravity,
        bar.transit_time * times,
        Chain.of_bar(bar, bar.length * positions),
        displacement,
        multiplier * bar.wave_speed**2 / bar.length,
        active,
        effort,
        problem.every,
        waves=waves,
    )


def _sample(
    space: SpaceTimeMesh, points: Floats, u: Floats, times: Floats, positions: Floats
) -> Floats:
    """Evaluate the P1 field of a mesh without layers on a grid; same on every rank."""
    from matplotlib.tri import LinearTriInterpolator, Triangulation  # noqa: PLC0415  (rarely needed)

    mesh = space.mesh
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    nodes = dolfinx_fem.functionspace(mesh, ("Lagrange", 1))
    local = nodes.dofmap.list[:owned]
    cells = fem.gather(
        mesh.comm, nodes.dofmap.index_map.local_to_global(local.ravel().astype(np.int32))
    ).reshape(-1, 3)
    field = LinearTriInterpolator(Triangulation(points[:, 0], points[:, 1], cells), u)
    # Point location fails on the hull itself: move the sides inwards by less than any digit kept.
    inside_t = np.clip(times, _INWARDS * times[-1], (1.0 - _INWARDS) * times[-1])
    inside_x = np.clip(positions, _INWARDS, 1.0 - _INWARDS)
    grid_t, grid_x = np.meshgrid(inside_t, inside_x, indexing="ij")
    return np.asarray(field(grid_t, grid_x).filled(np.nan), dtype=np.float64)
