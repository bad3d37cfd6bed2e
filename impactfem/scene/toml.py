"""TOML: reading scene files with clear errors, and writing tables back."""

import re
import tomllib
from collections.abc import Mapping
from datetime import date, datetime, time
from os import PathLike
from pathlib import Path
from typing import Any

from impactfem.errors import SceneError
from impactfem.scene.toml_hints import toml_hint
from impactfem.scene.values import show

MAX_BYTES = 2**20
MAX_PARTS = 16

# A key of more parts than any scene has. tomllib's time and memory grow with their square; such a
# row of words in a text is refused as well. Each word is tried from its beginning only.
_LONG_KEY = re.compile(
    r"(?<![\w-])(?:(?:[\w-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+){" + str(MAX_PARTS) + "}",
    re.ASCII,
)


def read_toml(path: str | PathLike[str]) -> dict[str, Any]:
    """Read a TOML file of at most 1 MiB.

    Raises:
        SceneError: the file is missing, unreadable, empty, too large, not UTF-8 or not TOML.
    """
    name = str(path)
    data = _read_bytes(name)
    if len(data) > MAX_BYTES:
        raise SceneError(f"{name}: larger than the limit of 1 MiB; give a scene file.")
    try:
        text = data.decode("utf-8-sig")  # editors on Windows put a byte order mark first
    except UnicodeDecodeError as error:
        byte = f"byte {error.start} ({data[error.start]:#04x})"
        raise SceneError(f"{name}: {byte} is not UTF-8; save the file as UTF-8 text.") from None
    if "\0" in text:
        raise SceneError(f"{name}: this is a binary file; give a scene file in TOML.")
    if not text.strip():
        needs = "title, duration, [[body]] and [[obstacle]]"
        raise SceneError(f"{name}: the file is empty; add {needs}.")
    return parse_toml(text, name)


def _read_bytes(name: str) -> bytes:
    try:
        with Path(name).open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        why = "there is no such file; check the path"
    except IsADirectoryError:
        why = "this is a folder; give the scene file in it"
    except PermissionError:
        why = "there is no permission to read the file; allow it, or copy the file"
    except (OSError, ValueError) as error:  # too long a name, a null character in it
        why = f"the file cannot be read ({getattr(error, 'strerror', None) or error}); check it"
        name = show(name)
    raise SceneError(f"{name}: {why}.") from None


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Parse TOML text; `name` stands for the file in messages.

    Raises:
        SceneError: with line, column and the line itself.
    """
    long = _LONG_KEY.search(text)
    if long:
        line = text.count("\n", 0, long.start()) + 1
        raise SceneError(
            f"{name}: not valid TOML: line {line} has a key of more than {MAX_PARTS} parts "
            f"{show(long[0])}; shorten it."
        )
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"at line (\d+), column", str(error))
        number = int(found[1]) if found else 0
        lines = text.split("\n")  # tomllib counts these only
        wrong = lines[number - 1].strip() if 0 < number <= len(lines) else ""
        shown = f" in {show(' '.join(wrong.split()))}" if wrong else ""
        why = f"{error}{shown}; correct it: {toml_hint(str(error), wrong)}"
    except RecursionError:
        why = "lists or tables are nested too deeply; simplify them"
    except ValueError as error:  # integers of thousands of digits
        why = f"{error}; correct the value"
    raise SceneError(f"{name}: not valid TOML: {why}.") from None


def parse_assignment(text: str) -> tuple[str, Any]:
    """Split ``solve.elements=80`` into the path and the value.

    The value is read as TOML (``80``, ``[]``, ``"free"``), otherwise taken as text (``clamped``,
    ``-0.5*x``). Nothing after ``=`` gives None: `Scene.with_settings` then removes the key.

    Raises:
        SceneError: there is no ``=``, or nothing before it.
    """
    path, equals, given = text.partition("=")
    path, given = path.strip(), given.strip()
    if not equals or not path:
        raise SceneError(f"setting {show(text)}: write it as key=value, as solve.elements=80.")
    if not given:
        return path, None
    try:
        table = tomllib.loads(f"value = {given}")
    except (ValueError, RecursionError):
        return path, given
    value = table["value"]
    # More keys come from line breaks; a date can only be meant as text.
    return path, given if len(table) > 1 or isinstance(value, datetime | date | time) else value


def write_value(value: object) -> str:
    """Return a text, number, boolean, list or inline table as a TOML value."""
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            return '"' + "".join(_escape(character) for character in value) + '"'
        case list() | tuple():
            if value and all(isinstance(entry, dict) for entry in value):
                return "[\n" + "".join(f"    {write_value(entry)},\n" for entry in value) + "]"
            return "[" + ", ".join(write_value(entry) for entry in value) + "]"
        case dict():
            inner = (f"{_key(name)} = {write_value(entry)}" for name, entry in value.items())
            return f"{{ {', '.join(inner)} }}"
    raise TypeError(f"{type(value).__name__} cannot be written as TOML")


def _key(name: str) -> str:
    """A key as it may stand bare, else in quotes: joints have the names of their file."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else write_value(name)


def _escape(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    if ord(character) < 0x20 or ord(character) == 0x7F:
        return f"\\u{ord(character):04x}"
    return character


def write_table(heading: str, table: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """Return a table as text, with units as comments; no heading for the top level."""
    lines = [heading] if heading else []
    for name, value in table.items():
        unit = f"  # [{units[name]}]" if units.get(name) else ""
        lines.append(f"{name} = {write_value(value)}{unit}")
    return "\n".join(lines) + "\n"
