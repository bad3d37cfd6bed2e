"""From a scene to its result."""

import resource
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
from impactfem.reference import (
    Errors,
    exact_bar,
    exact_curves,
    exact_fields,
    exact_history,
    measure,
)
from impactfem.result import Fields, Result
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
class _Answer:
    """What a method gives before it is summed up."""

    history: xr.Dataset
    fields: Fields | None
    errors: Errors | None
    num_dofs: int
    iterations: int
    set_changes: tuple[int, ...]
    converged: bool
    message: str
    memory_mib: float
    ranks: int = 1


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
    answer = (_solve_exact if chosen.method == "exact" else _solve_galerkin)(
        scene, chosen, progress
    )
    wall_time = time.perf_counter() - start
    end = float(answer.history["time"][-1])
    return Result(
        _as_used(scene, chosen),
        answer.history,
        _summary(scene, chosen, answer, wall_time),
        answer.fields if scene.output.fields else None,
        exact_curves(exact_bar(scene, end), scene.bodies[0], end),
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


def _solve_exact(scene: Scene, chosen: Plan, progress: Progress) -> _Answer:
    progress.step("following the characteristics")
    bar, exact = scene.bodies[0], exact_bar(scene)
    elements = chosen.elements or DEFAULT_ELEMENTS
    layers = chosen.layers or 1
    times = np.linspace(0.0, scene.duration, layers + 1)
    shown = np.unique(np.append(np.arange(0, layers + 1, scene.output.every), layers))
    return _Answer(
        history=exact_history(exact, bar, scene.gravity, times),
        fields=exact_fields(exact, times[shown], np.linspace(0, bar.length, elements + 1)),
        errors=None,
        num_dofs=0,
        iterations=0,
        set_changes=(),
        converged=True,
        message="closed form",
        memory_mib=_peak_memory_mib(),
    )


def _solve_galerkin(scene: Scene, chosen: Plan, progress: Progress) -> _Answer:
    # DOLFINx and Gmsh load slowly: only for methods that need them.
    from impactfem.fem import MPI  # noqa: PLC0415
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415
    from impactfem.mesh.spacetime import layered_mesh  # noqa: PLC0415
    from impactfem.spacetime.galerkin import GalerkinSettings, solve_galerkin  # noqa: PLC0415
    from impactfem.spacetime.history import bar_fields, bar_history  # noqa: PLC0415

    comm = MPI.COMM_WORLD
    bar, path = scene.bodies[0], scene.mesh_path
    progress.step("building the space-time mesh")
    if path is not None:
        space = read_mesh(comm, path, bar.length, scene.duration, bar.wave_speed)
    elif chosen.elements and chosen.layers and chosen.courant:
        space = layered_mesh(comm, chosen.elements, chosen.layers, chosen.courant)
    else:
        raise SceneError("solve: the plan has neither elements nor a mesh; give solve.elements")
    progress.step("solving")
    settings = GalerkinSettings(
        chosen.active_set, chosen.gamma, chosen.tolerance, chosen.max_iterations
    )
    solution = solve_galerkin(space, bar, scene.gravity, settings, progress)
    progress.step("measuring the error")
    finite = bool(np.isfinite(solution.displacement).all())
    exact = exact_bar(scene, max(scene.duration, float(solution.times[-1])))
    return _Answer(
        history=bar_history(solution, bar, scene.gravity),
        fields=bar_fields(solution, scene.output.every),
        errors=measure(solution, exact) if finite else None,
        num_dofs=solution.num_unknowns,
        iterations=solution.iterations,
        set_changes=solution.set_changes,
        converged=solution.converged,
        message=solution.message,
        memory_mib=comm.allreduce(_peak_memory_mib()),
        ranks=comm.size,
    )


def _summary(scene: Scene, chosen: Plan, answer: _Answer, wall_time: float) -> dict[str, Any]:
    """Figures of a run, as in ``summary.json``; None stands for numbers that are not finite."""
    history = answer.history
    t, force = history["time"].values, history["contact_force"].values
    energy = history["total_energy"].values
    scale = abs(energy[0]) or float(np.abs(history["kinetic_energy"].values).max()) or 1.0
    growth = (energy - energy[0]) / scale
    status = "completed" if answer.converged else "not_converged"
    if answer.converged and not growth.max() <= GROWTH_LIMIT:
        status = "unstable"
    summary = {
        "title": scene.title,
        "status": status,
        "method": chosen.method,
        "num_dofs": answer.num_dofs,
        "num_steps": len(t) - 1,
        "wall_time": wall_time,
        "peak_memory_mib": answer.memory_mib,  # of all ranks together
        "ranks": answer.ranks,
        "active_set": {
            "iterations": answer.iterations,
            "set_changes": list(answer.set_changes),
            "converged": answer.converged,
            "message": answer.message,
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
        "error": asdict(answer.errors) if answer.errors else None,
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


def _peak_memory_mib() -> float:
    """Largest resident memory of this process so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


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
