"""From a scene to its result."""

import resource
import sys
import time
from dataclasses import replace
from typing import Any

from impactfem.log import Progress
from impactfem.methods import METHODS
from impactfem.planning import Plan, plan
from impactfem.reference import exact_bar, exact_curves, measure
from impactfem.result import Result
from impactfem.result.bar_motion import bar_fields, bar_history
from impactfem.runners import RUNNERS
from impactfem.scene import Scene
from impactfem.summary import Cost, summarise


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
    motion = RUNNERS[METHODS[chosen.method].family](scene, chosen, progress)
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
        summarise(scene, chosen, history, motion.effort, errors, _cost(wall_time)),
        bar_fields(motion) if scene.output.fields else None,
        exact_curves(exact, bar, end),
    )


def _as_used(scene: Scene, chosen: Plan) -> Scene:
    """The scene with the plan's choices filled in."""
    settings = scene.solve
    filled = replace(settings, method=chosen.method, degree=chosen.degree, fitted=chosen.fitted)
    if settings.mesh is None:
        if settings.accuracy is None or chosen.method == "dg":  # else the size follows from it
            filled = replace(filled, elements=chosen.elements)
        if settings.dt is None:
            filled = replace(filled, courant=chosen.courant)
    return replace(scene, solve=filled)


def _cost(wall_time: float) -> Cost:
    """Time and memory of all ranks; MPI counts only if a method has loaded it."""
    mpi = sys.modules.get("mpi4py.MPI")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if mpi is None:
        return Cost(wall_time, memory, 1)
    return Cost(wall_time, mpi.COMM_WORLD.allreduce(memory), mpi.COMM_WORLD.size)
