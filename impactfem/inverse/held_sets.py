"""Bars by equations with an active set, with derivatives along the pieces on which sets stay.

A step of a parameter changes the equations and not the sets: what is found is the derivative of the
discrete solution with its active set, by differences of solutions with that set. Where a pair is
neither pressed nor apart (gamma lambda + u = 0, which is usual: plans put impacts on layers) the
set belongs to one side, and each side decides that pair itself.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.bars import BarRuns, differences, reader
from impactfem.inverse.outcomes import Outcome, at_times, means_at
from impactfem.inverse.pulses import force_rise, pressed_time
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.planning import BarNumbers, Plan
from impactfem.result.bar_motion import BarMotion
from impactfem.result.bar_row_motion import RowMotion, row_history
from impactfem.runs.line_probes import bar_probes
from impactfem.scene import Scene
from impactfem.system.spring_wall import wall_gap

Marks = NDArray[np.int8]

_WEAK = 1e-9  # share of the largest merit below which a pair is neither pressed nor apart


def check_one_bar(chosen: Plan[Any]) -> None:
    """Refuse bars in a row.

    Raises:
        SceneError: They have derivatives by their exact solution only.
    """
    if not isinstance(chosen.numbers, BarNumbers):
        raise SceneError(
            f'solve.method = "{chosen.method}": bars in a row have derivatives by their exact '
            'solution; take solve.method = "exact"'
        )


@dataclass(frozen=True)
class HeldSets(ABC):
    """Runs of a bar on a mesh that all of them keep.

    Attributes:
        chosen: The plan.
    """

    chosen: Plan[BarNumbers]

    @abstractmethod
    def march(self, scene: Scene, marks: Marks | None) -> BarMotion:
        """The motion, all levels kept.

        Args:
            scene: The scene.
            marks: Sets of the pairs: 1 in contact, 0 not, `DECIDE` as they come; None: all come.
        """

    def reference(self, scene: Scene) -> "BarRuns | HeldSets":
        """Exact runs of the same bar; where there are none, on a finer mesh."""
        return BarRuns(self.chosen) if scene.bar.has_two_waves else self.finer()

    @abstractmethod
    def finer(self) -> "HeldSets":
        """The same equations on a finer mesh."""

    def outcome(self, scene: Scene, times: Floats, marks: Marks | None = None) -> Outcome:
        """A run, known at some times: columns are linear between levels.

        Args:
            scene: The scene.
            times: [s].
            marks: Sets of the pairs; None: they are found.
        """
        return self.told(scene, times, self.march(scene, marks))

    def told(self, scene: Scene, times: Floats, motion: BarMotion) -> Outcome:
        """What is known of a motion at some times."""
        bar = scene.bar
        (wall,) = scene.obstacles
        row = RowMotion.of_one(motion, bar, wall.name)
        history = row_history(row, scene.bars, bar_probes(scene, row))
        levels = motion.times

        def at(values: Floats) -> Floats:
            return np.asarray(np.interp(times, levels, values))

        told = at_times(history, times)
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
            means=means_at(history, times),
        )

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """Numbers of a run and their derivatives, with the active set of the run."""
        marks = self.marks(changes.scene, self.march(changes.scene, None))
        return differences(changes, self.reader(changes, quantities, marks))

    def reader(
        self, changes: Changes, quantities: Quantities, marks: Marks
    ) -> Callable[[Floats], Floats]:
        """What reads the numbers of runs with given sets."""
        return reader(partial(self.outcome, marks=marks), changes, quantities)

    def marks(self, scene: Scene, motion: BarMotion) -> Marks:
        """Sets of a run; those of pairs that are on no side are left open."""
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
    level = rebound_level(motion)
    return abs(float(motion.mean_velocity[level])) if level else float("nan")


def rebound_level(motion: BarMotion) -> int:
    """Level at which the speed after the last contact is told; 0 if there was none, or it lasts."""
    touching, last = np.flatnonzero(motion.active), len(motion.active) - 1
    ended = touching.size and touching[-1] < last
    return min(int(touching[-1]) + 3, len(motion.times) - 1) if ended else 0
