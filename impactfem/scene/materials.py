"""Materials of solids by the physical groups of their mesh files."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

from impactfem.scene.boundary import SPACE
from impactfem.scene.given import FormulaLike, Given, MaybeFormulas, MaybeTable, Tables
from impactfem.scene.inline import Formulas, InlineTable, ListOf
from impactfem.scene.kinds import Choice, Real, RealOrFormula
from impactfem.scene.ogden import OgdenTerm
from impactfem.scene.orthotropic import OrthotropicSolid
from impactfem.scene.schema import KeyedError, key, keys_of, table
from impactfem.scene.solid_constants import CONSTANTS, LAWS, NONE
from impactfem.scene.viscoelastic import VISCOELASTIC, KelvinVoigt, Maxwell

if TYPE_CHECKING:
    from impactfem.scene.solids import Solid

STRESS_AT_REST = (
    "stress in it as it is without displacement: [sxx, syy, sxy], in space [sxx, syy, szz, "
    "sxy, syz, sxz], of the place"
)
"""What `residual_stress` of a body and of one of its materials is."""

_OF_BODY = "as the body has it"


@table("materials = { NAME = { ... } }")
class Material:
    """What one group of elements is made of.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "material"

    density: Given[float | None, FormulaLike | None] = key(
        RealOrFormula(SPACE), "mass density", unit="kg/m^3", default=None, absent=_OF_BODY
    )
    youngs_modulus: Given[float | None, FormulaLike | None] = key(
        RealOrFormula(SPACE), "Young's modulus", unit="Pa", default=None, absent=_OF_BODY
    )
    poisson_ratio: Given[float | None, FormulaLike | None] = key(
        RealOrFormula(SPACE, above=-1, below=0.5), "Poisson's ratio", default=None, absent=_OF_BODY
    )
    orthotropic: MaybeTable[OrthotropicSolid] = key(
        InlineTable((OrthotropicSolid,)), "moduli along three axes", default=None, absent=_OF_BODY
    )
    material: str | None = key(Choice(LAWS), "law of the material", default=None, absent=_OF_BODY)
    c10: float | None = key(
        Real(at_least=0), "constant of Mooney's and Rivlin's law", unit="Pa", default=None,
        absent=_OF_BODY,
    )  # fmt: skip
    c01: float | None = key(
        Real(at_least=0), "constant of Mooney's and Rivlin's law", unit="Pa", default=None,
        absent=_OF_BODY,
    )  # fmt: skip
    bulk_modulus: float | None = key(
        Real(above=0), "bulk modulus at small strains, with c10 and c01 or terms", unit="Pa",
        default=None, absent=_OF_BODY,
    )  # fmt: skip
    terms: Tables[OgdenTerm] | None = key(
        ListOf(InlineTable((OgdenTerm,))), 'terms of "ogden" and "foam"', default=None,
        absent=_OF_BODY,
    )  # fmt: skip
    viscoelastic: MaybeTable[KelvinVoigt | Maxwell] = key(
        InlineTable(tuple(VISCOELASTIC)),
        "how it creeps and relaxes",
        default=None,
        absent=_OF_BODY,
    )
    residual_stress: MaybeFormulas = key(
        Formulas(SPACE, lengths=(3, 6)),
        STRESS_AT_REST,
        unit="Pa",
        default=None,
        absent=_OF_BODY,
    )


def solids_of(solid: "Solid") -> Mapping[str, "Solid"]:
    """A body as it would be of each of its materials alone, by the names of their groups.

    Raises:
        KeyedError: A material lacks a constant, or has one that is not allowed.
    """
    strain = solid.strain or ("finite" if solid.is_finite else None)
    found = {}
    for name, material in solid.materials.items():
        given = {own: getattr(material, own) for own in keys_of(Material)}
        own = {key: value for key, value in given.items() if value is not None}
        # Constants of the body that belong to another law are not meant for this one.
        law = own.get("material", solid.material)
        meant = () if material.orthotropic else CONSTANTS[law]
        if any(term.beta is not None for term in own.get("terms", ())):
            meant = ("terms",)
        left: dict[str, Any] = {name: none for name, none in NONE.items() if name not in meant}
        if material.orthotropic:
            left |= {"element": None, "material": "linear"}
        elif set(own) & {*NONE, "material"}:
            left["orthotropic"] = None
        if material.viscoelastic is not None:
            left["rayleigh_stiffness"] = 0.0  # that of the body is not meant either
        try:
            found[name] = replace(solid, materials={}, strain=strain, damping=None, **(left | own))
        except KeyedError as error:
            if error.key not in given:
                raise
            place = f"materials.{name}.{error.key}"
            raise KeyedError(solid.kind, place, error.text) from None
    return found
