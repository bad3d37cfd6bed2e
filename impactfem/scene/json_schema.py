"""The scene language as a JSON schema (draft 7), from the declarations that read scenes.

Editors complete and check TOML with it. It knows single values: types, ranges, words, required and
unknown keys. What two keys mean together (a body inside an obstacle) only the reader knows. Draft 7
and `oneOf` on the key `kind`, since Taplo (Even Better TOML) follows these and no `if`.
"""

import json
from collections.abc import Iterable, Sequence
from functools import singledispatch
from typing import Any

from impactfem.scene.grammar import MAX_LENGTH
from impactfem.scene.inline import (
    MAX_ENTRIES,
    FormulaOrFormulas,
    Formulas,
    InlineTable,
    ListOf,
    NumberOrList,
    NumberOrVector,
    TablesByName,
    Vector,
)
from impactfem.scene.kinds import (
    SIDE,
    Choice,
    Choices,
    FilePath,
    FormulaOf,
    Integer,
    Kind,
    Line,
    Name,
    Real,
    RealOrFormula,
    SideName,
    Switch,
)
from impactfem.scene.loads import LoadKind
from impactfem.scene.rigid_keys import InertiaKind
from impactfem.scene.scene import Scene
from impactfem.scene.schema import REQUIRED, Key, keys_of
from impactfem.scene.settings import Window
from impactfem.scene.tables import ObjectsKind, SettingsKind
from impactfem.scene.trajectory import FREE, RangesByName

DRAFT = "http://json-schema.org/draft-07/schema#"
_NUMBER = {"type": "number"}

type Schema = dict[str, Any]


def json_schema() -> Schema:
    """Return the schema of scene files, as JSON has it."""
    found: dict[str, Schema] = {}
    top = _table(Scene, found)
    title = "Scene of impactfem"
    return {"$schema": DRAFT, "title": title, **top, "definitions": dict(sorted(found.items()))}


def json_schema_text() -> str:
    """Return the schema as the text of a file."""
    return json.dumps(json_schema(), indent=1, ensure_ascii=True) + "\n"


def _table(cls: type[Any], found: dict[str, Schema]) -> Schema:
    """Schema of a table; `found` collects those of tables inside it."""
    keys = keys_of(cls).values()
    properties: Schema = {}
    required = []
    if isinstance(getattr(cls, "kind", None), str):  # else a key like others, or none
        text = f"Makes it a {cls.kind}. {_first_line(cls)}"
        properties["kind"] = {"const": cls.kind, "type": "string", "description": text}
        required.append("kind")
    properties |= {entry.name: _described(entry, found) for entry in keys}
    required += [entry.name for entry in keys if entry.default is REQUIRED and not entry.also]
    twins = [entry for entry in keys if entry.also]
    for entry in twins:
        said = f"Another name of {entry.name}."
        properties[entry.also] = properties[entry.name] | {"description": said}
    schema = {
        "type": "object",
        "description": _first_line(cls),
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }
    if twins:  # one of both names
        names = ((entry.name, entry.also) for entry in twins)
        schema["allOf"] = [{"oneOf": [{"required": [n]} for n in both]} for both in names]
    return schema


def _first_line(cls: type[Any]) -> str:
    return (cls.__doc__ or "").partition("\n")[0]


def _described(entry: Key, found: dict[str, Schema]) -> Schema:
    """Schema of a key with its meaning, unit, range and default."""
    row = entry.describe()
    unit = f" [{row.unit}]" if row.unit else ""
    text = f"{row.doc}{unit}: {row.allowed}. "
    text += "Required." if row.default == "required" else f"Default: {row.default}."
    schema = _schema(entry.kind, found)
    if "$ref" in schema:  # draft 7 ignores what stands beside a reference
        schema = {"allOf": [schema]}
    schema["description"] = text[:1].upper() + text[1:]
    if entry.default is REQUIRED or entry.default is None:
        return schema
    if not isinstance(entry.kind, SettingsKind | ObjectsKind):
        schema["default"] = entry.kind.write(entry.kind.read(entry.default))
    return schema


def _reference(cls: type[Any], found: dict[str, Schema]) -> Schema:
    module = cls.__module__
    name = cls.__name__ if module.startswith("impactfem.") else f"{module}.{cls.__name__}"
    if name not in found:
        found[name] = {}  # taken, should a table hold itself
        found[name] = _table(cls, found)
    return {"$ref": f"#/definitions/{name}"}


def _one_of(classes: Iterable[type[Any]], found: dict[str, Schema]) -> Schema:
    references = [_reference(cls, found) for cls in classes]
    return references[0] if len(references) == 1 else {"oneOf": references}


def _list(items: Schema, least: int, most: int) -> Schema:
    return {"type": "array", "items": items, "minItems": least, "maxItems": most}


@singledispatch
def _schema(kind: Kind, found: dict[str, Schema]) -> Schema:  # noqa: ARG001  # of those below
    """Schema of the values of a kind.

    Raises:
        TypeError: the kind has no schema yet.
    """
    raise TypeError(f"{type(kind).__name__} has no JSON schema: register one in {__name__}")


@_schema.register
def _(kind: Real, _found: dict[str, Schema]) -> Schema:
    bounds = {
        "exclusiveMinimum": kind.above,
        "minimum": kind.at_least,
        "exclusiveMaximum": kind.below,
    }
    return _NUMBER | {name: bound for name, bound in bounds.items() if bound is not None}


@_schema.register
def _(kind: Integer, _found: dict[str, Schema]) -> Schema:
    return {"type": "integer", "minimum": kind.at_least, "maximum": kind.at_most}


@_schema.register
def _(kind: Line, _found: dict[str, Schema]) -> Schema:
    return {"type": "string", "pattern": r"^[^\x00-\x1f]*\S[^\x00-\x1f]*$"} | _short(kind)


@_schema.register
def _(kind: FilePath, _found: dict[str, Schema]) -> Schema:
    anyhow = ("".join(_either_case(letter) for letter in end) for end in kind.endings)
    return {"type": "string", "pattern": f"({'|'.join(anyhow)})$"} | _short(kind)


def _short(kind: Line) -> Schema:
    return {"minLength": 1, "maxLength": kind.max_length}


def _either_case(letter: str) -> str:
    if letter.isalpha():
        return f"[{letter}{letter.upper()}]"
    return letter if letter.isdigit() else f"\\{letter}"


@_schema.register
def _(_kind: Switch, _found: dict[str, Schema]) -> Schema:
    return {"type": "boolean"}


@_schema.register
def _(_kind: Name, _found: dict[str, Schema]) -> Schema:
    return {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_-]{0,39}$"}


@_schema.register
def _(_kind: SideName, _found: dict[str, Schema]) -> Schema:
    return {"type": "string", "pattern": f"^({SIDE})$"}


@_schema.register
def _(kind: Choice, _found: dict[str, Schema]) -> Schema:
    return {"type": "string", "enum": list(kind.words)}


@_schema.register
def _(kind: Choices, _found: dict[str, Schema]) -> Schema:
    words = {"type": "string", "enum": list(kind.words)}
    return {"type": "array", "items": words, "uniqueItems": True}


@_schema.register
def _(kind: FormulaOf, found: dict[str, Schema]) -> Schema:
    return {"anyOf": [_NUMBER, _formula(), *_signal(kind.variables, found)]}


@_schema.register
def _(kind: RealOrFormula, found: dict[str, Schema]) -> Schema:
    return {"anyOf": [_schema(Real(above=kind.above, below=kind.below), found), _formula()]}


def _signal(variables: Sequence[str], found: dict[str, Schema]) -> list[Schema]:
    """A measured signal, where a formula of time may stand."""
    if "t" not in variables:
        return []
    keys = {
        name: {"type": "string", "description": text}
        for name, text in (
            ("table", "File with a line of headings, one of them time or t. Required."),
            ("column", "Which one. Default: the only one besides the time."),
            ("formula", "Of signal, its value, and of what the key knows. Default: signal."),
        )
    }
    found["Signal"] = {
        "type": "object", "description": "Column of a file over time, or a formula of it.",
        "properties": keys, "required": ["table"], "additionalProperties": False,
    }  # fmt: skip
    return [{"$ref": "#/definitions/Signal"}]


def _formula() -> Schema:
    """What a formula must look like at least; its names only the reader knows."""
    pattern = r"^\s*[0-9A-Za-z_+\-*/().,<>=!\s]*[0-9A-Za-z_).]\s*$"
    # Blanks around it do not count there.
    return {"type": "string", "pattern": pattern, "maxLength": 2 * MAX_LENGTH}


@_schema.register
def _(kind: Vector, _found: dict[str, Schema]) -> Schema:
    entry = _NUMBER | ({"exclusiveMinimum": 0} if kind.positive else {})
    schema = _list(entry, min(kind.lengths), max(kind.lengths))
    return schema | ({"contains": {"not": {"const": 0}}} if kind.nonzero else {})


@_schema.register
def _(_kind: NumberOrVector, _found: dict[str, Schema]) -> Schema:
    return {"anyOf": [_NUMBER, _list(_NUMBER, 3, 3)]}


@_schema.register
def _(kind: NumberOrList, found: dict[str, Schema]) -> Schema:
    entry = _schema(kind.inner, found)
    return {"anyOf": [entry, _list(entry, 1, kind.at_most)]}


@_schema.register
def _(_kind: InertiaKind, _found: dict[str, Schema]) -> Schema:
    above = _NUMBER | {"exclusiveMinimum": 0}
    return {"anyOf": [above, _list(above, 3, 3), _list(_list(_NUMBER, 3, 3), 3, 3)]}


@_schema.register
def _(kind: FormulaOrFormulas, found: dict[str, Schema]) -> Schema:
    each = FormulaOf(kind.variables), Formulas(kind.variables)
    return {"anyOf": [_schema(one, found) for one in each]}


@_schema.register
def _(kind: Formulas, found: dict[str, Schema]) -> Schema:
    blank = [{"type": "string", "pattern": r"^\s*$"}] if kind.blank else []
    entry = {"anyOf": [_NUMBER, _formula(), *blank, *_signal(kind.variables, found)]}
    return _list(entry, min(kind.lengths), max(kind.lengths))


@_schema.register
def _(kind: InlineTable, found: dict[str, Schema]) -> Schema:
    return _one_of(kind.classes, found)


@_schema.register
def _(kind: TablesByName, found: dict[str, Schema]) -> Schema:
    return {"type": "object", "additionalProperties": _reference(kind.cls, found)}


@_schema.register
def _(_kind: RangesByName, _found: dict[str, Schema]) -> Schema:
    each = {"anyOf": [_NUMBER, _list(_NUMBER, 2, 2), {"const": FREE}, {"type": "object"}]}
    return {"type": "object", "additionalProperties": each}


@_schema.register
def _(kind: ListOf, found: dict[str, Schema]) -> Schema:
    different = {"uniqueItems": True} if kind.different else {}
    return _list(_schema(kind.inner, found), kind.at_least, MAX_ENTRIES) | different


@_schema.register
def _(_kind: LoadKind, found: dict[str, Schema]) -> Schema:
    vector = _list(_NUMBER, 1, 3)
    pair = _list([_NUMBER, {"anyOf": [_NUMBER, vector]}], 2, 2)  # type: ignore[arg-type]
    (signal,) = _signal(("t",), found)
    signals = _list({"anyOf": [_NUMBER, signal]}, 1, 3)
    pairs = {"type": "array", "items": pair, "minItems": 1}
    return {"anyOf": [_NUMBER, vector, pairs, signal, signals]}


@_schema.register
def _(_kind: Window, _found: dict[str, Schema]) -> Schema:
    layers = {"type": "integer", "minimum": 1, "maximum": 1_000_000_000}
    return {"anyOf": [layers, {"const": "all"}]}


@_schema.register
def _(kind: SettingsKind, found: dict[str, Schema]) -> Schema:
    return _reference(kind.cls, found)


@_schema.register
def _(kind: ObjectsKind, found: dict[str, Schema]) -> Schema:
    return _list(_one_of(kind.classes, found), kind.at_least, kind.at_most)
