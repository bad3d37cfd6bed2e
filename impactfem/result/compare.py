"""How far two histories are apart, column by column."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from impactfem.arrays import Floats
from impactfem.cards import card, table
from impactfem.errors import OutputError
from impactfem.result.record import Record
from impactfem.result.table import Table
from impactfem.scene.column_names import RESERVED

_SHOWN = 12  # columns in a notebook
_SAME = 1e-12  # share of the duration by which times are the same


@dataclass(frozen=True)
class Difference:
    """How far a column is apart.

    Attributes:
        name: Of the column.
        unit: Of its values.
        absolute: Largest difference; infinite where one value is none and the other is one.
        relative: The same over `scale`; 0 where nothing differs.
        scale: Largest value of the columns of the same unit of the same body, or of no body: what
            vanishes but for rounding is not measured by its rounding.
        time: When the difference is largest [s].
    """

    name: str
    unit: str
    absolute: float
    relative: float
    scale: float
    time: float


@dataclass(frozen=True)
class Comparison:
    """Two histories side by side.

    Attributes:
        columns: Those of both, the one that is farthest apart first.
        only_first, only_second: Columns of one alone; they are not judged.
        until: Last time that was compared [s].
        interpolated: Whether times differ: then values of the one with more rows are interpolated
            at the times of the other.
        same_end: Whether both end at the same time, but for a step.
    """

    columns: tuple[Difference, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]
    until: float
    interpolated: bool
    same_end: bool

    @property
    def worst(self) -> float:
        """Largest relative difference of all columns."""
        return self.columns[0].relative

    def within(self, tolerance: float) -> bool:
        """Whether both are the same motion up to a relative difference."""
        return self.same_end and self.worst <= tolerance

    def _repr_html_(self) -> str:
        alone = [*self.only_first, *self.only_second]
        rows = [("until", f"{self.until:g} s" + ", interpolated" * self.interpolated)]
        rows += [("in one alone", ", ".join(alone))] if alone else []
        rows += [] if self.same_end else [("end", "they do not end at the same time")]
        head = "column", "unit", "apart", "relative", "at [s]"
        lines = [
            (c.name, c.unit, f"{c.absolute:.3g}", f"{c.relative:.2g}", f"{c.time:.4g}")
            for c in self.columns[:_SHOWN]
        ]
        more = len(self.columns) - len(lines)
        lines += [(f"{more} more, closer", "", "", "", "")] if more > 0 else []
        return card("Two histories side by side", rows, parts=[table(head, lines)])


def compare(one: Record | str | Path, other: Record | str | Path) -> Comparison:
    """Compare the histories of two results, or of two result folders.

    Raises:
        OutputError: A folder holds no complete result.
    """
    first, second = (
        result if isinstance(result, Record) else Record.load(result) for result in (one, other)
    )
    return compare_histories(first.rows, second.rows)


def compare_histories(one: Table, other: Table) -> Comparison:
    """Compare two histories.

    Raises:
        OutputError: They have no time in common.
    """
    times = [np.asarray(table["time"].values, dtype=np.float64) for table in (one, other)]
    ends = [float(t[-1]) for t in times]
    until, span = min(ends), max(ends)
    same = len(times[0]) == len(times[1]) and bool(
        (np.abs(times[0] - times[1]) <= _SAME * span).all()
    )
    at = min(times, key=len)
    at = at[at <= until * (1.0 + _SAME)]
    if not len(at):
        raise OutputError("the histories have no time in common; compare runs of one scene")
    step = max(float(np.diff(t).max(initial=0.0)) for t in times)
    both = [name for name in one.data_vars if name in other]
    values = {
        name: [
            _values(table, name) if same else _interpolated(at, t, _values(table, name))
            for table, t in zip((one, other), times, strict=True)
        ]
        for name in both
    }
    scales: dict[tuple[str, str], float] = {}
    for name in both:
        group = _group(one, name)
        scales[group] = max([scales.get(group, 0.0), *map(_largest, values[name])])
    when = times[0] if same else at
    columns = []
    for name, (first, second) in values.items():
        group = _group(one, name)
        columns.append(_difference(name, group[0], first, second, scales[group], when))
    return Comparison(
        tuple(sorted(columns, key=lambda column: -column.relative)),
        tuple(name for name in one.data_vars if name not in other),
        tuple(name for name in other.data_vars if name not in one),
        until, interpolated=not same, same_end=span - until <= step,
    )  # fmt: skip


def _difference(
    name: str, unit: str, one: Floats, other: Floats, scale: float, times: Floats
) -> Difference:
    none = np.isnan(one), np.isnan(other)
    apart = np.where(none[0] & none[1], 0.0, np.abs(one - other))
    apart[none[0] ^ none[1]] = np.inf
    row = int(np.argmax(apart))
    absolute = float(apart[row])
    relative = absolute / scale if scale > 0.0 else absolute
    return Difference(name, unit, absolute, relative, scale, float(times[row]))


def _group(table: Table, name: str) -> tuple[str, str]:
    """Unit and body of a column; what belongs to no body has the empty name."""
    first, dot, _ = name.partition(".")
    unit = str(table[name].attrs.get("units", ""))
    return unit, first if dot and first not in RESERVED else ""


def _values(table: Table, name: str) -> Floats:
    return np.asarray(table[name].values, dtype=np.float64)


def _interpolated(at: Floats, times: Floats, values: Floats) -> Floats:
    return np.asarray(np.interp(at, times, values))


def _largest(values: Iterable[float]) -> float:
    found = np.abs(np.asarray(values))
    return float(found[np.isfinite(found)].max(initial=0.0))
