"""Whether the error of solids is estimated, by runs on other elements, and what these cost."""

from collections.abc import Callable, Sequence
from typing import Any

from impactfem.errors import SceneError
from impactfem.scene import Scene

ACROSS = 3.0
"""Elements across a body that elements twice as large must leave."""

WORTH = 5.0
"""Seconds up to which a run on elements half as large is made without being asked for."""


def choose_estimate(
    scene: Scene, solids: Sequence[Any], smallest: Sequence[float], curved: bool,
    cost: Callable[[float], float], reasons: dict[str, str],
) -> tuple[bool, float]:  # fmt: skip
    """Whether further runs shall tell the error, and their time [s].

    Args:
        scene: The scene.
        solids: Its bodies that have elements.
        smallest: Smallest extent of each [m].
        curved: Whether an element of a mesh file is curved.
        cost: Estimated time [s] of a run on elements so many times as large.
        reasons: Gets the reason.

    Raises:
        SceneError: It is asked for, but a mesh cannot be made coarser or finer.
    """
    asked = scene.solve.estimate
    if asked is False:
        reasons["estimate"] = "as asked"
        return False, 0.0
    files = [str(solid.mesh) for solid in solids if solid.mesh_size is None]
    if files and curved:
        why = f"the curved elements of {files[0]} can be made neither larger nor smaller"
        if asked:
            raise SceneError(
                f"solve.estimate = true: {why}; save it with order 1 (gmsh -order 1), or run two "
                "meshes yourself"
            )
        reasons["estimate"] = f"no: {why}"
        return False, 0.0
    if files:
        seconds = cost(0.5)
        text = f"on elements half as large, those of {files[0]} cut, in about {seconds:.2g} s"
        if not asked and seconds > WORTH:
            reasons["estimate"] = f"no: a run {text} would tell it; solve.estimate = true makes it"
            return False, 0.0
        reasons["estimate"] = f"{'as asked' if asked else 'by a run'} {text}"
        return True, seconds
    thin = [
        solid.name
        for solid, extent in zip(solids, smallest, strict=True)
        if solid.mesh_size is not None and extent < ACROSS * 2.0 * solid.mesh_size
    ]
    if thin and not asked:
        reasons["estimate"] = (
            f"no: elements twice as large would leave fewer than {ACROSS:.0f} across {thin[0]}"
        )
        return False, 0.0
    reasons["estimate"] = (
        "as asked"
        if asked
        else "by runs on elements twice and four times as large, for a fraction of the first"
    )
    return True, cost(2.0) + cost(4.0)
