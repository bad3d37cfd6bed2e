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
    many = problem.rate.map(count)
    times, parameters = motion.times, motion.parameters
    spans = np.diff(times)

    def together(place: float, flat: Floats) -> Floats:
        """All intervals at once, each from 0 to 1."""
        u = parabola(motion.controls, np.array(place))
        found = _called(many, times[:-1] + place * spans, flat.reshape(count, n).T, u.T,
                        np.repeat(parameters[:, None], count, axis=1))[0]  # fmt: skip
        return np.asarray((found * spans).T.ravel())

    small = np.tile(TOLERANCE * sizes, count)
    ends = _integrated(together, 0.0, np.ones(1), motion.states[:-1].ravel(), small)
    defects = ends.reshape(count, n) - motion.states[1:]
    states, cost = np.full((count + 1, n), np.nan), 0.0
    states[0] = motion.states[0]
    for k in range(count):
        end = _one(problem, motion, sizes, k, np.append(states[k], cost), times[k + 1 : k + 2])
        states[k + 1], cost = end[0, :n], float(end[0, n])
        if not np.isfinite(end).all():
            break
    if problem.final is not None:
        told = problem.last(motion.duration, states[-1], parameters)
        cost += float(told)
    return Followed(states, cost, defects)


def followed_closely(
    problem: Problem, motion: Motion, sizes: Floats, pieces: int
) -> tuple[Floats, Floats]:
    """The same at more places: times [s] (k,) and states (k, n)."""
    times, n = motion.times, len(problem.states)
    moments, states = [times[:1]], [motion.states[:1]]
    for k in range(motion.intervals):
        at = np.linspace(times[k], times[k + 1], pieces + 1)[1:]
        found = _one(problem, motion, sizes, k, np.append(states[-1][-1], 0.0), at)
        moments.append(at)
        states.append(found[:, :n])
    return np.concatenate(moments), np.concatenate(states)


def _one(
    problem: Problem, motion: Motion, sizes: Floats, k: int, begun: Floats, at: Floats
) -> Floats:
    """States and cost at times within one interval, (k, n + 1)."""
    n, u, start = len(problem.states), motion.controls[k], motion.times[k]
    span = motion.times[k + 1] - start

    def rate(t: float, x: Floats) -> Floats:
        control = parabola(u, np.array((t - start) / span))
        told = _called(problem.rate, t, x[:n], control, motion.parameters)
        return np.concatenate([told[0].ravel(), told[1].ravel()])

    # What only is a sum does not choose the step; SciPy takes no endless tolerance.
    return _integrated(rate, start, at, begun, np.append(TOLERANCE * sizes, 1e300))


def _integrated(rate: Any, start: float, at: Floats, begun: Floats, small: Floats) -> Floats:
    """States at some times; NaN where they cannot be reached."""
    lost = np.full((len(at), len(begun)), np.nan)
    if not np.isfinite(begun).all():
        return lost
    with np.errstate(all="ignore"):
        found = solve_ivp(
            rate, (start, at[-1]), begun, method="DOP853", rtol=TOLERANCE, atol=small, t_eval=at
        )
    return np.asarray(found.y.T) if found.success else lost


def _called(function: Any, *given: Any) -> tuple[Floats, ...]:
    return tuple(np.asarray(each, dtype=float) for each in function(*given))
