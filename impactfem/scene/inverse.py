"""What may vary, what was measured and what is wanted: gradients and identification."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from impactfem.scene.grammar import CONSTANTS, FUNCTIONS
from impactfem.scene.inline import InlineTable, ListOf, Vector
from impactfem.scene.kinds import Choice, FilePath, Integer, Line, Name, Real
from impactfem.scene.schema import KeyedError, check_fields, key, table
from impactfem.scene.values import show

MAX_PARAMETERS = 1000
MAX_MEASURES = 1000
TERMS = ("value", "misfit", "speed", "terminal_energy", "vibration_energy")
VARIABLES = ("t", "x", "y", "z", "vx", "vy", "vz")
"""Names that formulas have already."""


@table("[[parameter]]")
@dataclass(frozen=True, kw_only=True)
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

    def __post_init__(self) -> None:
        check_fields(self, self.heading)
        if self.path is None:
            if self.name in {*VARIABLES, *CONSTANTS, *FUNCTIONS} or "-" in self.name:
                text = f" = {show(self.name)} cannot stand in a formula: give another name, or key."
                raise KeyedError(self.heading, "name", text)
            if self.start is None:
                text = " is missing: no key tells a value, give a number."
                raise KeyedError(self.heading, "start", text)
        if self.bounds is not None and not self.bounds[0] < self.bounds[1]:
            text = f" = {show(list(self.bounds))}: give the smaller number first."
            raise KeyedError(self.heading, "bounds", text)
        low, high = self.limits
        if self.start is not None and not low <= self.start <= high:
            text = f" = {show([low, high])} excludes the start {self.start:g}: widen them."
            raise KeyedError(self.heading, "bounds", text)

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds; infinite where there are none."""
        low, high = self.bounds or (-math.inf, math.inf)
        return low, high


@table("[[measure]]")
@dataclass(frozen=True, kw_only=True)
class Measure:
    """A figure of a run, or a history of it, that is looked at or was measured.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "measure"

    name: str = key(Name(), "name of the measure in terms")
    of: str = key(
        Line(),
        "a column of the history, or impulse.PAIR, duration.PAIR or rebound_speed.BODY",
    )
    data: str | None = key(
        FilePath(endings=(".csv", ".txt")),
        "what was measured: columns time, value and perhaps sigma", default=None, absent="none",
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

    def __post_init__(self) -> None:
        check_fields(self, self.heading)
        if self.data is not None and (self.value is not None or self.at is not None):
            other = "value" if self.value is not None else "at"
            text = f" = {show(self.data)} has times and values of its own: remove {other}."
            raise KeyedError(self.heading, "data", text)

    @property
    def is_measured(self) -> bool:
        """Whether there are data."""
        return self.data is not None or self.value is not None


@table("minimise = [{ ... }]")
@dataclass(frozen=True, kw_only=True)
class Term:
    """A part of an objective.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "term"

    term: str = key(
        Choice(TERMS),
        "value of a measure; misfit of one, the sum of ((measure - data)/sigma)^2 / 2; speed of a "
        "body's centre; mechanical energy at the end; energy less that of centres of mass",
    )
    of: str | None = key(Name(), "name of a measure (value, misfit)", default=None, absent="none")
    body: str | None = key(Name(), "name of a body (speed)", default=None, absent="none")
    at: float | None = key(Real(at_least=0), "time", unit="s", default=None, absent="the end")
    weight: float = key(Real(), "factor of the term", default=1.0)

    def __post_init__(self) -> None:
        check_fields(self, self.heading)
        wanted = {"value": "of", "misfit": "of", "speed": "body"}.get(self.term)
        for name in ("of", "body"):
            given = getattr(self, name)
            if (given is None) != (wanted != name):
                text = (
                    f" is missing: {self.term} needs it."
                    if given is None
                    else f" = {show(given)} is not known of {self.term}: remove it."
                )
                raise KeyedError("", name, text)
        if self.at is not None and self.term in {"value", "misfit", "terminal_energy"}:
            text = f" = {self.at:g}: {self.term} has its own time, remove it."
            raise KeyedError("", "at", text)


@table("[objective]")
@dataclass(frozen=True, kw_only=True)
class Objective:
    """What is wanted: a sum of terms that becomes least, and how it is searched.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "objective"

    minimise: tuple[Term, ...] = key(
        ListOf(InlineTable((Term,)), at_least=1), "terms of what becomes least"
    )
    max_iterations: int = key(Integer(1, 100_000), "largest number of iterations", default=100)
    tolerance: float = key(
        Real(above=0, below=1), "relative change of parameters and objective at the end",
        default=1e-8,
    )  # fmt: skip
    seed: int = key(
        Integer(0, 2**31 - 1), "of the random direction in which gradients are checked", default=0
    )

    def __post_init__(self) -> None:
        check_fields(self, self.heading)


def check_asked(scene: Any) -> None:
    """Refuse parameters, measures and terms that contradict each other or the scene.

    Raises:
        KeyedError: naming the key.
    """
    for heading, entries in (("parameter", scene.parameters), ("measure", scene.measures)):
        taken: dict[str, int] = {}
        for index, entry in enumerate(entries):
            if entry.name in taken:
                text = f" = {show(entry.name)} is the name of {heading}[{taken[entry.name]}] too: "
                raise KeyedError(f"{heading}[{index}]", "name", f"{text}give another.")
            taken[entry.name] = index
    for index, measure in enumerate(scene.measures):
        _check_time(f"measure[{index}]", measure.at, scene.duration)
    known = {measure.name: measure for measure in scene.measures}
    bodies = [body.name for body in scene.bodies]
    for index, term in enumerate(scene.objective.minimise if scene.objective else ()):
        where = f"objective.minimise[{index}]"
        _check_time(where, term.at, scene.duration)
        for name, there in (("of", list(known)), ("body", bodies)):
            given = getattr(term, name)
            if given is not None and given not in there:
                text = f" = {show(given)} is none of {', '.join(there) or 'those, there are none'}"
                raise KeyedError(where, name, f"{text}: correct it.")
        if term.term == "misfit" and not known[str(term.of)].is_measured:
            text = f" = {show(term.of)} has neither data nor value to differ from: give one."
            raise KeyedError(where, "of", text)


def _check_time(where: str, at: float | None, duration: float) -> None:
    if at is not None and at > duration:
        text = f" = {at:g} s is after the end at {duration:g} s: give a time up to it."
        raise KeyedError(where, "at", text)


def named_numbers(parameters: Sequence[Parameter]) -> Mapping[str, float]:
    """Numbers that formulas know by name."""
    return {p.name: p.start for p in parameters if p.path is None and p.start is not None}
