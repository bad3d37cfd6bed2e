"""The motion that really follows from a control, by a method that knows nothing of the mesh."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from impactfem.arrays import Floats
from impactfem.trajectory.impacts import MOST, first_impact
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
        impacts: Time [s] and place in the problem's list of each.
    """

    states: Floats
    cost: float
    defects: Floats
    impacts: tuple[tuple[float, int], ...] = ()


def followed(problem: Problem, motion: Motion, sizes: Floats) -> Followed:
    """Follow a motion from its start, and from each node to the next.

    Args:
        problem: Its equation.
        motion: Its start and controls.
        sizes: Of states (n,), for the tolerance.
    """
    count, n = motion.intervals, len(problem.states)
    times, parameters = motion.times, motion.parameters
    if problem.impacts:
        ends = np.array([
            _one(problem, motion, sizes, k, np.append(motion.states[k], 0.0), times[k + 1 : k + 2])
            for k in range(count)
        ])[:, 0, :n]  # fmt: skip
    else:
        ends = _all_at_once(problem, motion, sizes)
    defects = ends - motion.states[1:]
    states, cost = np.full((count + 1, n), np.nan), 0.0
    states[0], struck = motion.states[0], list[tuple[float, int]]()
    for k in range(count):
        begun, at = np.append(states[k], cost), times[k + 1 : k + 2]
        end = _one(problem, motion, sizes, k, begun, at, struck)
        states[k + 1], cost = end[0, :n], float(end[0, n])
        if not np.isfinite(end).all():
            break
    if problem.final is not None:
        told = problem.last(motion.duration, states[-1], parameters)
        cost += float(told)
    return Followed(states, cost, defects, tuple(struck))


def _all_at_once(problem: Problem, motion: Motion, sizes: Floats) -> Floats:
    """Where what follows from each node is at the next one, (N, n)."""
    count, n = motion.intervals, len(problem.states)
    many = problem.rate.map(count)
    times, parameters = motion.times, np.repeat(motion.parameters[:, None], count, axis=1)
    spans = np.diff(times)

    def together(place: float, flat: Floats) -> Floats:
        """All intervals at once, each from 0 to 1."""
        u = parabola(motion.controls, np.array(place))
        x = flat.reshape(count, n).T
        found = _called(many, times[:-1] + place * spans, x, u.T, parameters)[0]
        return np.asarray((found * spans).T.ravel())

    small = np.tile(TOLERANCE * sizes, count)
    found = _integrated(together, 0.0, np.ones(1), motion.states[:-1].ravel(), small)
    return found.reshape(count, n)


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
    problem: Problem, motion: Motion, sizes: Floats, k: int, begun: Floats, at: Floats,
    struck: list[tuple[float, int]] | None = None,
) -> Floats:  # fmt: skip
    """States and cost at times within one interval, (k, n + 1); impacts are added to a list."""
    n, u, start = len(problem.states), motion.controls[k], motion.times[k]
    span = motion.times[k + 1] - start

    def told_at(function: Any, t: float, x: Floats) -> tuple[Floats, ...]:
        control = parabola(u, np.array((t - start) / span))
        return _called(function, t, x[:n], control, motion.parameters)

    def rate(t: float, x: Floats) -> Floats:
        told = told_at(problem.rate, t, x)
        return np.concatenate([told[0].ravel(), told[1].ravel()])

    # What only is a sum does not choose the step; SciPy takes no endless tolerance.
    small = np.append(TOLERANCE * sizes, 1e300)
    if not problem.impacts:
        return _integrated(rate, start, at, begun, small)

    def gaps(t: float, x: Floats) -> Floats:
        return told_at(problem.gaps, t, x)[0].ravel()

    def jump(j: int, t: float, x: Floats) -> Floats:
        if struck is not None:
            struck.append((t, j))
        return np.append(told_at(problem.jumps[j], t, x)[0].ravel(), x[n:])

    return _through(rate, gaps, jump, start, at, begun, small)


def _through(
    rate: Any, gaps: Any, jump: Any, start: float, at: Floats, begun: Floats, small: Floats
) -> Floats:
    """States at some times, through impacts; NaN where they cannot be reached."""
    found = np.full((len(at), len(begun)), np.nan)
    t, x, done, struck, short = start, begun, 0, -1, 1e-7 * (at[-1] - start)
    for _ in range(MOST):
        if not np.isfinite(x).all():
            break
        with np.errstate(all="ignore"):
            flight = solve_ivp(
                rate, (t, at[-1]), x, method="DOP853", rtol=TOLERANCE, atol=small,
                dense_output=True,
            )  # fmt: skip
        if not flight.success:
            break
        place = flight.sol

        def look(s: Floats, t: float = t, place: Any = place) -> tuple[Floats, Floats]:
            near = [
                np.array([gaps(at, place(at)) for at in t + s + step]).T
                for step in (-short, 0.0, short)
            ]
            return near[1], (near[2] - near[0]) / (2.0 * short)

        first = first_impact(look, at[-1] - t, struck)
        until = at[-1] if first is None else t + first[0]
        reached = at[done:][at[done:] < until] if first else at[done:]
        if len(reached):
            found[done : done + len(reached)] = place(reached).T
        done += len(reached)
        if first is None:
            break
        t, struck = until, first[1]
        x = jump(struck, t, place(t))
    return found


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
    told = function(*given)
    told = told if isinstance(told, tuple | list) else (told,)
    return tuple(np.asarray(each, dtype=float) for each in told)
