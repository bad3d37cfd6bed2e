"""The nonlinear program of a problem on a mesh, by one of the transcriptions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.trajectory.motion import Motion
from impactfem.trajectory.nlp import Answer, Program
from impactfem.trajectory.problem import Problem, Row, bounds_of, held
from impactfem.trajectory.struck import Struck
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.transcriptions import Interval, Spot, Transcription, runge_kutta


@dataclass(frozen=True)
class Sizes:
    """How large states (n,), controls (m,) and parameters (q,) are, and the duration [s]."""

    states: Floats
    controls: Floats
    parameters: Floats
    duration: float


@dataclass(frozen=True)
class Guess:
    """Where the search begins.

    Attributes:
        duration: T [s].
        states: Of shares of the duration (k,) to (k, n).
        controls: To (k, m).
        parameters: (q,).
        counts: Impacts of each kind (J,), to which the search is kept; None: it is not.
    """

    duration: float
    states: Callable[[Floats], Floats]
    controls: Callable[[Floats], Floats]
    parameters: Floats
    counts: Floats | None = None

    @classmethod
    def of(cls, motion: Motion, counts: Floats | None = None) -> "Guess":
        """A motion that was found on another mesh."""
        return cls(motion.duration, motion.state_at, motion.control_at, motion.parameters, counts)


_INSIDE = 1e-9  # of a size, by which gaps at nodes may be closed: they are where impacts end
_SHARE = 0.03  # of the size of controls, whose cost is the size of the cost


class Stretch:
    """A problem on one mesh, written into a program.

    Args:
        program: Where unknowns and rows go.
        problem: What is asked.
        row: The transcription.
        constant: Whether controls are constant between nodes, where the row leaves that open.
        fractions: Nodes, as shares of the duration (N + 1,).
        guess: Where the search begins.
        sizes: Of all unknowns.
        begun: Time at its start, an expression.
        eps: Products that are 0 are at most so many times the sizes of their factors.
    """

    def __init__(
        self, program: Program, problem: Problem, row: Transcription, fractions: Floats,
        guess: Guess, sizes: Sizes, *, constant: bool = False, begun: Any = 0.0, eps: float = 0.0,
    ) -> None:  # fmt: skip
        self.program, self.problem, self.row = program, problem, row
        self.fractions, self.guess, self.sizes = fractions, guess, sizes
        self.eps, self.factors = eps, factor_sizes(problem, guess, sizes)
        self.control = ("constant" if constant else "linear") if row.control == "either" else ""
        self.control = self.control or row.control
        self.duration: Any = problem.duration[0]
        if problem.free:
            bounds = np.array([problem.duration])
            self.duration = program.unknown(bounds, [guess.duration], np.array([sizes.duration]))
        self.parameters: Any = np.zeros(0)
        if problem.parameters:
            bounds = bounds_of(problem.parameters)
            self.parameters = program.unknown(bounds, guess.parameters, sizes.parameters)
        self.times = [begun + self.duration * share for share in fractions]
        self.lefts: list[Spot] = []
        self.rights: list[Spot] = []
        self.middles: list[Spot] = []
        self._write()

    def _write(self) -> None:
        problem, program, row = self.problem, self.program, self.row
        bounds = bounds_of(problem.states)
        ends = [held(given, bounds, list(problem.states)) for given in (problem.start, problem.end)]
        states, nodes = self.guess.states(self.fractions), len(self.fractions)
        u = self._control_unknowns(self.fractions)
        left = self._spot(0, self._state_unknown(ends[0], states[0]), u[0])
        self._ends(problem.start_rows, left.x)
        halves = 0.5 * (self.fractions[1:] + self.fractions[:-1])
        amid, at_halves = self._control_middles(u, halves), self.guess.states(halves)
        # Kept here: CasADi counts no references of functions written in Python.
        self.flow = Struck(problem) if problem.impacts else runge_kutta(problem.rate)
        for k in range(1, nodes):
            limits = ends[1] if k == nodes - 1 else bounds
            held_control = self.control == "constant"
            if held_control:
                left = left.at(left.t, left.x, u[k - 1])
            x: Any = left.x if row.shoots else self._state_unknown(limits, states[k])
            right = self._spot(k, x, u[k - 1] if held_control else u[k])
            inner = self._state_unknown(bounds, at_halves[k - 1]) if row.middles else left.x
            middle = left.at((left.t + right.t) / 2, inner, amid[k - 1])
            h = self.duration * (self.fractions[k] - self.fractions[k - 1])
            end, between, cost = row.step(Interval(h, left, right, middle, self.flow))
            program.cost = program.cost + cost
            if row.shoots:
                right = right.at(right.t, end, right.u)
                self._limit(right, limits)
            else:
                self._defect((right.x - end) / self.sizes.states, k)
            if between is not None:
                self._defect((middle.x - between) / self.sizes.states, k)
                self._path(middle)
            self._path(left)
            self._pairs(right)
            self.lefts.append(left)
            self.middles.append(middle)
            self.rights.append(right)
            left = right
        self._path(left)
        self._ends(problem.end_rows, left.x)
        program.cost = program.cost + self._last_cost(left)
        if isinstance(self.flow, Struck) and self.guess.counts is not None:
            program.cost = program.cost + self.flow.unlike(self.guess.counts)

    def _ends(self, rows: Sequence[Row], x: Any) -> None:
        for row in rows:
            low, high, name = row.low / row.size, row.high / row.size, row.name
            self.program.row(row.of(x) / row.size, low, high, partial(_named, name))

    def _last_cost(self, spot: Spot) -> Any:
        if self.problem.final is None:
            return 0
        return self.problem.last(spot.t, spot.x, self.parameters)

    def _spot(self, node: int, x: Any, u: Any) -> Spot:
        return Spot(self.problem.rate, self.times[node], x, u, self.parameters)

    def _state_unknown(self, bounds: Floats, guess: Floats) -> Any:
        return self.program.unknown(bounds, guess, self.sizes.states)

    def _control_unknowns(self, shares: Floats) -> list[Any]:
        """Of nodes; where controls are constant, of intervals."""
        if not self.problem.controls:
            return [np.zeros(0)] * len(shares)
        bounds, size = bounds_of(self.problem.controls), self.sizes.controls
        places = 0.5 * (shares[1:] + shares[:-1]) if self.control == "constant" else shares
        return [self.program.unknown(bounds, guess, size) for guess in self.guess.controls(places)]

    def _control_middles(self, u: list[Any], halves: Floats) -> list[Any]:
        """Amid intervals: unknowns of their own where controls are parabolas."""
        if self.control == "constant":
            return u
        if self.control == "quadratic" and self.problem.controls:
            return self._control_unknowns(halves)
        return [(u[k] + u[k + 1]) / 2 for k in range(len(halves))]

    def _defect(self, rows: Any, node: int) -> None:
        names, t = list(self.problem.states), self.fractions[node] * self.guess.duration
        self.program.row(rows, 0.0, 0.0, lambda i: f"the motion of {names[i]} up to t = {t:.4g} s")

    def _limit(self, spot: Spot, limits: Floats) -> None:
        """Bounds of states that are no unknowns."""
        names, node = list(self.problem.states), len(self.rights) + 1
        kept = np.flatnonzero(np.isfinite(limits).any(axis=1))
        if not len(kept):
            return
        rows = loaded().vertcat(*(spot.x[int(i)] / self.sizes.states[i] for i in kept))
        low, high = (limits[kept] / self.sizes.states[kept, None]).T
        t = self.fractions[node] * self.guess.duration

        def name(row: int) -> str:
            state, (least, most) = names[kept[row]], limits[kept[row]]
            return f"{state} from {least:g} to {most:g} at t = {t:.4g} s"

        self.program.row(rows, low, high, name)

    def _path(self, spot: Spot) -> None:
        t = self.fractions[len(self.lefts)] * self.guess.duration
        if self.problem.impacts and not self.row.shoots:  # nodes are outside of what is struck
            gaps = self.problem.gaps(spot.t, spot.x, spot.u, spot.p)
            struck = [impact.name for impact in self.problem.impacts]
            self.program.row(
                gaps, -_INSIDE, np.inf, lambda i: f"the gap of {struck[i]} at t = {t:.4g} s"
            )
        if self.problem.path is None:
            return
        rows = self.problem.limited(spot.t, spot.x, spot.u, spot.p)
        self.program.row(
            rows, -np.inf, 0.0, lambda i: f"{self.problem.path_name(i)} at t = {t:.4g} s"
        )

    def _pairs(self, spot: Spot) -> None:
        """Factors >= 0 at the end of an interval, whose products are next to 0."""
        if self.problem.pairs is None:
            return
        one, two = self.problem.paired(spot.t, spot.x, spot.u, spot.p)
        one, two = one / self.factors[0], two / self.factors[1]
        t = self.fractions[len(self.lefts) + 1] * self.guess.duration
        names = self.problem.pair_names

        def name(i: int) -> str:
            return f"{names[i] if i < len(names) else f'pairs[{i}]'} at t = {t:.4g} s"

        self.program.row(one, 0.0, np.inf, name)
        self.program.row(two, 0.0, np.inf, name)
        self.program.row(one * two, -np.inf, self.eps, name)

    def motion(self, answer: Answer) -> Motion:
        """The numbers of an answer."""
        casadi = loaded()
        n, m = len(self.problem.states), len(self.problem.controls)

        def columns(parts: list[Any]) -> Any:
            return casadi.horzcat(*(casadi.MX(part) for part in parts))

        asked = [
            columns([self.lefts[0].x, *(spot.x for spot in self.rights)]),
            columns([spot.rate for spot in self.lefts]),
            columns([spot.rate for spot in self.rights]),
            columns([spot.u for spot in self.lefts]), columns([spot.u for spot in self.middles]),
            columns([spot.u for spot in self.rights]), columns([spot.x for spot in self.middles]),
            casadi.MX(self.duration), casadi.MX(self.parameters),
        ]  # fmt: skip
        found = [
            np.asarray(each, dtype=float) for each in self.program.values(asked, answer.unknowns)
        ]
        count = len(self.fractions) - 1
        rates = np.stack([each.reshape(count, n) for each in found[1:3]], axis=1)
        controls = np.stack([each.reshape(count, m) for each in found[3:6]], axis=1)
        middles = found[6].reshape(count, n) if self.row.middles else None
        return Motion(
            self.fractions, float(found[7][0]), found[0].reshape(count + 1, n), rates, controls,
            found[8].ravel(), middles,
        )  # fmt: skip


def _named(name: str, _: int) -> str:
    return name


def sizes_of(problem: Problem, guess: Guess) -> Sizes:
    """Sizes of unknowns: from ends and bounds, else from how they act on what has one."""
    states = _said(problem.states, problem.start, problem.end)
    own = np.array([problem.sizes.get(name, np.nan) for name in problem.states])
    states = np.where(np.isnan(states), own, states)
    controls = _said(problem.controls, {}, {})
    parameters = np.nan_to_num(_said(problem.parameters, {}, {}), nan=1.0)
    casadi, span = loaded(), guess.duration
    t, x, u, p = problem.rate.mx_in()
    rate = problem.rate(t, x, u, p)[0]
    slopes = casadi.Function(
        "slopes", [t, x, u, p], [rate, casadi.jacobian(rate, x), casadi.jacobian(rate, u)]
    )
    least = np.array([0.3, 0.7])  # two places: one may be where a slope vanishes
    told = [
        slopes(span * share, guess.states(np.array([share]))[0],
               guess.controls(np.array([share]))[0], guess.parameters)
        for share in least
    ]  # fmt: skip
    rates, by_states, by_controls = (
        np.nan_to_num(
            np.abs(np.array([np.asarray(each[i], dtype=float) for each in told])),
            nan=0.0,
            posinf=0.0,
        ).max(axis=0)
        for i in range(3)
    )
    for _ in range(len(states)):
        for i in np.flatnonzero(np.isnan(states)):
            states[i] = _acting(states, by_states[:, i], span)
            if np.isnan(states[i]):  # what known ones do to it in all the time
                known = np.nan_to_num(states, nan=0.0)
                states[i] = span * float(by_states[i] @ known) or np.nan
    rest = span * rates.ravel()
    states = np.where(np.isnan(states), np.where(rest > 0.0, rest, 1.0), states)
    for j in np.flatnonzero(np.isnan(controls)):
        controls[j] = _acting(states, by_controls[:, j], span)
    if problem.pairs is not None:
        _size_by_pairs(problem, guess, states, controls)
    return Sizes(states, np.nan_to_num(controls, nan=1.0), parameters, span)


def _size_by_pairs(problem: Problem, guess: Guess, states: Floats, controls: Floats) -> None:
    """Sizes of controls that act in factors alone: of what stands beside them there."""
    by_states, by_controls = _factor_slopes(problem, guess)
    for j in np.flatnonzero(np.isnan(controls)):
        beside = by_states @ states + by_controls @ np.nan_to_num(controls, nan=0.0)
        acts = (by_controls[:, j] > 0.0) & (beside > 0.0)
        if acts.any():
            controls[j] = float((beside[acts] / by_controls[acts, j]).max())


def factor_sizes(problem: Problem, guess: Guess, sizes: Sizes) -> tuple[Floats, Floats]:
    """Sizes of the factors of products that are 0, (k,) each, by those of what they are made of."""
    if problem.pairs is None:
        return np.ones(0), np.ones(0)
    by_states, by_controls = _factor_slopes(problem, guess)
    total = by_states @ sizes.states + by_controls @ sizes.controls
    one, two = np.where(total > 0.0, total, 1.0).reshape(2, -1)
    return one, two


def _factor_slopes(problem: Problem, guess: Guess) -> tuple[Floats, Floats]:
    """Sizes of slopes of all factors by states and controls, first ones and second (2 k, ...)."""
    casadi = loaded()
    t, x, u, p = problem.paired.mx_in()
    both = casadi.vertcat(*problem.paired(t, x, u, p))
    told = casadi.Function(
        "slopes", [t, x, u, p], [casadi.jacobian(both, x), casadi.jacobian(both, u)]
    )
    half = np.array([0.5])
    found = told(0.5 * guess.duration, guess.states(half)[0], guess.controls(half)[0],
                 guess.parameters)  # fmt: skip
    by_states, by_controls = (np.nan_to_num(np.abs(np.asarray(e, dtype=float))) for e in found)
    return by_states, by_controls


def cost_size(problem: Problem, guess: Guess, sizes: Sizes) -> float:
    """Size of the cost, that of small controls: units then do not matter.

    Where a cost is told to be larger, searches for a cart and pole stay at the motion of least
    effort near their start; told to be smaller they end at one motion or another, by chance.
    """
    x = guess.states(np.array([0.5]))[0]
    told = problem.rate(0.5 * guess.duration, x, _SHARE * sizes.controls, guess.parameters)
    found = guess.duration * abs(float(told[1]))
    found += abs(float(problem.last(guess.duration, x, guess.parameters)))
    return found if np.isfinite(found) and found > 0.0 else 1.0


def _acting(known: Floats, slopes: Floats, span: float) -> float:
    """How large an unknown is that moves others, in the given time, by their sizes."""
    acts = (slopes > 0.0) & ~np.isnan(known)
    return float((known[acts] / (slopes[acts] * span)).min()) if acts.any() else np.nan


def _said(limits: Any, start: Any, end: Any) -> Floats:
    """Sizes that are said: how far it goes, its values, its bounds; NaN where none is."""
    found = np.full(len(limits), np.nan)
    for i, (name, bounds) in enumerate(limits.items()):
        ends = [np.mean(given[name]) for given in (start, end) if name in given]
        candidates = [abs(ends[1] - ends[0])] if len(ends) == 2 else []
        candidates += [max(map(abs, ends), default=0.0)]
        candidates += [max(map(abs, bounds))] if bounds is not None else []
        sound = [value for value in candidates if np.isfinite(value) and value > 0.0]
        found[i] = sound[0] if sound else np.nan
    return found
