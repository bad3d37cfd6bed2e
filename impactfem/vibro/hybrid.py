"""Systems that flow and jump in a known order: walkers, hoppers, machines with stops.

A phase flows by x' = f(x) until its event g(x) falls through 0, where x jumps to R(x). How
neighbours move follows along: between events by the equation of first variation, at an event by the
saltation matrix

    S = R' + (f+ - R' f-) g'^T / (g'^T f-).

Sources: Aizerman and Gantmacher, On the stability of periodic motions (1958); Kong, Payne, Zhu,
Johnson, Saltation matrices: the essential tool for linearizing hybrid systems (2023).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import DOP853, OdeSolution
from scipy.optimize import brentq

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.system.derivatives import Derivative

RTOL = 1e-12  # of each step
_ATOL = 1e-3  # times that, of the largest state
_LOOKS = 8  # at the event within a step
_POLISH = 4  # steps of Newton's method for the time of an event
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Phase:
    """One way to move, until something happens.

    All functions take the state x (n,), and parameters by name, and are smooth; those that take
    complex numbers (of NumPy) have exact derivatives.

    Attributes:
        rate: x' (n,).
        event: What ends the phase as it falls through 0.
        jump: To the state after the event (n,); None: it stays.
        when: Where the event counts, true or false; None: always. A walker's foot, whose knee is
            left out, strikes only once it is ahead.
        name: For messages and tables.
    """

    rate: Callable[..., ArrayLike]
    event: Callable[..., Any]
    jump: Callable[..., ArrayLike] | None = None
    when: Callable[..., Any] | None = None
    name: str = ""


@dataclass(frozen=True)
class Passage:
    """A phase that was passed through.

    Attributes:
        name: Of the phase.
        begin: Time at its start [s].
        end: Time of its event.
        before: State just before it jumps (n,).
        after: State just after (n,).
        course: States (n,) or (n, k) at times from begin to end.
        change: Of the state after by that at the start, at these times: Phi to the event (n, n).
        jump: R' (n, n).
        saltation: S (n, n).
    """

    name: str
    begin: float
    end: float
    before: Floats
    after: Floats
    course: Callable[[Any], Floats]
    change: Floats
    jump: Floats
    saltation: Floats

    @property
    def mapped(self) -> Floats:
        """Change of the state after the jump at its own time: of the map from event to event."""
        return self.jump @ self.change


class HybridSystem:
    """Phases that follow each other, again and again.

    Args:
        phases: In their order.
        names: Of the states.

    Raises:
        SceneError: There is no phase, or no state.
    """

    def __init__(self, phases: Sequence[Phase], names: Sequence[str]) -> None:
        self.phases = tuple(phases)
        self.names = tuple(names)
        if not self.phases or not all(isinstance(phase, Phase) for phase in self.phases):
            raise SceneError("HybridSystem: phases: give at least one impactfem.systems.Phase")
        if not self.names or isinstance(names, str):
            raise SceneError('HybridSystem: names: name the states, as names=["angle", "spin"]')

    def follow(
        self, start: ArrayLike, cycles: int = 1, parameters: Mapping[str, float] | None = None,
        *, longest: float = 100.0, neighbours: bool = False,
    ) -> list[Passage]:  # fmt: skip
        """The motion from a state at the start of the first phase.

        By Dormand and Prince's method of order 8, tolerance 1e-12; events by Newton's method.

        Args:
            start: State (n,).
            cycles: How often all phases are passed through.
            parameters: By name, for the functions of the phases.
            longest: A phase that lasts longer is refused [s].
            neighbours: Whether derivatives follow along; else they are none.

        Raises:
            SceneError: A shape is wrong.
            ConvergenceError: A phase does not come to its event, or cannot be followed to it.
        """
        x, t = self.checked(start), 0.0
        found: list[Passage] = []
        laws = [_Law(phase, parameters or {}, len(x), k) for k, phase in enumerate(self.phases)]
        for count in range(cycles * len(laws)):
            law = laws[count % len(laws)]
            after = laws[(count + 1) % len(laws)]
            found.append(law.passed(t, x, after, longest, neighbours=neighbours))
            t, x = found[-1].end, found[-1].after
        return found

    def checked(self, start: ArrayLike) -> Floats:
        """A state.

        Raises:
            SceneError: It has another length, or is not finite.
        """
        x = np.array(start, dtype=float)
        if x.shape != (len(self.names),) or not np.isfinite(x).all():
            raise SceneError(
                f"start: {start!r} is no state; give {len(self.names)} finite numbers "
                f"({', '.join(self.names)})"
            )
        return x


class _Law:
    """A phase at given parameters."""

    def __init__(self, phase: Phase, parameters: Mapping[str, float], n: int, place: int) -> None:
        self.name = phase.name or f"phase {place + 1}"
        self.n = n
        self.rate = self._vector("rate", phase.rate, parameters)
        self.jump = self._vector("jump", phase.jump or _stays, parameters if phase.jump else {})
        self._event = partial(phase.event, **parameters)
        self._when = None if phase.when is None else partial(phase.when, **parameters)
        self.slope, self.turn = Derivative(self.rate), Derivative(self.jump)
        self.normal = Derivative(self._event)

    def _vector(
        self, what: str, function: Callable[..., ArrayLike], parameters: Mapping[str, float]
    ) -> Callable[[Any], Any]:
        def told(x: Any) -> Any:
            found = np.asarray(function(x, **parameters))
            if found.shape != (self.n,):
                raise SceneError(
                    f"{what} of {self.name}: has shape {found.shape} for {self.n} states; give "
                    "the entry of each"
                )
            return found

        return told

    def when(self, x: Floats) -> bool:
        return self._when is None or bool(self._when(x))

    def event(self, x: Floats) -> float:
        found = np.asarray(self._event(x), dtype=float)
        if found.size != 1:
            raise SceneError(f"event of {self.name}: has {found.size} entries; give one number")
        return float(found.reshape(()))

    def flow(self, _: float, y: Floats) -> Floats:
        """Rates of the state and, behind it, of its neighbours."""
        x = y[: self.n]
        rate = np.asarray(self.rate(x), dtype=float)
        if len(y) == self.n:
            return rate
        near = self.slope(x) @ y[self.n :].reshape(self.n, self.n)
        return np.concatenate([rate, near.ravel()])

    def passed(
        self, t: float, x: Floats, following: "_Law", longest: float, *, neighbours: bool
    ) -> Passage:
        """From its start through its event."""
        y = np.concatenate([x, np.eye(self.n).ravel()]) if neighbours else x
        course, end, y = self._flown(t, y, longest)
        n, before = self.n, y[: self.n]
        after = np.asarray(self.jump(before), dtype=float)
        change, turn, saltation = (np.full((n, n), np.nan) for _ in range(3))
        if neighbours:
            turn, normal, came = self.turn(before), self.normal(before)[0], self.rate(before)
            late = -normal / (normal @ came)  # change of the event's time
            left = following.rate(after)
            saltation = turn - np.outer(left - turn @ came, late)
            change = y[n:].reshape(n, n)
            turn = turn @ (np.eye(n) + np.outer(came, late))
        return Passage(self.name, t, end, before, after, course, change, turn, saltation)

    def _flown(
        self, t: float, y: Floats, longest: float
    ) -> tuple[Callable[[Any], Floats], float, Floats]:
        solver = self._solver(t, y, t + longest)
        armed = self.event(y[: self.n]) > 0.0
        stuck = self.when(y[: self.n]) and not armed
        stuck = stuck and not self.normal(y[: self.n])[0] @ self.rate(y[: self.n]) > 0.0
        times, parts = [t], list[Any]()
        while solver.status == "running":
            last = solver.y
            with np.errstate(all="ignore"):
                solver.step()
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                break
            dense = solver.dense_output()
            times.append(solver.t)
            parts.append(dense)

            def gap(s: float, dense: Any = dense) -> float:
                return self.event(dense(s)[: self.n])

            looks = np.linspace(solver.t_old, solver.t, _LOOKS + 1)
            gaps = [gap(s) for s in looks]
            for k in range(_LOOKS):
                armed = armed or gaps[k] > 0.0
                if stuck and not armed and gaps[k + 1] < 0.0:
                    raise ConvergenceError(
                        f"{self.name}: begins where its event is at 0 and falling, at "
                        f"t = {t:.6g}; begin elsewhere, or turn the sign of event round"
                    )
                if not armed or not gaps[k] >= 0.0 > gaps[k + 1]:
                    continue
                root = brentq(gap, looks[k], looks[k + 1], xtol=4.0 * _EPS * abs(solver.t))
                if self.when(dense(root)[: self.n]):
                    end, y = self._polished(solver.t_old, last, float(root))
                    return _course(times, parts, self.n), end, y
        why = "cannot be followed" if solver.status != "finished" else f"lasts {longest:g} s"
        state = ", ".join(f"{value:.4g}" for value in solver.y[: self.n])
        raise ConvergenceError(
            f"{self.name}: {why} without coming to its event from t = {t:.6g} on (state at "
            f"t = {solver.t:.6g}: {state}); give another start or parameters, or a larger longest"
        )

    def _solver(self, t: float, y: Floats, stop: float) -> DOP853:
        small = np.full(len(y), _ATOL * RTOL * float(np.abs(y[: self.n]).max()))
        small[self.n :] = _ATOL * RTOL
        return DOP853(self.flow, t, y, stop, rtol=RTOL, atol=np.maximum(small, 1e-300))

    def _polished(self, t: float, y: Floats, end: float) -> tuple[float, Floats]:
        """Time and state of an event, by steps that end there: dense output is less right."""
        for _ in range(_POLISH):
            found = y
            if end > t:
                solver = self._solver(t, y, end)
                while solver.status == "running":
                    solver.step()
                found = solver.y
            x = found[: self.n]
            late = self.event(x) / float(self.normal(x)[0] @ self.rate(x))
            if abs(late) <= 4.0 * _EPS * abs(end):
                break
            end = max(end - late, t)
        return end, found


def _stays(x: Any) -> Any:
    return x


def _course(times: list[float], parts: list[Any], n: int) -> Callable[[Any], Floats]:
    whole = OdeSolution(times, parts)  # its last part reaches beyond the event

    def at(t: Any) -> Floats:
        return np.asarray(whole(t))[:n]

    return at
