"""What happens on the surfaces of a solid: supports, tractions and pressures."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from impactfem.scene.formula import Formula
from impactfem.scene.inline import Formulas
from impactfem.scene.kinds import Choice, FormulaOf, Line, Switch
from impactfem.scene.schema import KeyedError, check_fields, key, table

if TYPE_CHECKING:
    from collections.abc import Sequence

type FormulaLike = float | str | Formula

SUPPORTS = ("fixed", "symmetry", "motion")
SPACE = ("x", "y", "z")
SURFACE = Line(100)
_SURFACE_DOC = "name of a surface of the body"


_SPRINGS = ("stiffness", "rotational_stiffness")


def check_sprung(support: object, what: str, *, sprung: bool) -> None:
    """Refuse springs that hold nothing, or that a support does not have.

    Args:
        support: With a `stiffness` and a `rotational_stiffness`.
        what: That it holds, in words.
        sprung: Whether springs hold it.

    Raises:
        KeyedError: naming the key.
    """
    springs = {name: getattr(support, name) for name in _SPRINGS}
    if not sprung:
        for name, value in springs.items():
            if value:
                text = f' = {value:g} is for elastic {what}s: give kind = "elastic", or remove it.'
                raise KeyedError("support", name, text)
    elif not any(springs.values()):
        text = f" is 0 of an elastic {what}: give it, or rotational_stiffness, or "
        raise KeyedError("support", "stiffness", f'{text}kind = "free".')


@table("supports = [{ ... }]")
@dataclass(frozen=True, kw_only=True)
class Support:
    """How a surface is held: fixed, symmetry (no motion along its normal) or a given motion.

    Raises:
        SceneError: a value is not allowed, or a motion is missing or given in vain.
    """

    surface: str = key(SURFACE, _SURFACE_DOC)
    kind: str = key(Choice(SUPPORTS), "fixed, no motion along the normal, or moved as given")
    value: tuple[Formula | None, ...] | None = key(
        Formulas(("t",), blank=True),
        'displacement for kind = "motion"; "" leaves a direction free',
        unit="m",
        default=None,
        absent="none",
    )

    if TYPE_CHECKING:  # type checkers learn that numbers and texts may be given for formulas

        def __init__(
            self, *, surface: str, kind: str, value: Sequence[FormulaLike | None] | None = None
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, "support")
        if self.moves:
            if self.value is None:
                text = ' is missing: a motion needs formulas in t, as ["0", "0.1*sin(t)"].'
                raise KeyedError("support", "value", text)
            if all(entry is None for entry in self.value):
                text = " leaves every direction free: give at least one formula in t."
                raise KeyedError("support", "value", text)
        elif self.value is not None:
            text = f' is not allowed with kind = "{self.kind}": remove it, or use kind = "motion".'
            raise KeyedError("support", "value", text)

    @property
    def moves(self) -> bool:
        """Whether the surface moves as given."""
        return self.kind == "motion"

    @property
    def mirrors(self) -> bool:
        """Whether the surface is a plane of symmetry, on which the body may slide."""
        return self.kind == "symmetry"


@table("tractions = [{ ... }]")
@dataclass(frozen=True, kw_only=True)
class Traction:
    """A force per area of the undeformed surface, in fixed directions.

    Raises:
        SceneError: a value is not allowed.
    """

    surface: str = key(SURFACE, _SURFACE_DOC)
    value: tuple[Formula, ...] = key(
        Formulas((*SPACE, "t")), "force per area in each direction", unit="Pa"
    )

    if TYPE_CHECKING:

        def __init__(self, *, surface: str, value: Sequence[FormulaLike]) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, "traction")


@table("pressures = [{ ... }]")
@dataclass(frozen=True, kw_only=True)
class Pressure:
    """A force per area against the outward normal of a surface, undeformed or as it is by then.

    Raises:
        SceneError: a value is not allowed.
    """

    surface: str = key(SURFACE, _SURFACE_DOC)
    value: Formula = key(  # noqa: RUF009  # a field
        FormulaOf((*SPACE, "t")), "pressure, positive when it pushes inward", unit="Pa"
    )
    follows: bool | None = key(
        Switch(),
        "whether it acts on the surface as it is by then; x, y, z are of the undeformed one",
        default=None,
        absent="true under finite strain",
    )

    if TYPE_CHECKING:

        def __init__(
            self, *, surface: str, value: FormulaLike, follows: bool | None = None
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, "pressure")
