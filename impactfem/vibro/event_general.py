"""Flights of any system by a library integrator with dense output, and their events.

Each step of SciPy's DOP853 is looked through at times (`event_looks`) between which the gaps are
cubics: a gap that changes sign, or has a minimum between two of them and is negative there, gives a
bracket in which the event is located to rounding.
"""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Forced
from impactfem.system.joined import closed as closed_rows
from impactfem.vibro.event_choice import Onset
from impactfem.vibro.event_contacts import Contacts
from impactfem.vibro.event_legs import stops
from impactfem.vibro.event_looks import Look, Looking
from impactfem.vibro.event_motion import Motion
from impactfem.vibro.event_record import Record, gap_rounding

Curve = Callable[[float], float]

_SAMPLES = 8  # of a step, for the largest force
_LOOKS = 128  # of a step: with more the steps become shorter
_SHORTEST = 1e-4  # of a flight, to which they do
_EPS = 2.0**-52
_LATER = 1e-3  # of a step of the integrator: where an acceleration is looked at that begins as 0
_FIRST = 1e-6  # of the duration, before the first step
_DRIFT = 1e-9  # gap of closed constraints, as a share of the lengths, that is taken away
_MAX_STALL = 1000


def fly_general(
    system: GeneralizedSystem, u: Floats, v: Floats, duration: float, contacts: Contacts,
    record: Record, tolerances: tuple[float, float], more: Sequence[float] = (),
) -> None:  # fmt: skip
    """Follow a system by the library integrator, which stops at ``more`` times; fills the record.

    Raises:
        ConvergenceError: The integrator failed, or events do not move on.
    """
    t, row, rubbed, passed, jumped = 0.0, 0, 0.0, 0, 0
    u, v = closed_rows(system, u, v)
    stalled = 0
    kicks, left = deque(system.kicks(duration)), deque(stops(system, duration, more))
    released, watched = None, -1
    step: float | None = None
    while True:
        earlier, kick, jump = None, -1, -1
        while kicks and kicks[0].at.before <= t:
            at, kick = kicks.popleft().at, passed
            passed += 1
            earlier = system.motion_rate(at.before) if earlier is None else earlier
            t = max(t, at.after)
        while left and left[0].before <= t:
            at = left.popleft()
            if at.before < at.after:
                jump = jumped
                jumped += 1
            t = max(t, at.after)
        near = record.near(t, u, v)
        if watched >= 0:
            near[watched] = True
        later = _LATER * step if step else _FIRST * duration

        def begin(
            t: float, u: Floats, v: Floats, closed: tuple[int, ...], later: float = later
        ) -> Onset:
            return Motion(system, closed, tolerances[0]).onset(t, u, v, later)

        before = u, v
        u, v, impacts, impulses = contacts.settle(t, u, v, near, begin, released, earlier)
        u, v = closed_rows(system, u, v)
        record.depart(t, before, (u, v), row, contacts, contacts.strikes, watched, kick, jump)
        record.add(impacts, impulses, row)
        record.rubbed[min(row, len(record.rubbed) - 1)] += contacts.work - rubbed
        rubbed = contacts.work
        if t >= duration:
            record.fill(row, u, v)
            return
        motion = contacts.motion(tolerances[0])
        start = t
        ahead = kicks[0].at.before if kicks else duration, left[0].before if left else duration
        stop = min(duration, *ahead)
        t, y, row, watched, step = _flight(
            motion, t, np.concatenate([u, v, np.zeros(motion.integrals)]), stop, contacts,
            record, row, tolerances, step,
        )  # fmt: skip
        u, v = (part.copy() for part in motion.split(y))
        released = motion.ended(-2 - watched) if watched <= -2 else None
        stalled = stalled + 1 if t == start else 0
        if stalled > _MAX_STALL:
            raise ConvergenceError(
                f"events: {_MAX_STALL} events at t = {t:.9g} without moving on; give a larger "
                "stick_speed"
            )


def _flight(
    motion: Motion, t: float, y: Floats, stop: float, contacts: Contacts, record: Record,
    row: int, tolerances: tuple[float, float], step: float | None,
) -> tuple[float, Floats, int, int, float]:  # fmt: skip
    """One flight up to the next event.

    Returns:
        Time, state, next row, event (constraint, -2 - place of a closed one that is released, or
        -1 for the end or a drift to be taken away), and the length of the last step.
    """
    system, (rtol, atol) = motion.system, tolerances
    state = system.coordinates + system.dofs
    first = min(step, stop - t) if step else None
    solver = DOP853(motion, t, y, stop, rtol=rtol, atol=atol, first_step=first)
    held, pushes = np.zeros(len(motion.closed)), slice(state, state + len(motion.closed))
    spent = 0.0  # of the work of friction, the integral behind
    loose = motion.loose(t, *motion.split(y))
    fresh = t
    while True:
        before = solver.t
        solver.step()
        record.steps += 1
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            raise ConvergenceError(
                f"events: the integrator failed at t = {solver.t:.6g} (state "
                f"{solver.y[:state].tolist()}); check the forces for a singularity"
            )
        raw = solver.dense_output()
        dense = partial(_kept, motion, raw) if system.is_joined else raw
        now, event, seen = _first_event(motion, contacts, dense, before, solver.t, fresh, loose)
        # A body that spins freely has no error that would bound its steps.
        solver.max_step = max(_SHORTEST * (stop - t), (now - before) * _LOOKS / seen)
        while row < len(record.times) and record.times[row] < now:
            at = dense(record.times[row])
            record.fill(row, *motion.split(at))
            record.lasting[row, list(motion.closed)] += at[pushes] - held
            held = at[pushes]
            record.rubbed[row] += at[pushes.stop :].sum() - spent
            spent = at[pushes.stop :].sum()
            row += 1
        if system.is_joined:  # the next step begins where the rows are closed
            solver.y = motion.kept(solver.y)
            solver.f = motion(solver.t, solver.y)
        end = dense(now) if event != -1 else solver.y
        if motion.closed:
            for s in np.linspace(before, now, _SAMPLES + 1):
                at = dense(s)
                pressed = motion.forces(s, *motion.split(at))[1]
                record.peak = max(record.peak, float(pressed.sum()))
        drifted = _drifted(motion, now, end, now - t)
        if event != -1 or solver.status == "finished" or drifted:
            last = min(row, len(record.times) - 1)
            record.lasting[last, list(motion.closed)] += end[pushes] - held
            record.rubbed[last] += end[pushes.stop :].sum() - spent
            return now, end, row, event, solver.step_size or step or 0.0


def _drifted(motion: Motion, t: float, y: Floats, span: float) -> bool:
    """Whether the gaps that a flight holds closed have drifted open by its end.

    What rests at the origin has no lengths but those it would fall in this time.
    """
    system, (u, v), rows = motion.system, motion.split(y), list(motion.closed)
    drift = float(np.abs(system.gap(t, u)[rows]).max(initial=0.0))
    if not drift > _DRIFT * float(np.abs(u).max()):
        return False
    fall = system.jacobian(u)[rows] @ Forced.at(system, t, u, v).free
    return drift > _DRIFT * span**2 * float(np.abs(fall).max())


def _kept(motion: Motion, dense: Callable[[float], Floats], t: float) -> Floats:
    """The state at a time of a step, with its bilateral rows closed."""
    return motion.kept(dense(t))


def _first_event(
    motion: Motion, contacts: Contacts, dense: Callable[[float], Floats],
    start: float, end: float, fresh: float, loose: Floats,
) -> tuple[float, int, int]:  # fmt: skip
    """Time and event of the first event in a step, the end and -1 if there is none; and looks."""
    system = motion.system
    watched = np.ones(system.num_constraints, dtype=bool)
    watched[list(contacts.closed + contacts.implied)] = False

    def look(s: float) -> Look:
        y = motion.split(dense(s))
        return Look(s, system.gap(s, y[0]), system.gap_rate(s, *y), motion.guards(s, *y))

    # Places and speeds of the dense output agree within the tolerance.
    doubt = motion.rtol / _EPS * gap_rounding(system, end, *motion.split(dense(end)))
    seen = Looking(look, watched, doubt).over(start, end)
    samples, gaps, rates, guarded = (np.array(each) for each in zip(*seen, strict=True))
    best, event = end, -1
    for j in np.flatnonzero(watched).tolist():

        def gap(s: float, j: int = j) -> float:
            return float(system.gap(s, motion.split(dense(s))[0])[j])

        def rate(s: float, j: int = j) -> float:
            return float(system.gap_rate(s, *motion.split(dense(s)))[j])

        order = int(contacts.order[j]) if start == fresh else 0
        at = _first_closing(gap, rate, samples, gaps[:, j], rates[:, j], order)
        if at is not None and (at < best or event == -1):
            best, event = at, j
    for i in range(len(loose)):

        def guard(s: float, i: int = i) -> float:
            return float(motion.guards(s, *motion.split(dense(s)))[i] + loose[i])

        falls = np.flatnonzero(guarded[:, i] + loose[i] < 0.0)
        if len(falls):
            k = int(falls[0])
            at = samples[0] if k == 0 else _root(guard, samples[k - 1], samples[k])
            if at < best or event == -1:
                best, event = at, -2 - i
    return float(best), event, len(seen)


def _first_closing(
    gap: Curve, rate: Curve, samples: Floats, gaps: Floats, rates: Floats, order: int
) -> float | None:
    """First time at which a gap falls through 0; order tells how it leaves 0 at the start."""
    if order:
        start = samples[0]
        low = start + 1e-3 * (samples[1] - start)
        if gaps[1] < 0.0:
            # Left and came back: the root at the start is divided out.
            while gap(low) <= 0.0 and low - start > 4.0 * _EPS * abs(start):
                low = start + 0.5 * (low - start)
            return _root(gap, low, samples[1]) if gap(low) > 0.0 else float(low)
    for k in range(len(samples) - 1):
        a, b = samples[k], samples[k + 1]
        if gaps[k] <= 0.0 and not (k == 0 and order):
            if rates[k] < 0.0:
                return float(a)
            continue
        if gaps[k + 1] < 0.0:
            return _root(gap, a, b)
        if rates[k] < 0.0 < rates[k + 1] and not (k == 0 and order):
            lowest = _root(rate, a, b)
            if gap(lowest) < 0.0:
                return _root(gap, a, lowest)
    return None


def _root(curve: Curve, a: float, b: float) -> float:
    return float(brentq(curve, a, b, xtol=4.0 * _EPS * max(abs(b), 1e-300), rtol=4.0 * _EPS))
