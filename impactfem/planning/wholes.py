"""Of which part of a symmetric whole a scene is: then results are those of the whole."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from impactfem.findings import Finding, warning
from impactfem.result.whole import Whole
from impactfem.scene import Scene
from impactfem.scene.obstacles import Rigid
from impactfem.scene.obstacles.mirror import Mirror
from impactfem.scene.ties import TieRows

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart

_AXES = "xyz"
_SAME = 1e-9  # of the size of the body, for places of planes


def find_whole(
    scene: Scene, parts: Sequence["SolidPart"], others: Sequence[str], reasons: dict[str, str]
) -> tuple[Whole, list[Finding]]:
    """Find the planes of symmetry that cut every body of a scene.

    A cut of a shape is one as the scene says. A support of kind "symmetry" is one where it says
    so of a half: all nodes lie on one side of the only such plane across its axis (two of them are
    guides, as of a wave guide), gravity and obstacles are symmetric about it, and the scene says of
    how much it is that joints, springs and masses hold: there are none on it.

    Args:
        scene: The scene.
        parts: Its solids.
        others: Names of bodies without meshes, which no plane cuts.
        reasons: Gets what was decided.

    Returns:
        What the solids are parts of, and what is to be told of it.
    """
    each = [_planes(scene, part, reasons) for part in parts]
    if others and any(each):
        cut = next(part.solid.name for part, planes in zip(parts, each, strict=True) if planes)
        text = f"{cut} is part of a symmetric whole, but {others[0]} is not cut: it meets this "
        text += "part alone, and forces, energies and masses are those of what is computed"
        remedy = f"model all of {cut}, or give {others[0]} the mass that belongs to its part"
        return Whole(), [warning("setting", text, cut, remedy=remedy)]
    size = max(part.system.nodes.size for part in parts)
    common = {
        axis: level
        for axis, level in sorted(each[0].items())
        if all(abs(planes.get(axis, float("inf")) - level) <= _SAME * size for planes in each)
    }
    whole = Whole(tuple((_AXES[axis], level) for axis, level in common.items()))
    if common:
        where = " and ".join(f"{axis} = {level:g} m" for axis, level in whole.planes)
        reasons["symmetry"] = (
            f"cut at {where}: forces, impulses, energies and masses are those of the whole, "
            f"{whole.factor} times what is computed"
        )
        mirrors = (Mirror(axis, level, size) for axis, level in common.items())
        if not all(_is_symmetric(scene, mirror) for mirror in mirrors):
            reasons["symmetry"] += "; gravity and obstacles have mirror images there, too"
    elif any(each):
        reasons["symmetry"] = (
            "not all bodies are cut by the same planes: forces, energies and masses are those of "
            "the parts that are computed"
        )
    return whole, []


def _planes(scene: Scene, part: "SolidPart", reasons: dict[str, str]) -> dict[int, float]:
    """Coordinate [m] of the planes that cut a body, by the number of the axis across."""
    found = {axis: level + 0.0 for axis, level in part.solid.cuts}
    if _is_held(scene, part.solid.name):
        if any(axis not in found for axis, _ in part.system.supports.planes):
            reasons["symmetry supports"] = (
                f"guides, since joints, springs or masses hold {part.solid.name}: nothing says of "
                "how much of a whole; shape.symmetry does"
            )
        return found
    for axis, level in part.system.supports.planes:
        mirror = Mirror(axis, level, part.system.nodes.size)
        if axis not in found and _is_symmetric(scene, mirror):
            found[axis] = level + 0.0
    return found


def _is_held(scene: Scene, body: str) -> bool:
    """Whether joints, springs or masses hold it, and do not say of how much of them it is."""
    return any(body in joint.bodies and not isinstance(joint, TieRows) for joint in scene.couplings)


def _is_symmetric(scene: Scene, mirror: Mirror) -> bool:
    """Whether gravity and obstacles are their own mirror images."""
    pulled = any(value[mirror.axis] != 0.0 for value in scene.vector_gravity.values)
    obstacles = scene.rigid_obstacles
    return not pulled and all(any(_images(o, p, mirror) for p in obstacles) for o in obstacles)


def _images(one: Rigid, other: Rigid, mirror: Mirror) -> bool:
    if one.rotation or other.rotation:
        return False
    if one.motion is not None or other.motion is not None:
        across = None if one.motion is None else one.motion[mirror.axis]
        stays = across is not None and across.is_constant and float(across(t=0.0)) == 0.0
        if one is not other or not stays:
            return False
    return one.mirrors(other, mirror)
