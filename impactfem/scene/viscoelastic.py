"""How solids creep and relax: laws that scale their whole elasticity at small strains."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from impactfem.scene.formula import Formula
from impactfem.scene.given import Tables
from impactfem.scene.inline import InlineTable, ListOf
from impactfem.scene.kinds import Real
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.solids import Solid


@table('viscoelastic = { kind = "kelvin_voigt" }')
class KelvinVoigt:
    """A dashpot beside the elasticity: stress C : (strain + time x its rate).

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "kelvin_voigt"
    heading: ClassVar[str] = "viscoelastic"

    time: float = key(Real(above=0), "of retardation; the same as rayleigh_stiffness", unit="s")


@table("terms = [{ ... }]")
class MaxwellTerm:
    """A spring and a dashpot in a row, beside the elasticity.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "terms"

    modulus: float = key(
        Real(above=0),
        "what it adds at once to youngs_modulus, which is what is left after long",
        unit="Pa",
    )
    time: float = key(Real(above=0), "of relaxation", unit="s")


@table('viscoelastic = { kind = "maxwell" }')
class Maxwell:
    """Generalised Maxwell: youngs_modulus + the sum of modulus exp(-t / time) relaxes.

    Poisson's ratio stays: the whole elasticity is scaled.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    kind: ClassVar[str] = "maxwell"
    heading: ClassVar[str] = "viscoelastic"

    terms: Tables[MaxwellTerm] = key(
        ListOf(InlineTable((MaxwellTerm,)), at_least=1), "springs with dashpots, one each"
    )


VISCOELASTIC: Sequence[type[Any]] = (KelvinVoigt, Maxwell)


def check_viscoelastic(solid: "Solid") -> None:
    """Refuse what contradicts the law; of Kelvin and Voigt's fill `rayleigh_stiffness`.

    Raises:
        KeyedError: naming the key.
    """
    law = solid.viscoelastic
    for own in ("quality_factor", "damping_ratio"):
        if not (value := getattr(solid, own)):
            continue
        names = {
            "viscoelastic": isinstance(law, KelvinVoigt),
            "materials": solid.materials and solid.retardation,
        }  # fmt: skip
        other = next((name for name, damps in names.items() if damps), None)
        if other is not None:
            text = f" = {value} and {other} both damp the body: remove one."
            raise KeyedError(solid.kind, own, text)
    if law is None:
        return
    if isinstance(law, KelvinVoigt):
        given = solid.rayleigh_stiffness
        if given not in {0.0, law.time}:
            text = f" = {given} and viscoelastic.time = {law.time} are one thing: remove one."
            raise KeyedError(solid.kind, "rayleigh_stiffness", text)
        object.__setattr__(solid, "rayleigh_stiffness", law.time)
        return
    if isinstance(given := getattr(solid, "youngs_modulus"), Formula):  # noqa: B009  (as read)
        text = ".terms have moduli beside one youngs_modulus, and that of the body is "
        text += f"{show(given.text)}: give one number, or materials."
        raise KeyedError(solid.kind, "viscoelastic", text)
