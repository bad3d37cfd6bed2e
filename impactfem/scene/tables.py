"""Tables inside a scene: bodies, obstacles and settings, as kinds of values."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, override

from impactfem.scene.kinds import Kind, one_of
from impactfem.scene.nearest import meant
from impactfem.scene.schema import KeyedError, check_keys, from_table, keys_of
from impactfem.scene.values import NotAllowedError, show, type_in_words

MAX_OBSTACLES = 100
MAX_BODIES = 2000
EXTENDED = ("body[", "obstacle[")
"""Tables to whose kinds extensions add others."""
MODELLED = (
    f"up to {MAX_BODIES} bodies of any kinds and up to {MAX_OBSTACLES} obstacles, of bars in a row "
    "one wall"
)
"""What a scene may hold, in words."""


@dataclass(frozen=True)
class SettingsKind(Kind):
    """One table of settings."""

    type_name: ClassVar[str] = "table"
    cls: type[Any]
    heading: str

    @property
    @override
    def allowed(self) -> str:
        return f"the keys of {self.heading}"

    @override
    def read(self, value: object) -> Any:
        if not isinstance(value, self.cls):
            raise NotAllowedError(f"it is {type_in_words(value)}, write {self.cls.__name__}(...)")
        return value

    @override
    def write_default(self, default: object) -> str:
        return f"defaults of {self.heading}"


@dataclass(frozen=True)
class ObjectsKind(Kind):
    """A list of bodies or obstacles."""

    type_name: ClassVar[str] = "list of tables"
    classes: Collection[type[Any]]
    heading: str
    at_most: int
    at_least: int = 1

    @property
    @override
    def allowed(self) -> str:
        if len(self.classes) == 1:
            return counted(self.heading)
        kinds = " or ".join(show(cls.kind) for cls in self.classes)
        return f"{counted(self.heading)} of kind {kinds}"

    @override
    def read(self, value: object) -> tuple[Any, ...]:
        classes = tuple(self.classes)
        if isinstance(value, classes):
            raise NotAllowedError("it is not in a list, write [ ] around it")
        if not isinstance(value, list | tuple):
            raise NotAllowedError(f"it is {type_in_words(value)}, not a list")
        for entry in value:
            if not isinstance(entry, classes):
                names = " or ".join(cls.__name__ for cls in classes)
                raise NotAllowedError(f"{show(entry)} is not a {names}")
        check_count(value, self.at_most, self.at_least)
        return tuple(value)

    @override
    def write_default(self, default: object) -> str:
        return "none"


def counted(heading: str) -> str:
    """Return how many tables of a heading are allowed, in words."""
    return f"one or more {heading}"


def check_count(entries: list[Any] | tuple[Any, ...], at_most: int, at_least: int = 1) -> None:
    """Refuse no bodies or obstacles, or too many.

    Raises:
        NotAllowedError: with the number.
    """
    if not at_least <= len(entries) <= at_most:
        are = "is none" if not entries else f"are {len(entries)}"
        raise NotAllowedError(f"there {are}, but this version models {MODELLED}")


def read_objects(
    value: object,
    heading: str,
    classes: Mapping[str, type[Any]] | type[Any],
    at_most: int,
    at_least: int = 1,
) -> list[Any]:
    """Read the tables of a heading such as ``[[body]]``, each with the class of its kind.

    Raises:
        KeyedError: naming the key, e.g. ``body[0].kind``.
    """
    if not isinstance(value, list | tuple):
        text = f" = {show(value)} is not a list: write [[{heading}]] with two brackets."
        raise KeyedError(heading, "", text)
    try:
        check_count(value, at_most, at_least)  # first: a file may hold thousands
    except NotAllowedError as error:
        wanted = counted(f"[[{heading}]]")
        text = f" = {show(value)} is not allowed: {error}; give {wanted}."
        raise KeyedError(heading, "", text) from None
    return [read_object(entry, f"{heading}[{i}]", classes) for i, entry in enumerate(value)]


def read_object(
    entry: object, where: str, classes: Mapping[str, type[Any]] | type[Any]
) -> Any:  # of one of the classes
    """Read a table with the class of its kind, or with the only class.

    Raises:
        KeyedError: naming the key.
    """
    if isinstance(classes, type):
        return from_table(classes, entry, where)
    allowed = " or ".join(show(kind) for kind in classes)
    if not isinstance(entry, Mapping):
        heading = where.partition("[")[0]
        text = f" = {show(entry)} is not a table: write [[{heading}]] and keys below it."
        raise KeyedError(where, "", text)
    given = entry.get("kind")
    if given is None:
        known = list(
            dict.fromkeys(key.name for cls in classes.values() for key in keys_of(cls).values())
        )
        check_keys(entry, ["kind", *known], where)  # "kind" may be there, but misspelt
        raise KeyedError(where, "kind", f" is missing: add kind = {allowed}.")
    try:
        kind = one_of(given, tuple(classes))
    except NotAllowedError as error:
        more = ""
        if where.startswith(EXTENDED) and "did you mean" not in str(error):
            more = ", or load the extension that adds it (--extension)"
        text = f" = {show(given)} is not allowed: {error}; give {allowed}{more}."
        raise KeyedError(where, "kind", text) from None
    return from_table(classes[kind], entry, where, "kind")


def assign(data: dict[str, Any], path: str, value: object) -> None:
    """Put a value at a path such as ``solve.dt``, ``body.0.gap`` or ``body.ball.velocity.1``.

    Raises:
        NotAllowedError: there is no such table.
    """
    place, name = _home(data, path)
    place[name] = own(value)


def looked_up(data: dict[str, Any], path: str) -> object:
    """Return what stands at a path of plain tables.

    Raises:
        NotAllowedError: there is nothing.
    """
    place, name = _home(data, path)
    if isinstance(place, dict) and name not in place:
        raise NotAllowedError(f"the scene has no {show(name)} there; {meant(str(name), place)}")
    return place[name]


def is_missing(data: dict[str, Any], path: str) -> bool:
    """Whether the table of a path is there, and what the path ends with is not.

    Raises:
        NotAllowedError: there is no such table.
    """
    place, name = _home(data, path)
    return isinstance(place, dict) and name not in place


_PLACES = "surface", "edge", "face"
"""Keys by which loads and supports of solids and of plates may be named."""


def _home(data: dict[str, Any], path: str) -> tuple[Any, Any]:
    """Return the table or list of numbers in which a path ends, and the key or index in it."""
    parts = [part.strip() for part in path.replace("[", ".").replace("]", "").split(".")]
    place: Any = data
    for part in parts[:-1]:
        if isinstance(place, list):
            found = {str(index): entry for index, entry in enumerate(place)}
            entries = [entry for entry in place if isinstance(entry, dict)]
            found |= {str(e["kind"]): e for e in entries if "kind" in e and "name" not in e}
            found |= {str(e[key]): e for key in _PLACES for e in entries if key in e}
            found |= {str(e["name"]): e for e in entries if "name" in e}
            if part not in found:
                raise NotAllowedError(f"there is no {show(part)}; write {' or '.join(found)}")
            place = found[part]
        elif isinstance(place, dict) and part in (tables := _tables(place)):
            place = tables[part]
        else:
            raise NotAllowedError(
                f"there is no table {show(part)}; the tables are {', '.join(_of_tables(data))}"
            )
    last = parts[-1]
    if place == []:
        raise NotAllowedError(f"there is nothing in {'.'.join(parts[:-1])}")
    if isinstance(place, list) and not _is_table(place[0]):
        if not (last.isdigit() and int(last) < len(place)):
            raise NotAllowedError(
                f"{show(last)} is no entry of a list of {len(place)}; write 0 to {len(place) - 1}"
            )
        return place, int(last)
    if isinstance(place, list):
        example = ".".join([*parts[:-1], str(place[0].get("name", 0)), parts[-1]])
        raise NotAllowedError(f"say which one is meant, such as {example}")
    if not isinstance(place, dict):
        raise NotAllowedError(f"there is no table but {show(place)}")
    return place, last


def _is_table(entry: object) -> bool:
    """Whether an entry of a list is a table of several keys, and no measured signal."""
    return isinstance(entry, dict) and "table" not in entry


def own(value: object, depth: int = 5) -> object:
    """Return a copy of tables and lists: later assignments must not reach the caller's."""
    if depth and isinstance(value, list):
        return [own(entry, depth - 1) for entry in value]
    if depth and isinstance(value, dict):
        return {name: own(entry, depth - 1) for name, entry in value.items()}
    return value


def _tables(data: dict[str, Any]) -> dict[str, Any]:
    """Return the tables and lists of a table."""
    return {
        name: value
        for name, value in data.items()
        if isinstance(value, dict) or (isinstance(value, list) and value)
    }


def _of_tables(data: dict[str, Any]) -> list[str]:
    """Return the names of tables, and of lists of tables."""
    return [
        name
        for name, value in _tables(data).items()
        if isinstance(value, dict) or isinstance(value[0], dict)
    ]
