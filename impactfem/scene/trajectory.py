"""What is asked of a motion that controls shall reach: where it begins and ends, limits, cost."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, override

from impactfem.scene.given import Given, Tables
from impactfem.scene.inline import ByName, InlineTable, ListOf, NumberOrList
from impactfem.scene.kinds import Choice, Integer, Line, Name, Real
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import NotAllowedError, is_number, number, show

TRANSCRIPTIONS = (
    "euler", "midpoint", "trapezoid", "hermite_simpson", "multiple_shooting", "single_shooting",
    "contact_implicit", "hybrid",
)  # fmt: skip
FREE = "free"
_COSTS = ("effort", "time")


@dataclass(frozen=True)
class RangesByName(ByName):
    """A value, a pair of limits, or "free", under names of columns."""

    type_name: ClassVar[str] = "table of numbers"

    @property
    @override
    def allowed(self) -> str:
        return 'a table { "COLUMN" = value } with numbers, pairs of limits or "free"'

    @override
    def _named(self, value: Mapping[Any, object]) -> list[tuple[str, object]]:
        return _flat(value)

    @override
    def _entry(self, entry: object) -> tuple[float, float]:
        if entry == FREE:
            return -math.inf, math.inf
        if is_number(entry):
            return number(entry), number(entry)
        if not isinstance(entry, list | tuple) or len(entry) != 2:
            raise NotAllowedError('it is no number, no pair and not "free"')
        low, high = map(number, entry)
        if not low <= high:
            raise NotAllowedError("its first number is larger than its second")
        return low, high

    @override
    def write(self, value: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
        return {
            name: FREE if not math.isfinite(low) else low if low == high else [low, high]
            for name, (low, high) in value.items()
        }


def _flat(value: Mapping[Any, object], head: str = "") -> list[tuple[str, object]]:
    """Entries by their whole names: TOML makes tables of names with dots that are not quoted."""
    found: list[tuple[str, object]] = []
    for name, entry in value.items():
        inner = isinstance(entry, Mapping)
        found += _flat(entry, f"{head}{name}.") if inner else [(f"{head}{name}", entry)]  # type: ignore[arg-type]
    return found


@table("cost = [{ ... }]")
class Cost:
    """A part of what a motion costs.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "cost"

    term: str = key(
        Choice(_COSTS), "integral of the square of a control over time, or the duration"
    )
    of: str | None = key(Name(), "name of the control (effort)", default=None, absent="none")
    weight: float = key(Real(), "factor of the term", default=1.0)

    def _check(self) -> None:
        if (self.of is None) == (self.term == "effort"):
            text = " is missing: effort is that of a control."
            if self.of is not None:
                text = f" = {show(self.of)} is not known of {self.term}: remove it."
            raise KeyedError("", "of", text)


@table("[trajectory]")
class TrajectoryKeys:
    """A motion that the controls of a scene shall reach, for `impactfem trajectory`.

    A run takes the controls at their starts and leaves this table aside.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "trajectory"

    transcription: str = key(
        Choice(TRANSCRIPTIONS), "how the motion becomes finitely many equations",
        default="hermite_simpson",
    )  # fmt: skip
    modes: Sequence[str] = key(
        ListOf(Line()), 'order of contacts (hybrid): "flight", "stance" (all closed), or contacts '
        'BODY.OBSTACLE, joined by "+", with "_slip" or "_slip_back" what slips', default=(),
    )  # fmt: skip
    nodes: int = key(Integer(1, 4000), "number of intervals of the first mesh", default=40)
    duration: Given[tuple[float, ...] | None, float | Sequence[float] | None] = key(
        NumberOrList(Real(above=0), 2), "how long it lasts, or bounds of that", unit="s",
        default=None, absent="that of the scene",
    )  # fmt: skip
    start: Given[Mapping[str, tuple[float, float]], Mapping[str, Any]] = key(
        RangesByName(), "columns at t = 0, where they are not those of the scene", default=()
    )
    end: Given[Mapping[str, tuple[float, float]], Mapping[str, Any]] = key(
        RangesByName(), "columns at the end; a coordinate that is said ends at rest, unless its "
        'rate is said too, as a number or "free"', default=(),
    )  # fmt: skip
    bounds: Given[Mapping[str, tuple[float, float]], Mapping[str, Any]] = key(
        RangesByName(), "least and largest values of columns, all the way", default=()
    )
    path: Sequence[str] = key(
        ListOf(Line()), "formulas of columns and t that stay <= 0 all the way", default=()
    )
    cost: Tables[Cost] = key(
        ListOf(InlineTable((Cost,))), "what becomes least; without it the effort of all controls",
        default=(),
    )  # fmt: skip
    refine: float | None = key(
        Real(above=0, below=1),
        "largest defect between nodes, in shares of how far a state moves: intervals with more "
        "are cut; the end may be missed by its root", default=None, absent="no refinement",
    )  # fmt: skip
    max_iterations: int = key(Integer(1, 100_000), "of the search on each mesh", default=1000)

    def _check(self) -> None:
        pair = self.duration
        if pair is not None and len(pair) == 2 and not pair[0] <= pair[1]:
            text = f" = {show(list(pair))}: give the smaller number first."
            raise KeyedError(self.heading, "duration", text)
        if (self.transcription == "hybrid") != bool(self.modes):
            text = ' is missing: give the order of contacts, as modes = ["flight", "stance"].'
            if self.modes:
                text = f' = {show(list(self.modes))} belongs to transcription = "hybrid".'
            raise KeyedError(self.heading, "modes", text)
        if not self.end:
            text = ' is missing: give what shall be reached, as end = { "cart.x" = 1.0 }.'
            raise KeyedError(self.heading, "end", text)
