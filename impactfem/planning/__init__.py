"""The plan: the least model and method that a scene needs, with the reasons, before solving."""

from dataclasses import replace

from impactfem.planning.bar_rows import BarRowPlan, plan_bar_row
from impactfem.planning.bars import Plan, plan_bar
from impactfem.planning.doubts import MEETS_NOTHING, doubts
from impactfem.planning.drawing import choose_film, drawing_seconds
from impactfem.planning.few import plan_few
from impactfem.planning.solid_plan import SolidPlan
from impactfem.planning.solids import plan_solids
from impactfem.planning.vibro import VibroPlan, plan_vibro
from impactfem.scene import Scene

__all__ = [
    "AnyPlan",
    "BarRowPlan",
    "Plan",
    "SolidPlan",
    "VibroPlan",
    "plan",
    "plan_bar",
    "plan_bar_row",
    "plan_solids",
    "plan_vibro",
]

type AnyPlan = Plan | BarRowPlan | SolidPlan | VibroPlan


def plan(scene: Scene) -> AnyPlan:
    """Choose model, method and numbers for a scene (collective for solids, which are meshed).

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
        MeshError: The mesh cannot be made.
    """
    if scene.bars:
        bars = plan_bar_row(scene) if scene.is_bar_row else plan_bar(scene)
        return _with_drawing(bars, scene)
    made: AnyPlan
    if scene.is_vibro:
        made = plan_vibro(scene)
    else:
        made = plan_solids(scene) if scene.solids else plan_few(scene)
    found = doubts(scene)
    told = {finding.subject for finding in made.findings if finding.code == MEETS_NOTHING}
    if told & {body.name for body in scene.bodies}:  # which says more
        found = tuple(finding for finding in found if finding.code != MEETS_NOTHING)
    made = replace(made, findings=(*made.findings, *found))
    return _with_drawing(made, scene)


def _with_drawing(made: AnyPlan, scene: Scene) -> AnyPlan:
    """A plan that also says whether a film is written, and what drawing takes."""
    film, why = choose_film(scene, made.seconds)
    return replace(
        made,
        film=film,
        reasons={**made.reasons, "film": why},
        drawing_seconds=drawing_seconds(scene, film=film),
    )
