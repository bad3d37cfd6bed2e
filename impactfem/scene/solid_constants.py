"""Constants of the laws of solids: which must be given, and what follows from them."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from impactfem.scene.formula import Formula
from impactfem.scene.ogden import small_strains
from impactfem.scene.schema import REQUIRED, KeyedError, keys_of
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.orthotropic import OrthotropicSolid
    from impactfem.scene.solids import Solid

CONSTANTS: Mapping[str, tuple[str, ...]] = {
    "linear": ("youngs_modulus", "poisson_ratio"),
    "neo_hookean": ("youngs_modulus", "poisson_ratio"),
    "mooney_rivlin": ("c10", "c01", "bulk_modulus"),
    "ogden": ("terms", "bulk_modulus"),
    "foam": ("terms", "poisson_ratio"),
}
"""What each law takes beside the density."""
LAWS = tuple(CONSTANTS)
NONE: Mapping[str, Any] = dict.fromkeys(
    ("youngs_modulus", "poisson_ratio", "c10", "c01", "bulk_modulus"), None
) | {"terms": ()}
"""All of them, and what stands for one that is not given."""
_ELASTIC = CONSTANTS["linear"]
_ALIKE = 1e-9  # of constants that are given twice
_STIFF = 0.45  # Poisson's ratio beyond which a foam is none


def check_constants(solid: "Solid") -> dict[str, float]:
    """Refuse missing and contradicting constants; returns Young's modulus and Poisson's ratio.

    Raises:
        KeyedError: naming the key.
    """
    if solid.orthotropic is not None:
        return _orthotropic(solid, solid.orthotropic)
    wanted = CONSTANTS[solid.material]
    for name, none in NONE.items():
        value = getattr(solid, name)
        if name in wanted or name in _ELASTIC or value == none:
            continue
        laws = " or ".join(f'"{law}"' for law, own in CONSTANTS.items() if name in own)
        shown = " = [...]" if name == "terms" else f" = {value}"
        raise KeyedError(solid.kind, name, f"{shown} belongs to material = {laws}: remove it.")
    if solid.material == "foam" and all(term.beta is not None for term in solid.terms):
        wanted = ("terms",)
    for name in ("density", *wanted):
        value = getattr(solid, name)
        if value is None:
            keys_of(type(solid))[name].read(REQUIRED, solid.kind)
        if name == "terms" and not value:
            text = f' is missing: material = "{solid.material}" needs it; give [{{ mu = ..., alpha '
            raise KeyedError(solid.kind, name, text + "= ... }].")
    if solid.material in {"ogden", "foam"}:
        return _ogden(solid)
    return _mooney(solid) if solid.material == "mooney_rivlin" else {}


def derived_constants(solid: "Solid") -> tuple[str, ...]:
    """Keys of a body of one material that follow from others."""
    if solid.orthotropic is not None:
        return _ELASTIC
    return tuple(
        name for name in _ELASTIC
        if name not in CONSTANTS[solid.material] or any(t.beta is not None for t in solid.terms)
    )  # fmt: skip


def terms_of(solid: "Solid") -> tuple[tuple[float, float, float], ...]:
    """Terms of Ogden's law: mu [Pa], alpha and beta of each."""
    nu = solid.poisson_ratio
    same = nu / (1.0 - 2.0 * nu) if solid.material == "foam" else 0.0
    return tuple((t.mu, t.alpha, same if t.beta is None else t.beta) for t in solid.terms)


def _ogden(solid: "Solid") -> dict[str, float]:
    """Young's modulus and Poisson's ratio of Ogden's law, and of that for foams.

    Raises:
        KeyedError: They make no material that resists shear and pressure.
    """
    betas = {term.beta is None for term in solid.terms}
    if solid.material == "ogden" and betas != {True}:
        text = '.beta belongs to material = "foam": remove it.'
        raise KeyedError(solid.kind, "terms", text)
    if len(betas) > 1:
        raise KeyedError(solid.kind, "terms", ".beta: give it to all terms, or to none.")
    given: object = solid.poisson_ratio
    if isinstance(given, Formula):
        text = f" = {show(given.text)} beside terms: give one number."
        raise KeyedError(solid.kind, "poisson_ratio", text)
    shear = sum(term.mu for term in solid.terms)
    if not shear > 0.0:
        text = f".mu make a shear modulus of {shear:.6g}, their sum, which must be > 0."
        raise KeyedError(solid.kind, "terms", text)
    bulk = solid.bulk_modulus
    if solid.material == "ogden" and not float(bulk or 0.0) > 2.0 / 3.0 * shear:
        text = f" = {bulk} must exceed 2/3 of the shear modulus, the sum of mu, {shear:.6g}: give "
        raise KeyedError(solid.kind, "bulk_modulus", text + 'more, or material = "foam".')
    if solid.material == "foam" and solid.terms[0].beta is None:
        # Poisson's ratio is given, and makes beta.
        modulus, ratio = 2.0 * shear * (1.0 + solid.poisson_ratio), solid.poisson_ratio
    else:
        each = [(term.mu, term.alpha, term.beta or 0.0) for term in solid.terms]
        modulus, ratio = small_strains(each, bulk)
    if solid.material == "foam" and not -1.0 < ratio <= _STIFF:
        text = f" make a Poisson's ratio of {ratio:.4g}, and a foam has at most {_STIFF}: give "
        text += 'smaller beta or poisson_ratio, or material = "ogden".'
        raise KeyedError(solid.kind, "terms", text)
    return _as_given(solid, {"youngs_modulus": modulus, "poisson_ratio": ratio}, "terms")


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
    for name in (*NONE, "element"):
        given = getattr(solid, name)
        if given not in {None, (), found.get(name), "standard"}:
            shown = show(given.text if isinstance(given, Formula) else given)
            raise KeyedError(
                solid.kind, name, f" = {shown} does not go with orthotropic: remove one of them."
            )
    return found


def _mooney(solid: "Solid") -> dict[str, float]:
    """Young's modulus and Poisson's ratio by Mooney's and Rivlin's constants.

    Raises:
        KeyedError: They make no material that resists shear and pressure.
    """
    c10, c01, bulk = (float(getattr(solid, name)) for name in CONSTANTS["mooney_rivlin"])
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
    return _as_given(solid, found, "c10, c01 and bulk_modulus")


def _as_given(solid: "Solid", found: dict[str, float], by: str) -> dict[str, float]:
    """Constants that follow from others.

    Raises:
        KeyedError: They are given otherwise.
    """
    for name, value in found.items():
        given = getattr(solid, name)
        if isinstance(given, Formula):
            text = f" = {show(given.text)} contradicts {by}: remove it."
            raise KeyedError(solid.kind, name, text)
        if given is not None and abs(given - value) > _ALIKE * abs(value):
            text = f" = {given} contradicts {by}, which make it {value:.6g}: "
            raise KeyedError(solid.kind, name, text + "remove it.")
    return found
