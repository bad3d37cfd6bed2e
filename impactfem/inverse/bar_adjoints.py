"""Derivatives of a bar's run by layers: one reversed sweep for each number, whatever varies."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.bar_readings import Added, Reading, ReadRun, read_numbers
from impactfem.inverse.local_slopes import Local, slopes
from impactfem.inverse.outcomes import Outcome
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes
from impactfem.marching.given import Given, reversed_sweep
from impactfem.marching.kernels import DECIDE
from impactfem.result.bar_motion import BarMotion
from impactfem.scene import Scene
from impactfem.system.chain import Chain
from impactfem.system.fronts import starts_as_waves

Marks = NDArray[np.int8]

_STILL = 1e-9  # share of the largest derivative of a gap below which nothing is moved
_SIDES = (-1, 1)


class Adjoints:
    """Derivatives of the numbers of a run by what its sweep is given.

    Args:
        changes: The place, and the sizes of steps.
        quantities: The numbers.
        motion: Of the run, all levels kept.
        marks: Its sets; `DECIDE` where each side has its own.
        travel: Nodes as in `Bar.places`.
        dt: Of the layers of a scene [s].
    """

    def __init__(
        self, changes: Changes, quantities: Quantities, motion: BarMotion, marks: Marks,
        travel: Floats, dt: Callable[[Scene], float],
    ) -> None:  # fmt: skip
        scene = changes.scene
        bar, times = scene.bar, motion.times
        self._changes, self._quantities, self._marks = changes, quantities, marks
        self._travel, self._times, self._dt = travel, times, dt
        self._clamped = bar.far_end == "clamped"
        self._multiplier = bar.section * motion.multiplier
        self._run = ReadRun(
            scene, self._given(scene), motion,
            levels=starts_as_waves(bar, Chain.of_bar(bar, travel), times),
        )  # fmt: skip

    def jacobian(
        self, outcome: Outcome, rebound: int
    ) -> tuple[tuple[Floats, Floats], NDArray[np.bool_]] | None:
        """Derivatives of all numbers on both sides, (n, P) each, and which unknowns they are of.

        Args:
            outcome: What the numbers were read from.
            rebound: Level at which the speed after the last contact is told.

        Returns:
            None if there are numbers whose derivatives are not known here.
        """
        read = read_numbers(self._run, self._quantities, outcome, rebound)
        if read is None:
            return None
        by, known = slopes(self._changes, self._arrays)
        found = np.zeros((2, len(read), len(known)))
        for marks, own in self._sided(by):
            rows = np.array([self._row(add, marks) for add in read]).reshape(len(read), -1) @ by
            for side, columns in zip(found, own, strict=True):
                side[:, columns] = rows[:, columns]
        self._quantities.add_efforts(found, self._run.scene)
        return (found[0], found[1]), known

    def _given(self, scene: Scene) -> Given:
        dt = self._dt(scene)
        if abs(dt - self._times[1]) > 1e-14 * dt:
            raise SceneError("other time steps")  # of which levels the derivatives are is not kept
        return Given.of(scene.bar, scene.axial_gravity, self._travel, self._times)

    def _arrays(self, scene: Scene) -> Sequence[Local]:
        """What a run is given, each entry with its layers and places."""
        t, x = self._times, scene.bar.places(self._travel)
        layers = {"t": (t[:-1], t[1:])}
        elements = {"x": (x[:-1], x[1:])}
        nodes = {"x": (np.insert(x, 0, x[0])[:-1], np.append(x, x[-1])[1:])}
        given = self._given(scene)
        rows = len(given.forces)
        loads = nodes | ({"t": (t[:-1, None], t[1:, None])} if rows == len(t) - 1 else {})
        spans = {
            **dict.fromkeys(("element_mass", "stiffness", "speeds", "moments"), elements),
            "velocity": nodes, "start": nodes, "forces": loads,
            **dict.fromkeys(("gravity", "ends", "ways"), layers),
        }  # fmt: skip
        return [Local(values, spans.get(name, {})) for name, values in given._asdict().items()]

    def _row(self, add: Added, marks: Marks) -> Floats:
        """Derivatives of a number by all that the run is given, (entries,)."""
        reading, run = Reading(self._run), self._run
        add(reading)
        reversed_sweep(
            run.given, run.dt, self._clamped, run.u, self._multiplier, marks, reading.last,
            reading.of_u, reading.of_multiplier, reading.given,
        )  # fmt: skip
        return np.concatenate([each.ravel() for each in reading.given])

    def _sided(self, by: csr_array) -> list[tuple[Marks, tuple[Floats, Floats]]]:
        """Sets of the layers, and the unknowns below and above which they hold, (P,) each.

        A pair that is on neither side is in contact where the free end would go into the wall: the
        derivative of its gap tells for all unknowns at once.
        """
        base = np.where(self._marks == DECIDE, self._run.motion.active, self._marks)
        everything = np.ones((2, by.shape[1]), dtype=bool)
        groups = [(base.astype(np.int8), everything)]
        for layer in np.flatnonzero(self._marks == DECIDE).tolist():
            split = []
            for marks, own in groups:
                open_, shut = marks.copy(), marks.copy()
                open_[layer], shut[layer] = 0, 1
                slope = (
                    self._row(partial(Reading.of, level=layer + 1, node=0, weight=1.0), open_) @ by
                )
                slope *= self._changes.scales
                still = np.abs(slope) <= _STILL * np.abs(slope).max(initial=0.0)
                into = np.array([side * slope < 0.0 for side in _SIDES])
                into[:, still] = marks[layer]
                split += [(open_, own & ~into), (shut, own & into)]
            groups = [(marks, own) for marks, own in split if own.any()]
        return [(marks, (own[0], own[1])) for marks, own in groups]
