"""From a scene to its result."""

import resource
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from impactfem.errors import MeshError, SceneError
from impactfem.log import Progress
from impactfem.methods import METHODS
from impactfem.planning import Plan, plan
from impactfem.reference import Errors, exact_bar, exact_curves, exact_motion, measure
from impactfem.result import BarMotion, Effort, Result
from impactfem.result.bar_motion import bar_fields, bar_history
from impactfem.scene import Scene
from impactfem.sizing import DEFAULT_ELEMENTS

Floats = NDArray[np.float64]

# Share of the largest force that counts as none: displacements right to 1e-9 at an impact on a
# layer can make a pair active one layer early, with about this force.
_NO_FORCE = 1e-6

GROWTH_NOTED = 1e-6
"""Relative growth of energy that a report points out; no method the plan may choose exceeds it."""

GROWTH_LIMIT = 1e-2
"""Relative growth of energy from which a run counts as unstable."""


@dataclass(frozen=True)
class _Cost:
    """What a run took."""

    wall_time: float
    memory_mib: float
    ranks: int


def solve(scene: Scene, *, progress: Progress | None = None, **settings: Any) -> Result:
    """Solve a scene.

    Args:
        scene: What to model.
        progress: Told of the stages; silent if None.
        **settings: Keys of the scene's ``[solve]`` table that replace its own, as
            ``solve(scene, elements=80)``.

    Returns:
        The result, on every rank. If the active set did not settle, ``summary["status"]`` says so
        and what was computed is kept.

    Raises:
        SceneError: The scene or a setting cannot work.
        MeshError: The mesh file has a fault.
        ConvergenceError: A linear system could not be solved.
        MissingDependencyError: DOLFINx or Gmsh is not installed.
    """
    if settings:
        scene = scene.with_settings({f"solve.{key}": value for key, value in settings.items()})
    progress = progress or Progress()
    chosen = plan(scene)
    start = time.perf_counter()
    motion = _SOLVERS[METHODS[chosen.method].family](scene, chosen, progress)
    wall_time = time.perf_counter() - start
    progress.step("measuring the error")
    end = max(scene.duration, float(motion.times[-1]))
    exact = exact_bar(scene, end)
    errors = measure(motion, exact) if chosen.method != "exact" and motion.is_finite else None
    bar = scene.bodies[0]
    history = bar_history(motion, bar)
    return Result(
        _as_used(scene, chosen),
        history,
        _summary(scene, chosen, history, motion.effort, errors, _cost(wall_time)),
        bar_fields(motion) if scene.output.fields else None,
        exact_curves(exact, bar, end),
    )


def _as_used(scene: Scene, chosen: Plan) -> Scene:
    """The scene with the plan's choices filled in."""
    settings = scene.solve
    filled = replace(settings, method=chosen.method)
    if settings.mesh is None:
        filled = replace(filled, elements=chosen.elements)
        if settings.dt is None:
            filled = replace(filled, courant=chosen.courant)
    return replace(scene, solve=filled)


def _solve_exact(scene: Scene, chosen: Plan, progress: Progress) -> BarMotion:
    progress.step("following the characteristics")
    bar = scene.bodies[0]
    times = np.linspace(0.0, scene.duration, (chosen.layers or 1) + 1)
    positions = np.linspace(0.0, bar.length, (chosen.elements or DEFAULT_ELEMENTS) + 1)
    exact = exact_bar(scene)
    return exact_motion(exact, bar, scene.gravity, times, positions, scene.output.every)


def _solve_marching(scene: Scene, chosen: Plan, progress: Progress) -> BarMotion:
    progress.step("loading the time loops (compiled at their first use)")
    from impactfem.marching.march import SCHEMES, Marching, march  # noqa: PLC0415  (loads Numba)

    bar, scheme = scene.bodies[0], SCHEMES[chosen.method]
    if scene.mesh_path is not None:
        positions, dt, layers = _layers_of_mesh(scene, chosen.method)
    elif chosen.elements and chosen.layers and chosen.dt:
        positions = np.linspace(0.0, bar.length, chosen.elements + 1)
        dt, layers = chosen.dt, chosen.layers
    else:
        raise SceneError("solve: the plan has neither elements nor a mesh; give solve.elements")
    progress.step("marching")
    numbers = Marching(
        dt,
        layers,
        window=layers if chosen.window == "all" else int(chosen.window),
        gamma=chosen.gamma,
        tolerance=chosen.tolerance,
        max_iterations=chosen.max_iterations,
        every=scene.output.every,
    )
    return march(bar, scene.gravity, positions, scheme, numbers)


def _layers_of_mesh(scene: Scene, method: str) -> tuple[Floats, float, int]:
    """Node positions [m], time step [s] and layers of a user's mesh, if a sweep can use it.

    Raises:
        MeshError: The mesh has no layers of equal height, or they are beyond the stability limit.
    """
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.marching.chain import Chain  # noqa: PLC0415
    from impactfem.marching.march import SCHEMES  # noqa: PLC0415
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415

    bar, path = scene.bodies[0], scene.mesh_path
    if path is None:
        raise MeshError("solve.mesh: no mesh file is given")
    space = read_mesh(MPI.COMM_WORLD, path, bar.length, scene.duration, bar.wave_speed)
    times, nodes = space.layout.times, space.layout.nodes
    remedy = 'use method = "dg", which works on any triangles'
    if times is None or nodes is None:
        raise MeshError(
            f"mesh file {path}: its nodes form no layers, {method} sweeps layers; {remedy}"
        )
    steps = bar.transit_time * np.diff(times)
    if np.ptp(steps) > 1e-9 * steps.max():
        raise MeshError(
            f"mesh file {path}: layers are {steps.min():g} to {steps.max():g} s high, {method} "
            f"needs equal ones; {remedy}"
        )
    limit = SCHEMES[method].stable_dt(Chain.of_bar(bar, bar.length * nodes))
    if steps[0] > limit * (1 + 1e-9):
        raise MeshError(
            f"mesh file {path}: layers of {steps[0]:g} s are beyond the stability limit 2 / "
            f"omega_max = {limit:g} s of {method} on its elements; use thinner layers, or {remedy}"
        )
    return bar.length * nodes, float(steps[0]), len(steps)


def _solve_monolithic(scene: Scene, chosen: Plan, progress: Progress) -> BarMotion:
    # DOLFINx and Gmsh load slowly: only for methods that need them.
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415
    from impactfem.mesh.spacetime import layered_mesh  # noqa: PLC0415
    from impactfem.spacetime.galerkin import GalerkinSettings, solve_galerkin  # noqa: PLC0415
    from impactfem.spacetime.stability import refuse_growth  # noqa: PLC0415

    comm = MPI.COMM_WORLD
    bar, path = scene.bodies[0], scene.mesh_path
    progress.step("building the space-time mesh")
    if path is not None:
        space = read_mesh(comm, path, bar.length, scene.duration, bar.wave_speed)
        refuse_growth(space, path)
    elif chosen.elements and chosen.layers and chosen.courant:
        space = layered_mesh(comm, chosen.elements, chosen.layers, chosen.courant)
    else:
        raise SceneError("solve: the plan has neither elements nor a mesh; give solve.elements")
    progress.step("solving")
    settings = GalerkinSettings(
        chosen.active_set, chosen.gamma, chosen.tolerance, chosen.max_iterations
    )
    return solve_galerkin(space, bar, scene.gravity, settings, progress, scene.output.every)


def _solve_dg(scene: Scene, chosen: Plan, progress: Progress) -> BarMotion:
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415
    from impactfem.spacetime.discontinuous import (  # noqa: PLC0415
        DiscontinuousSettings,
        solve_discontinuous,
    )

    bar, path, asked = scene.bodies[0], scene.mesh_path, scene.solve
    progress.step("building the space-time mesh")
    mesh = None
    if path is not None:
        mesh = read_mesh(MPI.COMM_WORLD, path, bar.length, scene.duration, bar.wave_speed)
    settings = DiscontinuousSettings(
        degree=1 if asked.degree is None else asked.degree,
        elements=chosen.elements or DEFAULT_ELEMENTS,
        fitted=bool(asked.fitted),
        accuracy=asked.accuracy,
        mesh=mesh,
        window=chosen.window,
        gamma=chosen.gamma,
        tolerance=chosen.tolerance,
        max_iterations=chosen.max_iterations,
        every=scene.output.every,
    )
    progress.step("solving")
    motion, details = solve_discontinuous(
        MPI.COMM_WORLD, bar, scene.gravity, scene.duration, settings, progress
    )
    return replace(motion, effort=replace(motion.effort, details=details))


_SOLVERS = {
    "dg": _solve_dg,
    "exact": _solve_exact,
    "marching": _solve_marching,
    "monolithic": _solve_monolithic,
}


def _cost(wall_time: float) -> _Cost:
    """Time and memory of all ranks; MPI counts only if a method has loaded it."""
    mpi = sys.modules.get("mpi4py.MPI")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if mpi is None:
        return _Cost(wall_time, memory, 1)
    return _Cost(wall_time, mpi.COMM_WORLD.allreduce(memory), mpi.COMM_WORLD.size)


def _summary(
    scene: Scene, chosen: Plan, history: xr.Dataset, effort: Effort, errors: Errors | None,
    cost: _Cost,
) -> dict[str, Any]:  # fmt: skip
    """Figures of a run, as in ``summary.json``; None stands for numbers that are not finite."""
    t, force = history["time"].values, history["contact_force"].values
    energy = history["total_energy"].values
    scale = abs(energy[0]) or float(np.abs(history["kinetic_energy"].values).max()) or 1.0
    growth = (energy - energy[0]) / scale
    status = "completed" if effort.converged else "not_converged"
    if effort.converged and not growth.max() <= GROWTH_LIMIT:
        status = "unstable"
    summary = {
        "title": scene.title,
        "status": status,
        "method": chosen.method,
        "num_dofs": effort.num_unknowns,
        "num_steps": len(t) - 1,
        "wall_time": cost.wall_time,
        "peak_memory_mib": cost.memory_mib,  # of all ranks together
        "ranks": cost.ranks,
        "active_set": {
            "iterations": effort.iterations,
            "set_changes": list(effort.set_changes),
            "converged": effort.converged,
            "message": effort.message,
        },
        "energy": {
            "initial": energy[0],
            "final": energy[-1],
            "max_relative_drift": np.abs(growth).max(),
            "final_relative_drift": growth[-1],
            "max_relative_growth": max(0.0, growth.max()),
            "grows": bool(growth.max() > GROWTH_NOTED),
        },
        "contact": {
            "intervals": contact_intervals(t, force),
            "max_force": force.max(),
            "impulse": float(np.sum(force[1:] * np.diff(t))),
            "max_penetration": max(0.0, -float(history["gap"].min())),
        },
        "error": asdict(errors) if errors else None,
        "details": effort.details,
        "plan": chosen.as_dict(),
    }
    plain: dict[str, Any] = _plain(summary)
    return plain


def contact_intervals(times: Floats, force: Floats) -> list[list[float]]:
    """Join the layers in which the obstacle pushes to intervals.

    A pair that is active without a force (gap and force both zero to rounding) does not count.

    Args:
        times: Layer times [s], shape (rows,).
        force: Contact force during (t_{m-1}, t_m] [N], shape (rows,); row 0 is ignored.

    Returns:
        Pairs [t_in, t_out] in seconds.
    """
    on = np.concatenate([[False], force[1:] > _NO_FORCE * force.max(), [False]])
    changes = np.flatnonzero(on[1:] != on[:-1])
    return [
        [float(times[i]), float(times[j])] for i, j in zip(changes[::2], changes[1::2], strict=True)
    ]


def _plain(value: Any) -> Any:
    """Make plain JSON data: Python numbers, None for what is not finite."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
