"""Constants of the laws of solids: which must be given, and what follows from them."""

from typing import TYPE_CHECKING

from impactfem.scene.formula import Formula
from impactfem.scene.schema import REQUIRED, KeyedError, keys_of
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.orthotropic import OrthotropicSolid
    from impactfem.scene.solids import Solid

_ELASTIC = ("youngs_modulus", "poisson_ratio")
_MOONEY = ("c10", "c01", "bulk_modulus")
_ALIKE = 1e-9  # of constants that are given twice


def check_constants(solid: "Solid") -> dict[str, float]:
    """Refuse missing and contradicting constants; returns Young's modulus and Poisson's ratio.

    Raises:
        KeyedError: naming the key.
    """
    mooney = solid.material == "mooney_rivlin"
    wanted, other = (_MOONEY, ()) if mooney else (_ELASTIC, _MOONEY)
    if solid.orthotropic is not None:
        return _orthotropic(solid, solid.orthotropic)
    wanted = ("density", *wanted)
    for name in other:
        if getattr(solid, name) is not None:
            text = f' = {getattr(solid, name)} belongs to material = "mooney_rivlin": remove it.'
            raise KeyedError(solid.kind, name, text)
    for name in wanted:
        if getattr(solid, name) is None:
            keys_of(type(solid))[name].read(REQUIRED, solid.kind)
    if not mooney:
        return {}
    return _small_strains(solid)


def _orthotropic(solid: "Solid", law: "OrthotropicSolid") -> dict[str, float]:
    """The mean of an orthotropic material, by which steps and blows are foreseen.

    Raises:
        KeyedError: Other constants are given too, or some are missing.
    """
    if solid.material != "linear":
        text = f" = {show(solid.material)} is alike in all directions, but orthotropic is given: "
        raise KeyedError(solid.kind, "material", text + "remove one of them.")
    try:
        law.check_model(solid.model)
    except KeyedError as error:
        raise error.moved("").under("orthotropic", solid.kind) from None
    if getattr(solid, "density") is None:  # noqa: B009  (once read it is there)
        keys_of(type(solid))["density"].read(REQUIRED, solid.kind)
    found = dict(zip(_ELASTIC, law.mean, strict=True))
    for name in (*_ELASTIC, *_MOONEY, "element"):
        given = getattr(solid, name)
        if given not in {None, found.get(name), "standard"}:
            shown = show(given.text if isinstance(given, Formula) else given)
            raise KeyedError(
                solid.kind, name, f" = {shown} does not go with orthotropic: remove one of them."
            )
    return found


def _small_strains(solid: "Solid") -> dict[str, float]:
    """Young's modulus and Poisson's ratio by Mooney's and Rivlin's constants.

    Raises:
        KeyedError: They make no material that resists shear and pressure.
    """
    c10, c01, bulk = (float(getattr(solid, name)) for name in _MOONEY)
    shear = 2.0 * (c10 + c01)
    if not shear > 0.0:
        text = f" = {c10} and c01 = {c01} leave no shear modulus 2 (c10 + c01): give more."
        raise KeyedError(solid.kind, "c10", text)
    least = (4.0 * c10 + 16.0 * c01) / 3.0
    if not bulk > least:
        text = f" = {bulk} must exceed (4 c10 + 16 c01) / 3 = {least:.6g}, or volumes lose their "
        raise KeyedError(solid.kind, "bulk_modulus", text + "resistance: give more.")
    found = {
        "youngs_modulus": 9.0 * bulk * shear / (3.0 * bulk + shear),
        "poisson_ratio": (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear)),
    }
    for name, value in found.items():
        given = getattr(solid, name)
        if isinstance(given, Formula):
            text = f" = {show(given.text)} contradicts c10, c01 and bulk_modulus: remove it."
            raise KeyedError(solid.kind, name, text)
        if given is not None and abs(given - value) > _ALIKE * abs(value):
            text = f" = {given} contradicts c10, c01 and bulk_modulus, which make it {value:.6g}: "
            raise KeyedError(solid.kind, name, text + "remove it.")
    return found
