"""Kinds of values with inner structure: vectors, formulas, inline tables and lists of these."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, override

import numpy as np

from impactfem.scene.formula import Formula
from impactfem.scene.kinds import FormulaOf, Kind, Real
from impactfem.scene.schema import KeyedError, keys_of
from impactfem.scene.tables import read_object
from impactfem.scene.values import (
    LEAST,
    EntryNotAllowedError,
    NotAllowedError,
    is_number,
    number,
    show,
    type_in_words,
)

MAX_ENTRIES = 10_000


@dataclass(frozen=True)
class Vector(Kind):
    """A list of numbers, stored as a tuple."""

    type_name: ClassVar[str] = "list of numbers"
    lengths: tuple[int, ...] = (2, 3)
    positive: bool = False
    nonzero: bool = False

    @property
    @override
    def allowed(self) -> str:
        bound = " > 0" * self.positive + ", not all 0" * self.nonzero
        return f"a list of {_counts(self.lengths)} numbers{bound}"

    @override
    def read(self, value: object) -> tuple[float, ...]:
        entries = entries_of(value, self.lengths)
        result = tuple(_number(index, entry) for index, entry in enumerate(entries))
        if self.positive and not all(entry > 0 for entry in result):
            raise NotAllowedError("its entries must be > 0")
        if self.nonzero and not any(result):
            raise NotAllowedError("its entries are all 0")
        sizes = [abs(entry) for entry in result]
        if (self.positive and min(sizes) < LEAST) or (self.nonzero and max(sizes) < LEAST):
            raise NotAllowedError(f"it is below {LEAST:g}, which vanishes: give SI units")
        return result

    @override
    def write(self, value: tuple[float, ...]) -> list[float]:
        return list(value)


@dataclass(frozen=True)
class NumberOrVector(Kind):
    """A number, or a list of three."""

    type_name: ClassVar[str] = "number or list of numbers"

    @property
    @override
    def allowed(self) -> str:
        return "a number in 2D, a list of 3 numbers in 3D"

    @override
    def read(self, value: object) -> float | tuple[float, ...]:
        return number(value) if is_number(value) else Vector((3,)).read(value)

    @override
    def write(self, value: float | tuple[float, ...]) -> float | list[float]:
        return list(value) if isinstance(value, tuple) else value


@dataclass(frozen=True)
class NumberOrList(Kind):
    """A number, or a list of such, stored as a tuple."""

    type_name: ClassVar[str] = "number or list of numbers"
    inner: Real
    at_most: int

    @property
    @override
    def allowed(self) -> str:
        return f"{self.inner.allowed}, or a list of 1 to {self.at_most} of such"

    @override
    def read(self, value: object) -> tuple[float, ...]:
        if is_number(value):
            return (self.inner.read(value),)
        found = ListOf(self.inner, at_least=1).read(value)
        if len(found) > self.at_most:
            raise NotAllowedError(f"it has {len(found)} entries")
        return found

    @override
    def write(self, value: tuple[float, ...]) -> float | list[float]:
        return list(value) if len(value) > 1 else value[0]


@dataclass(frozen=True)
class Formulas(Kind):
    """A list of numbers or formulas, one for each direction; None where an empty text stands."""

    type_name: ClassVar[str] = "list of formulas"
    variables: tuple[str, ...]
    blank: bool = False
    lengths: tuple[int, ...] = (2, 3)

    @property
    @override
    def allowed(self) -> str:
        free = ', "" for a free one' * self.blank
        counts = _counts(self.lengths)
        return f"a list of {counts} numbers or formulas in {', '.join(self.variables)}{free}"

    @override
    def read(self, value: object) -> tuple[Formula | None, ...]:
        entries = entries_of(value, self.lengths)
        return tuple(self._entry(index, entry) for index, entry in enumerate(entries))

    def _entry(self, index: int, value: object) -> Formula | None:
        empty = value is None or (isinstance(value, str) and not value.strip())
        if self.blank and empty:
            return None
        try:
            formula: Formula = FormulaOf(self.variables).read(value)
        except NotAllowedError as error:
            raise EntryNotAllowedError(f"[{index}]", value, str(error)) from None
        return formula

    @override
    def write(self, value: tuple[Formula | None, ...]) -> list[Any]:
        return ["" if entry is None else entry.plain for entry in value]


@dataclass(frozen=True)
class FormulaOrFormulas(Kind):
    """A number or formula, or a list of such, one for each direction."""

    type_name: ClassVar[str] = "formula or list of formulas"
    variables: tuple[str, ...]

    @property
    @override
    def allowed(self) -> str:
        return f"{FormulaOf(self.variables).allowed}, or {Formulas(self.variables).allowed}"

    @override
    def read(self, value: object) -> Formula | tuple[Formula | None, ...]:
        several = isinstance(value, Sequence) and not isinstance(value, str)
        return Formulas(self.variables).read(value) if several else self._one.read(value)

    @property
    def _one(self) -> FormulaOf:
        return FormulaOf(self.variables)

    @override
    def write(self, value: Formula | tuple[Formula | None, ...]) -> Any:
        return Formulas(self.variables).write(value) if isinstance(value, tuple) else value.plain


@dataclass(frozen=True)
class InlineTable(Kind):
    """A table in one line; several classes are told apart by their key ``kind``."""

    type_name: ClassVar[str] = "table"
    classes: tuple[type[Any], ...]

    @property
    def _kinds(self) -> Mapping[str, type[Any]]:
        return {cls.kind: cls for cls in self.classes} if len(self.classes) > 1 else {}

    @property
    @override
    def allowed(self) -> str:
        if self._kinds:
            return f"a table {{ kind = {' or '.join(show(kind) for kind in self._kinds)}, ... }}"
        names = ", ".join(entry.name for entry in keys_of(self.classes[0]).values())
        return f"a table {{ ... }} with the keys {names}"

    @override
    def read(self, value: object) -> Any:
        if isinstance(value, self.classes):
            return value
        if not isinstance(value, Mapping):
            raise NotAllowedError(f"it is {type_in_words(value)}, not a table")
        return read_object(value, "", self._kinds or self.classes[0])

    @override
    def write(self, value: Any) -> dict[str, Any]:
        kind = {"kind": value.kind} if self._kinds else {}
        return kind | plain(value)


class Named(dict[str, Any]):
    """Tables by name, which nothing changes once they are read."""

    def __hash__(self) -> int:  # type: ignore[override]  # dictionaries have none
        return hash(frozenset(self.items()))


class ByName(Kind, ABC):
    """Entries under names that a file gives, which only its reader knows."""

    @override
    def read(self, value: object) -> Mapping[str, Any]:
        if not isinstance(value, Mapping):
            if not value and isinstance(value, list | tuple):
                return Named()
            raise NotAllowedError(f"it is {type_in_words(value)}, not a table")
        found = Named()
        for name, entry in self._named(value):
            try:
                found[name] = self._entry(entry)
            except KeyedError as error:
                raise error.under(name) from None
            except NotAllowedError as error:
                raise EntryNotAllowedError(f".{name}", entry, str(error)) from None
        return found

    def _named(self, value: Mapping[Any, object]) -> list[tuple[str, object]]:
        return [(str(name), entry) for name, entry in value.items()]

    @abstractmethod
    def _entry(self, entry: object) -> Any:
        """Read what a name stands for."""


@dataclass(frozen=True)
class TablesByName(ByName):
    """Tables of one class by name."""

    type_name: ClassVar[str] = "table of tables"
    cls: type[Any]

    @property
    @override
    def allowed(self) -> str:
        names = ", ".join(entry.name for entry in keys_of(self.cls).values())
        return f"a table {{ NAME = {{ ... }} }} with the keys {names} for each name"

    @override
    def _entry(self, entry: object) -> Any:
        return InlineTable((self.cls,)).read(entry)

    @override
    def write(self, value: Mapping[str, Any]) -> dict[str, Any]:
        return {name: plain(entry) for name, entry in value.items()}


@dataclass(frozen=True)
class ListOf(Kind):
    """A list of values of one kind, stored as a tuple."""

    inner: Kind
    at_least: int = 0
    different: bool = False

    @property
    def type_name(self) -> str:  # type: ignore[override]  # follows from the inner kind
        """Word for the scene reference."""
        return f"list of {self.inner.type_name}s"

    @property
    @override
    def allowed(self) -> str:
        least = f" of at least {self.at_least}" * (self.at_least > 0)
        return f"a list{least}, each {self.inner.allowed}"

    @override
    def read(self, value: object) -> tuple[Any, ...]:
        found: list[Any] = []
        for index, entry in enumerate(entries_of(value)):
            try:
                found.append(self.inner.read(entry))
            except KeyedError as error:
                raise error.under(f"[{index}]") from None
            except EntryNotAllowedError as error:
                raise error.inside(index) from None
            except NotAllowedError as error:
                raise EntryNotAllowedError(f"[{index}]", entry, str(error)) from None
            if self.different and found[-1] in found[:-1]:
                raise NotAllowedError(f"{show(entry)} is given twice, remove one")
        if len(found) < self.at_least:
            raise NotAllowedError(f"it has {len(found)} entries")
        return tuple(found)

    @override
    def write(self, value: tuple[Any, ...]) -> list[Any]:
        return [self.inner.write(entry) for entry in value]


def entries_of(value: object, lengths: tuple[int, ...] = ()) -> list[Any]:
    """Return the entries of a list, of one of the lengths if any are given.

    Raises:
        NotAllowedError: it is no list, or has another length.
    """
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, list | tuple):
        raise NotAllowedError(f"it is {type_in_words(value)}, not a list")
    if lengths and len(value) not in lengths:
        raise NotAllowedError(f"it has {len(value)} entries, not {_counts(lengths)}")
    if len(value) > MAX_ENTRIES:
        raise NotAllowedError(f"it has {len(value)} entries, more than {MAX_ENTRIES}")
    return list(value)


def _counts(lengths: tuple[int, ...]) -> str:
    return " or ".join(str(length) for length in lengths)


def _number(index: int, value: object) -> float:
    try:
        return number(value)
    except NotAllowedError as error:
        raise EntryNotAllowedError(f"[{index}]", value, str(error)) from None


def plain(instance: Any) -> dict[str, Any]:  # any dataclass with keys
    """Return the keys and values of an instance as a scene file holds them."""
    values = {
        entry.name: (entry.kind, getattr(instance, name))
        for name, entry in keys_of(type(instance)).items()
        if name not in getattr(instance, "derived", ())
    }
    return {name: kind.write(value) for name, (kind, value) in values.items() if value is not None}
