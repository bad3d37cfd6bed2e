"""Keys of the scene language: declared once as dataclass fields, checked and described."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any, ClassVar, NamedTuple, Protocol, cast, dataclass_transform

from impactfem.errors import SceneError
from impactfem.scene.kinds import Kind
from impactfem.scene.nearest import nearest, same_as
from impactfem.scene.values import EntryNotAllowedError, NotAllowedError, show

TOP = "top level"
_MOST_KNOWN = 45  # keys that a message lists: that of a table without a kind would list all


class _Required:
    """Default of a key that must be given."""

    def __repr__(self) -> str:
        return "<required>"


REQUIRED = _Required()


class KeyedError(SceneError):
    """An error at one key: the message starts with the path of the key."""

    def __init__(self, where: str, key: str, text: str) -> None:
        super().__init__(f"{join(where, key)}{text}")
        self.where, self.key, self.text = where, key, text

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        return type(self), (self.where, self.key, self.text)

    def moved(self, where: str) -> "KeyedError":
        """Return the same error for a table that stands at another place."""
        return KeyedError(where, self.key, self.text)

    def under(self, name: str, where: str = "") -> "KeyedError":
        """Return the same error for a table that is the value of a key, or entry of a list."""
        inner = join(self.where, self.key)
        return KeyedError(where, name + inner if inner[:1] == "[" else join(name, inner), self.text)


class DataclassLike(Protocol):
    """A dataclass whose fields were declared with `key`."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


@dataclass(frozen=True)
class Key:
    """One key of the language: kind of its value, meaning, unit and default."""

    name: str
    kind: Kind
    doc: str
    unit: str
    default: object
    absent: str = ""
    also: str = ""

    @property
    def wanted(self) -> str:
        """What to give, for messages."""
        unit = f" [{self.unit}]" if self.unit else ""
        return f"{self.kind.allowed}{unit} ({self.doc})"

    def read(self, value: object, where: str) -> object:
        """Return a value as stored.

        Raises:
            KeyedError: the value is missing or not allowed.
        """
        if value is REQUIRED:
            raise KeyedError(where, self.name, f" is missing: add it, give {self.wanted}.")
        if value is None and self.default is None:
            return None
        try:
            return self.kind.read(value)
        except KeyedError as error:  # inside a table
            raise error.under(self.name, where) from None
        except EntryNotAllowedError as error:
            text = f" = {show(error.value)} is not allowed: {error.why}; give {self.wanted}."
            raise KeyedError(where, self.name + error.place, text) from None
        except NotAllowedError as error:
            text = f" = {show(value)} is not allowed: {error}; give {self.wanted}."
            raise KeyedError(where, self.name, text) from None

    def describe(self) -> "KeyDoc":
        """Return the row of the scene reference."""
        if self.default is REQUIRED:
            default = "required"
        elif self.default is None:
            default = self.absent or "chosen by the plan"
        else:
            default = self.kind.write_default(self.default)
        kind = self.kind
        return KeyDoc(self.name, kind.type_name, self.unit, default, self.doc, kind.allowed)


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


def key(
    kind: Kind,
    doc: str,
    *,
    unit: str = "",
    default: object = REQUIRED,
    name: str = "",
    absent: str = "",
    also: str = "",
) -> Any:  # as dataclasses.field, to fit fields of any type
    """Declare a dataclass field as a key of the scene language.

    Args:
        kind: what values are allowed and how they are stored.
        doc: meaning, a few words.
        unit: SI unit, empty for none.
        default: value when absent; None means that the plan chooses, unless `absent` says more.
        name: name in scene files, when it is not the name of the field.
        absent: what None means, for the scene reference.
        also: another name that scene files may use for it.
    """
    return field(default=default, metadata={"key": (kind, doc, unit, name, absent, also)})


def aside() -> Any:  # as `key`
    """Declare a field that is no key, and by which two tables do not differ; None if not given."""
    return field(default=None, compare=False, repr=False)


def keys_of(cls: type[DataclassLike]) -> dict[str, Key]:
    """Return the keys of a class by the names of their fields."""
    found = {}
    for entry in fields(cls):
        if "key" in entry.metadata:
            kind, doc, unit, name, *words = entry.metadata["key"]
            found[entry.name] = Key(name or entry.name, kind, doc, unit, entry.default, *words)
    return found


def check_fields(instance: Any, where: str) -> None:
    """Check and convert all fields of a new frozen instance of a table, in place.

    Raises:
        KeyedError: a value is missing or not allowed.
    """
    for name, entry in keys_of(type(instance)).items():
        object.__setattr__(instance, name, entry.read(getattr(instance, name), where))


def check_ends(where: str, name: str, low: float, high: float) -> None:
    """Refuse two ends that do not rise.

    Raises:
        KeyedError: naming their key.
    """
    if not low < high:
        raise KeyedError(where, name, f" = {show([low, high])}: give the smaller number first.")


def check_keys(table: object, known: list[str], where: str, own: str = "") -> Mapping[str, object]:
    """Return the table if it is one and all its keys are known.

    Args:
        table: what stands in the file.
        known: names of keys.
        where: place of the table, for messages.
        own: heading of the table in the reference, for hints.

    Raises:
        KeyedError: naming the nearest known key, or the table where the key belongs.
    """
    if not isinstance(table, Mapping):
        text = f" = {show(table)} is not a table: write [{where}] and keys below it."
        raise KeyedError(where or "scene", "", text)
    for name, value in table.items():
        if name not in known:
            short = isinstance(name, str) and 0 < len(name) <= 40 and name.isprintable()
            text = f" = {show(value)} is not a known key: {_hint(str(name), known, own)}"
            more = ", ..." * (len(known) > _MOST_KNOWN)
            text += f" Known keys: {', '.join(known[:_MOST_KNOWN])}{more}."
            raise KeyedError(where, name if short else show(name), text)
    return table


def _hint(name: str, known: list[str], own: str) -> str:
    """What to do about an unknown key: where it belongs, or what is meant."""
    homes = [] if name == "kind" else _homes(name)  # each kind of table has kinds of its own
    if TOP in homes and own != TOP:
        return "it belongs to the top of the file; move it before the first table."
    within = [part for part in ("shape", "outline") if part in known]
    drawn = next((p for p in within if any(h.startswith(f"{p} = ") for h in homes)), None)
    near = nearest(name, known)
    meant = f'did you mean "{near}"?' if near else "remove it."
    if drawn:
        meant = f"or write it into what is drawn: {drawn} = {{ kind = ..., {name} = ... }}."
    siblings = [heading for heading in homes if _family(heading) == _family(own)]
    if siblings:
        kinds = " or ".join(show(_TABLES[heading].kind) for heading in siblings)  # type: ignore[attr-defined]
        return f"only kind = {kinds} has it; {meant}"
    lists = [h for h in homes if "[{" in own and h.partition(" = ")[0] == own.partition(" = ")[0]]
    if lists:
        return f"only {' or '.join(lists)} of other bodies has it; {meant}"
    if _family(own) == "[[obstacle]] with " and "[[body]] with " in map(_family, homes):
        text = "it belongs to bodies, and obstacles move by motion and rotation only; remove it, or"
        return f"{text} give a body."
    elsewhere = next((other for other in same_as(name) if _homes(other)), "")
    if elsewhere and near not in same_as(name):
        meant = f'did you mean "{elsewhere}"? That belongs to {" or ".join(_homes(elsewhere)[:3])}.'
    if homes:
        other = f" Or {meant}" if elsewhere else ""
        return f"it belongs to {' or '.join(homes[:3])}; move it there.{other}"
    return meant


def _homes(name: str) -> list[str]:
    """Headings of the tables that have a key, in the order of the reference."""
    headings = sorted(_TABLES, key=_rank)
    return [h for h in headings if name in (entry.name for entry in keys_of(_TABLES[h]).values())]


def _family(heading: str) -> str:
    """Kinds of one thing are of one family: all bodies, all obstacles, all shapes."""
    return heading.partition("kind =")[0]


def from_table[T: DataclassLike](cls: type[T], table: object, where: str, *extra: str) -> T:
    """Make an instance from a table of a scene file.

    Args:
        cls: class whose fields were declared with `key`.
        table: what stands in the file; None counts as absent.
        where: place of the table, e.g. ``body[0]``.
        extra: keys that may stand in the table besides (``kind``).

    Raises:
        KeyedError: unknown keys first (one may be misspelt), then missing and wrong ones.
    """
    keys = keys_of(cls)
    names = {entry.name: name for name, entry in keys.items()}
    own = next((heading for heading, known in _TABLES.items() if known is cls), "")
    given = check_keys(_renamed(table, keys.values(), where), [*extra, *names], where, own)
    values = {names[k]: v for k, v in given.items() if k in names and v is not None}
    try:
        return cls(**values)
    except KeyedError as error:
        raise error.moved(where) from None


def _renamed(table: object, keys: Iterable[Key], where: str) -> object:
    """Return the table with the names of the reference for keys that go by another one.

    Raises:
        KeyedError: a key is there by both names.
    """
    others = {entry.also: entry.name for entry in keys if entry.also}
    if not isinstance(table, Mapping) or not others.keys() & table.keys():
        return table
    for other, name in others.items():
        if other in table and name in table:
            text = f" = {show(table[other])} and {name} = {show(table[name])} say the same place"
            raise KeyedError(where, other, f"{text}: remove one of them.")
    return {others.get(name, name): value for name, value in table.items()}


_TABLES: dict[str, type[DataclassLike]] = {}


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(key,))
def table[T](heading: str = "") -> Callable[[type[T]], type[T]]:
    """Make a class a table of the language: a frozen dataclass that checks its keys.

    Its method ``_check``, if it has one, is called once its keys are; a `heading` or `kind` of the
    class names it in messages.

    Args:
        heading: As the scene reference has it, for `describe` and for hints; empty for a class
            that others inherit.
    """

    def register(cls: type[T]) -> type[T]:
        if not hasattr(cls, "__post_init__"):
            cls.__post_init__ = _checked  # type: ignore[attr-defined]
        made: Any = dataclass(frozen=True, kw_only=True)(cls)
        if heading:
            _TABLES[heading] = made
        return cast("type[T]", made)

    return register


def entitle(heading: str, cls: type[DataclassLike]) -> None:
    """Give a table a heading, under which `describe` and hints know it."""
    _TABLES[heading] = cls


def _checked(instance: Any) -> None:
    """Check the keys of a new table, then what they mean together."""
    check_fields(instance, getattr(instance, "heading", None) or instance.kind)
    check = getattr(instance, "_check", None)
    if check is not None:
        check()


def describe() -> list[TableDoc]:
    """Return every table and key of the scene language, for the scene reference."""
    tables = []
    for heading, cls in sorted(_TABLES.items(), key=lambda item: _rank(item[0])):
        kind = None if "kind" in keys_of(cls) else getattr(cls, "kind", None)
        extra = [KeyDoc("kind", "text", "", "required", f"makes it a {kind}", show(kind))]
        rows = [entry.describe() for entry in keys_of(cls).values()]
        tables.append(TableDoc(heading, (extra if kind else []) + rows))
    return tables


def _rank(heading: str) -> int:
    """Return the place of a table in the reference: as in a scene file, inline tables last."""
    kinds = ("bar", "solid", "point", "rod", "beam", "rigid", "mechanism", "springs", "plate")
    bodies = (f'[[body]] with kind = "{kind}"' for kind in kinds)
    inline = (
        "supports", "tractions", "pressures", "outline", "shape", "refine", "springs",
        "orientation", "rotation", "joints", "place", "soft", "materials", "orthotropic", "layers",
        "damping", "model", "noise", "minimise", "constraints", "cost",
    )  # fmt: skip
    others = (
        "[[obstacle]]", "[[contact]]", "[[joint]]", "[[spring]]", "[[tie]]", "[[point_mass]]",
        "[[probe]]", "[[parameter]]", "[[control]]", "[[controller]]", "[[measure]]", "[objective]",
        "[trajectory]", "[drop]", "[solve]", "[output]",
    )  # fmt: skip
    order = (TOP, *bodies, *others, *inline)
    return next((i for i, start in enumerate(order) if heading.startswith(start)), len(order))
