"""Whether the error of solids is estimated, by runs on other elements, and what these cost."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from impactfem.errors import SceneError
from impactfem.scene import Scene

ACROSS = 3.0
"""Elements across a body that elements twice as large must leave."""

WORTH = 5.0
"""Seconds up to which a run on elements half as large is made without being asked for."""

COARSER, FINER = (2.0, 4.0), (0.5,)
"""How many times as large elements are in further runs."""


@dataclass(frozen=True)
class Estimate:
    """By which further runs the error is told.

    Attributes:
        factors: How many times as large their elements are; none if it is not told.
        kept: Bodies whose elements stay as they are.
        seconds: Time of these runs.
    """

    factors: tuple[float, ...] = ()
    kept: tuple[str, ...] = ()
    seconds: float = 0.0


def choose_estimate(
    scene: Scene, solids: Sequence[Any], smallest: Sequence[float], curved: bool,
    cost: Callable[[float], float], reasons: dict[str, str],
) -> Estimate:  # fmt: skip
    """By which further runs the error shall be told.

    On larger elements, which are cheap, wherever these are fine enough across all bodies; else, and
    with mesh files, on smaller ones.

    Args:
        scene: The scene.
        solids: Its bodies that have elements.
        smallest: Smallest extent of each, or of a ball that may strike it [m].
        curved: Whether an element of a mesh file is curved.
        cost: Estimated time [s] of a run on elements so many times as large.
        reasons: Gets the reason.

    Raises:
        SceneError: It is asked for, but a mesh cannot be made coarser or finer.
    """
    asked = scene.solve.estimate
    if asked is False:
        reasons["estimate"] = "as asked"
        return Estimate()
    files = [str(solid.mesh) for solid in solids if solid.mesh_size is None]
    if files and curved:
        why = f"the curved elements of {files[0]} can be made neither larger nor smaller"
        if asked:
            raise SceneError(
                f"solve.estimate = true: {why}; save it with order 1 (gmsh -order 1), or run two "
                "meshes yourself"
            )
        reasons["estimate"] = f"no: {why}"
        return Estimate()
    thin = [
        solid.name
        for solid, extent in zip(solids, smallest, strict=True)
        if solid.mesh_size is not None and extent < ACROSS * 2.0 * solid.mesh_size
    ]
    if not files and not thin:
        words = "by runs on elements twice and four times as large, for a fraction of the first"
        reasons["estimate"] = "as asked" if asked else words
        return Estimate(COARSER, seconds=sum(map(cost, COARSER)))
    seconds = cost(*FINER)
    why = f"those of {files[0]} cut" if files else "since twice as large ones would leave fewer "
    why += "" if files else f"than {ACROSS:.0f} across {thin[0]} or what strikes it"
    text = f"on elements half as large, {why}, in about {seconds:.2g} s"
    if asked or seconds <= WORTH:
        reasons["estimate"] = f"{'as asked' if asked else 'by a run'} {text}"
        return Estimate(FINER, seconds=seconds)
    if not files and len(thin) < len(solids):
        text = "by runs on elements twice and four times as large; those of "
        reasons["estimate"] = f"{text}{', '.join(thin)} stay, whose own share is not seen"
        return Estimate(COARSER, tuple(thin), sum(map(cost, COARSER)))
    reasons["estimate"] = f"no: a run {text} would tell it; solve.estimate = true makes it"
    return Estimate()
