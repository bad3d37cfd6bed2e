"""Work-precision studies: errors of methods at several sizes against time, unknowns and memory."""

import gc
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.errors import ImpactError, SceneError
from impactfem.methods import METHODS
from impactfem.reference.bar import exact_bar, measure
from impactfem.result.bar_motion import BarMotion
from impactfem.scene import Scene
from impactfem.solving import solve
from impactfem.studies.solids import Attempt, attempts_at
from impactfem.studies.study import Row, Study
from impactfem.studies.variant import Variant
from impactfem.studies.vibro import attempt_steps

type Baseline = Callable[[Scene, int], tuple[BarMotion, float]]
"""Takes a scene and a number of elements; returns the motion and the seconds it took."""

_KEPT = 400  # levels at which displacement errors are measured
_MANY, _SHORT = 20, 0.2  # runs that take less than so many seconds together are repeated more often


def work_precision(
    scene: Scene,
    methods: Sequence[str],
    sizes: Sequence[int],
    repeats: int = 3,
    *,
    baselines: Mapping[str, Baseline] | None = None,
    progress: Callable[[str], None] | None = None,
    **settings: Any,
) -> Study:
    """Solve a scene by several methods at several sizes.

    Every variant runs once at its least size before anything is timed, so that compilation and
    imports are not counted. A method that fails is a row that says why.

    Args:
        scene: What to model. Solids are measured against method conserving on elements half as
            large as the smallest of ``sizes``; points, rods and beams as `solve` does it.
        methods: Methods, with settings after "@", as `"galerkin@courant=0.5"`.
        sizes: Numbers of elements along the body; of steps for points, rods and beams.
        repeats: Runs of which the median time counts; short ones are run more often.
        baselines: Other solvers by name, run and measured in the same way.
        progress: Told of each row.
        **settings: Keys of ``[solve]`` for all methods.

    Returns:
        The study.

    Raises:
        SceneError: A method is unknown, there is no size, or a setting is not allowed.
    """
    if not methods and not baselines:
        raise SceneError("methods: none is given; name at least one, as galerkin")
    if not sizes or min(sizes) < 1 or repeats < 1:
        raise SceneError(f"sizes = {list(sizes)}, repeats = {repeats}: give numbers from 1 on")
    if settings:
        scene = scene.with_settings({f"solve.{key}": value for key, value in settings.items()})
    variants = [Variant.parse(name) for name in methods]
    ordered = sorted(set(sizes))
    attempt = _HOW[scene.solver](scene, ordered)
    if baselines and attempt is not _attempt:
        kind = next(body.kind for body in scene.bodies)
        raise SceneError(f"baselines: studies of a {kind} have none; leave them out")
    parts = [_rows_of(scene, variant, ordered, repeats, attempt) for variant in variants]
    for name, solver in (baselines or {}).items():
        parts.append(_rows_of_baseline(scene, name, solver, ordered, repeats))
    rows = []
    for row in chain.from_iterable(parts):
        rows.append(row)
        if progress:
            stepped = attempt is attempt_steps
            progress(row.text.replace(" elements:", " steps:") if stepped else row.text)
    return Study(scene.title, tuple(rows), repeats, tuple(baselines or ()))


def _rows_of(
    scene: Scene, variant: Variant, sizes: Sequence[int], repeats: int, attempt: Attempt
) -> Iterator[Row]:
    fixed = variant.settings.get("elements")
    own = [int(fixed)] if fixed is not None else list(sizes)
    attempt(scene, variant, own[0])
    for elements in own:
        yield _row(scene, variant, elements, repeats, attempt)


def _row(scene: Scene, variant: Variant, elements: int, repeats: int, attempt: Attempt) -> Row:
    times: list[float] = []
    totals: list[float] = []
    memory = None
    while len(times) < repeats or (len(times) < _MANY and sum(totals) < _SHORT):
        before = None if times else _resident(reset=True)
        start = time.perf_counter()
        result = attempt(scene, variant, elements)
        totals.append(time.perf_counter() - start)
        if isinstance(result, ImpactError):
            return Row(variant.name, elements, "failed", note=str(result))
        if before is not None:
            memory = max(0.0, _resident() - before)
        times.append(float(result.summary["wall_time"]))
    summary = result.summary
    errors = summary["error"] or {}
    note = errors.get("reference", "") if METHODS[variant.method].exact else ""
    return Row(
        variant.name,
        elements,
        summary["status"],
        errors.get("displacement_max"),
        errors.get("displacement_l2"),
        errors.get("force_l1"),
        summary["energy"]["max_relative_drift"],
        statistics.median(times),
        statistics.median(totals),
        summary["num_dofs"],
        memory,
        note,
    )


def _attempt(scene: Scene, variant: Variant, elements: int) -> Any:
    """The result, or the error that a method ended with."""
    keys = {"method": variant.method, "elements": elements, **variant.settings}
    try:
        case = scene.with_settings({f"solve.{key}": value for key, value in keys.items()})
        courant = case.solve.courant or 1.0
        transit = max(bar.transit_time for bar in case.bars)
        layers = case.duration / transit * elements / courant
        every = max(1, int(layers) // _KEPT)
        return solve(case.with_settings({"output.every": every}))
    except ImpactError as error:
        return error


_HOW: Mapping[str, Callable[[Scene, Sequence[int]], Attempt]] = {
    "bar": lambda *_: _attempt,
    "bar_row": lambda *_: _attempt,
    "march": attempts_at,
    "vibro": lambda *_: attempt_steps,
}
"""How a scene is solved at one of the sizes, by `Scene.solver`."""


def _rows_of_baseline(
    scene: Scene, name: str, solver: Baseline, sizes: Sequence[int], repeats: int
) -> Iterator[Row]:
    solver(scene.with_settings({"duration": 0.01 * scene.duration}), sizes[0])
    for elements in sizes:
        before = _resident(reset=True)
        runs = [solver(scene, elements)]
        while len(runs) < repeats or (len(runs) < _MANY and sum(t for _, t in runs) < _SHORT):
            runs.append(solver(scene, elements))
        memory = None if before is None else max(0.0, _resident() - before)
        motion, _ = runs[-1]
        seconds = statistics.median(seconds for _, seconds in runs)
        row = Row(name, elements, "not finite", seconds=seconds, total=seconds, memory=memory)
        if motion.is_finite:
            errors = measure(motion, exact_bar(scene, max(scene.duration, motion.times[-1])))
            total = motion.kinetic + motion.elastic + motion.potential
            drift = np.abs(total - total[0]).max() / (abs(total[0]) or motion.kinetic.max())
            row = replace(
                row,
                status="completed",
                displacement_max=errors.displacement_max,
                displacement_l2=errors.displacement_l2,
                force_l1=errors.force_l1,
                drift=float(drift),
                unknowns=motion.effort.num_unknowns,
            )
        yield row


def _resident(*, reset: bool = False) -> Any:
    """Peak resident memory [MiB], or the present one after a reset; None where unknown."""
    name = "VmRSS" if reset else "VmHWM"
    try:
        if reset:
            gc.collect()
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    values = (line.split()[1] for line in lines if line.startswith(name))
    return next((int(value) / 1024 for value in values), None)
