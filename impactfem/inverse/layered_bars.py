"""Bars by space-time layers, with derivatives along the pieces on which active sets stay.

A step of a parameter changes the equations and not the sets: what is found is the derivative of the
discrete solution with its active set, by differences of solutions with that set. Where a pair is
neither pressed nor apart (gamma lambda + u = 0, which is usual: plans put impacts on layers) the
set belongs to one side, and each side decides that pair itself.
"""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.inverse.bar_adjoints import Adjoints
from impactfem.inverse.bars import BarRuns, apart, differences, reader
from impactfem.inverse.outcomes import Outcome
from impactfem.inverse.pulses import force_rise, pressed_time
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.planning import BarNumbers, Plan
from impactfem.result.bar_motion import BarMotion
from impactfem.result.bar_row_motion import RowMotion, row_history
from impactfem.result.table import Series, Table
from impactfem.runs.line_probes import bar_probes
from impactfem.scene import Scene
from impactfem.system.spring_wall import wall_gap

Floats = NDArray[np.float64]
Marks = NDArray[np.int8]

_MANY = 10  # numbers for each unknown, each a sweep, that still take less than runs beside it
_WEAK = 1e-9  # share of the largest merit below which a pair is neither pressed nor apart


@dataclass(frozen=True)
class LayeredBars:
    """Runs of galerkin's equations as planned, whoever solves them: elements and courant stay."""

    chosen: Plan[BarNumbers]

    def __post_init__(self) -> None:
        if not isinstance(self.chosen.numbers, BarNumbers):
            raise SceneError(
                f'solve.method = "{self.chosen.method}": bars in a row have derivatives by their '
                'exact solution; take solve.method = "exact"'
            )
        if self.chosen.numbers.elements is None:
            raise SceneError(
                "solve.mesh: derivatives need layers of equal height; remove it, or take "
                'solve.method = "exact"'
            )

    def reference(self, scene: Scene) -> "BarRuns | LayeredBars":
        """Exact runs of the same bar; where there are none, on elements half as large."""
        if scene.bar.has_two_waves:
            return BarRuns(self.chosen)
        numbers = self.chosen.numbers
        finer = replace(numbers, elements=2 * (numbers.elements or 1))
        return LayeredBars(replace(self.chosen, numbers=finer))

    def _dt(self, scene: Scene) -> float:
        numbers = self.chosen.numbers
        return (numbers.courant or 1.0) * scene.bar.transit_time / (numbers.elements or 1)

    def _layers(self, scene: Scene) -> int:
        """So many that neighbours, whose layers are a little lower, last as long."""
        return math.ceil(scene.duration / self._dt(scene) - 1e-9) + 1

    def _march(self, scene: Scene, marks: Marks | None) -> BarMotion:
        from impactfem.marching.march import SCHEMES, Marching, march  # noqa: PLC0415  (Numba)

        numbers, bar = self.chosen.numbers, scene.bar
        layers = self._layers(scene) if marks is None else len(marks)
        marching = Marching(
            self._dt(scene), layers, gamma=numbers.gamma, tolerance=numbers.tolerance, marks=marks
        )
        positions = np.linspace(0.0, bar.length, (numbers.elements or 1) + 1)
        return march(bar, scene.axial_gravity, positions, SCHEMES["galerkin"], marching)

    def outcome(self, scene: Scene, times: Floats, marks: Marks | None = None) -> Outcome:
        """A run, known at some times: columns are linear between levels.

        Args:
            scene: The scene.
            times: [s].
            marks: Sets of the layers; None: they are found.
        """
        return self._told(scene, times, self._march(scene, marks))

    def _told(self, scene: Scene, times: Floats, motion: BarMotion) -> Outcome:
        bar = scene.bar
        (wall,) = scene.obstacles
        row = RowMotion.of_one(motion, bar, wall.name)
        history = row_history(row, scene.bars, bar_probes(scene, row))
        levels = motion.times

        def at(values: Floats) -> Floats:
            return np.asarray(np.interp(times, levels, values))

        told = Table.over_time(
            times,
            {
                name: Series(column.dims, at(np.asarray(column.values, float)), column.attrs)
                for name, column in history.items()
                if name != "time" and column.values.ndim == 1
            },
        )
        pairs = (n.removeprefix("force.") for n, _ in told.items() if n.startswith("force."))
        (pair,) = pairs
        pushed = np.concatenate([[0.0], np.cumsum(row.force[:, 0] * np.diff(levels))])
        section, springy = bar.section, bar.wall_stiffness is not None
        return Outcome(
            told,
            {pair: at(pushed)},
            {pair: pressed_time(levels, motion.gap)} if springy else {},
            {bar.name: _rebound(motion)},
            {bar.name: section * bar.length},
            section * at(motion.end_work),
            {pair: float(row.force.max(initial=0.0))},
            rise={pair: force_rise(levels, motion.gap, row.force[:, 0])} if springy else {},
        )

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """Numbers of a run and their derivatives, with the active set of the run.

        By a reversed sweep for each number; by differences where numbers are many more than
        unknowns, of unknowns that change the layers, and before a wall that gives way.
        """
        scene = changes.scene
        motion = self._march(scene, None)
        marks = self._marks(scene, motion)
        read = reader(partial(self.outcome, marks=marks), changes, quantities)
        outcome = self._told(scene, quantities.times, motion)
        numbers = quantities.read(outcome, scene)
        if len(numbers) > _MANY * len(changes.values) or scene.bar.wall_stiffness is not None:
            return differences(changes, read)
        travel = np.linspace(0.0, scene.bar.length, len(motion.positions))
        adjoints = Adjoints(changes, quantities, motion, marks, travel, self._dt)
        found = adjoints.jacobian(outcome, _rebound_level(motion))
        if found is None:
            return differences(changes, read)
        (below, above), known = found
        if not known.all():
            some = changes.some(~known)
            rest = differences(some, reader(partial(self.outcome, marks=marks), some, quantities))
            below[:, ~known], above[:, ~known] = rest.sides or (rest.jacobian, rest.jacobian)
        mean = 0.5 * (below + above)
        if not apart([below, above]):
            return Slopes(numbers, mean, [])
        return Slopes(numbers, mean, [], 0.0, (below, above))

    def _marks(self, scene: Scene, motion: BarMotion) -> Marks:
        """Sets of the layers of a run; those of pairs that are on no side are left open."""
        from impactfem.marching.kernels import DECIDE  # noqa: PLC0415  (loads Numba)

        bar = scene.bar
        metres = bar.length / bar.wave_speed**2
        gap = wall_gap(bar, motion.gap, motion.multiplier)
        merit = self.chosen.numbers.gamma * metres * motion.multiplier + gap
        weak = np.abs(merit) <= _WEAK * np.abs(merit).max(initial=0.0)
        return np.where(weak, DECIDE, motion.active).astype(np.int8)


def _rebound(motion: BarMotion) -> float:
    """Speed of the centre in the second layer after the last contact; NaN if there was none.

    The layer of a release still has half of the force of the one before.
    """
    level = _rebound_level(motion)
    return abs(float(motion.mean_velocity[level])) if level else float("nan")


def _rebound_level(motion: BarMotion) -> int:
    touching = np.flatnonzero(motion.active)
    return min(int(touching[-1]) + 3, len(motion.times) - 1) if touching.size else 0
