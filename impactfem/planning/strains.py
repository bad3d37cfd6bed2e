"""Small or finite strain: what bodies take that do not say, by what the plan foresees of them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from impactfem.errors import SceneError
from impactfem.findings import Finding
from impactfem.planning.model_limits import CODES
from impactfem.scene import Scene, Solid

_MOST = 0.4  # foreseen strain beyond which steps may not settle: that needs a choice of meshes
_LAW = "neo_hookean"
"""What bodies take that have no other law: at small strains it is the linear one, and under finite
strain that one (St. Venant, Kirchhoff) grows weaker as it is pressed, until no step settles."""


def with_strains(scene: Scene, finite: Iterable[str]) -> Scene:
    """The scene with finite strain of some bodies, by name, that leave it to the plan.

    Raises:
        SceneError: Finite strain cannot do this scene.
    """
    names = set(finite)
    solids = {
        solid.name: replace(solid, strain="finite", material=_law(solid))
        for solid in scene.solids
        if solid.name in names and not solid.is_finite
    }
    if not solids:
        return scene
    return replace(scene, bodies=tuple(solids.get(body.name, body) for body in scene.bodies))


def _law(solid: Solid) -> str:
    """The law of a body under finite strain: orthotropic ones are linear."""
    return solid.material if solid.orthotropic else _LAW


def finite_instead(
    scene: Scene, findings: Sequence[Finding]
) -> tuple[Scene, tuple[Finding, ...]] | None:
    """The scene with finite strain where small ones would not be trusted, and what says that.

    Args:
        scene: The scene.
        findings: What its plan foresees with small strains.

    Returns:
        None where none asks for it, says otherwise, or where finite strain cannot do the scene.
    """
    free = {solid.name for solid in scene.solids if solid.strain is None and not solid.is_finite}
    beyond = tuple(
        found
        for found in findings
        if found.severity == "fault" and found.code in CODES and found.subject in free
    )
    strains = (found.value or 0.0 for found in beyond if found.code == "model_strain")
    if not beyond or max(strains, default=0.0) > _MOST:
        return None
    try:
        return with_strains(scene, {found.subject for found in beyond}), beyond
    except SceneError:
        return None


def told(beyond: Sequence[Finding], small: float | None, finite: float | None) -> dict[str, str]:
    """Why bodies take finite strain and what that costs, for the reasons of a plan.

    Args:
        beyond: As `finite_instead` gave it.
        small: Time with small strains [s], if it is known.
        finite: Time with finite ones [s].
    """
    price = (
        "" if small is None or finite is None else f" in about {small:.2g} s, not {finite:.2g} s"
    )
    return {
        f"strain of {found.subject}": f"finite: {found.text.split(':')[0]}, where "
        f'small strains end; strain = "small" keeps these{price}'
        for found in beyond
    }
