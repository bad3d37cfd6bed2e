"""What may vary, what was measured and what is wanted: gradients and identification."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from impactfem.scene.given import Tables
from impactfem.scene.grammar import CONSTANTS, FUNCTIONS
from impactfem.scene.inline import InlineTable, ListOf, Vector
from impactfem.scene.kinds import Choice, FilePath, FolderPath, Integer, Line, Name, Real
from impactfem.scene.schema import KeyedError, check_ends, key, table
from impactfem.scene.values import show

MAX_PARAMETERS = 1000
MAX_MEASURES = 1000
TERMS = (
    "value", "misfit", "speed", "terminal_energy", "vibration_energy", "effort", "mass",
    "peak_force", "time",
)  # fmt: skip
SOLVERS = (
    "lbfgs", "trust_constr", "slsqp", "ipopt", "tao", "least_squares", "gauss_newton",
)  # fmt: skip
VARIABLES = ("t", "x", "y", "z", "vx", "vy", "vz")
"""Names that formulas have already."""


def check_formula_name(heading: str, name: str, remedy: str) -> None:
    """Refuse a name that means something else in formulas, or cannot stand there.

    Raises:
        KeyedError: naming the key.
    """
    if name in {*VARIABLES, *CONSTANTS, *FUNCTIONS} or "-" in name:
        text = f" = {show(name)} cannot stand in a formula: {remedy}."
        raise KeyedError(heading, "name", text)


@table("[[parameter]]")
class Parameter:
    """A number of the scene that may vary.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "parameter"

    name: str = key(Name(), "name of the parameter; without key, formulas may use it")
    path: str | None = key(
        Line(), "path of a number of the scene, as body.ball.mass or body.0.velocity.1",
        name="key", default=None, absent="its name stands in formulas",
    )  # fmt: skip
    start: float | None = key(
        Real(), "value to begin with, and that of plain runs", default=None,
        absent="that of the scene",
    )  # fmt: skip
    bounds: Sequence[float] | None = key(
        Vector((2,)), "least and largest value", default=None, absent="none"
    )

    def _check(self) -> None:
        if self.path is None:
            check_formula_name(self.heading, self.name, "give another name, or key")
            if self.start is None:
                text = " is missing: no key tells a value, give a number."
                raise KeyedError(self.heading, "start", text)
        low, high = self.limits
        check_ends(self.heading, "bounds", low, high)
        if self.start is not None and not low <= self.start <= high:
            text = f" = {show([low, high])} excludes the start {self.start:g}: widen them."
            raise KeyedError(self.heading, "bounds", text)

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds; infinite where there are none."""
        low, high = self.bounds or (-math.inf, math.inf)
        return low, high


@table("[[measure]]")
class Measure:
    """A figure of a run, or a history of it, that is looked at or was measured.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "measure"

    name: str = key(Name(), "name of the measure in terms")
    of: str = key(
        Line(),
        "a column of the history, or impulse.PAIR, duration.PAIR, force_rise.PAIR or "
        "rebound_speed.BODY",
    )
    data: str | None = key(
        FilePath(endings=(".csv", ".txt")),
        "what was measured: columns time, value and perhaps sigma", default=None, absent="none",
    )  # fmt: skip
    result: str | None = key(
        FolderPath(), "result folder of another run, whose history of the same column is the data",
        default=None, absent="none",
    )  # fmt: skip
    value: float | None = key(
        Real(), "what was measured, as one number", default=None, absent="none"
    )
    sigma: float | None = key(
        Real(above=0), "standard deviation of what was measured", default=None,
        absent="that of data, or 1",
    )  # fmt: skip
    unit: str | None = key(
        Line(20), "unit of what was measured, for comparison with the column's", default=None,
        absent="taken to be that of the column",
    )  # fmt: skip
    at: float | None = key(
        Real(at_least=0), "one instant of a history", unit="s", default=None, absent="its end"
    )

    def _check(self) -> None:
        own = "data" if self.data is not None else "result"
        known = [
            name for name in ("data", "result", "value", "at") if getattr(self, name) is not None
        ]
        if len(known) > 1 and own in known:
            other = next(name for name in known if name != own)
            shown = show(getattr(self, own))
            text = f" = {shown} has times and values of its own: remove {other}."
            raise KeyedError(self.heading, own, text)

    @property
    def is_measured(self) -> bool:
        """Whether there are data."""
        return any(each is not None for each in (self.data, self.result, self.value))


@table("minimise = [{ ... }]")
class Term:
    """A part of an objective.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "term"

    term: str = key(
        Choice(TERMS),
        "value of a measure; misfit of one, the sum of ((measure - data)/sigma)^2 / 2; speed of a "
        "body's centre; mechanical energy at the end; energy less that of centres of mass; "
        "integral of the square of a control; mass of a body; largest force of a pair of bars; "
        "time until a pair first touches",
    )
    of: str | None = key(
        Name(), "name of a measure (value, misfit) or control (effort)", default=None, absent="none"
    )
    body: str | None = key(Name(), "name of a body (speed, mass)", default=None, absent="none")
    pair: str | None = key(
        Line(), "name of a pair as in columns, bar.wall (peak_force)", default=None, absent="none"
    )
    until: str | None = key(
        Line(), "name of a pair as in columns, ball.floor (time)", default=None, absent="none"
    )
    at: float | None = key(Real(at_least=0), "time", unit="s", default=None, absent="the end")
    weight: float = key(Real(), "factor of the term", default=1.0)

    def _check(self) -> None:
        wanted = _NEEDED.get(self.term)
        for name in ("of", "body", "pair", "until"):
            given = getattr(self, name)
            if (given is None) != (wanted != name):
                text = (
                    f" is missing: {self.term} needs it."
                    if given is None
                    else f" = {show(given)} is not known of {self.term}: remove it."
                )
                raise KeyedError("", name, text)
        if self.at is not None and self.term not in {"speed", "vibration_energy"}:
            text = f" = {self.at:g}: {self.term} has its own time, remove it."
            raise KeyedError("", "at", text)


_NEEDED = {
    "value": "of", "misfit": "of", "effort": "of", "speed": "body", "mass": "body",
    "peak_force": "pair", "time": "until",
}  # fmt: skip
"""Keys of terms besides their time."""


@table("constraints = [{ ... }]")
class Limit:
    """A term that has to stay within limits.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "constraint"

    term: str = key(Choice(TERMS), "as in minimise")
    of: str | None = key(Name(), "as in minimise", default=None, absent="none")
    body: str | None = key(Name(), "as in minimise", default=None, absent="none")
    pair: str | None = key(Line(), "as in minimise", default=None, absent="none")
    until: str | None = key(Line(), "as in minimise", default=None, absent="none")
    at: float | None = key(Real(at_least=0), "time", unit="s", default=None, absent="the end")
    least: float | None = key(Real(), "least value", name="min", default=None, absent="none")
    most: float | None = key(Real(), "largest value", name="max", default=None, absent="none")

    def _check(self) -> None:
        self.limited  # noqa: B018  # checks the other keys
        if self.least is None and self.most is None:
            raise KeyedError("", "max", " is missing: give min, max or both.")
        low, high = self.limits
        if low > high:
            raise KeyedError("", "min", f" = {low:g} is above max = {high:g}: exchange them.")

    @property
    def limited(self) -> Term:
        """What stays within limits."""
        return Term(
            term=self.term, of=self.of, body=self.body, pair=self.pair, until=self.until, at=self.at
        )

    @property
    def limits(self) -> tuple[float, float]:
        """Least and largest value."""
        return (
            -math.inf if self.least is None else self.least,
            math.inf if self.most is None else self.most,
        )


@table("[objective]")
class Objective:
    """What is wanted: a sum of terms that becomes least, and how it is searched.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "objective"

    minimise: Tables[Term] = key(
        ListOf(InlineTable((Term,)), at_least=1), "terms of what becomes least"
    )
    constraints: Tables[Limit] = key(
        ListOf(InlineTable((Limit,))), "terms that stay within limits (optimise)", default=()
    )
    searched_by: str | None = key(
        Choice(SOLVERS),
        "how optimise searches: L-BFGS-B, trust-constr or SLSQP of SciPy, Ipopt (extra optimise), "
        "BLMVM of PETSc's TAO; of "
        "misfits also SciPy's trust region reflective method, as in identify, or Gauss-Newton",
        name="solver", default=None, absent="lbfgs; trust_constr with constraints",
    )  # fmt: skip
    max_iterations: int = key(Integer(1, 100_000), "largest number of iterations", default=100)
    tolerance: float = key(
        Real(above=0, below=1), "relative change of parameters and objective at the end",
        default=1e-8,
    )  # fmt: skip
    gain: float | None = key(
        Real(at_least=0, below=1),
        "share of what optimise has won that 10 evaluations have to add, or it ends",
        default=None, absent="0.001 by massless, conserving and explicit steps, else 0",
    )  # fmt: skip
    seed: int = key(
        Integer(0, 2**31 - 1), "of the random direction in which gradients are checked", default=0
    )


def check_asked(scene: Any) -> None:
    """Refuse parameters, controls, measures and terms that contradict each other or the scene.

    Raises:
        KeyedError: naming the key.
    """
    named = {"parameter": scene.parameters, "control": scene.controls}
    parts = [part for each in scene.controllers for part in each.parts]
    _check_names(named | {"controller": parts})
    _check_names({"measure": scene.measures})
    for index, measure in enumerate(scene.measures):
        _check_time(f"measure[{index}]", measure.at, scene.duration)
    for index, control in enumerate(scene.controls):
        if control.along == "x":
            continue
        for name, time in (("from", control.begin), ("until", control.end)):
            _check_time(f"control[{index}]", time, scene.duration, name)
    if scene.objective is not None:
        for index, term in enumerate(scene.objective.minimise):
            _check_term(f"objective.minimise[{index}]", term, scene)
        for index, limit in enumerate(scene.objective.constraints):
            _check_term(f"objective.constraints[{index}]", limit.limited, scene)


def _check_names(groups: Mapping[str, Sequence[Any]]) -> None:
    """Refuse names that are given twice."""
    taken: dict[str, str] = {}
    for heading, entries in groups.items():
        for index, entry in enumerate(entries):
            where = f"{heading}[{index}]"
            if entry.name in taken:
                text = (
                    f" = {show(entry.name)} is the name of {taken[entry.name]} too: give another."
                )
                raise KeyedError(where, "name", text)
            taken[entry.name] = where


def _check_term(where: str, term: Term, scene: Any) -> None:
    _check_time(where, term.at, scene.duration)
    known = {measure.name: measure for measure in scene.measures}
    of = [control.name for control in scene.controls] if term.term == "effort" else list(known)
    for name, there in (("of", of), ("body", [body.name for body in scene.bodies])):
        given = getattr(term, name)
        if given is not None and given not in there:
            text = f" = {show(given)} is none of {', '.join(there) or 'those, there are none'}"
            raise KeyedError(where, name, f"{text}: correct it.")
    if term.term == "misfit" and not known[str(term.of)].is_measured:
        text = f" = {show(term.of)} has neither data nor value to differ from: give one."
        raise KeyedError(where, "of", text)


def _check_time(where: str, at: float | None, duration: float, name: str = "at") -> None:
    if at is not None and at > duration:
        text = f" = {at:g} s is after the end at {duration:g} s: give a time up to it."
        raise KeyedError(where, name, text)


def named_numbers(parameters: Sequence[Parameter]) -> Mapping[str, float]:
    """Numbers that formulas know by name."""
    return {p.name: p.start for p in parameters if p.path is None and p.start is not None}
