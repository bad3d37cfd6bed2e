"""Walls that change their velocity at once, for schemes with a constant step.

What lies on such a wall is struck: Newton's law holds for the velocity relative to the wall after
the change. A scheme whose law compares the ends of steps takes the velocity before for that of the
wall then, and would let nothing rebound. It is given the wall as if it had always moved as it does
after the change.
"""

import numpy as np

from impactfem.arrays import Floats
from impactfem.system.generalized import GeneralizedSystem


class Kicks:
    """Changes of the velocity of walls towards the body, by steps of a length h.

    Args:
        system: Its motions.
        steps: Number of steps.
        h: Their length [s].
    """

    def __init__(self, system: GeneralizedSystem, steps: int, h: float) -> None:
        self._shape = system.num_constraints
        found = [kick for kick in system.kicks(steps * h) if kick.after > kick.before]
        levels = h * np.arange(steps + 1)
        times = np.array([kick.at.after for kick in found])
        self._step = np.searchsorted(levels, times, side="left") - 1  # t_step < time <= t_step+1
        self._late = times - levels[self._step] if found else times
        self._constraint = np.array([kick.constraint for kick in found], dtype=np.int64)
        self._kicks = found
        self._h = h

    def rates(self, rate: Floats, begin: int) -> tuple[Floats, Floats]:
        """Rates of the walls before and after each step from ``begin`` on [m/s], (steps, J) each.

        Args:
            rate: Those at the levels, shape (steps + 1, J).
            begin: The first level.
        """
        before, after = rate[:-1].copy(), rate[1:].copy()
        for step, j, late, kick in zip(
            self._step - begin, self._constraint, self._late, self._kicks, strict=True
        ):
            if 0 <= step < len(before):
                before[step, j] = kick.after
            if 0 < step <= len(after) and late <= kick.at.after - kick.at.before:
                after[step - 1, j] = kick.before  # the level is within rounding of the change
        return before, after

    def shifts(self, begin: int, end: int) -> tuple[Floats, Floats]:
        """How much nearer the walls were at t_m-1 and at t_m [m], (steps, J), steps begin to end.

        Nearer than walls that had always moved as after a change within t_m-1 to t_m+1.
        """
        old, now = np.zeros((2, end - begin, self._shape))
        for step, late, j, kick in zip(
            self._step, self._late, self._constraint, self._kicks, strict=True
        ):
            change = kick.after - kick.before
            if begin <= step < end:
                old[step - begin, j] += change * (late + self._h)
                now[step - begin, j] += change * late
            if begin <= step + 1 < end:
                old[step + 1 - begin, j] += change * late
        return old, now
