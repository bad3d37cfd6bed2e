"""A work-precision study as data: its tables, observed orders, comparisons and picture."""

import csv
import io
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from impactfem.cards import card, table
from impactfem.errors import OutputError
from impactfem.studies.study_figure import draw

ROUNDING = 1e-9
"""Errors below this are rounding: no order is computed from them."""

LOST = 0.5
"""Relative errors beyond this say only that the motion is lost; nothing is compared by them."""

_ERRORS = ("displacement_max", "displacement_l2", "force_l1")


@dataclass(frozen=True)
class Row:
    """One method at one size.

    Attributes:
        method: Name of the variant or baseline.
        elements: Elements along the bar.
        status: As in ``summary.json``, or "failed".
        displacement_max, displacement_l2, force_l1: Relative errors; None if there are none.
        drift: Largest relative drift of energy.
        seconds: Median time of the solution alone [s].
        total: Median time with planning and measuring of errors [s].
        unknowns: Space-time unknowns.
        memory: Growth of resident memory during the first run, errors included [MiB].
        note: What a reader must know of the row.
    """

    method: str
    elements: int
    status: str
    displacement_max: float | None = None
    displacement_l2: float | None = None
    force_l1: float | None = None
    drift: float | None = None
    seconds: float | None = None
    total: float | None = None
    unknowns: int | None = None
    memory: float | None = None
    note: str = ""

    @property
    def text(self) -> str:
        """One line for a terminal."""
        if self.seconds is None:
            return f"{self.method}, {self.elements} elements: {self.status} ({self.note})"
        return (
            f"{self.method}, {self.elements} elements: displacement {_short(self.displacement_max)}"
            f", force {_short(self.force_l1)}, {1e3 * self.seconds:.3g} ms, {self.status}"
        )


@dataclass(frozen=True)
class Comparison:
    """The fastest of our rows that is at least as accurate as a row of theirs.

    Attributes:
        theirs: The row compared with.
        ours: The fastest row with no larger error; None if there is none.
        speedup: Their time over ours; None without such a row.
    """

    theirs: Row
    ours: Row | None
    speedup: float | None


@dataclass(frozen=True)
class Study:
    """Errors and cost of methods at several sizes.

    Attributes:
        title: Of the scene.
        rows: By method, then size.
        repeats: Runs of which the median time counts.
        baselines: Names of the rows that are not methods of impactfem.
    """

    title: str
    rows: tuple[Row, ...]
    repeats: int
    baselines: tuple[str, ...] = ()

    @property
    def methods(self) -> tuple[str, ...]:
        """Names in the order of the rows."""
        return tuple(dict.fromkeys(row.method for row in self.rows))

    def joined(self, other: "Study") -> "Study":
        """The rows of both studies, as of one scene."""
        names = dict.fromkeys((*self.baselines, *other.baselines))
        return replace(self, rows=self.rows + other.rows, baselines=tuple(names))

    def orders(self) -> dict[str, dict[str, float | None]]:
        """Observed orders in 1 / elements by least squares; None where errors are rounding."""
        return {
            name: {error: self._order(name, error) for error in _ERRORS} for name in self.methods
        }

    def _order(self, method: str, error: str) -> float | None:
        points = [
            (row.elements, getattr(row, error))
            for row in self.rows
            if row.method == method and (getattr(row, error) or 0.0) > ROUNDING
        ]
        if len({n for n, _ in points}) < 2:
            return None
        sizes, errors = np.log(np.array(points)).T
        return float(-np.polyfit(sizes, errors, 1)[0])

    def compare(self, ours: Sequence[str], theirs: str, error: str) -> list[Comparison]:
        """Hold the best of some methods against one, at each error that one reaches.

        Args:
            ours: Names of our variants.
            theirs: Name of the other method; its rows with errors beyond `LOST` do not count.
            error: "displacement_max", "displacement_l2", "force_l1" or "drift".
        """
        found = []
        mine = [
            row for row in self.rows
            if row.method in ours and row.seconds and row.status == "completed"
            and getattr(row, error) is not None
        ]  # fmt: skip
        for row in self.rows:
            limit = getattr(row, error)
            if row.method != theirs or limit is None or not row.seconds:
                continue
            if error in _ERRORS and limit > LOST:
                continue
            good = [r for r in mine if getattr(r, error) <= limit]
            best = min(good, key=lambda r: r.seconds or 0.0, default=None)
            speedup = row.seconds / best.seconds if best and best.seconds else None
            found.append(Comparison(row, best, speedup))
        return found

    def csv(self) -> str:
        """The rows as CSV, numbers in full."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        names = [item.name for item in fields(Row)]
        writer.writerow(names)
        for row in self.rows:
            values = (getattr(row, name) for name in names)
            writer.writerow(["" if value is None else value for value in values])
        return text.getvalue()

    def __repr__(self) -> str:
        return f"Study({self.title!r}, {len(self.rows)} rows of {', '.join(self.methods)})"

    def _repr_html_(self) -> str:
        head = ("method", "elements", "u max", "u L2", "force L1", "drift", "time [ms]", "status")
        lines = [
            (
                row.method, str(row.elements), _short(row.displacement_max),
                _short(row.displacement_l2), _short(row.force_l1), _short(row.drift),
                _short(row.seconds, 1e3), row.status,
            )
            for row in self.rows
        ]  # fmt: skip
        return card(f"{self.title}: errors and cost", [], parts=[table(head, lines)])

    def markdown(self) -> str:
        """The rows and the observed orders as Markdown."""
        head = ["method", "n", "u max", "u L2", "force L1", "energy drift", "time [ms]"]
        head += ["with errors [ms]", "unknowns", "MiB", "status"]
        rows = [
            [
                row.method, str(row.elements), _short(row.displacement_max),
                _short(row.displacement_l2), _short(row.force_l1), _short(row.drift),
                _short(row.seconds, 1e3), _short(row.total, 1e3),
                "-" if row.unknowns is None else str(row.unknowns),
                "-" if row.memory is None else f"{row.memory:.1f}",
                row.status + (f": {row.note}" if row.note else ""),
            ]
            for row in self.rows
        ]  # fmt: skip
        orders = [
            [name, *("-" if p is None else f"{p:.2f}" for p in values.values())]
            for name, values in self.orders().items()
        ]
        how = (
            f"Times: medians of at least {self.repeats} runs, after one not counted (compilation)."
        )
        return "\n".join([
            f"## {self.title}\n",
            markdown_table(head, rows),
            "\nObserved orders in 1/n (least squares; - where errors are rounding):\n",
            markdown_table(["method", "u max", "u L2", "force L1"], orders),
            f"\n{conditions()} {how}",
        ])  # fmt: skip

    def figure(self) -> Figure:
        """Displacement and force error against time, both axes logarithmic."""
        return draw(self.title, self.methods, self.baselines, self._points)

    def _points(self, name: str, error: str) -> list[tuple[float, float]]:
        """Times [ms] and errors of a method, where both are known."""
        return [
            (1e3 * row.seconds, getattr(row, error))
            for row in self.rows
            if row.method == name and row.seconds and getattr(row, error) is not None
        ]

    def save(self, folder: str | Path, name: str = "study") -> list[Path]:
        """Write NAME.csv, NAME.md and NAME.png.

        Raises:
            OutputError: The folder cannot be written.
        """
        folder = Path(folder)
        paths = [folder / f"{name}.{kind}" for kind in ("csv", "md", "png")]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            paths[0].write_text(self.csv(), encoding="utf-8")
            paths[1].write_text(self.markdown() + "\n", encoding="utf-8")
            self.figure().savefig(paths[2], dpi=100)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
        return paths


def conditions() -> str:
    """Date, machine and versions of a measurement, as a sentence."""
    found = []
    for package in ("impactfem", "numpy", "numba", "fenics-dolfinx", "dolfinx-solver-real"):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    found.insert(1, f"Python {platform.python_version()}")
    machine = f"on {datetime.now(UTC):%Y-%m-%d} on {os.cpu_count()} cores"
    return f"Measured {machine} with {', '.join(found)}."


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "/") for cell in line) + " |" for line in lines
    )


def _short(value: float | None, factor: float = 1.0) -> str:
    return (
        "-"
        if value is None
        else f"{factor * value:.2e}"
        if factor == 1.0
        else f"{factor * value:.3g}"
    )
