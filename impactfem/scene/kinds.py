"""Kinds of values in a scene: what is allowed, how it is stored, and how it is written back."""

import os
import re
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any, ClassVar, override

import numpy as np

from impactfem.errors import MeshError, plain
from impactfem.reading.live import LiveMesh, is_live
from impactfem.scene.formula import Formula
from impactfem.scene.grammar import FormulaError, naming
from impactfem.scene.nearest import nearest
from impactfem.scene.values import LEAST, NotAllowedError, number, show, type_in_words


class Kind(ABC):
    """A kind of value: `read` checks and converts, `write` gives what a scene file holds."""

    type_name: ClassVar[str]

    @property
    @abstractmethod
    def allowed(self) -> str:
        """What is allowed, in words that follow "give"."""

    @abstractmethod
    def read(self, value: object) -> Any:  # each kind stores another type
        """Return the value as stored.

        Raises:
            NotAllowedError: saying why not.
        """

    def write(self, value: Any) -> Any:  # each kind stores another type
        """Return a stored value as plain numbers, texts and lists."""
        return value

    def write_default(self, default: object) -> str:
        """Return a default as the scene reference shows it."""
        return show(self.write(self.read(default)))


@dataclass(frozen=True)
class Real(Kind):
    """A finite number within bounds."""

    type_name: ClassVar[str] = "number"
    above: float | None = None
    at_least: float | None = None
    below: float | None = None

    @property
    @override
    def allowed(self) -> str:
        bounds = (("> ", self.above), (">= ", self.at_least), ("< ", self.below))
        words = " and ".join(f"{sign}{bound:g}" for sign, bound in bounds if bound is not None)
        return f"a number {words}".strip()

    @override
    def read(self, value: object) -> float:
        result = number(value)
        if self.above is not None and not result > self.above:
            raise NotAllowedError(f"it must be > {self.above:g}")
        if self.above == 0.0 and result < LEAST:
            raise NotAllowedError(f"it is below {LEAST:g}, which vanishes: give SI units")
        if self.at_least is not None and not result >= self.at_least:
            raise NotAllowedError(f"it must be >= {self.at_least:g}")
        if self.below is not None and not result < self.below:
            raise NotAllowedError(f"it must be < {self.below:g}")
        return result


@dataclass(frozen=True)
class Integer(Kind):
    """A whole number within bounds."""

    type_name: ClassVar[str] = "integer"
    at_least: int
    at_most: int

    @property
    @override
    def allowed(self) -> str:
        return f"an integer from {self.at_least} to {self.at_most}"

    @override
    def read(self, value: object) -> int:
        real = number(value)
        if not isinstance(value, int | np.integer):
            whole = real.is_integer() and abs(real) < 1e15
            hint = f", write {int(real)}" if whole else ""
            raise NotAllowedError(f"it is not an integer{hint}")
        result = int(value)
        if result < self.at_least:
            raise NotAllowedError(f"it must be >= {self.at_least}")
        if result > self.at_most:
            raise NotAllowedError(f"it must be <= {self.at_most}")
        return result


@dataclass(frozen=True)
class Line(Kind):
    """A text of one line."""

    type_name: ClassVar[str] = "text"
    max_length: int = 200

    @property
    @override
    def allowed(self) -> str:
        return f"a text of 1 to {self.max_length} characters in one line"

    @override
    def read(self, value: object) -> str:
        text = _text(value)
        if not text.strip():
            raise NotAllowedError("it is empty")
        if len(text) > self.max_length:
            raise NotAllowedError(f"it has {len(text)} characters")
        for character in text:
            # Controls, lone surrogates (not writable as UTF-8) and line separators, and what turns
            # the direction of writing: a text could then read as another one.
            if (
                unicodedata.category(character) in {"Cc", "Cs", "Zl", "Zp"}
                or plain(character) != character
            ):
                raise NotAllowedError(f"it holds the control character U+{ord(character):04X}")
        return text


@dataclass(frozen=True)
class FolderPath(Line):
    """The path of a folder."""

    max_length: int = 1000

    @property
    @override
    def allowed(self) -> str:
        return "the path of a folder, absolute or relative to the scene file"

    @override
    def read(self, value: object) -> str:
        return super().read(str(value) if isinstance(value, PurePath) else value)


@dataclass(frozen=True)
class FilePath(FolderPath):
    """The path of a file with one of several endings."""

    endings: tuple[str, ...] = ()

    @property
    @override
    def allowed(self) -> str:
        return f"the path of a {self._endings} file, absolute or relative to the scene file"

    @override
    def read(self, value: object) -> str:
        if ".msh" in self.endings and (isinstance(value, LiveMesh) or is_live(value)):
            try:
                value = os.fspath(value if isinstance(value, LiveMesh) else LiveMesh(value))
            except (MeshError, OSError) as error:
                raise NotAllowedError(f"of this mesh of DOLFINx: {error}") from None
        path = super().read(value)
        if not path.lower().endswith(self.endings):
            raise NotAllowedError(f"its name does not end in {self._endings}")
        return path

    @property
    def _endings(self) -> str:
        *first, last = self.endings
        return f"{', '.join(first)} or {last}"


@dataclass(frozen=True)
class Switch(Kind):
    """true or false."""

    type_name: ClassVar[str] = "boolean"

    @property
    @override
    def allowed(self) -> str:
        return "true or false"

    @override
    def read(self, value: object) -> bool:
        if not isinstance(value, bool):
            raise NotAllowedError("it is not true or false")
        return value


@dataclass(frozen=True)
class Name(Kind):
    """A name that can stand in column names and file names."""

    type_name: ClassVar[str] = "text"

    @property
    @override
    def allowed(self) -> str:
        return "a name of at most 40 letters, digits, _ and - that starts with a letter"

    @override
    def read(self, value: object) -> str:
        text = _text(value)
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,39}", text):
            raise NotAllowedError("it is not a name")
        return text


SIDE = (
    r"[A-Za-z][A-Za-z0-9_-]{0,39}(/[^/\s]{1,80})?"
    r"|(?=.{1,40}$)[A-Za-z0-9_-]*[*?][A-Za-z0-9_*?-]*"
)
"""What names a side of a contact, as a regular expression."""


@dataclass(frozen=True)
class SideName(Kind):
    """A name, a pattern of names, or names of a body and one of its surfaces with a slash."""

    type_name: ClassVar[str] = "text"

    @property
    @override
    def allowed(self) -> str:
        return "a name, a pattern of names with * or ?, or body/surface"

    @override
    def read(self, value: object) -> str:
        text = _text(value)
        if not re.fullmatch(SIDE, text):
            raise NotAllowedError("it is neither a name nor body/surface")
        return text


@dataclass(frozen=True)
class Choice(Kind):
    """One of several words."""

    type_name: ClassVar[str] = "text"
    words: Collection[str]

    @property
    @override
    def allowed(self) -> str:
        return " or ".join(show(word) for word in self.words)

    @override
    def read(self, value: object) -> str:
        return one_of(value, self.words)


@dataclass(frozen=True)
class Choices(Kind):
    """A list of different words out of several."""

    type_name: ClassVar[str] = "list of texts"
    words: tuple[str, ...]

    @property
    @override
    def allowed(self) -> str:
        return f"a list of {', '.join(show(word) for word in self.words)}, or [] for none"

    @override
    def read(self, value: object) -> tuple[str, ...]:
        if isinstance(value, str):
            raise NotAllowedError(f"it is a text, write a list [{show(value)}]")
        if not isinstance(value, list | tuple):
            raise NotAllowedError(f"it is {type_in_words(value)}, not a list")
        result: list[str] = []
        for entry in value:
            word = one_of(entry, self.words)
            if word in result:
                raise NotAllowedError(f"{show(word)} is given twice, remove one")
            result.append(word)
        return tuple(result)

    @override
    def write(self, value: tuple[str, ...]) -> list[str]:
        return list(value)


@dataclass(frozen=True)
class FormulaOf(Kind):
    """A number or a formula of some variables."""

    type_name: ClassVar[str] = "number or formula"
    variables: tuple[str, ...]

    @property
    @override
    def allowed(self) -> str:
        return f"a number or a formula in {', '.join(self.variables)}"

    @override
    def read(self, value: object) -> Formula:
        if isinstance(value, Formula):
            if value.variables == self.variables:
                return value
            with naming(dict(value.named)):  # it keeps what it uses by name
                try:
                    return value.of(self.variables)
                except FormulaError as error:
                    raise NotAllowedError(error.why) from None
        return self._read(value)

    def _read(self, value: object) -> Formula:
        if isinstance(value, Mapping):
            from impactfem.scene.measured import measured  # noqa: PLC0415  (rare)

            return measured(value, self.variables)
        text = value if isinstance(value, str) else repr(number(value))
        try:
            return Formula(text, self.variables)
        except FormulaError as error:
            raise NotAllowedError(error.why) from None

    @override
    def write(self, value: Formula) -> Any:
        return value.plain


@dataclass(frozen=True)
class RealOrFormula(FormulaOf):
    """A number in bounds, or a formula of some variables, which stays one."""

    above: float = 0.0
    below: float | None = None

    @property
    @override
    def allowed(self) -> str:
        own = Real(above=self.above, below=self.below).allowed
        return f"{own}, or a formula in {', '.join(self.variables)}"

    @override
    def read(self, value: object) -> float | Formula:  # type: ignore[override]  # wider
        if isinstance(value, str | Formula | Mapping):
            return super().read(value)
        return Real(above=self.above, below=self.below).read(value)

    @override
    def write(self, value: float | Formula) -> Any:
        return value.plain if isinstance(value, Formula) else value


def one_of(value: object, words: Collection[str]) -> str:
    """Return a text that is one of several words.

    Raises:
        NotAllowedError: naming the nearest word, if one is near.
    """
    text = _text(value)
    if text not in words:
        near = nearest(text, words)
        meant = f", did you mean {show(near)}?" if near else ""
        raise NotAllowedError(f"{show(text)} is not known{meant}")
    return text


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise NotAllowedError(f"it is {type_in_words(value)}, write a text in quotes")
    return str(value)
