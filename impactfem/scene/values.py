"""Values as users give them: read numbers strictly, show any value in a message."""

import math
import reprlib
from collections.abc import Mapping
from datetime import date, datetime, time

import numpy as np

_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = 60
_short.maxlevel = 3
_SHOWN_CHARACTERS = 60
_SHOWN_ENTRIES = 6


class NotAllowedError(Exception):
    """A value is refused; the message says why."""


class EntryNotAllowedError(NotAllowedError):
    """An entry of a list is refused.

    Attributes:
        place: which one, as ``[2]`` or ``[2][0]``.
        value: the entry.
        why: the reason.
    """

    def __init__(self, place: str, value: object, why: str) -> None:
        super().__init__(f"the entry {show(value)} is not allowed, {why}")
        self.place, self.value, self.why = place, value, why

    def inside(self, index: int) -> "EntryNotAllowedError":
        """Return the same error for a list that is itself an entry."""
        return EntryNotAllowedError(f"[{index}]{self.place}", self.value, self.why)


LEAST, MOST = 1e-50, 1e50
"""Least size of what must be above 0, most of all: products and powers neither vanish nor
overflow."""


def number(value: object) -> float:
    """Return a finite float of a size that can be computed with.

    Raises:
        NotAllowedError: for texts, booleans, NaN, infinity, absurd sizes and everything else.
    """
    if isinstance(value, str):
        raise NotAllowedError("it is a text, write the number without quotes and without unit")
    if not is_number(value):
        raise NotAllowedError(f"it is {type_in_words(value)}, not a number")
    try:
        result = float(value)  # type: ignore[arg-type]
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise NotAllowedError("it is not a finite number below 1.8e308")
    if abs(result) > MOST:
        raise NotAllowedError(
            f"it is beyond {MOST:g}, which cannot be computed with: give SI units"
        )
    return result


def degrees_hint(angle: float) -> str:
    """Return why an angle is no angle in radians, with the value meant; empty if it may be one."""
    if abs(angle) <= 2.0 * math.pi + 1e-9:
        return ""
    return f"more than a full turn: give radians ({math.radians(angle):.6g} if degrees were meant)"


def is_number(value: object) -> bool:
    """Whether a value is a number; true and false are not."""
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def type_in_words(value: object) -> str:
    """Return what a value is, for people who write TOML."""
    words: list[tuple[type | tuple[type, ...], str]] = [
        (str, "a text"),
        ((bool, np.bool_), "true or false"),
        ((int, float, np.integer, np.floating), "a number"),
        ((list, tuple), "a list"),
        (Mapping, "a table"),
        ((datetime, date, time), "a date or time"),
        (type(None), "nothing"),
    ]
    found = (text for types, text in words if isinstance(value, types))
    return next(found, f"of type {type(value).__name__}")


def show(value: object) -> str:
    """Return a value as a scene file would hold it, shortened when long."""
    if isinstance(value, str):
        return f'"{_printable(value)}"'
    if isinstance(value, list | tuple) and len(value) <= _SHOWN_ENTRIES:
        # One level only: values from hostile files may be nested thousands of levels deep.
        nested = (list, tuple, Mapping)
        entries = (_foreign(v) if isinstance(v, nested) else show(v) for v in value)
        return f"[{', '.join(entries)}]"
    if isinstance(value, Mapping) and len(value) <= _SHOWN_ENTRIES and all(map(_is_word, value)):
        nested = (list, tuple, Mapping)
        pairs = ((name, "..." if isinstance(v, nested) else show(v)) for name, v in value.items())
        return f"{{ {', '.join(f'{name} = {text}' for name, text in pairs)} }}"
    return _simple(value)


def _is_word(name: object) -> bool:
    return isinstance(name, str) and name.isidentifier() and len(name) <= 40


def _simple(value: object) -> str:
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    if isinstance(value, int) and abs(value) >= 10**40:
        return f"an integer of {int(value.bit_length() * math.log10(2)) + 1} digits"
    if isinstance(value, np.integer | np.floating | datetime | date | time):
        return str(value)
    if hasattr(value, "plain"):  # formulas
        return show(value.plain)
    if hasattr(value, "kind") and hasattr(value, "name"):  # bodies and obstacles
        return f"{value.kind} {show(value.name)}"
    return _foreign(value)


def _foreign(value: object) -> str:
    try:
        return _printable(_short.repr(value))
    except Exception:  # noqa: BLE001  # the repr of a foreign object may fail in any way
        return f"a value of type {type(value).__name__}"


def _printable(text: str) -> str:
    if len(text) > _SHOWN_CHARACTERS:
        text = f"{text[:45]}...{text[-10:]}"
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
