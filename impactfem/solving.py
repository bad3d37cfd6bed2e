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

from impactfem.errors import SceneError
from impactfem.log import Progress
from impactfem.planning import DEFAULT_ELEMENTS, Plan, plan
from impactfem.reference import Errors, exact_bar, exact_curves, exact_motion, measure
from impactfem.result import BarMotion, Effort, Result
from impactfem.result.bar_motion import bar_fields, bar_history
from impactfem.scene import Scene

Floats = NDArray[np.float64]

METHODS: Mapping[str, str] = {
    "galerkin": "space-time P1 Petrov-Galerkin with a primal-dual active set for all layers at "
    "once; exact at the nodes at courant 1 when impacts fall on layers, first order in h "
    "otherwise; courant < 1 rings, courant > 1 is refused",
    "exact": "characteristics of a homogeneous bar; exact for piecewise linear initial data, "
    "thousands of bounces in a fraction of a second",
}
"""Methods by name, with their limits."""

_NO_FORCE = 1e-9  # share of the largest force that counts as rounding

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
    motion = _METHODS[chosen.method](scene, chosen, progress)
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


def _solve_galerkin(scene: Scene, chosen: Plan, progress: Progress) -> BarMotion:
    # DOLFINx and Gmsh load slowly: only for methods that need them.
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415
    from impactfem.mesh.spacetime import layered_mesh  # noqa: PLC0415
    from impactfem.spacetime.galerkin import GalerkinSettings, solve_galerkin  # noqa: PLC0415

    comm = MPI.COMM_WORLD
    bar, path = scene.bodies[0], scene.mesh_path
    progress.step("building the space-time mesh")
    if path is not None:
        space = read_mesh(comm, path, bar.length, scene.duration, bar.wave_speed)
        if space.layout.times is None:
            progress.message(f"warning: {path.name} has no layers: the method is not stable on it")
    elif chosen.elements and chosen.layers and chosen.courant:
        space = layered_mesh(comm, chosen.elements, chosen.layers, chosen.courant)
    else:
        raise SceneError("solve: the plan has neither elements nor a mesh; give solve.elements")
    progress.step("solving")
    settings = GalerkinSettings(
        chosen.active_set, chosen.gamma, chosen.tolerance, chosen.max_iterations
    )
    return solve_galerkin(space, bar, scene.gravity, settings, progress, scene.output.every)


_METHODS = {"exact": _solve_exact, "galerkin": _solve_galerkin}


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
        },
        "contact": {
            "intervals": contact_intervals(t, force),
            "max_force": force.max(),
            "impulse": float(np.sum(force[1:] * np.diff(t))),
            "max_penetration": max(0.0, -float(history["gap"].min())),
        },
        "error": asdict(errors) if errors else None,
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
