"""The motion that really follows from a control, by a method that knows nothing of the mesh."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from impactfem.arrays import Floats
from impactfem.trajectory.motion import Motion, parabola
from impactfem.trajectory.problem import Problem

TOLERANCE = 1e-12  # of each step of Dormand and Prince's method of order 8


@dataclass(frozen=True)
class Followed:
    """What follows from the controls of a motion.

    Attributes:
        states: At nodes (N + 1, n); NaN from where it could not be followed.
        cost: Along it.
        defects: How far what follows from each node is from the next one (N, n).
    """

    states: Floats
    cost: float
    defects: Floats


def followed(problem: Problem, motion: Motion, sizes: Floats) -> Followed:
    """Follow a motion from its start, and from each node to the next.

    Args:
        problem: Its equation.
        motion: Its start and controls.
        sizes: Of states (n,), for the tolerance.
    """
    count, n = motion.intervals, len(problem.states)
    rate = problem.rate
    many = rate.map(count)
    times, parameters = motion.times, motion.parameters
    spans = np.diff(times)

    def together(place: float, flat: Floats) -> Floats:
        """All intervals at once, each from 0 to 1."""
        u = parabola(motion.controls, np.array(place))
        found = _called(many, times[:-1] + place * spans, flat.reshape(count, n).T, u.T,
                        np.repeat(parameters[:, None], count, axis=1))[0]  # fmt: skip
        return np.asarray((found * spans).T.ravel())

    small = np.tile(TOLERANCE * sizes, count)
    ends = _integrated(together, 0.0, 1.0, motion.states[:-1].ravel(), small)
    defects = ends.reshape(count, n) - motion.states[1:]
    states, cost = np.full((count + 1, n), np.nan), 0.0
    states[0] = motion.states[0]
    for k in range(count):
        u = motion.controls[k]

        def one(t: float, x: Floats, k: int = k, u: Floats = u) -> Floats:
            place = (t - times[k]) / spans[k]
            told = _called(rate, t, x[:n], parabola(u, np.array(place)), parameters)
            return np.concatenate([told[0].ravel(), told[1].ravel()])

        begun, small = np.append(states[k], cost), np.append(TOLERANCE * sizes, np.inf)
        end = _integrated(one, times[k], times[k + 1], begun, small)
        states[k + 1], cost = end[:n], float(end[n])
        if not np.isfinite(end).all():
            break
    if problem.final is not None:
        told = problem.last(motion.duration, states[-1], parameters)
        cost += float(told)
    return Followed(states, cost, defects)


def _integrated(rate: Any, start: float, end: float, begun: Floats, small: Floats) -> Floats:
    """State at the end; NaN where it cannot be reached."""
    if not np.isfinite(begun).all():
        return np.full(len(begun), np.nan)
    with np.errstate(all="ignore"):
        # SciPy takes no endless tolerance: what only is a sum does not choose the step.
        absolute = np.where(np.isfinite(small), small, 1e300)
        found = solve_ivp(
            rate, (start, end), begun, method="DOP853", rtol=TOLERANCE, atol=absolute,
            t_eval=[end],
        )  # fmt: skip
    return found.y[:, -1] if found.success else np.full(len(begun), np.nan)


def _called(function: Any, *given: Any) -> tuple[Floats, ...]:
    return tuple(np.asarray(each, dtype=float) for each in function(*given))
