"""Motions that reach what is asked at least cost: transcribed, solved, refined, followed."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.trajectory.building import Guess, Sizes, Stretch, cost_size, sizes_of
from impactfem.trajectory.following import Followed, followed, followed_closely
from impactfem.trajectory.impacts import Impact
from impactfem.trajectory.motion import Motion
from impactfem.trajectory.nlp import Answer, Program
from impactfem.trajectory.problem import Given, Limited, Problem, bounds_of, held
from impactfem.trajectory.struck import Struck
from impactfem.trajectory.transcriptions import TRANSCRIPTIONS, Transcription, transcription_of

_JUDGED = 1e-3  # defect that is allowed where no mesh is refined
_ROUNDS = 12  # of refinement
_PIECES = 4  # an interval is cut into at most
_RELAXED = tuple(10.0**-k for k in range(8))  # eps, one after the other
_NEARLY = 5  # of these on finer meshes
_TIGHT = 1e-4  # of which nothing is seen beside steps of first order
_NODES = 4000  # of a refined mesh
_NOTHING = 1e-9  # of the size of the cost
_NEAR_ONE = (1e-2, 1e3)  # costs in their size, with which the search may end
_LONGER = 1e3  # times the longest duration: looked through for the shortest one that can be
_WITHIN = 100  # iterations through impacts, and for the shortest duration: searches may creep on
_MESH = 40  # intervals at most on which the shortest duration is looked for
_INSIDE = 1e-9  # of the sizes at the start, by which gaps may be closed there
_REMEDY = "give another guess, more nodes, or bounds of states and controls"
_REMEDIES = {
    "Invalid_Number_Detected": "a function or its slope is not finite where it begins: give "
    "another guess, or bounds that keep away from there",
    "Not_Enough_Degrees_Of_Freedom": "more is asked of start and end than controls can reach: "
    "leave some of it out",
}


@dataclass(frozen=True)
class Transcribed:
    """A motion that was found, and how far it is from the one that really follows.

    Distances of a state are in shares of how far it moves.

    Attributes:
        problem: What was asked.
        transcription: Name of the row of the table.
        status: "converged", "infeasible" or "not_converged".
        message: What the search said; what was not met, and the remedy.
        cost: Least cost that was found, by the transcription.
        kkt_residual: Of the first-order conditions, in sizes of unknowns, rows and cost.
        iterations: Of Ipopt, in all.
        refine: Largest defect that was asked for; 0: the mesh was kept.
        rounds: Number N of intervals of each mesh that was solved.
        seconds: That it took [s].
        follower: Who tells what really follows.
        wrong: What else is against it.
        more: Figures of its own.
        eps: Of products that are 0, how large they are left, in sizes of their factors.
    """

    problem: Problem
    transcription: str
    status: str
    message: str
    cost: float
    kkt_residual: float
    iterations: int
    refine: float
    rounds: tuple[int, ...]
    seconds: float
    _motion: Motion
    _followed: Followed
    _sizes: Floats
    follower: str = "dop853"
    eps: float = 0.0
    wrong: tuple[str, ...] = ()
    more: Mapping[str, Any] = field(default_factory=dict)

    def with_followed(self, method: str, states: Floats) -> "Transcribed":
        """The same with what really follows by another method, at the nodes (N + 1, n)."""
        return replace(self, follower=method, _followed=replace(self._followed, states=states))

    @property
    def duration(self) -> float:
        """T [s]."""
        return self._motion.duration

    @property
    def times(self) -> Floats:
        """Of the nodes [s], (N + 1,)."""
        return self._motion.times

    @property
    def nodes(self) -> int:
        """Number N of intervals."""
        return self._motion.intervals

    @property
    def states(self) -> dict[str, Floats]:
        """At the nodes, (N + 1,) each."""
        return dict(zip(self.problem.states, self._motion.states.T, strict=True))

    @property
    def controls(self) -> dict[str, Floats]:
        """At the nodes, (N + 1,) each; at a jump, after it."""
        return dict(zip(self.problem.controls, self.control(self.times).T, strict=True))

    @property
    def parameters(self) -> dict[str, float]:
        """Those that were searched."""
        values = map(float, self._motion.parameters)
        return dict(zip(self.problem.parameters, values, strict=True))

    def control(self, times: ArrayLike) -> Floats:
        """Controls (k, m) at times (k,) [s], as they are between nodes."""
        shares = np.atleast_1d(np.asarray(times, dtype=float)) / self._motion.duration
        return self._motion.control_at(shares)

    def follow(self, pieces: int) -> tuple[Floats, Floats]:
        """What really follows, at so many places in each interval: times (k,), states (k, n)."""
        return followed_closely(self.problem, self._motion, self._sizes, pieces)

    @property
    def at_nodes(self) -> Floats:
        """States at the nodes, (N + 1, n)."""
        return self._motion.states

    @property
    def fractions(self) -> Floats:
        """Of the nodes, as shares of the duration (N + 1,)."""
        return self._motion.fractions

    @property
    def sizes(self) -> Floats:
        """How far states move, of which distances are shares (n,)."""
        return self._sizes

    @property
    def is_stepwise(self) -> bool:
        """Whether controls stay as they are from each node to the next."""
        controls = self._motion.controls
        return bool((controls == controls[:, :1]).all())

    def as_guess(self) -> Guess:
        """Where another search begins."""
        return Guess.of(self._motion)

    @property
    def resimulated(self) -> dict[str, Floats]:
        """What really follows from start and controls, at the nodes (N + 1,); see `followed`."""
        return dict(zip(self.problem.states, self._followed.states.T, strict=True))

    @property
    def impacts(self) -> list[dict[str, Any]]:
        """Time [s] and name of each impact of what really follows."""
        names = [impact.name for impact in self.problem.impacts]
        return [{"time": t, "of": names[j]} for t, j in self._followed.impacts]

    @property
    def resimulated_cost(self) -> float:
        """The cost of what really follows."""
        return self._followed.cost

    @cached_property
    def defects(self) -> Floats:
        """How far what follows from each node is from the next one, (N,)."""
        return _largest(self._followed.defects / self._sizes)

    @property
    def defect_max(self) -> float:
        """Largest of them."""
        return float(self.defects.max())

    @property
    def resimulated_distance(self) -> float:
        """Largest distance of the motion from what really follows, at the nodes."""
        away = (self._followed.states - self._motion.states) / self._sizes
        return float(_largest(away).max())

    @property
    def end_errors(self) -> dict[str, float]:
        """How far what really follows ends from what is asked, by state, in its units."""
        return self._off(self._followed.states[-1])

    def off_end(self, last: Floats) -> float:
        """How far a last state (n,) is from what is asked, in shares of how far states move."""
        off = self._off(last)
        return max((self._share(name, off) for name in off), default=0.0)

    def _off(self, last: Floats) -> dict[str, float]:
        names = list(self.problem.states)
        low, high = held(self.problem.end, bounds_of(self.problem.states), names).T
        off = np.maximum(np.maximum(low - last, last - high), 0.0)
        found = {name: float(off[names.index(name)]) for name in self.problem.end}
        return found | {row.name: row.off(last) for row in self.problem.end_rows}

    @property
    def resimulated_end_error(self) -> float:
        """Largest of them, in shares of how far the states move; inf: it could not be followed."""
        return self.off_end(self._followed.states[-1])

    @property
    def bounds_exceeded(self) -> float:
        """How far what really follows leaves bounds of states, in shares of how far they move."""
        low, high = bounds_of(self.problem.states).T
        states = self._followed.states
        off = np.maximum(np.maximum(low - states, states - high), 0.0) / self._sizes
        return float(np.nan_to_num(off, nan=np.inf).max())

    @property
    def allowed(self) -> float:
        """The largest end error that is trusted: root of the defect that is allowed."""
        return float(np.sqrt(self.refine or _JUDGED))

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why it is not to be trusted; nothing if it is."""
        if self.status != "converged":
            return (self.message,)
        found = list(self.wrong)
        if not np.isfinite(self._followed.states).all():
            found.append(
                "what really follows cannot be followed to the end: its rate grows endless"
            )
        elif self.resimulated_end_error > self.allowed:
            off = self.end_errors
            name = max(off, key=lambda name: self._share(name, off))
            found.append(
                f"what really follows misses the end: {name} by {self.end_errors[name]:.3g}, "
                f"{self.resimulated_end_error:.2g} of how far it moves, allowed {self.allowed:.2g};"
                " give more nodes, or refine"
            )
        if self.eps > _TIGHT:
            found.append(
                f"complementarity is relaxed by eps = {self.eps:g}: nothing was found below; give "
                "more nodes, or another start"
            )
        if self.refine and self.defect_max > self.refine:
            found.append(
                f"defect {self.defect_max:.2g} is above refine = {self.refine:g} with "
                f"{self.nodes} intervals; a control that jumps keeps it up: bound it, or allow more"
            )
        return tuple(found)

    def _share(self, name: str, off: Mapping[str, float]) -> float:
        sizes = {row.name: row.size for row in self.problem.end_rows}
        sizes |= dict(zip(self.problem.states, self._sizes, strict=True))
        return float(np.nan_to_num(off[name] / sizes[name], nan=np.inf))

    @property
    def trusted(self) -> bool:
        """Whether the search converged and what really follows ends as asked."""
        return not self.doubts

    @property
    def summary(self) -> dict[str, Any]:
        """The figures, as in summary.json."""
        return {
            "status": self.status, "message": self.message, "transcription": self.transcription,
            "cost": self.cost, "resimulated_cost": self.resimulated_cost,
            "duration": self.duration, "parameters": self.parameters,
            "kkt_residual": self.kkt_residual, "defect_max": self.defect_max,
            "resimulated_distance": self.resimulated_distance,
            "followed_by": self.follower, "impacts": self.impacts,
            "resimulated_end_error": self.resimulated_end_error, "end_errors": self.end_errors,
            "allowed_end_error": self.allowed, "bounds_exceeded": self.bounds_exceeded,
            "eps": self.eps, "nodes": self.nodes, "rounds": list(self.rounds),
            "iterations": self.iterations, "seconds": self.seconds, **self.more,
        }  # fmt: skip


def transcribe(
    dynamics: Callable[..., Any], *, states: Limited, controls: Limited = (),
    duration: float | tuple[float, float], start: Given | None = None, end: Given | None = None,
    running: Callable[..., Any] | None = None, final: Callable[..., Any] | None = None,
    path: Callable[..., Any] | None = None, parameters: Limited = (),
    impacts: Sequence[Impact] = (), pairs: Callable[..., Any] | None = None,
    transcription: str = "hermite_simpson", nodes: int = 40, refine: float = 0.0,
    control: str = "linear", guess: "Mapping[str, ArrayLike] | Transcribed | None" = None,
    max_iterations: int = 1000,
) -> Transcribed:  # fmt: skip
    """Find the motion x' = f(t, x, u, p) that reaches what is asked at least cost.

    The functions are called once, with symbols of CasADi, from which Ipopt has exact first and
    second derivatives; functions of NumPy work on these. The answer is a local optimum. It is then
    followed from its start with its controls by Dormand and Prince's method of order 8, tolerance
    1e-12, which knows nothing of the mesh.

        >>> block = impactfem.transcribe(
        ...     lambda t, x, u: [x[1], u[0]], states=["x", "v"], controls=["u"], duration=1.0,
        ...     start={"x": 0, "v": 0}, end={"x": 1, "v": 0}, running=lambda t, x, u: u[0] ** 2,
        ... )
        >>> round(block.cost, 6)
        12.0

    Args:
        dynamics: f(t, x, u), or f(t, x, u, p) where parameters are searched: rates of the states.
        states: Names, or names with least and largest values (None: any).
        controls: Likewise.
        duration: T [s], or its least and largest value: then it is searched.
        start: States at t = 0 by name: a value, or a pair of limits. Others are free.
        end: States at t = T.
        running: Integrand of the cost, (t, x, u[, p]).
        final: Cost of the end, (T, x[, p]).
        path: What stays <= 0 at all nodes (and amid intervals, with "hermite_simpson").
        parameters: Constants that are searched, as states.
        impacts: What the motion strikes (`impactfem.inverse.Impact`), through which shooting goes.
        pairs: Factors >= 0 of products that are 0, (t, x, u[, p]), one after the other: those of
            complementarity, with "contact_implicit".
        transcription: A row of the table: "euler", "midpoint", "trapezoid", "hermite_simpson",
            "multiple_shooting", "single_shooting", "contact_implicit".
        nodes: Number N of intervals of the first mesh.
        refine: Largest defect between nodes: intervals with more are cut. 0: the mesh is kept.
        control: Between nodes of shooting: "linear" or "constant".
        guess: Where to begin: an answer, or by names of states, controls, parameters and
            "duration" a number or values at equal distances of time.
        max_iterations: Of Ipopt, for each mesh.

    Raises:
        SceneError: Something given cannot be; the message names it.
        MissingDependencyError: CasADi is not installed.
    """
    problem = Problem.of(
        dynamics, states, controls, parameters, duration, start or {}, end or {},
        running=running, final=final, path=path, impacts=tuple(impacts), pairs=pairs,
    )  # fmt: skip
    return solved(
        problem, transcription, nodes, refine, guess, control=control, most=max_iterations
    )


def solved(
    problem: Problem, transcription: str, nodes: int, refine: float,
    guess: "Mapping[str, ArrayLike] | Transcribed | None", *, control: str, most: int,
) -> Transcribed:  # fmt: skip
    """Solve a problem; see `transcribe`."""
    row = transcription_of(transcription)
    if control not in {"linear", "constant"}:
        raise SceneError(f'control: "{control}" is not known; give "linear" or "constant"')
    if problem.impacts and not row.through:
        through = [name for name, each in TRANSCRIPTIONS.items() if each.through]
        raise SceneError(
            f'transcription: "{transcription}" does not go through impacts '
            f"({problem.impacts[0].name}); give {' or '.join(through)}"
        )
    if not (isinstance(nodes, int) and 1 <= nodes <= _NODES):
        raise SceneError(f"nodes: {nodes} is no number of intervals; give 1 to {_NODES}")
    if not 0.0 <= refine < 1.0:
        raise SceneError(f"refine: {refine} is no defect; give 0 (no refinement) to 1, as 1e-6")
    if (transcription == "contact_implicit") != (problem.pairs is not None):
        raise SceneError(
            f'transcription: "{transcription}" and pairs do not go together; give both '
            '"contact_implicit" and pairs, or none'
        )
    most = min(most, _WITHIN) if problem.impacts else most
    search = _Search(problem, row, control == "constant", most)
    begun = time.perf_counter()
    given = {} if isinstance(guess, Transcribed) else guess or {}
    first = guess.as_guess() if isinstance(guess, Transcribed) else begin(problem, given)
    mesh = np.linspace(0.0, 1.0, nodes + 1)
    if problem.impacts:
        first = rolled_out(problem, first, mesh)
    found = search.refined(mesh, first, refine)
    message = found.answer.said
    if found.answer.status == "infeasible":
        message = search.why_infeasible(found.answer, first)
    elif found.answer.status != "converged" and problem.impacts:
        message = f"the search did not converge (Ipopt: {message}){_kept(problem, first, row)}"
    elif found.answer.status == "not_converged":
        message = (
            f"the search did not converge (Ipopt: {message}) in {found.answer.iterations} "
            f"iterations; {_REMEDIES.get(message, _REMEDY)}"
        )
    else:
        message = found.answer.in_words
    return Transcribed(
        problem, transcription, found.answer.status, message, found.answer.cost, found.answer.kkt,
        search.iterations, refine, tuple(search.rounds), time.perf_counter() - begun,
        found.motion, found.followed, found.sizes, eps=search.eps,
    )  # fmt: skip


@dataclass(frozen=True)
class _Found:
    """A motion on one mesh."""

    answer: Answer
    motion: Motion
    followed: Followed
    sizes: Floats


class _Search:
    """Motions of one problem on several meshes."""

    def __init__(self, problem: Problem, row: Transcription, constant: bool, most: int) -> None:
        self.problem, self.row, self.constant, self.most = problem, row, constant, most
        self.iterations, self.rounds = 0, list[int]()
        self.relaxed = _RELAXED if problem.pairs is not None else (0.0,)
        self.eps = self.relaxed[0]

    def refined(self, mesh: Floats, guess: Guess, refine: float) -> _Found:
        """On meshes that are cut where defects are large."""
        found = self.solved(mesh, guess)
        for _ in range(_ROUNDS if refine else 0):
            defects = _largest(found.followed.defects / found.sizes)
            if found.answer.status != "converged" or defects.max() <= refine:
                break
            mesh = cut(mesh, defects, refine, self.row.order)
            if len(mesh) > _NODES:
                break
            self.relaxed = self.relaxed[-_NEARLY:]  # it begins next to the answer
            finer = self.solved(mesh, Guess.of(found.motion, guess.counts))
            if finer.answer.status != "converged":
                break
            found = finer
        return found

    def solved(self, mesh: Floats, guess: Guess) -> _Found:
        """On one mesh; once more with the size of its cost, if that is far from 1."""
        sizes = sizes_of(self.problem, guess)
        size = cost_size(self.problem, guess, sizes)
        for _ in range(3):
            answer, motion = self._solved(mesh, guess, sizes, size, self.relaxed[0])
            share = abs(answer.cost) / size
            if answer.status != "converged" or _NEAR_ONE[0] < share < _NEAR_ONE[1]:
                break
            if share < _NOTHING:  # it costs nothing
                break
            size, guess = abs(answer.cost), Guess.of(motion, guess.counts)
        for eps in self.relaxed[1:]:
            tighter, moved = self._solved(mesh, Guess.of(motion), sizes, size, eps)
            if tighter.status == "infeasible" and answer.status == "converged":
                break  # what is known holds at the eps before
            answer, motion, self.eps = tighter, moved, eps
        self.rounds.append(len(mesh) - 1)
        spans = np.maximum(motion.spans(), 1e-3 * sizes.states)
        return _Found(answer, motion, followed(self.problem, motion, spans), spans)

    def _solved(
        self, mesh: Floats, guess: Guess, sizes: Sizes, size: float, eps: float = 0.0
    ) -> tuple[Answer, Motion]:
        program = Program()
        stretch = Stretch(
            program, self.problem, self.row, mesh, guess, sizes, constant=self.constant, eps=eps
        )
        answer = program.solve(size, self.most)
        self.iterations += answer.iterations
        return answer, stretch.motion(answer)

    def why_infeasible(self, answer: Answer, guess: Guess) -> str:
        """What cannot be met, and the least duration with which it can."""
        told = f"no motion was found that meets all that is asked; farthest off is {answer.worst}"
        if self.problem.impacts:
            return told + _kept(self.problem, guess, self.row)
        low, high = self.problem.duration
        longer = replace(
            self.problem, duration=(1e-3 * low, _LONGER * high), running=None,
            final=lambda t, *_: t,
        )  # fmt: skip
        search = _Search(longer, self.row, self.constant, min(self.most, _WITHIN))
        found, _ = search._solved(
            np.linspace(0.0, 1.0, min(self.rounds[-1], _MESH) + 1),
            replace(guess, duration=4.0 * high),
            sizes_of(longer, replace(guess, duration=4.0 * high)), 4.0 * high,
        )  # fmt: skip
        if found.status == "converged" and found.cost > high:
            return f"{told}; the shortest duration that was found is {found.cost:.4g} s: give that"
        return f"{told}; widen bounds, or ask for less at the ends"


def cut(mesh: Floats, defects: Floats, refine: float, order: int) -> Floats:
    """A mesh whose intervals with large defects are cut."""
    # An interval's defect falls with its length to the order and one.
    pieces = np.ceil((2.0 * defects / refine) ** (1.0 / (order + 1)))
    pieces = np.where(defects > refine, np.clip(pieces, 2, _PIECES), 1).astype(int)
    return np.concatenate([
        *(np.linspace(a, b, count, endpoint=False)
          for a, b, count in zip(mesh[:-1], mesh[1:], pieces, strict=True)), [1.0],
    ])  # fmt: skip


def _kept(problem: Problem, guess: Guess, row: Transcription) -> str:
    """To what a search through impacts is kept, and the remedy."""
    counts = np.zeros(len(problem.impacts)) if guess.counts is None else guess.counts
    told = ", ".join(
        f"{each.name}: {count:.0f}" for each, count in zip(problem.impacts, counts, strict=True)
    )
    return (
        f"; it was kept to motions that strike as often as the guess does ({told}): give a guess, "
        "as values of controls, that strikes as it should and ends nearer, or ask for less"
    ) + ("" if row.shoots else "; single_shooting lets impacts pass nodes, which this does not")


def begin(problem: Problem, given: Mapping[str, ArrayLike]) -> Guess:
    """Where a search begins: straight from start to end, controls 0, unless values are given.

    Raises:
        SceneError: A name is not known, or values are none.
    """
    known = [*problem.states, *problem.controls, *problem.parameters, "duration"]
    for name, values in given.items():
        if name not in known:
            raise SceneError(f"guess.{name}: there is no such name; give one of {', '.join(known)}")
        if not np.isfinite(np.asarray(values, dtype=float)).all():
            raise SceneError(f"guess.{name}: {values!r} are no finite numbers")
    low, high = problem.duration
    duration = float(np.clip(given.get("duration", np.sqrt(low * high)), low, high))
    ends = [_values(side) for side in (problem.start, problem.end)]
    lines = {
        name: given.get(name, _line(name, limits, *ends)) for name, limits in problem.states.items()
    }
    pushes = {name: given.get(name, [0.0]) for name in problem.controls}
    parameters = [
        float(np.mean(np.asarray(given.get(name, _inside(limits)), dtype=float)))
        for name, limits in problem.parameters.items()
    ]

    def along(columns: Mapping[str, ArrayLike]) -> Callable[[Floats], Floats]:
        each = [np.atleast_1d(np.asarray(values, dtype=float)) for values in columns.values()]

        def at(shares: Floats) -> Floats:
            found = [np.interp(shares, np.linspace(0, 1, len(v)), v) for v in each]
            return np.array(found).reshape(len(each), len(shares)).T

        return at

    return Guess(duration, along(lines), along(pushes), np.array(parameters))


def rolled_out(problem: Problem, guess: Guess, mesh: Floats) -> Guess:
    """A guess whose states follow from its controls, through impacts to whose count it is kept.

    Raises:
        SceneError: It starts inside, its impacts accumulate, or it cannot be followed.
    """
    flow, times, n = Struck(problem), guess.duration * mesh, len(problem.states)
    controls, counts = guess.controls(mesh), np.zeros(len(problem.impacts))
    states = [guess.states(mesh[:1])[0]]
    gaps = np.asarray(problem.gaps(0.0, states[0], controls[0], guess.parameters)).ravel()
    if gaps.min() < -_INSIDE * max(np.abs(states[0]).max(), np.abs(gaps).max()):
        name, worst = problem.impacts[int(gaps.argmin())].name, -gaps.min()
        raise SceneError(f"start: {worst:.3g} inside ({name}); move it out")
    for k, h in enumerate(np.diff(times)):
        ends = controls[k], controls[k + 1]
        z = np.concatenate([times[k : k + 1], states[-1], *ends, guess.parameters, [h]])
        told = np.asarray(flow.value(z, 0), dtype=float).ravel()
        if not np.isfinite(told).all():
            raise SceneError(
                f"guess: cannot be followed after t = {times[k]:.4g} s: impacts accumulate in "
                "lasting contact, or rates grow endless; shooting goes through impacts alone: give "
                "controls that keep bodies from rest on what they strike, or a shorter duration"
            )
        states.append(told[:n])
        counts += told[n + 1 :]
    found = np.array(states).T
    return replace(
        guess, states=lambda at: np.array([np.interp(at, mesh, each) for each in found]).T,
        counts=counts,
    )  # fmt: skip


def _values(side: Given) -> dict[str, float]:
    """One value of each limit at an end."""
    return {
        name: _inside(value) if isinstance(value, Sequence) else value
        for name, value in side.items()
    }


def _line(
    name: str, limits: Any, start: Mapping[str, float], end: Mapping[str, float]
) -> list[float]:
    first = start.get(name, end.get(name, _inside(limits)))
    return [first, end.get(name, first)]


def _inside(limits: Any) -> float:
    """A number between limits: 0 if it is, else the nearest or the middle."""
    if limits is None:
        return 0.0
    low, high = limits
    return (
        float(np.clip(0.0, low, high))
        if low <= 0.0 <= high or not np.isfinite(high - low)
        else 0.5 * (low + high)
    )


def _largest(shares: Floats) -> Floats:
    """The largest share of each row; what could not be followed is endlessly far."""
    return np.asarray(np.nan_to_num(np.abs(shares), nan=np.inf).max(axis=1))
