"""Kinds of values in a scene: what is allowed, how it is stored, and how it is written back."""

import math
import re
import reprlib
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date, datetime, time
from typing import Any, ClassVar

import numpy as np

from impactfem.scene.formula import Formula, FormulaError

_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = 60
_short.maxlevel = 3


class NotAllowedError(Exception):
    """A value is refused; the message says why."""


def show(value: object) -> str:
    """Return a value as a scene file would have it, shortened when long, for messages."""
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, np.integer | np.floating):
        value = value.item()
    if isinstance(value, Formula):
        return show(value.plain)
    if isinstance(value, str):
        text = value if len(value) <= 60 else f"{value[:45]}...{value[-10:]}"
        return '"' + "".join(c if c.isprintable() else repr(c)[1:-1] for c in text) + '"'
    if isinstance(value, int) and abs(value) >= 10**40:
        return f"an integer of about {int(value.bit_length() * math.log10(2)) + 1} digits"
    if isinstance(value, list | tuple) and len(value) <= 6:
        shown = "[" + ", ".join(
            show(v) if not isinstance(v, list | tuple | dict) else _short.repr(v) for v in value
        )
        return shown + "]"
    try:
        return _short.repr(value)
    except Exception:  # noqa: BLE001  # the repr of a foreign object may fail in any way
        return f"an object of type {type(value).__name__}"


def number(value: object, unit_hint: str = "write the number without quotes") -> float:
    """Return a finite float, refusing texts, booleans, NaN and infinity."""
    if isinstance(value, bool | np.bool_):
        raise NotAllowedError("true and false are not numbers")
    if isinstance(value, str):
        raise NotAllowedError(f"it is a text, {unit_hint}")
    if not isinstance(value, int | float | np.integer | np.floating):
        raise NotAllowedError(f"it is {_kind_name(value)}, not a number")
    try:
        result = float(value)
    except OverflowError:
        raise NotAllowedError("the number is too large") from None
    if not math.isfinite(result):
        raise NotAllowedError("it is not finite")
    return result


def _kind_name(value: object) -> str:
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, datetime | date | time):
        return "a date or time"
    if isinstance(value, str):
        return "a text"
    if isinstance(value, bool | np.bool_):
        return "true or false"
    if isinstance(value, int | float):
        return "a number"
    return "nothing" if value is None else f"of type {type(value).__name__}"


class Kind(ABC):
    """A kind of value: `read` checks and converts, `write` gives what a scene file holds."""

    type_name: ClassVar[str]

    @property
    @abstractmethod
    def allowed(self) -> str:
        """What is allowed, in words."""

    @abstractmethod
    def read(self, value: object) -> Any:  # noqa: ANN401
        """Return the value as stored; raise NotAllowedError saying why not."""

    def write(self, value: Any) -> Any:  # noqa: ANN401
        """Return a stored value as plain numbers, texts and lists."""
        return value

    def default_text(self, default: object, required: object) -> str:
        """Return the default as the scene reference shows it."""
        if default is required:
            return "required"
        if default is None:
            return "chosen by the plan"
        return show(self.write(self.read(default)))


@dataclass(frozen=True)
class Real(Kind):
    """A finite number within bounds."""

    type_name: ClassVar[str] = "number"
    above: float | None = None
    at_least: float | None = None
    below: float | None = None

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        bounds = []
        if self.above is not None:
            bounds.append(f"> {self.above:g}")
        if self.at_least is not None:
            bounds.append(f">= {self.at_least:g}")
        if self.below is not None:
            bounds.append(f"< {self.below:g}")
        return " ".join(["a number", " and ".join(bounds)]).strip()

    def read(self, value: object) -> float:
        """Return a float; raise NotAllowedError saying why not."""
        result = number(value)
        if self.above is not None and not result > self.above:
            raise NotAllowedError(f"it must be > {self.above:g}")
        if self.at_least is not None and not result >= self.at_least:
            raise NotAllowedError(f"it must be >= {self.at_least:g}")
        if self.below is not None and not result < self.below:
            raise NotAllowedError(f"it must be < {self.below:g}")
        return result


@dataclass(frozen=True)
class Integer(Kind):
    """A whole number within bounds."""

    type_name: ClassVar[str] = "integer"
    at_least: int
    at_most: int

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        return f"an integer from {self.at_least} to {self.at_most}"

    def read(self, value: object) -> int:
        """Return an int; raise NotAllowedError saying why not."""
        as_float = number(value)
        if not isinstance(value, int | np.integer):
            hint = (
                f", write {int(as_float)}" if as_float.is_integer() and abs(as_float) < 1e15 else ""
            )
            raise NotAllowedError(f"it is not written as an integer{hint}")
        result = int(value)
        if not self.at_least <= result <= self.at_most:
            raise NotAllowedError(
                f"it must be >= {self.at_least}"
                if result < self.at_least
                else f"it must be <= {self.at_most}"
            )
        return result


@dataclass(frozen=True)
class Line(Kind):
    """A text of one line."""

    type_name: ClassVar[str] = "text"
    max_length: int = 200

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        return f"a text of 1 to {self.max_length} characters in one line"

    def read(self, value: object) -> str:
        """Return the text; raise NotAllowedError saying why not."""
        if not isinstance(value, str):
            raise NotAllowedError(f"it is {_kind_name(value)}, write it in quotes")
        if not value.strip():
            raise NotAllowedError("it is empty")
        if len(value) > self.max_length:
            raise NotAllowedError(f"it has {len(value)} characters")
        for character in value:
            if unicodedata.category(character) in {"Cc", "Cs", "Zl", "Zp"}:
                raise NotAllowedError(f"it holds the control character U+{ord(character):04X}")
        return str(value)


@dataclass(frozen=True)
class Name(Kind):
    """A name that can stand in column names and file names."""

    type_name: ClassVar[str] = "text"
    allowed: ClassVar[str] = (
        "a name of at most 40 letters, digits, _ and - that starts with a letter"  # type: ignore[misc]
    )

    def read(self, value: object) -> str:
        """Return the name; raise NotAllowedError saying why not."""
        if not isinstance(value, str):
            raise NotAllowedError(f"it is {_kind_name(value)}, write it in quotes")
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,39}", value):
            raise NotAllowedError("it is not a name")
        return str(value)


@dataclass(frozen=True)
class Choice(Kind):
    """One of several words."""

    type_name: ClassVar[str] = "text"
    words: tuple[str, ...]

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        return " or ".join(f'"{word}"' for word in self.words)

    def read(self, value: object) -> str:
        """Return the word; raise NotAllowedError saying why not."""
        return one_of(value, self.words)


@dataclass(frozen=True)
class Choices(Kind):
    """A list of different words out of several."""

    type_name: ClassVar[str] = "list of texts"
    words: tuple[str, ...]

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        return f"a list of {', '.join(f'"{word}"' for word in self.words)}, [] for none"

    def read(self, value: object) -> tuple[str, ...]:
        """Return a tuple; raise NotAllowedError saying why not."""
        if isinstance(value, str):
            raise NotAllowedError(f"it is a text, write a list: [{show(value)}]")
        if not isinstance(value, list | tuple):
            raise NotAllowedError(f"it is {_kind_name(value)}, not a list")
        result: list[str] = []
        for entry in value:
            word = one_of(entry, self.words)
            if word in result:
                raise NotAllowedError(f'"{word}" is given twice, remove one')
            result.append(word)
        return tuple(result)

    def write(self, value: tuple[str, ...]) -> list[str]:
        """Return a list of words."""
        return list(value)


@dataclass(frozen=True)
class FormulaOf(Kind):
    """A number or a formula of some variables."""

    type_name: ClassVar[str] = "number or formula"
    variables: tuple[str, ...]

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        return f"a number or a formula in {', '.join(self.variables)}"

    def read(self, value: object) -> Formula:
        """Return a Formula; raise NotAllowedError saying why not."""
        if isinstance(value, Formula):
            if set(value.variables) <= set(self.variables):
                return value
            value = value.text
        try:
            return Formula(value if isinstance(value, str) else repr(number(value)), self.variables)
        except FormulaError as error:
            raise NotAllowedError(error.why) from None

    def write(self, value: Formula) -> float | str:
        """Return a number or a text."""
        return value.plain


def one_of(value: object, words: tuple[str, ...]) -> str:
    """Return a word that is one of several; raise NotAllowedError with the nearest one."""
    from difflib import get_close_matches  # noqa: PLC0415

    if not isinstance(value, str):
        raise NotAllowedError(f"{show(value)} is {_kind_name(value)}, write a text in quotes")
    if value not in words:
        near = get_close_matches(value.lower()[:80], words, 1)
        meant = f', did you mean "{near[0]}"?' if near else ""
        raise NotAllowedError(f"{show(value)} is not known{meant}")
    return str(value)
