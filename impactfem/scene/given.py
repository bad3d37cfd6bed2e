"""What the keys of a table may be given as, where they are stored as another type."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self, overload

from impactfem.scene.formula import Formula


class Given[Stored, Taken]:
    """A key that is read as one type, and may be given as another, for type checkers.

    They take it for a descriptor, whose setter tells what a table is made from. When the program
    runs it is an annotation only, and `impactfem.scene.schema.key` makes a plain field.
    """

    if TYPE_CHECKING:

        @overload
        def __get__(self, instance: None, owner: object) -> Self: ...
        @overload
        def __get__(self, instance: object, owner: object) -> Stored: ...
        def __get__(self, instance: object, owner: object) -> Any: ...
        def __set__(self, instance: object, value: Stored | Taken) -> None: ...


type FormulaLike = float | str | Formula
type AFormula = Given[Formula, FormulaLike]
type MaybeFormula = Given[Formula | None, FormulaLike | None]
type FormulaOrSome = Given[
    Formula | tuple[Formula, ...] | None, FormulaLike | Sequence[FormulaLike] | None
]
type SomeFormulas = Given[tuple[Formula, ...], Sequence[FormulaLike]]
type MaybeFormulas = Given[tuple[Formula, ...] | None, Sequence[FormulaLike] | None]
type Tables[T] = Given[tuple[T, ...], Sequence[T | Mapping[str, Any]]]
type MaybeTable[T] = Given[T | None, T | Mapping[str, Any] | None]
