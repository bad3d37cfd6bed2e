"""TOML: reading scene files with clear errors, and writing tables back."""

import re
import tomllib
from collections.abc import Mapping
from datetime import date, datetime, time
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from impactfem.errors import SceneError
from impactfem.scene.kinds import show

MAX_BYTES = 2**20


def read_toml(path: str | PathLike[str]) -> dict[str, Any]:
    """Read a TOML file of at most 1 MiB.

    Raises:
        SceneError: the file is missing, unreadable, empty, too large, not UTF-8 or not TOML.
    """
    name = fspath(path)
    try:
        with Path(name).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise SceneError(f"{name}: there is no such file; check the path.") from None
    except IsADirectoryError:
        raise SceneError(f"{name}: this is a folder; give the scene file in it.") from None
    except PermissionError:
        raise SceneError(f"{name}: no permission to read the file; change it with chmod.") from None
    except (OSError, ValueError) as error:
        raise SceneError(
            f"{show(name)}: the file cannot be read ({error}); check the path."
        ) from None
    if len(data) > MAX_BYTES:
        raise SceneError(
            f"{name}: larger than 1 MiB, the limit for scene files; is it a scene file?"
        )
    try:
        text = data.decode("utf-8-sig")  # editors on Windows put a byte order mark first
    except UnicodeDecodeError as error:
        raise SceneError(
            f"{name}: byte {error.start} ({data[error.start]:#04x}) is not UTF-8; save the file as UTF-8 text."
        ) from None
    if "\0" in text:
        raise SceneError(f"{name}: this is a binary file; give a scene file in TOML text.")
    if not text.strip():
        raise SceneError(
            f"{name}: the file is empty; it needs title, duration, [[body]], [[obstacle]]."
        )
    return parse_toml(text, name)


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Parse TOML text; `name` of the file is for messages.

    Raises:
        SceneError: with line, column and the line itself.
    """
    try:
        # Universal newlines as in text files: a lone carriage return is not a line end in TOML.
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        found = re.search(r"at line (\d+), column", message)
        lines = text.splitlines()
        line = lines[int(found[1]) - 1].strip() if found and int(found[1]) <= len(lines) else ""
        raise SceneError(
            f"{name}: not valid TOML: {message}{': ' + show(line) if line else ''}; "
            "correct that line (key = value, texts in quotes, each key once)."
        ) from None
    except RecursionError:
        raise SceneError(f"{name}: lists or tables are nested too deeply; simplify them.") from None
    except ValueError as error:
        raise SceneError(f"{name}: a value cannot be read ({error}); correct it.") from None


def parse_assignment(text: str) -> tuple[str, Any]:
    """Split ``solve.elements=80`` into the path and the value.

    The value is read as TOML (``80``, ``[]``, ``"free"``), otherwise taken as a text (``clamped``, ``-0.5*x``).
    An empty value is None: `Scene.with_settings` then removes the key.

    Raises:
        SceneError: there is no ``=``, or nothing before it.
    """
    path, equals, given = text.partition("=")
    path, given = path.strip(), given.strip()
    if not equals or not path:
        raise SceneError(f"setting {show(text)}: write it as key=value, such as solve.elements=80.")
    if not given:
        return path, None
    try:
        table = tomllib.loads(f"value = {given}")
    except (ValueError, RecursionError):
        return path, given
    value = table["value"] if set(table) == {"value"} else given
    return path, given if isinstance(value, datetime | date | time) else value


def write_value(value: object) -> str:
    """Return a text, number, boolean, list or table of these as a TOML value."""
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            return '"' + "".join(_escape(character) for character in value) + '"'
        case list() | tuple():
            return "[" + ", ".join(write_value(entry) for entry in value) + "]"
    raise TypeError(f"{type(value).__name__} cannot be written as TOML")


def _escape(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    if ord(character) < 0x20 or ord(character) == 0x7F:
        return f"\\u{ord(character):04x}"
    return character


def write_table(table: Mapping[str, Any], units: Mapping[str, str]) -> list[str]:
    """Return the lines ``key = value  # [unit]`` of a table."""
    lines = []
    for name, value in table.items():
        unit = f"  # [{units[name]}]" if units.get(name) else ""
        lines.append(f"{name} = {write_value(value)}{unit}")
    return lines
