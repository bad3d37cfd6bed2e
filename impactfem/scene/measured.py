"""Measured signals: columns of files over time, wherever a scene takes a formula of time.

Between two samples a signal goes straight from one to the next.
"""

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, override

import numpy as np

from impactfem.arrays import Floats
from impactfem.reading.regular import read_regular, reason
from impactfem.scene.formula import Formula
from impactfem.scene.grammar import FOLDER, FormulaError
from impactfem.scene.nearest import meant
from impactfem.scene.pieces import Table
from impactfem.scene.values import NotAllowedError, show

SIGNAL = "signal"
"""What formulas call the values of the column."""

_KEYS = ("table", "column", "formula")
_MOST = 64 * 2**20  # bytes of a file
_SECONDS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6, "\u03bcs": 1e-6}
_TIMES = ("time", "t")
_HEADING = re.compile(r"\s*\"?\s*([^\[(\"]*[^\[(\"\s])\s*(?:[\[(]([^\])]*)[\])])?\s*\"?\s*")
_WORDS = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")


class Measured(Formula):
    """A measured signal as a formula: that of a file's column, or a formula of it.

    Attributes:
        given: As the scene has it.
        unit: Of the column as its file says; empty if it says nothing.
        span: First and last time of the file [s].
        base: Where its path starts.
    """

    given: Mapping[str, Any]
    unit: str
    span: tuple[float, float]
    base: Path | None

    @override
    def of(self, variables: tuple[str, ...]) -> "Measured":
        """As of other formulas; its file is where it was, whoever asks.

        Raises:
            NotAllowedError: They have no time.
        """
        token = FOLDER.set(self.base)
        try:
            return measured(self.given, variables)
        finally:
            FOLDER.reset(token)

    @property
    @override
    def plain(self) -> dict[str, Any]:
        return dict(self.given)

    @property
    @override
    def record(self) -> tuple[tuple[float, float], str]:
        return self.span, "" if "formula" in self.given else self.unit


def measured(given: Mapping[str, Any], variables: tuple[str, ...]) -> Measured:
    """Read a signal that a scene names.

    Args:
        given: ``table``, a file with a line of headings, one of them time or t; ``column``, which
            may be left out where there is one besides; ``formula`` of the variables and
            ``signal``, its value.
        variables: Of the formula that it stands for.

    Raises:
        NotAllowedError: It is none, its file has no such column, or this is not a function of time.
    """
    _check(given, variables)
    times, columns = _read(given["table"])
    name = given.get("column", next(iter(columns)) if len(columns) == 1 else None)
    if name not in columns:
        if name is None:
            there = ", ".join(show(each) for each in columns)
            raise NotAllowedError(f"its file has several columns: say which, column = {there}")
        raise NotAllowedError(f"its file has no column {show(name)}; {meant(name, columns)}")
    values, unit = columns[name]
    node = ("table", Table.through(times, values), ("variable", "t"))
    try:
        inner = Formula(given.get("formula", SIGNAL), (*variables, SIGNAL))
    except FormulaError as error:
        raise NotAllowedError(f"its formula: {error.why}") from None
    plain = dict(given)
    if plain.get("formula", "").strip() == SIGNAL:
        del plain["formula"]
    own = {name: Formula(name, variables) for name in variables}
    whole = inner.composed(**own, **{SIGNAL: _of(node, variables)})
    made: Measured = object.__new__(Measured)
    text = f"{given['table']}: {name}, {inner.text}"
    made._store(text, variables, whole.tree, (*whole.named, (f"{SIGNAL} {name}", node)))  # noqa: SLF001
    for field, value in (
        ("given", plain), ("unit", unit), ("span", (float(times[0]), float(times[-1]))),
        ("base", FOLDER.get()),
    ):  # fmt: skip
        object.__setattr__(made, field, value)
    return made


def _check(given: Mapping[str, Any], variables: tuple[str, ...]) -> None:
    if "table" not in given:
        text = 'it is a table, not a number; a signal is { table = "FILE.csv", column = "NAME" }'
        raise NotAllowedError(text)
    for name in given:
        if name not in _KEYS:
            raise NotAllowedError(f"a signal has no key {show(name)}, but {', '.join(_KEYS)}")
        if not isinstance(given[name], str):
            raise NotAllowedError(f"its {name} is {show(given[name])}, not a text")
    if "t" not in variables:
        raise NotAllowedError("a measured signal is a function of time, and this is none")


def _of(node: Any, variables: tuple[str, ...]) -> Formula:
    """A node as a formula."""
    found = object.__new__(Formula)
    found._store(SIGNAL, variables, node)
    return found


def _read(name: str) -> tuple[Floats, dict[str, tuple[Floats, str]]]:
    """Times [s], and values and unit of the other columns by name.

    Raises:
        NotAllowedError: The file cannot be read, or is no table.
    """
    path = Path(FOLDER.get() or "", name)
    try:
        known = path.stat()
        return _table(path, (known.st_mtime_ns, known.st_size))
    except OSError as error:
        why = f"cannot be read ({reason(error)}): check it, relative paths start at the scene file"
    except UnicodeDecodeError:
        why = "holds no text: give numbers with commas or blanks between them"
    except ValueError as error:
        why = str(error)
    raise NotAllowedError(f"its file {why} (looked for {path})")


@lru_cache(maxsize=32)
def _table(path: Path, known: tuple[int, int]) -> tuple[Floats, dict[str, tuple[Floats, str]]]:
    """The table in a file; `known` tells its contents apart."""
    del known
    lines = read_regular(path, _MOST).decode("utf-8-sig").splitlines()
    told = [
        (k, line) for k, line in enumerate(lines, 1) if line.strip() and line.lstrip()[0] != "#"
    ]
    if not told:
        raise ValueError("is empty: give a line of headings, then time and values")
    first = told[0][1]
    mark = next((each for each in ";,\t" if each in first), None)
    cells = first.split(mark) if mark else _WORDS.findall(first)
    headings = [_HEADING.fullmatch(cell) for cell in cells]
    names = [match.group(1) if match else "" for match in headings]
    if not all(names) or _number(names[0], mark) is not None:
        text = f"has no headings in line {told[0][0]}"
        raise ValueError(f'{text}: begin it with names of columns, as "time,a" or "time [s],a [N]"')
    units = [(match.group(2) or "").strip() if match else "" for match in headings]
    place = next((k for k, each in enumerate(names) if each.lower() in _TIMES), None)
    if place is None or len(names) < 2:
        text = f"has the columns {', '.join(map(show, names))}"
        raise ValueError(f"{text}: give one called time and one of values")
    if units[place] not in _SECONDS:
        raise ValueError(f"has times in {show(units[place])}: give s, ms or us")
    if len({*names}) < len(names):
        raise ValueError("has two columns of one name: give each its own")
    rows = np.array([_row(line, number, mark, len(names)) for number, line in told[1:]])
    if len(rows) < 2:
        raise ValueError(f"has {len(rows)} lines of numbers: give at least 2")
    times = rows[:, place] * _SECONDS[units[place]]
    if (late := np.flatnonzero(np.diff(times) <= 0.0)).size:
        number = told[int(late[0]) + 2][0]
        raise ValueError(f"has times that do not ascend, in line {number}: sort it, each time once")
    others = {n: (rows[:, k], units[k]) for k, n in enumerate(names) if k != place}
    return times, others


def _row(line: str, number: int, mark: str | None, count: int) -> list[float]:
    cells = line.split(mark)
    found = [value for cell in cells if (value := _number(cell, mark)) is not None]
    if len(found) != len(cells) or len(found) != count:
        text = f"has {show(line.strip()[:40])} in line {number}"
        raise ValueError(f"{text}: give {count} finite numbers")
    return found


def _number(cell: str, mark: str | None) -> float | None:
    """A finite number, with a decimal comma where columns are apart by semicolons."""
    try:
        value = float(cell.replace(",", ".") if mark == ";" else cell)
    except ValueError:
        return None
    return value if np.isfinite(value) else None
