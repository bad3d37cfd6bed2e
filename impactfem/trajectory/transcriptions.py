"""Transcriptions: how a motion becomes finitely many equations, as rows of one table.

Sources: Hargraves and Paris, Direct trajectory optimization using nonlinear programming and
collocation (1987); Betts, Practical methods for optimal control (2010), chapters 3 and 4; Kelly,
An introduction to trajectory optimization (2017).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

from impactfem.errors import SceneError
from impactfem.trajectory.symbols import loaded

SUBSTEPS = 4
"""Of Runge and Kutta's method between two nodes of shooting."""


@dataclass(frozen=True)
class Spot:
    """A place of the motion: its symbols, and the rate there.

    Attributes:
        function: (t, x, u, p) to rate and integrand of the cost.
        t: Time.
        x: States (n,).
        u: Controls (m,).
        p: Parameters.
    """

    function: Any
    t: Any
    x: Any
    u: Any
    p: Any

    @cached_property
    def both(self) -> tuple[Any, Any]:
        """Rate (n,) and integrand, called for once."""
        rate, cost = self.function(self.t, self.x, self.u, self.p)
        return rate, cost

    @property
    def rate(self) -> Any:
        """x', (n,)."""
        return self.both[0]

    @property
    def cost(self) -> Any:
        """Integrand of the cost."""
        return self.both[1]

    def at(self, t: Any, x: Any, u: Any) -> "Spot":
        """Another one of the same motion."""
        return Spot(self.function, t, x, u, self.p)


@dataclass(frozen=True)
class Interval:
    """What a step of a transcription sees.

    Attributes:
        h: Length of time.
        left: At its beginning.
        right: At its end.
        middle: In its middle; its state is unknown where the transcription has such.
        flow: (t, x, control at both ends, p, h) to the state after h, and the cost.
    """

    h: Any
    left: Spot
    right: Spot
    middle: Spot
    flow: Any


type Step = Callable[[Interval], tuple[Any, Any, Any]]
"""To the state at the end, that in the middle (or None), and the cost."""


def _euler(over: Interval) -> tuple[Any, Any, Any]:
    return over.left.x + over.h * over.left.rate, None, over.h * over.left.cost


def _implicit_euler(over: Interval) -> tuple[Any, Any, Any]:
    return over.left.x + over.h * over.right.rate, None, over.h * over.right.cost


def _midpoint(over: Interval) -> tuple[Any, Any, Any]:
    place = (over.left.x + over.right.x) / 2
    middle = over.middle.at(over.middle.t, place, over.middle.u)
    return over.left.x + over.h * middle.rate, None, over.h * middle.cost


def _trapezoid(over: Interval) -> tuple[Any, Any, Any]:
    half = over.h / 2
    ends = over.left, over.right
    end = over.left.x + half * sum(each.rate for each in ends)
    return end, None, half * sum(each.cost for each in ends)


def _hermite_simpson(over: Interval) -> tuple[Any, Any, Any]:
    left, middle, right = over.left, over.middle, over.right
    between = (left.x + right.x) / 2 + over.h / 8 * (left.rate - right.rate)
    end = left.x + over.h / 6 * (left.rate + 4 * middle.rate + right.rate)
    return end, between, over.h / 6 * (left.cost + 4 * middle.cost + right.cost)


def _shooting(over: Interval) -> tuple[Any, Any, Any]:
    """Runge and Kutta's method of order 4, in substeps, as one function called for each interval.

    Derivatives of one function are made once; those of all intervals written out are not.
    """
    left = over.left
    end, cost = over.flow(left.t, left.x, left.u, over.right.u, left.p, over.h)
    return end, None, cost


@cache
def runge_kutta(function: Any) -> Any:
    """(t, x, control at both ends, p, h) to the state at the end, and the cost."""
    casadi = loaded()
    t, begun, u, p = function.mx_in()
    ends, span = casadi.MX.sym("ends", u.numel()), casadi.MX.sym("h")
    h, x, cost = span / SUBSTEPS, begun, 0

    def rate(place: float, x: Any) -> Any:
        share = place / SUBSTEPS
        return casadi.vertcat(*function(t + share * span, x, u + share * (ends - u), p))

    n = begun.numel()
    for step in range(SUBSTEPS):
        a = rate(step, x)
        b = rate(step + 0.5, x + h / 2 * a[:n])
        c = rate(step + 0.5, x + h / 2 * b[:n])
        d = rate(step + 1, x + h * c[:n])
        change = h / 6 * (a + 2 * b + 2 * c + d)
        x, cost = x + change[:n], cost + change[n:]
    made = casadi.Function("runge_kutta", [t, begun, u, ends, p, span], [x, cost])
    try:
        return made.expand()
    except RuntimeError:  # it calls what is no formula
        return made


@dataclass(frozen=True)
class Transcription:
    """A row of the table.

    Attributes:
        step: What it makes of an interval.
        order: Of its error at the nodes.
        control: Between nodes: "constant", "linear", "quadratic"; "either": the first two.
        middles: Whether states in the middle of intervals are unknown.
        shoots: Whether only controls are unknown: states follow from the start.
        through: Whether it goes through impacts.
        text: What it is.
    """

    step: Step
    order: int
    control: str
    text: str
    middles: bool = False
    shoots: bool = False
    through: bool = False


TRANSCRIPTIONS: Mapping[str, Transcription] = {
    "euler": Transcription(_euler, 1, "constant", "explicit Euler"),
    "midpoint": Transcription(_midpoint, 2, "constant", "implicit midpoint rule"),
    "trapezoid": Transcription(_trapezoid, 2, "linear", "trapezoidal collocation"),
    "hermite_simpson": Transcription(
        _hermite_simpson, 4, "quadratic", "collocation by cubics, cost by Simpson's rule",
        middles=True,
    ),
    "multiple_shooting": Transcription(
        _shooting, 4, "either", "Runge-Kutta between nodes, states at nodes unknown",
        through=True,
    ),
    "single_shooting": Transcription(
        _shooting, 4, "either", "Runge-Kutta from the start, controls alone unknown", shoots=True,
        through=True,
    ),
    "contact_implicit": Transcription(
        _implicit_euler, 1, "constant", "implicit Euler, products that are 0 relaxed",
    ),
}  # fmt: skip
"""Transcriptions by name."""


def transcription_of(name: str) -> Transcription:
    """A row of the table.

    Raises:
        SceneError: There is no such one.
    """
    if name not in TRANSCRIPTIONS:
        known = ", ".join(TRANSCRIPTIONS)
        raise SceneError(f'transcription: "{name}" is not known; give one of {known}')
    return TRANSCRIPTIONS[name]
