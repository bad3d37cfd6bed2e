"""From a scene to its result."""

import resource
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from impactfem.errors import SceneError
from impactfem.facade import Result
from impactfem.log import Progress
from impactfem.methods import METHODS, is_exact
from impactfem.planning import BarNumbers, MarchNumbers, Plan, RowNumbers, VibroNumbers, plan
from impactfem.planning.bar_errors import rounding_findings
from impactfem.provenance import run_record
from impactfem.reference.bar import Errors, exact_bar, exact_curves, measure
from impactfem.reference.bar import contact_figures as contact_figures_of_bar
from impactfem.reference.bar_row import exact_row_if_known
from impactfem.reference.rounding import rounding_of_exact, sampling_of_row
from impactfem.result.bar_motion import Effort, bar_fields, bar_history
from impactfem.result.bar_row_motion import pair_names, row_fields, row_history
from impactfem.result.table import Table
from impactfem.runs.bar_rows import contact_figures, measure_row, row_curves, run_bar_row
from impactfem.runs.bars import RUNNERS
from impactfem.runs.error_estimate import estimate_error
from impactfem.runs.forces import bar_window
from impactfem.runs.line_bodies import bar_figures
from impactfem.runs.line_probes import bar_probes, check_bar_probes, every_level, thinned
from impactfem.runs.summary import Cost, summarise
from impactfem.scene import Scene


def solve(
    scene: Scene | str | Path,
    *,
    progress: Progress | None = None,
    checkpoints: Path | None = None,
    restart: Path | None = None,
    planned: Plan[Any] | None = None,
    **settings: Any,
) -> Result:
    """Solve a scene.

    Args:
        scene: What to model, or the file that says it.
        progress: Told of the stages; silent if None.
        checkpoints: Folder for checkpoints of a solid every ``output.checkpoint`` layers; it must
            exist.
        restart: Folder with the checkpoint from which a solid continues.
        planned: The plan of this scene, if it is made already; settings make it anew.
        **settings: Keys of the scene's ``[solve]`` table that replace its own, as
            ``solve(scene, elements=80)``.

    Returns:
        The result, on every rank; the fields of a solid on rank 0 only. If the active set did not
        settle, ``summary["status"]`` says so and what was computed is kept.

    Raises:
        SceneError: The scene or a setting cannot work.
        MeshError: The mesh file has a fault, or the mesh cannot be made.
        ConvergenceError: A linear system could not be solved, or contact forces were not found.
        OutputError: The checkpoint cannot be read or written.
        MissingDependencyError: DOLFINx or Gmsh is not installed.
    """
    if isinstance(scene, str | Path):
        scene = Scene.from_toml(scene)
    if not isinstance(scene, Scene):
        raise SceneError(
            f"solve: it was given {type(scene).__name__}, not a Scene; make one by "
            'Scene.from_toml("scene.toml"), Scene.from_dict(...) or Scene(...)'
        )
    if settings:
        scene = scene.with_settings({f"solve.{key}": value for key, value in settings.items()})
        planned = None
    chosen = planned or plan(scene)
    result = _solve(scene, chosen, progress or Progress(), checkpoints, restart)
    return result.with_summary({**result.summary, "run": run_record()})


def _solve(
    scene: Scene,
    chosen: Plan[Any],
    progress: Progress,
    checkpoints: Path | None,
    restart: Path | None,
) -> Result:
    if scene.solver == "march":
        return _solve_solids(scene, chosen, progress, checkpoints, restart)
    if checkpoints is not None or restart is not None:
        body = scene.bodies[0]
        raise SceneError(f"body {body.name}: a {body.kind} is not checkpointed; leave that out")
    if scene.solver == "vibro":
        return _solve_vibro(scene, chosen, progress)
    if scene.solver == "bar_row":
        return _solve_bar_row(scene, chosen, progress)
    return _solve_bar(scene, chosen, progress)


def _solve_bar(scene: Scene, chosen: Plan[BarNumbers], progress: Progress) -> Result:
    start = time.perf_counter()
    check_bar_probes(scene)
    motion = RUNNERS[METHODS[chosen.method].family](every_level(scene), chosen, progress)
    probes = {}
    if scene.probes:
        probes = bar_probes(scene, [motion.positions], [motion.displacement], [motion.velocity])
        motion = thinned(motion, scene.output.every)
    wall_time = time.perf_counter() - start
    progress.step("measuring the error")
    bar, end = scene.bar, float(motion.times[-1])
    exact = exact_bar(scene, None if end <= scene.duration * (1.0 + 1e-9) else end)
    errors = None
    if motion.is_finite:
        errors = rounding_of_exact(scene) if is_exact(chosen.method) else measure(motion, exact)
    history = bar_history(motion, bar, scene.obstacles[0].name, probes)
    window = bar_window(chosen.method, motion, bar.wave_speed)
    bodies = {bar.name: bar_figures(bar, motion.positions, motion.displacement)}
    effort = replace(motion.effort, force_window=window, bodies=bodies)
    effort = _grown(chosen, effort, errors)
    summary = summarise(scene, chosen, history, effort, errors, _cost(wall_time))
    if is_exact(chosen.method):
        summary["contact"] |= contact_figures_of_bar(exact, bar)
    return Result(
        _bar_as_used(scene, chosen),
        history,
        summary,
        bar_fields(motion, bar.name) if scene.output.fields else None,
        exact_curves(exact, bar, end),
    )


def _grown(chosen: Plan[Any], effort: Effort, errors: Errors | None) -> Effort:
    """The effort with what rounding has grown to, where the plan foretold that it grows."""
    if errors is None or all(found.code != "rounding_growth" for found in chosen.findings):
        return effort
    grown = rounding_findings(errors.displacement_max, "has grown")
    return replace(effort, findings=grown, measured=("rounding_growth",))


def _solve_bar_row(scene: Scene, chosen: Plan[RowNumbers], progress: Progress) -> Result:
    start = time.perf_counter()
    check_bar_probes(scene)
    motion = run_bar_row(every_level(scene), chosen, progress)
    probes = {}
    if scene.probes:
        probes = bar_probes(scene, motion.positions, motion.displacement, motion.velocity)
        motion = thinned(motion, scene.output.every)
    wall_time = time.perf_counter() - start
    progress.step("measuring the error")
    end = max(scene.duration, float(motion.times[-1]))
    exact = exact_row_if_known(scene, end) if chosen.numbers.exact_known else None
    reference = None if is_exact(chosen.method) or not motion.is_finite else exact
    errors = None if reference is None else measure_row(motion, reference)
    if exact is not None and exact.sampled and motion.is_finite:
        sampling = sampling_of_row(scene, exact)
        errors = sampling if errors is None else errors.plus(sampling)
    bodies = {
        bar.name: bar_figures(bar, x, u)
        for bar, x, u in zip(scene.bars, motion.positions, motion.displacement, strict=True)
    }
    effort = _grown(chosen, replace(motion.effort, bodies=bodies), errors)
    history = row_history(motion, scene.bars, probes)
    summary = summarise(scene, chosen, history, effort, errors, _cost(wall_time))
    summary["contact"] |= contact_figures(motion, exact if is_exact(chosen.method) else None)
    settings = replace(scene.solve, method=chosen.method, elements=chosen.longest)
    if settings.dt is None:
        settings = replace(settings, courant=max(chosen.courant))
    return Result(
        replace(scene, solve=settings),
        history,
        summary,
        row_fields(motion, tuple(bar.name for bar in scene.bars)) if scene.output.fields else None,
        None if exact is None else row_curves(exact, end, pair_names(motion.labels, scene.bars)),
    )


def _solve_solids(
    scene: Scene,
    chosen: Plan[MarchNumbers],
    progress: Progress,
    checkpoints: Path | None,
    restart: Path | None,
) -> Result:
    from impactfem.runs.solids import run_solids  # noqa: PLC0415  (loads DOLFINx)

    start = time.perf_counter()
    motion, fields = run_solids(scene, chosen, progress, checkpoints=checkpoints, restart=restart)
    cost = _cost(time.perf_counter() - start)
    unknowns = max(1, motion.effort.num_unknowns)
    details = {"memory_per_unknown_kib": cost.memory_mib * 1024 / unknowns}
    effort = replace(motion.effort, details={**motion.effort.details, **details})
    used, history = _solids_as_used(scene, chosen), motion.history
    errors, effort = _estimated(used, chosen, history, effort, progress, is_finite=motion.is_finite)
    summary = summarise(scene, chosen, history, effort, errors, cost)
    return Result(used, history, summary, fields)


def _estimated(
    used: Scene, chosen: Plan[MarchNumbers], history: Table, effort: Effort, progress: Progress,
    *, is_finite: bool,
) -> tuple[Errors | None, Effort]:  # fmt: skip
    """The estimated errors of solids, and the effort with what told them."""
    if not (chosen.estimate and is_finite and effort.converged):
        return None, effort
    progress.step("estimating the error on other elements")
    errors, note = estimate_error(used, chosen, history)
    return errors, replace(effort, details={**effort.details, "error_estimate": note})


def _solve_vibro(scene: Scene, chosen: Plan[VibroNumbers], progress: Progress) -> Result:
    from impactfem.runs.vibro import run_vibro  # noqa: PLC0415  (loads Numba)

    run = run_vibro(scene, chosen, progress)
    cost = _cost(run.seconds)
    for finding in run.motion.effort.findings:
        progress.message(f"{finding.severity}: {finding.sentence}")
    summary = summarise(
        scene, chosen, run.history, run.motion.effort, run.errors, cost,
        driven=not run.model.conservative,
    )  # fmt: skip
    summary["contact"] |= run.contact
    settings = replace(
        scene.solve,
        method=chosen.method,
        dt=chosen.dt,
        impact_law=chosen.impact_law,
        estimate=chosen.estimate,
        penalty_stiffness=chosen.penalty_stiffness,
        penalty_integrator=chosen.penalty_integrator,
    )
    used = replace(scene, solve=settings)
    return Result(used, run.history, summary, run.fields, impacts=run.motion.impacts)


def _bar_as_used(scene: Scene, chosen: Plan[BarNumbers]) -> Scene:
    """The scene with the plan's choices filled in."""
    settings = scene.solve
    filled = replace(settings, method=chosen.method, degree=chosen.degree, fitted=chosen.fitted)
    if settings.mesh is None:
        if (
            settings.accuracy is None or not METHODS[chosen.method].layered
        ):  # else the size follows from it
            filled = replace(filled, elements=chosen.elements)
        if settings.dt is None:
            filled = replace(filled, courant=chosen.courant)
    return replace(scene, solve=filled)


def _solids_as_used(scene: Scene, chosen: Plan[MarchNumbers]) -> Scene:
    """The scene with the plan's choices filled in."""
    settings = replace(
        scene.solve,
        method=chosen.method,
        courant=chosen.courant if scene.solve.dt is None else None,
        normals=chosen.normals,
        estimate=chosen.estimate,
        linear_solver=None if chosen.linear_solver == "none" else chosen.linear_solver,
    )
    degrees = dict(zip((solid.name for solid in scene.solids), chosen.degrees, strict=True))
    solids = {s.name: replace(s, degree=degrees[s.name]) for s in scene.solids}
    bodies = tuple(solids.get(body.name, body) for body in scene.bodies)
    return replace(scene, bodies=bodies, solve=settings)


def _cost(wall_time: float) -> Cost:
    """Time and memory of all ranks; MPI counts only if a method has loaded it."""
    mpi = sys.modules.get("mpi4py.MPI")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if mpi is None:
        return Cost(wall_time, memory, 1)
    return Cost(wall_time, mpi.COMM_WORLD.allreduce(memory), mpi.COMM_WORLD.size)
