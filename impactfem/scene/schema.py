"""Keys of the scene language: declared once as dataclass fields, checked and described from there."""

from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields
from difflib import get_close_matches
from typing import Any, ClassVar, NamedTuple, Protocol

from impactfem.errors import SceneError
from impactfem.scene.kinds import Kind, NotAllowedError, show


class _Required:
    """Default of a key that must be given."""

    def __repr__(self) -> str:
        return "<required>"


REQUIRED = _Required()


class KeyFault(SceneError):
    """An error at one key; `moved` tells the same with the place of the table in a scene file."""

    def __init__(self, where: str, key: str, text: str) -> None:
        super().__init__(f"{join(where, key)}{text}")
        self.where, self.key, self.text = where, key, text

    def moved(self, where: str) -> "KeyFault":
        """Return the same fault for a table that stands at another place."""
        return KeyFault(where, self.key, self.text)


class DataclassLike(Protocol):
    """A dataclass whose fields were declared with `key`."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


@dataclass(frozen=True)
class Key:
    """One key of the language: its kind of value, unit, meaning and default."""

    name: str
    kind: Kind
    doc: str
    unit: str
    default: object

    @property
    def wanted(self) -> str:
        """What to give, for messages."""
        unit = f" [{self.unit}]" if self.unit else ""
        return f"{self.kind.allowed}{unit} ({self.doc})"


class KeyDoc(NamedTuple):
    """One row of the scene reference."""

    key: str
    type: str
    unit: str
    default: str
    doc: str
    allowed: str


class TableDoc(NamedTuple):
    """One table of the scene reference."""

    name: str
    keys: list[KeyDoc]


def join(where: str, key: str) -> str:
    """Return the path of a key in a table, e.g. ``body[0].length``."""
    return f"{where}.{key}" if where and key else where or key


def key(kind: Kind, doc: str, *, unit: str = "", default: object = REQUIRED, name: str = "") -> Any:  # noqa: ANN401
    """Declare a dataclass field as a key of the scene language.

    Args:
        kind: what values are allowed and how they are stored.
        doc: meaning, a few words.
        unit: SI unit, empty for none.
        default: value when absent; None means that the plan chooses.
        name: name in scene files when it differs from the name of the field.
    """
    return field(default=default, metadata={"key": (kind, doc, unit, name)})


def keys_of(cls: type[DataclassLike]) -> dict[str, Key]:
    """Return the keys of a class by the names of their fields."""
    found = {}
    for entry in fields(cls):
        if "key" in entry.metadata:
            kind, doc, unit, name = entry.metadata["key"]
            found[entry.name] = Key(name or entry.name, kind, doc, unit, entry.default)
    return found


def check_fields(instance: DataclassLike, where: str) -> None:
    """Check and convert all fields of a new instance, in place.

    Raises:
        KeyFault: a value is missing or not allowed.
    """
    for name, entry in keys_of(type(instance)).items():
        value = getattr(instance, name)
        if value is REQUIRED:
            raise missing(entry, where)
        if value is None and entry.default is None:
            continue
        try:
            checked = entry.kind.read(value)
        except NotAllowedError as error:
            raise KeyFault(where, entry.name, refusal(value, str(error), entry)) from None
        object.__setattr__(instance, name, checked)


def refusal(value: object, why: str, entry: Key) -> str:
    """Return the text of a message about a value, to follow its path."""
    return f" = {show(value)} is not allowed: {why}; give {entry.wanted}."


def missing(entry: Key, where: str) -> KeyFault:
    """Return the fault of a key that must be given."""
    return KeyFault(where, entry.name, f" is missing: add {entry.name} = {entry.wanted}.")


def check_keys(table: object, known: list[str], where: str) -> Mapping[str, object]:
    """Refuse what is not a table, and keys that are not known.

    Raises:
        KeyFault: naming the nearest known key, or the table where the key belongs.
    """
    if not isinstance(table, Mapping):
        header = f"[{where}]" if "[" not in where else "a table"
        raise KeyFault(where, "", f" = {show(table)} is not allowed: give {header} with keys.")
    for name, value in table.items():
        if name in known:
            continue
        if not isinstance(name, str):
            raise KeyFault(where, show(name), " is not allowed as a key: give a text.")
        near = get_close_matches(name[:80], known, 1, cutoff=0.6)
        homes = [heading for heading, cls in _TABLES.items() if name in _toml_names(cls)]
        if near:
            hint = f'did you mean "{near[0]}"?'
        elif name in NOT_YET:
            hint = f"{NOT_YET[name]}; remove it."
        elif homes:
            hint = f"it belongs to {homes[0]}; move it there."
        else:
            hint = "remove it."
        raise KeyFault(
            where,
            name if len(name) <= 40 and name.isprintable() else show(name),
            f" = {show(value)} is not a known key: {hint} Known keys: {', '.join(known)}.",
        )
    return table


# Keys that the language foresees but this version does not know.
NOT_YET: Mapping[str, str] = {
    "contact": "contact laws with friction or restitution are not available yet",
    "friction_coefficient": "friction is not available yet",
    "restitution": "restitution laws are not available yet",
}


def from_table[T: DataclassLike](cls: type[T], table: object, where: str, *extra: str) -> T:
    """Make an instance from a table of a scene file.

    Args:
        cls: class whose fields were declared with `key`.
        table: what stands in the file; None counts as absent.
        where: place of the table, e.g. ``body[0]``.
        extra: keys that may stand in the table besides (``kind``).

    Raises:
        KeyFault: unknown key first (it may be a misspelt one), then missing and wrong ones.
    """
    names = {entry.name: name for name, entry in keys_of(cls).items()}
    given = check_keys(table, [*extra, *names], where)
    values = {names[k]: v for k, v in given.items() if k in names and v is not None}
    try:
        return cls(**values)
    except KeyFault as fault:
        raise fault.moved(where) from None


_TABLES: dict[str, type[DataclassLike]] = {}


def table[T: type[DataclassLike]](heading: str) -> Callable[[T], T]:
    """Class decorator: register a class as a table of the language, for `describe`."""

    def register(cls: T) -> T:
        _TABLES[heading] = cls
        return cls

    return register


def _toml_names(cls: type[DataclassLike]) -> list[str]:
    return [entry.name for entry in keys_of(cls).values()]


def describe() -> list[TableDoc]:
    """Return every table and key of the scene language, for the reference and for messages."""
    tables = []
    for heading, cls in sorted(_TABLES.items(), key=lambda item: item[0] != TOP):
        rows = []
        if kind := getattr(cls, "kind", None):
            rows.append(KeyDoc("kind", "text", "", "required", f"this is a {kind}", f'"{kind}"'))
        for entry in keys_of(cls).values():
            rows.append(
                KeyDoc(
                    entry.name,
                    entry.kind.type_name,
                    entry.unit,
                    entry.kind.default_text(entry.default, REQUIRED),
                    entry.doc,
                    entry.kind.allowed,
                )
            )
        tables.append(TableDoc(heading, rows))
    return tables


TOP = "top level"
