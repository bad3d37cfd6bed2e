"""Run one bar as planned, by each method; heavy libraries are loaded when needed."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import MeshError, SceneError
from impactfem.log import Progress
from impactfem.marching.schemes import SCHEMES
from impactfem.methods import METHODS
from impactfem.planning import BarNumbers, Plan
from impactfem.reference.bar import (
    contact_figures,
    exact_bar,
    exact_curves,
    exact_motion,
    measure,
)
from impactfem.reference.rounding import rounding_of_exact
from impactfem.result import BarMotion
from impactfem.result.bar_row_motion import RowMotion
from impactfem.runs.bar_estimate import estimate_of_bar
from impactfem.runs.bar_run import Measured, run_of_bars
from impactfem.runs.forces import bar_window
from impactfem.runs.line_probes import check_bar_probes, every_level, thinned
from impactfem.runs.run import Checkpointing, Cost, Run
from impactfem.scene import Scene
from impactfem.sizing import DEFAULT_ELEMENTS

if TYPE_CHECKING:
    from impactfem.mesh.spacetime import SpaceTimeMesh
    from impactfem.spacetime.discontinuous import DiscontinuousSettings
    from impactfem.spacetime.galerkin import GalerkinSettings


def _solve_exact(scene: Scene, chosen: Plan[BarNumbers], progress: Progress) -> BarMotion:
    numbers = chosen.numbers
    progress.step("following the characteristics")
    bar = scene.bar
    times = np.linspace(0.0, scene.duration, (numbers.layers or 1) + 1)
    positions = np.linspace(0.0, bar.length, (numbers.elements or DEFAULT_ELEMENTS) + 1)
    exact = exact_bar(scene)
    return exact_motion(exact, bar, scene.axial_gravity, times, positions, scene.output.stride)


def _solve_marching(scene: Scene, chosen: Plan[BarNumbers], progress: Progress) -> BarMotion:
    numbers = chosen.numbers
    progress.step("loading the time loops (compiled at their first use)")
    from impactfem.marching.march import Marching, march  # noqa: PLC0415  (loads Numba)

    bar, scheme = scene.bar, SCHEMES[chosen.method]
    if scene.mesh_path is not None:
        positions, dt, layers = layers_of_mesh(scene, chosen.method)
    elif numbers.elements and numbers.layers and numbers.dt:
        positions = np.linspace(0.0, bar.length, numbers.elements + 1)
        dt, layers = numbers.dt, numbers.layers
    else:
        raise SceneError("solve: the plan has neither elements nor a mesh; give solve.elements")
    progress.step("marching")
    marching = Marching(
        dt,
        layers,
        window=layers if numbers.window == "all" else int(numbers.window),
        gamma=numbers.gamma,
        tolerance=numbers.tolerance,
        max_iterations=numbers.max_iterations,
        every=scene.output.stride,
    )
    return march(bar, scene.axial_gravity, positions, scheme, marching)


def layers_of_mesh(scene: Scene, method: str) -> tuple[Floats, float, int]:
    """Node positions [m], time step [s] and layers of a user's mesh, if a sweep can use it.

    Raises:
        MeshError: The mesh has no layers of equal height, or they are beyond the stability limit.
    """
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415
    from impactfem.system.chain import Chain  # noqa: PLC0415

    bar, path = scene.bar, scene.mesh_path
    if path is None:
        raise MeshError("solve.mesh: no mesh file is given")
    space = read_mesh(MPI.COMM_WORLD, path, bar.length, scene.duration, bar.wave_speed)
    times, nodes = space.layout.times, space.layout.nodes
    remedy = 'use method = "dg", which works on any triangles'
    if times is None or nodes is None:
        raise MeshError(
            f"mesh file {path}: its nodes form no time slabs, {method} needs them; {remedy}"
        )
    steps = bar.transit_time * np.diff(times)
    if np.ptp(steps) > 1e-9 * steps.max():
        raise MeshError(
            f"mesh file {path}: time slabs are {steps.min():g} to {steps.max():g} s high, {method} "
            f"needs equal ones; {remedy}"
        )
    limit = SCHEMES[method].stable_dt(Chain.of_bar(bar, bar.length * nodes))
    if steps[0] > limit * (1 + 1e-9):
        raise MeshError(
            f"mesh file {path}: time slabs of {steps[0]:g} s are beyond the stability limit 2 / "
            f"omega_max = {limit:g} s of {method} on its elements; use thinner slabs, or {remedy}"
        )
    return bar.length * nodes, float(steps[0]), len(steps)


def monolithic_mesh(scene: Scene) -> "SpaceTimeMesh":
    """The user's mesh, if the founding method can use it.

    Raises:
        MeshError: It cannot be read, or solutions on it grow.
    """
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415
    from impactfem.spacetime.stability import refuse_growth  # noqa: PLC0415

    bar, path = scene.bar, scene.mesh_path
    if path is None:
        raise MeshError("solve.mesh: no mesh file is given")
    space = read_mesh(MPI.COMM_WORLD, path, bar.length, scene.duration, bar.wave_speed)
    refuse_growth(space, path)
    return space


def monolithic_settings(chosen: Plan[BarNumbers]) -> "GalerkinSettings":
    """Numbers of the founding method as planned."""
    from impactfem.spacetime.galerkin import GalerkinSettings  # noqa: PLC0415

    numbers = chosen.numbers
    return GalerkinSettings(
        numbers.active_set, numbers.gamma, numbers.tolerance, numbers.max_iterations
    )


def _solve_monolithic(scene: Scene, chosen: Plan[BarNumbers], progress: Progress) -> BarMotion:
    # DOLFINx and Gmsh load slowly: only for methods that need them.
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.mesh.spacetime import layered_mesh  # noqa: PLC0415
    from impactfem.spacetime.galerkin import solve_galerkin  # noqa: PLC0415

    bar, numbers = scene.bar, chosen.numbers
    progress.step("building the space-time mesh")
    if scene.mesh_path is not None:
        space = monolithic_mesh(scene)
    elif numbers.elements and numbers.layers and numbers.courant:
        space = layered_mesh(MPI.COMM_WORLD, numbers.elements, numbers.layers, numbers.courant)
    else:
        raise SceneError("solve: the plan has neither elements nor a mesh; give solve.elements")
    progress.step("solving")
    return solve_galerkin(
        space, bar, scene.axial_gravity, monolithic_settings(chosen), progress, scene.output.stride
    )


def discontinuous_settings(scene: Scene, chosen: Plan[BarNumbers]) -> "DiscontinuousSettings":
    """Numbers of the discontinuous Galerkin method as planned, and the user's mesh."""
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415
    from impactfem.spacetime.discontinuous import DiscontinuousSettings  # noqa: PLC0415

    bar, path, asked = scene.bar, scene.mesh_path, scene.solve
    numbers = chosen.numbers
    mesh = None
    if path is not None:
        mesh = read_mesh(MPI.COMM_WORLD, path, bar.length, scene.duration, bar.wave_speed)
    return DiscontinuousSettings(
        degree=1 if numbers.degree is None else numbers.degree,
        elements=numbers.elements or DEFAULT_ELEMENTS,
        fitted=bool(numbers.fitted),
        events=_known_events(scene) if numbers.fitted else (),
        accuracy=asked.accuracy,
        mesh=mesh,
        window=numbers.window,
        gamma=numbers.gamma,
        tolerance=numbers.tolerance,
        max_iterations=numbers.max_iterations,
        every=scene.output.stride,
    )


def _solve_dg(scene: Scene, chosen: Plan[BarNumbers], progress: Progress) -> BarMotion:
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.spacetime.discontinuous import solve_discontinuous  # noqa: PLC0415

    progress.step("building the space-time mesh")
    settings = discontinuous_settings(scene, chosen)
    progress.step("solving")
    motion, details = solve_discontinuous(
        MPI.COMM_WORLD, scene.bar, scene.axial_gravity, scene.duration, settings, progress
    )
    return replace(motion, effort=replace(motion.effort, details=details))


def _known_events(scene: Scene) -> tuple[float, ...]:
    """Beginnings and ends of contact [s]: lines of a fitted mesh, which its solution confirms."""
    exact = exact_bar(scene)
    ends = [time for contact in exact.contacts for time in contact]
    return tuple(time for time in ends if time < scene.duration)


SOLVED: Mapping[str, Callable[[Scene, Plan[BarNumbers], Progress], BarMotion]] = {
    "dg": _solve_dg,
    "exact": _solve_exact,
    "monolithic": _solve_monolithic,
}
"""What solves a bar by each method; what is not here marches."""


def run(scene: Scene, plan: Plan[BarNumbers], progress: Progress, saved: Checkpointing) -> Run:
    """Compute the motion of a bar and measure its error."""
    start = time.perf_counter()
    saved.refuse(scene)
    check_bar_probes(scene)
    full = SOLVED.get(plan.method, _solve_marching)(every_level(scene), plan, progress)
    cost = Cost.since(start)
    progress.step("measuring the error")
    measured = _measured(scene, plan, thinned(full, scene))
    (wall,) = scene.obstacles
    if scene.controllers:  # which act at its far end
        work = float(scene.bar.section * full.end_work[-1])
        details = {**full.effort.details, "end_work": work}
        full = replace(full, effort=replace(full.effort, details=details))
    row = RowMotion.of_one(full, scene.bar, wall.name)
    return run_of_bars(scene, plan, _as_used(scene, plan), row, measured, cost)


def _measured(scene: Scene, plan: Plan[BarNumbers], motion: BarMotion) -> Measured:
    bar, end, method = scene.bar, float(motion.times[-1]), METHODS[plan.method]
    if not bar.has_two_waves:
        errors = None
        if motion.is_finite:
            errors = estimate_of_bar(
                scene, plan, motion, lambda a, b: _solve_marching(a, b, Progress())
            )
        return Measured(errors, None, {}, bar_window(method, motion, bar.wave_speed))
    exact = exact_bar(scene, None if end <= scene.duration * (1.0 + 1e-9) else end)
    errors = None
    if motion.is_finite:
        errors = rounding_of_exact(scene) if method.exact else measure(motion, exact)
    return Measured(
        errors,
        exact_curves(exact, bar, end),
        contact_figures(exact, bar) if method.exact else {},
        bar_window(method, motion, bar.wave_speed),
    )


def _as_used(scene: Scene, plan: Plan[BarNumbers]) -> Scene:
    """The scene with the plan's choices filled in."""
    settings, numbers, method = scene.solve, plan.numbers, METHODS[plan.method]
    filled = replace(settings, method=plan.method, degree=numbers.degree, fitted=numbers.fitted)
    if settings.mesh is None:
        if settings.accuracy is None or not method.layered:  # else the size follows from it
            filled = replace(filled, elements=numbers.elements)
        if settings.dt is None:
            filled = replace(filled, courant=numbers.courant)
    return replace(scene, solve=filled)
