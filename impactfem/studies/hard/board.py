"""The board of hard cases as data: cases, what must hold in them, and what was found."""

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from impactfem.cards import card, table
from impactfem.errors import OutputError
from impactfem.methods import METHODS
from impactfem.studies.study import conditions, markdown_table

type Facts = Mapping[str, float]
"""Figures of a run by name."""

Verdict = Literal["pass", "FAIL", "refused"]

Body = Literal["bar", "solid", "point"]


@dataclass(frozen=True)
class Claim:
    """What must hold: a figure is at most a limit.

    Attributes:
        figure: Name among the facts.
        limit: Largest value allowed.
        why: Why it must hold.
    """

    figure: str
    limit: float
    why: str

    def holds(self, facts: Facts) -> bool:
        """Whether the figure is a number up to the limit."""
        value = facts.get(self.figure, math.nan)
        return math.isfinite(value) and value <= self.limit


@dataclass(frozen=True)
class Case:
    """A hard case.

    Attributes:
        name: What is hard.
        run: Takes the name of a method and returns its facts; an ImpactError is a refusal.
        claims: Takes the name of a method and returns what must hold.
        methods: Methods that it is shown for.
        refusals: Methods that must refuse it with a message; they pass by doing so.
        quick: Whether it belongs to the quick part.
        body: What it is about, which is how the board is parted.
    """

    name: str
    run: Callable[[str], Facts]
    claims: Callable[[str], Sequence[Claim]]
    methods: tuple[str, ...]
    refusals: frozenset[str] = frozenset()
    quick: bool = True
    body: Body = "bar"


@dataclass(frozen=True)
class Cell:
    """What one method did in one case.

    Attributes:
        case: Name of the case.
        method: Name of the method.
        verdict: "refused" counts as passed where refusing is right.
        facts: Figures found.
        failed: Claims that do not hold.
        message: Of the refusal or failure.
        seconds: Time taken [s].
        body: As of the case.
    """

    case: str
    method: str
    verdict: Verdict
    facts: Facts
    failed: tuple[Claim, ...] = ()
    message: str = ""
    seconds: float = 0.0
    body: Body = "bar"

    @property
    def passed(self) -> bool:
        """Whether everything that must hold does."""
        return self.verdict != "FAIL"

    @property
    def figures(self) -> str:
        """The facts, or the message where there are none."""
        if not self.facts:
            return self.message
        return ", ".join(f"{name} {value:.2g}" for name, value in self.facts.items())

    @property
    def faults(self) -> str:
        """What failed, with the numbers."""
        return "; ".join(
            f"{c.figure} = {self.facts.get(c.figure, math.nan):.3g} > {c.limit:g} ({c.why})"
            for c in self.failed
        )


@dataclass(frozen=True)
class Board:
    """Cases by methods, with what was found.

    Attributes:
        cells: By case, then method.
        claims: What had to hold, by case.
    """

    cells: tuple[Cell, ...]
    claims: Mapping[str, tuple[Claim, ...]]

    @property
    def failures(self) -> tuple[Cell, ...]:
        """Cells in which something does not hold."""
        return tuple(cell for cell in self.cells if not cell.passed)

    def of(self, *methods: str) -> "Board":
        """The part of some methods."""
        return Board(tuple(c for c in self.cells if c.method in methods), self.claims)

    def without_controls(self) -> "Board":
        """The part of methods that the plan may choose or a user should: no negative controls."""
        return self.of(*(name for name in METHODS if METHODS[name].plannable))

    def __repr__(self) -> str:
        cases = len({cell.case for cell in self.cells})
        return f"Board({cases} cases, {len(self.cells)} cells, {len(self.failures)} failed)"

    def _repr_html_(self) -> str:
        failed = self.failures
        parts = [table(*self._verdicts(body)) for body in dict.fromkeys(c.body for c in self.cells)]
        rows = [("failed", f"{c.case}, {c.method}: {c.faults or c.message}") for c in failed]
        badge = f"{len(failed)} failed" if failed else f"all {len(self.cells)} hold"
        return card("Hard cases", rows, badge=badge, good=not failed, parts=parts)

    def markdown(self) -> str:
        """Overview, what must hold, figures and failures as Markdown."""
        cases = tuple(dict.fromkeys(cell.case for cell in self.cells))
        parts = [f"{self._overview(body)}\n" for body in dict.fromkeys(c.body for c in self.cells)]
        parts.append("## What must hold, and why\n")
        parts.append(
            markdown_table(
                ["case", "must hold"],
                [[case, _said(self.claims[case])] for case in cases],
            )
        )
        parts.append("\n## Figures\n")
        rows = [
            [c.case, c.method, c.verdict, c.figures, c.faults or (c.message if c.facts else "")]
            for c in self.cells
        ]
        parts += [
            markdown_table(["case", "method", "verdict", "figures", "what does not hold"], rows),
            f"\n{conditions()}",
        ]
        return "\n".join(parts)

    def _overview(self, body: Body) -> str:
        """Verdicts as a table of Markdown."""
        return markdown_table(*self._verdicts(body))

    def _verdicts(self, body: Body) -> tuple[list[str], list[list[str]]]:
        """Head and rows: verdicts of the cases of a kind of body by their methods."""
        cells = [cell for cell in self.cells if cell.body == body]
        methods = tuple(dict.fromkeys(cell.method for cell in cells))
        verdicts = {(cell.case, cell.method): cell.verdict for cell in cells}
        rows = [
            [case, *(verdicts.get((case, m), "") for m in methods)]
            for case in dict.fromkeys(cell.case for cell in cells)
        ]
        return [f"case ({body})", *methods], rows

    def csv(self) -> str:
        """One line per case, method and figure."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["case", "method", "verdict", "figure", "value", "message"])
        for cell in self.cells:
            for name, value in cell.facts.items() or [("", "")]:
                writer.writerow([cell.case, cell.method, cell.verdict, name, value, cell.message])
        return text.getvalue()

    def save(self, folder: str | Path, name: str = "hard_cases") -> list[Path]:
        """Write NAME.md and NAME.csv.

        Raises:
            OutputError: The folder cannot be written.
        """
        folder = Path(folder)
        paths = [folder / f"{name}.md", folder / f"{name}.csv"]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            paths[0].write_text(self.markdown() + "\n", encoding="utf-8")
            paths[1].write_text(self.csv(), encoding="utf-8")
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
        return paths


def _said(claims: Sequence[Claim]) -> str:
    """Claims in words; limits of one figure that differ by method only are said together."""
    limits: dict[tuple[str, str], list[str]] = {}
    for claim in claims:
        known = limits.setdefault((claim.figure, claim.why), [])
        if f"{claim.limit:g}" not in known:
            known.append(f"{claim.limit:g}")
    return "; ".join(f"{name} <= {' / '.join(of)} ({why})" for (name, why), of in limits.items())
