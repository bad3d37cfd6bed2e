"""Run bodies that are marched as planned, and estimate their error."""

import time
from dataclasses import replace

from impactfem.log import Progress
from impactfem.planning import MarchNumbers, Plan
from impactfem.planning.strains import with_strains
from impactfem.planning.vibration import struck_after_all
from impactfem.result.snapshots import Snapshots
from impactfem.runs.error_estimate import estimate_error
from impactfem.runs.run import Checkpointing, Cost, Run
from impactfem.runs.solid_rows import SolidsMotion
from impactfem.runs.solids import run_solids
from impactfem.scene import Scene


def run(scene: Scene, plan: Plan[MarchNumbers], progress: Progress, saved: Checkpointing) -> Run:
    """March the bodies (collective); see `run_solids`."""
    start = time.perf_counter()
    scene = strained(scene, plan)
    motion, fields = run_solids(scene, plan, progress, saved)
    return finished(scene, plan, progress, motion, fields, Cost.since(start))


def finished(
    scene: Scene, plan: Plan[MarchNumbers], progress: Progress, motion: SolidsMotion,
    fields: Snapshots | None, cost: Cost, *, estimate: bool = True,
) -> Run:  # fmt: skip
    """The run of a motion, with an estimate of its error if the plan has one (collective)."""
    effort, used = motion.effort, as_used(scene, plan)
    unknowns = max(1, effort.num_unknowns)
    details = {**effort.details, "memory_per_unknown_kib": cost.memory_mib * 1024 / unknowns}
    errors = None
    if estimate and plan.numbers.estimate and motion.is_finite and effort.converged:
        progress.step("estimating the error on other elements")
        errors, details["error_estimate"] = estimate_error(used, plan, motion)
    effort = replace(effort, details=details)
    force = float(motion.history["contact_force"].values.max())
    if plan.numbers.apart and force > 0.0:
        effort = replace(effort, findings=(*effort.findings, struck_after_all(force)))
    return Run(
        used=used, history=motion.history, effort=effort, errors=errors, cost=cost, fields=fields
    )


def strained(scene: Scene, plan: Plan[MarchNumbers]) -> Scene:
    """The scene with finite strain where the plan takes it."""
    pairs = zip(scene.solids, plan.numbers.strains, strict=True)
    return with_strains(scene, (solid.name for solid, strain in pairs if strain == "finite"))


def as_used(scene: Scene, plan: Plan[MarchNumbers]) -> Scene:
    """The scene with the plan's choices filled in."""
    numbers = plan.numbers
    settings = replace(
        scene.solve,
        method=plan.method,
        courant=numbers.courant if scene.solve.dt is None else None,
        normals=numbers.normals,
        estimate=numbers.estimate,
        linear_solver=None if numbers.linear_solver == "none" else numbers.linear_solver,
    )
    degrees = dict(zip((solid.name for solid in scene.solids), numbers.degrees, strict=True))
    solids = {s.name: replace(s, degree=degrees[s.name]) for s in scene.solids}
    bodies = tuple(solids.get(body.name, body) for body in scene.bodies)
    return replace(scene, bodies=bodies, solve=settings)
