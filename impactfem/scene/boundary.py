"""What happens on the surfaces of a solid: supports, tractions and pressures."""

from collections.abc import Sequence
from typing import Any, ClassVar

from impactfem.scene.formula import Formula
from impactfem.scene.given import AFormula, FormulaLike, Given, SomeFormulas
from impactfem.scene.inline import Formulas
from impactfem.scene.kinds import Choice, FormulaOf, Line, Real, Switch
from impactfem.scene.schema import KeyedError, key, table

SUPPORTS = ("fixed", "symmetry", "motion")
SPACE = ("x", "y", "z")
SURFACE = Line(100)
_SURFACE_DOC = "name of a surface of the body"


def until_key(what: str) -> Any:
    """The key of the time at which something ends."""
    return key(
        Real(at_least=0),
        f'when {what}; 0 with start = "static": it is part of the equilibrium alone',
        unit="s", default=None, absent="for ever",
    )  # fmt: skip


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
class Support:
    """How a surface is held: fixed, symmetry (no motion along its normal) or a given motion.

    Raises:
        SceneError: a value is not allowed, or a motion is missing or given in vain.
    """

    heading: ClassVar[str] = "support"

    surface: str = key(SURFACE, _SURFACE_DOC)
    kind: str = key(Choice(SUPPORTS), "fixed, no motion along the normal, or moved as given")
    value: Given[tuple[Formula | None, ...] | None, Sequence[FormulaLike | None] | None] = key(
        Formulas(("t",), blank=True),
        'displacement for kind = "motion"; "" leaves a direction free',
        unit="m",
        default=None,
        absent="none",
    )
    until: float | None = until_key("it lets go")

    def _check(self) -> None:
        if self.mirrors and self.until is not None:
            text = f" = {self.until:g} ends a plane of symmetry, which bodies cannot leave: remove "
            raise KeyedError("support", "until", text + 'it, or give kind = "motion".')
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


def supports_of(body: Any) -> tuple[Support, ...]:
    """Those of a body that may let go."""
    return tuple(s for s in getattr(body, "supports", ()) if isinstance(s, Support))


@table("tractions = [{ ... }]")
class Traction:
    """A force per area of the undeformed surface, in fixed directions.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "traction"

    surface: str = key(SURFACE, _SURFACE_DOC)
    value: SomeFormulas = key(
        Formulas((*SPACE, "t")), "force per area in each direction", unit="Pa"
    )
    until: float | None = until_key("it ends")

    @property
    def acting(self) -> tuple[Formula, ...]:
        """Its value up to its end, and 0 after it [Pa]."""
        return tuple(each.until(self.until) for each in self.value)


@table("pressures = [{ ... }]")
class Pressure:
    """A force per area against the outward normal of a surface, undeformed or as it is by then.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "pressure"

    surface: str = key(SURFACE, _SURFACE_DOC)
    value: AFormula = key(
        FormulaOf((*SPACE, "t")), "pressure, positive when it pushes inward", unit="Pa"
    )
    follows: bool | None = key(
        Switch(),
        "whether it acts on the surface as it is by then; x, y, z are of the undeformed one",
        default=None,
        absent="true under finite strain",
    )
    until: float | None = until_key("it ends")

    @property
    def acting(self) -> Formula:
        """Its value up to its end, and 0 after it [Pa]."""
        return self.value.until(self.until)
