"""Legs of a penalised motion: the integrator runs while one active set lasts, and what it met.

The penalty force has kinks, and jumps if damped, where the active set changes. In a leg the set is
kept, so that the right hand side is smooth and the integrator keeps its order; the leg ends at the
first root of the margin of the set (multipliers of the constraints that act, gaps of the others),
which is located on the dense output to the tolerance of positions.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from penalty_projection import Projector
from scipy.optimize import brentq

from impactfem.errors import ConvergenceError

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Dense = Callable[[float], Floats]

_SAMPLES = 4  # of a step of the integrator, at which margins are looked at
_SHORTEST = 1e-9  # leg, as a share of the interval between samples
_MAX_TOGGLES = 8  # changes of the active set at one instant
_BLIND = 0.01  # shortest leg without a set, in units of 1 / sqrt(k)


@dataclass
class Record:
    """Rows of the output and contact episodes, as they come.

    Attributes:
        times: Output times [s], shape (rows,).
        position: u, shape (rows, d).
        velocity: u', shape (rows, d).
        impulse: Integral of the contact forces from t = 0 on [N s], shape (rows, J).
        row: The next row to be written.
        episodes: Finished contacts (start, constraint, speed in, speed out, impulse).
        ends: When each of them ended [s].
        open: Contacts under way: constraint -> (start, speed in, impulse before).
        penetration: Largest penetration met at the samples [m].
        steps: Steps of the integrator.
        evaluations: Evaluations of the right hand side.
    """

    times: Floats
    position: Floats
    velocity: Floats
    impulse: Floats
    row: int = 0
    episodes: list[tuple[float, int, float, float, float]] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    open: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    penetration: float = 0.0
    steps: int = 0
    evaluations: int = 0

    def fill(self, end: float, state: Callable[[float], tuple[Floats, Floats, Floats]]) -> None:
        """Write the rows up to a time."""
        while self.row < len(self.times) and self.times[self.row] <= end:
            u, v, q = state(float(self.times[self.row]))
            self.position[self.row], self.velocity[self.row], self.impulse[self.row] = u, v, q
            self.row += 1

    def begin(self, t: float, constraint: int, speed: float, impulse: float) -> None:
        """A constraint starts to act."""
        self.open[constraint] = (t, speed, impulse)

    def finish(self, t: float, constraint: int, speed: float, impulse: float) -> None:
        """A constraint stops acting."""
        if constraint in self.open:
            start, before, earlier = self.open.pop(constraint)
            self.ends.append(t)
            self.episodes.append((start, constraint, before, speed, impulse - earlier))


class Legs:
    """Marches a penalised system from one change of the active set to the next.

    Args:
        projector: Penalty forces.
        record: Where rows and episodes go.
        solver: Makes a SciPy `OdeSolver` from (fun, t, y, end); y holds the displacement since the
            start of the leg, the velocity, and the impulse of the constraints.
        slack: Depth to which a margin may be negative [m]: the tolerance of positions. It keeps
            bodies at rest on the boundary from switching with every rounding error.
    """

    def __init__(
        self,
        projector: Projector,
        record: Record,
        solver: Callable[[Any, float, Floats, float], Any],
        slack: float,
    ) -> None:
        self._projector, self._record, self._solver = projector, record, solver
        self._slack = slack
        self._system = projector.system
        self._d = projector.system.dofs

    def run(self, u: Floats, v: Floats, duration: float) -> None:
        """March from t = 0 to the end, leg by leg.

        Raises:
            ConvergenceError: The integrator failed.
        """
        t, q = 0.0, np.zeros(self._system.num_constraints)
        active = self._first_set(u, v)
        self._switch(t, u, v, q, np.zeros_like(active), active)
        toggles, shortest = 0, _BLIND / np.sqrt(self._projector.stiffness)
        blind = shortest
        while t < duration:
            start, before = t, active
            if toggles > _MAX_TOGGLES:
                # Within rounding of a vertex no set is right for long: march on without one.
                t, u, v, q, _ = self._leg(t, u, v, q, None, min(t + blind, duration))
                active = self._projector.project(t, u).multiplier > 0.0
                toggles, blind = 0, 2.0 * blind
            else:
                t, u, v, q, change = self._leg(t, u, v, q, active, duration)
                toggles = toggles + 1 if t - start <= 1e-6 * shortest else 0
                blind = blind if t - start <= blind else shortest
                if change is not None:
                    active = active.copy()
                    active[change] = not active[change]
            self._switch(t, u, v, q, before, active)

    def _switch(
        self, t: float, u: Floats, v: Floats, q: Floats, before: Booleans, after: Booleans
    ) -> None:
        """Note the constraints that start and stop acting."""
        changed = np.flatnonzero(before != after)
        rate = self._system.gap_rate(t, u, v) if len(changed) else q
        for j in (int(j) for j in changed):
            if after[j]:
                self._record.begin(t, j, float(rate[j]), float(q[j]))
            else:
                self._record.finish(t, j, float(rate[j]), float(q[j]))

    def _first_set(self, u: Floats, v: Floats) -> Booleans:
        """The constraints that act just after the start: closed ones that the motion presses."""
        gap = self._system.gap(0.0, u)
        rate = self._system.gap_rate(0.0, u, v)
        speed = float(np.abs(rate).max(initial=0.0))
        size = float(np.abs(gap).max(initial=0.0)) + float(np.abs(u).max(initial=0.0))
        closed = np.abs(gap) <= 1e-13 * size
        active = gap < -1e-13 * size
        if closed.any():
            # A look ahead by so little that accelerations count only where there is no speed.
            free, _ = self._projector.acceleration(0.0, u, v, active)
            bend = self._system.jacobian(u) @ free + self._system.gap_curvature(0.0, u, v)
            still = np.abs(rate) <= 1e-13 * speed
            active |= closed & np.where(still, bend < 0.0, rate < 0.0)
        if active.sum() > 1:  # some of them may be shadowed by others
            ahead = u + v * 1e-9 / np.sqrt(self._projector.stiffness)
            found = self._projector.project(0.0, ahead).multiplier > 0.0
            active = found if found.any() else active
        return active

    def _leg(
        self, start: float, u: Floats, v: Floats, q: Floats, active: Booleans | None, end: float
    ) -> tuple[float, Floats, Floats, Floats, int | None]:
        """One leg; returns time, u, v, q at its end, and the constraint that changed."""
        d, projector, record = self._d, self._projector, self._record

        def fun(t: float, y: Floats) -> Floats:
            a, force = projector.acceleration(t, u + y[:d], y[d : 2 * d], active)
            return np.concatenate([y[d : 2 * d], a, force])

        solver = self._solver(fun, start, np.concatenate([np.zeros(d), v, q]), end)

        def split(y: Floats) -> tuple[Floats, Floats, Floats]:
            return u + y[:d], y[d : 2 * d], y[2 * d :]

        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise ConvergenceError(
                    f"penalty: the integrator failed at t = {solver.t:g}: {message}"
                )
            record.steps += 1
            dense = solver.dense_output()
            event = None
            if active is not None:
                event = self._first_root(dense, solver.t_old, solver.t, u, active)
            if event is not None:
                at, constraint = event
                record.evaluations += solver.nfev
                record.fill(at, lambda t: split(dense(t)))  # noqa: B023  # called at once
                return at, *split(dense(at)), constraint
            record.fill(solver.t, lambda t: split(dense(t)))  # noqa: B023  # called at once
        record.evaluations += solver.nfev
        return end, *split(solver.y), None

    def _first_root(
        self, dense: Dense, begin: float, end: float, u: Floats, active: Booleans
    ) -> tuple[float, int] | None:
        """The first time in a step at which the active set changes, and the constraint."""
        d = self._d

        def margin(t: float) -> Floats:
            place = u + dense(t)[:d]
            return self._projector.project(t, place, active).margin(active) + self._slack

        def rate(t: float) -> Floats:
            y = dense(t)
            return self._system.gap_rate(t, u + y[:d], y[d : 2 * d])

        flying = not active.any()
        times = np.linspace(begin, end, _SAMPLES + 1)
        old = margin(begin)
        old_rate = rate(begin) if flying else old
        for a, b in pairwise(times):
            new = margin(b)
            new_rate = rate(b) if flying else new
            roots = [_root(margin, int(j), a, b) for j in np.flatnonzero(new < 0.0)]
            if flying:  # a short contact between two samples has a minimum of the gap there
                dips = np.flatnonzero((new >= 0.0) & (old_rate < 0.0) & (new_rate > 0.0))
                for j in (int(j) for j in dips):
                    reach = -old_rate[j] * (b - a)
                    low = brentq(lambda t, j=j: rate(t)[j], a, b) if old[j] < reach else a
                    if margin(low)[j] < 0.0:
                        roots.append(_root(margin, j, a, low))
            else:
                inside = self._system.gap(b, u + dense(b)[:d])
                self._record.penetration = max(self._record.penetration, -float(inside.min()))
            if roots:
                return min(roots)
            old, old_rate = new, new_rate
        return None


def _root(margin: Callable[[float], Floats], j: int, a: float, b: float) -> tuple[float, int]:
    """The time in [a, b] at which margin j becomes negative; a if it is positive nowhere there.

    At the start of a leg the margin is 0: a brief leg rises and falls again before b.
    """
    start, share = a, 1.0
    while margin(start)[j] <= 0.0:
        share *= 0.5
        if share < _SHORTEST:
            return a, j
        start = a + share * (b - a)
    xtol = 4.0 * np.finfo(float).eps * max(abs(a), abs(b))
    return float(brentq(lambda t: margin(t)[j], start, b, xtol=xtol, rtol=1e-15)), j
