"""A scene as a card in a notebook: its bodies, obstacles, loads and what is set."""

from collections.abc import Mapping, Sequence
from typing import Any

from impactfem.cards import card
from impactfem.scene.content import Content
from impactfem.scene.inline import plain
from impactfem.scene.schema import REQUIRED, DataclassLike, keys_of
from impactfem.scene.toml import write_value

_MOST_OBJECTS = 8
_LISTS = {
    "body": "bodies", "obstacle": "obstacles", "contact": "contacts", "joint": "joints",
    "spring": "springs", "tie": "ties", "point_mass": "masses", "probe": "probes",
    "parameter": "parameters", "control": "controls", "controller": "controllers",
    "measure": "measures",
}  # fmt: skip
_TABLES = ("objective", "solve", "output")
_TOLD = {"name", "title", *_LISTS, *_TABLES}
_LONGEST = 120  # letters of a value


def scene_card(scene: Content) -> str:
    """The scene in a table, as its file would hold it: what differs from the defaults."""
    rows = []
    for what, name in _LISTS.items():
        rows += _objects(what, getattr(scene, name))
    rows.append(("scene", _keys(scene)))
    tables = {name: getattr(scene, name) for name in _TABLES}
    rows += [(name, _keys(table)) for name, table in tables.items() if table is not None]
    return card(scene.title, [row for row in rows if row[1]])


def _objects(what: str, entries: Sequence[Any]) -> list[tuple[str, str]]:
    rows = []
    for entry in entries[:_MOST_OBJECTS]:
        label = f"{what} {getattr(entry, 'name', None) or ''}".strip()
        rows.append((label, "; ".join(p for p in (getattr(entry, "kind", ""), _keys(entry)) if p)))
    if len(entries) > _MOST_OBJECTS:
        rows.append((what, f"and {len(entries) - _MOST_OBJECTS} more"))
    return rows


def _keys(entry: DataclassLike) -> str:
    """Keys whose values say more than their defaults, without names, titles and inner tables."""
    keys = {key.name: key for key in keys_of(type(entry)).values()}
    said = []
    for name, value in plain(entry).items():
        key = keys[name]
        inner = isinstance(value, Mapping) and not value
        if name in _TOLD or inner:
            continue
        usual = list(key.default) if isinstance(key.default, tuple) else key.default
        if usual is REQUIRED or not (value == usual or _is_zero(value)):
            said.append(f"{name} = {_shortened(value)} {key.unit}".strip())
    return ", ".join(said)


def _is_zero(value: object) -> bool:
    """Whether a value is a zero, as a number or formula, or a list of zeros."""
    if isinstance(value, list | tuple):
        return all(_is_zero(entry) for entry in value)
    return value in (0.0, "0", "0.0")


def _shortened(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    text = " ".join(write_value(_rounded(value)).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."


def _rounded(value: Any) -> Any:
    """Numbers with six digits, which are for reading."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, list | tuple):
        return [_rounded(entry) for entry in value]
    if isinstance(value, Mapping):
        return {name: _rounded(entry) for name, entry in value.items() if entry not in (0.0, [])}
    return value
