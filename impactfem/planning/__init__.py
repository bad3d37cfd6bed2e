"""The plan: the least model and method that a scene needs, with the reasons, before solving."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from impactfem.findings import Finding
from impactfem.planning.bar_rows import RowNumbers, plan_bar_row
from impactfem.planning.bars import BarNumbers
from impactfem.planning.doubts import doubts
from impactfem.planning.drawing import choose_film, drawing_seconds
from impactfem.planning.layered_bars import plan_one_bar
from impactfem.planning.plans import Choice, Numbers, Plan
from impactfem.planning.solid_plan import MarchNumbers
from impactfem.planning.solids import plan_march
from impactfem.planning.vibro import VibroNumbers, plan_vibro
from impactfem.scene import Scene

__all__ = [
    "BarNumbers",
    "Choice",
    "MarchNumbers",
    "Numbers",
    "Plan",
    "RowNumbers",
    "VibroNumbers",
    "plan",
]


PLANNERS: Mapping[str, Callable[[Scene], Plan[Any]]] = {
    "bar": plan_one_bar,
    "bar_row": plan_bar_row,
    "march": plan_march,
    "vibro": plan_vibro,
}
"""Who plans what `Scene.solver` names."""


def plan(scene: Scene) -> Plan[Any]:
    """Choose model, method and numbers for a scene (collective for solids, which are meshed).

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
        MeshError: The mesh cannot be made.
    """
    if scene.drop is not None:
        from impactfem.models.falls import fall  # noqa: PLC0415  (loads Pinocchio)

        fall(scene)
    made = PLANNERS[scene.solver](scene)
    film, why = choose_film(scene, made.seconds)
    return replace(
        made,
        findings=(*made.findings, *doubts(scene, made.findings), *_shared_rooms(scene)),
        film=film,
        reasons={**made.reasons, "film": why},
        drawing_seconds=drawing_seconds(scene, film=film),
    )


def _shared_rooms(scene: Scene) -> list[Finding]:
    """Warnings about rigid bodies of parts that overlap."""
    summed = [body for body in scene.bodies if body.summed]
    if not summed:
        return []
    from impactfem.planning.shared_room import overlapping  # noqa: PLC0415  (loads kernels)

    return [told for body in summed if (told := overlapping(body)) is not None]
