"""Run bars in a row as the plan says: motion, error against the exact one, curves, figures."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.exact import ExactBarRow
from impactfem.log import Progress
from impactfem.methods import METHODS
from impactfem.planning import Plan, RowNumbers
from impactfem.reference.bar import Errors, curve_times, relative, trapezoidal
from impactfem.reference.bar_row import exact_row, exact_row_if_known
from impactfem.reference.rounding import sampling_of_row
from impactfem.result.bar_motion import Effort, kept_levels
from impactfem.result.bar_row_motion import RowMotion, pair_labels, pair_names
from impactfem.result.table import Series, Table
from impactfem.runs.bar_run import Measured, run_of_bars
from impactfem.runs.line_probes import check_bar_probes, every_level, thinned
from impactfem.runs.run import Checkpointing, Cost, Run
from impactfem.runs.summary import contact_intervals
from impactfem.scene import Scene


def run(scene: Scene, plan: Plan[RowNumbers], progress: Progress, saved: Checkpointing) -> Run:
    """Compute the motion of bars in a row and measure its error.

    Raises:
        SceneError: There are too many waves to follow.
    """
    start = time.perf_counter()
    saved.refuse(scene)
    check_bar_probes(scene)
    full = _solve(every_level(scene), plan, progress)
    cost = Cost.since(start)
    progress.step("measuring the error")
    measured = _measured(scene, plan, thinned(full, scene))
    return run_of_bars(scene, plan, _as_used(scene, plan), full, measured, cost)


def _solve(scene: Scene, plan: Plan[RowNumbers], progress: Progress) -> RowMotion:
    numbers = plan.numbers
    if METHODS[plan.method].exact:
        progress.step("following the characteristics")
        end = max(scene.duration, numbers.layers * numbers.dt)
        times = numbers.dt * np.arange(numbers.layers + 1, dtype=np.float64)
        stride = scene.output.stride
        return exact_row_motion(scene, exact_row(scene, end), times, numbers.elements, stride)
    progress.step("loading the time loops (compiled at their first use)")
    from impactfem.marching.bar_row import march_row  # noqa: PLC0415  (loads Numba)

    progress.step("marching")
    return march_row(
        scene.bars, numbers.elements, numbers.dt, numbers.layers,
        wall=_wall(scene), every=scene.output.stride, method=plan.method,
    )  # fmt: skip


def _measured(scene: Scene, plan: Plan[RowNumbers], motion: RowMotion) -> Measured:
    end = max(scene.duration, float(motion.times[-1]))
    exact = exact_row_if_known(scene, end) if plan.numbers.exact_known else None
    errors, own = None, METHODS[plan.method].exact
    if exact is not None and motion.is_finite:
        errors = None if own else measure_row(motion, exact)
        if exact.sampled:
            sampling = sampling_of_row(scene, exact)
            errors = sampling if errors is None else errors.plus(sampling)
    names = pair_names(motion.labels, scene.bars)
    curves = None if exact is None or not names else row_curves(exact, end, names)
    return Measured(errors, curves, contact_figures(motion, exact if own else None))


def _as_used(scene: Scene, plan: Plan[RowNumbers]) -> Scene:
    """The scene with the plan's choices filled in."""
    settings = replace(scene.solve, method=plan.method, elements=plan.numbers.longest)
    if settings.dt is None:
        settings = replace(settings, courant=max(plan.numbers.courant))
    return replace(scene, solve=settings)


def exact_row_motion(
    scene: Scene, exact: ExactBarRow, times: Floats, elements: Sequence[int], every: int
) -> RowMotion:
    """The exact motion at given times and nodes; forces are means over the layers between."""
    kept = kept_levels(len(times) - 1, every)
    count, pairs = len(scene.bars), len(exact.contacts)
    positions = tuple(
        np.linspace(0.0, bar.length, n + 1) for bar, n in zip(scene.bars, elements, strict=True)
    )
    kinetic, elastic = exact.energy(times)
    t = times[kept, None]
    return RowMotion(
        times=times,
        labels=pair_labels(scene.bars, _wall(scene)),
        positions=positions,
        kept=kept,
        displacement=tuple(exact.displacement(k, t, x[None]) for k, x in enumerate(positions)),
        velocity=tuple(exact.velocity(k, t, x[None]) for k, x in enumerate(positions)),
        gap=of_pairs([exact.gap(j, times) for j in range(pairs)], len(times)),
        force=of_pairs([exact.mean_force(j, times) for j in range(pairs)], len(times) - 1),
        kinetic=kinetic.T,
        elastic=elastic.T,
        mean_displacement=np.stack([exact.mean_displacement(k, times) for k in range(count)], 1),
        mean_velocity=np.stack([exact.mean_velocity(k, times) for k in range(count)], 1),
        effort=Effort(message="closed form"),
    )


def of_pairs(values: Sequence[Floats], rows: int) -> Floats:
    """Values of each pair side by side, (rows, pairs); a bar alone has none."""
    return np.array(values).reshape(len(values), rows).T


def _wall(scene: Scene) -> str | None:
    return scene.obstacles[0].name if scene.obstacles else None


def measure_row(motion: RowMotion, exact: ExactBarRow) -> Errors:
    """Errors at the nodes of the kept levels, of the gaps, and of the forces of all pairs."""
    t = motion.times[motion.kept]
    largest, size, wrong, norm = 0.0, 0.0, 0.0, 0.0
    for k, (x, values) in enumerate(zip(motion.positions, motion.displacement, strict=True)):
        reference = exact.displacement(k, t[:, None], x[None, :])
        weights = trapezoidal(t)[:, None] * trapezoidal(x)[None, :]
        largest = max(largest, float(np.abs(values - reference).max()))
        # From where the bar starts: its place on the axis is no motion.
        way = reference - exact.displacement(k, 0.0, x)[None, :]
        size = max(size, float(np.abs(way).max()))
        wrong += float((weights * (values - reference) ** 2).sum())
        norm += float((weights * way**2).sum())
    missed, force = 0.0, 0.0
    for j in range(motion.gap.shape[1]):
        largest = max(largest, float(np.abs(motion.gap[:, j] - exact.gap(j, motion.times)).max()))
        # Split the layers where the exact force jumps: between it is constant.
        edges = np.union1d(motion.times, exact.force_breaks(j))
        edges = edges[edges <= motion.times[-1]]
        middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
        layer = np.searchsorted(motion.times, middle, side="left") - 1
        truth = exact.force(j, middle)
        missed += float(width @ np.abs(motion.force[layer, j] - truth))
        force += float(width @ truth)
    return Errors(
        "exact solution by characteristics",
        relative(largest, size),
        relative(np.sqrt(wrong), np.sqrt(norm)),
        relative(missed, force),
        measured=True,
    )


def row_curves(exact: ExactBarRow, end: float, names: Sequence[str]) -> Table:
    """Exact smallest gap, sum of forces and force of each pair, with both sides of jumps."""
    pairs = range(len(exact.contacts))
    jumps = np.unique(np.concatenate([exact.force_breaks(j) for j in pairs]))
    times = curve_times(jumps, end)
    forces = np.array([exact.force(j, times) for j in pairs])
    gaps = np.array([exact.gap(j, times) for j in pairs])
    told = [
        ("gap", gaps.min(axis=0), "m", "smallest exact gap"),
        ("contact_force", forces.sum(axis=0), "N", "exact force"),
        *((f"force.{names[j]}", forces[j], "N", f"exact force of {names[j]}") for j in pairs),
    ]
    return Table.over_time(
        times,
        {
            name: Series(("time",), values, {"units": unit, "long_name": text})
            for name, values, unit, text in told
        },
    )


def contact_figures(motion: RowMotion, exact: ExactBarRow | None) -> dict[str, Any]:
    """Contact intervals of all pairs together, and figures of each, for the summary.

    Args:
        motion: The motion.
        exact: The exact solution, if that is the motion; None: contacts are those of its layers.
    """
    pairs, intervals, total = [], [], 0.0
    for j, label in enumerate(motion.labels):
        force, gap = np.append(0.0, motion.force[:, j]), motion.gap[:, j]
        if exact is None:
            spells = contact_intervals(motion.times, force, gap) if force.any() else []
            impulse, largest = float(force[1:] @ np.diff(motion.times)), float(force.max())
        else:
            spells = [[begin, end] for begin, end in exact.contacts[j]]
            impulse = float(exact.impulse(j, motion.times[-1]))
            largest = exact.largest_force(j)
        intervals += spells
        total += impulse
        pairs.append(
            {
                "between": label.split("|"),
                "intervals": spells,
                "max_force": largest,
                "impulse": impulse,
            }
        )
    figures = {"pairs": pairs, "intervals": _joined(intervals), "impulse": total}
    if exact is not None:
        figures["max_force"] = _largest_sum(exact)
    return figures


def _largest_sum(exact: ExactBarRow) -> float:
    """Largest sum of the forces of all pairs [N]: they are constant between their jumps."""
    pairs = range(len(exact.contacts))
    breaks = [exact.force_breaks(j) for j in pairs]
    edges = np.unique(np.concatenate([*breaks, [0.0, exact.duration]]))
    middle = 0.5 * (edges[1:] + edges[:-1])
    return float(np.max(sum(exact.force(j, middle) for j in pairs)))


def _joined(intervals: list[list[float]]) -> list[list[float]]:
    """Times in which at least one of the intervals lasts."""
    spells: list[list[float]] = []
    for begin, end in sorted(intervals):
        if spells and begin <= spells[-1][1]:
            spells[-1][1] = max(spells[-1][1], end)
        else:
            spells.append([begin, end])
    return spells
