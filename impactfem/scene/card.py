"""A scene as a card in a notebook: its bodies, obstacles, loads and what is set."""

from typing import TYPE_CHECKING, Any

from impactfem.cards import card
from impactfem.scene.schema import DataclassLike, keys_of
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.scene import Scene

_MOST_OBJECTS = 8
_LONGEST = 90  # letters of a value


def scene_card(scene: "Scene") -> str:
    """The scene in a table: what differs from the defaults, with units."""
    rows = _objects("body", scene.bodies) + _objects("obstacle", scene.obstacles)
    rows += _objects("contact", scene.contacts)
    rows.append(("duration", f"{scene.duration:g} s"))
    for name in ("gravity", "solve", "output"):
        entry = getattr(scene, name)
        text = _settings(entry) if name != "gravity" else _value(entry, "m/s^2")
        if text and (name != "gravity" or _pulls(entry)):
            rows.append((name, text))
    return card(scene.title, rows)


def _objects(what: str, entries: tuple[Any, ...]) -> list[tuple[str, str]]:
    rows = []
    for entry in entries[:_MOST_OBJECTS]:
        name, kind = getattr(entry, "name", ""), getattr(entry, "kind", "")
        label = f"{what} {name}".strip()
        rows.append((label, ", ".join(part for part in (kind, _settings(entry)) if part)))
    if len(entries) > _MOST_OBJECTS:
        rows.append((what, f"and {len(entries) - _MOST_OBJECTS} more"))
    return rows


def _settings(entry: DataclassLike) -> str:
    """Keys that differ from their defaults."""
    given = []
    for field, key in keys_of(type(entry)).items():
        value = getattr(entry, field)
        if field != "name" and value is not None and value != key.default:
            given.append(f"{key.name} = {_value(value, key.unit)}")
    return ", ".join(given)


def _value(value: object, unit: str) -> str:
    if isinstance(value, float):
        text = f"{value:g}"
    else:
        shown = getattr(value, "plain", value)
        text = f"{shown:g}" if isinstance(shown, float) else show(shown)
    if len(text) > _LONGEST:
        text = f"{text[:_LONGEST]} ..."
    return f"{text} {unit}" if unit else text


def _pulls(gravity: Any) -> bool:
    """Whether there is any gravity."""
    return any(
        any(value) if isinstance(value, tuple | list) else bool(value) for value in gravity.values
    )
