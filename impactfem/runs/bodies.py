"""Run the time loop of several solids as planned: from the scene to their motions and fields."""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.complementarity import solve_by_active_set
from impactfem.contact.gaps import Gaps
from impactfem.contact.pairs import PairGaps
from impactfem.errors import ConvergenceError
from impactfem.fem import gather
from impactfem.log import Progress
from impactfem.marching.bodies_output import BodiesOutput
from impactfem.marching.composite import Composite
from impactfem.marching.leapfrog import Leapfrog
from impactfem.marching.midpoint import Midpoint
from impactfem.marching.model_watch import ModelWatch
from impactfem.marching.rubbing import Friction
from impactfem.marching.rubbing_march import RubbingMarch
from impactfem.marching.schemes import SOLID_SCHEMES, SolidScheme
from impactfem.marching.solids import SolidMarch
from impactfem.models.bodies import BodiesModel, BodyPart, bodies_model
from impactfem.planning.bodies import degrees
from impactfem.result.solid_fields import SolidFields
from impactfem.runs.bodies_rows import BodiesMotion, bodies_motion
from impactfem.runs.solid_steps import planned_steps
from impactfem.scene import Scene
from impactfem.scene.pairing import friction_of, obstacles_of
from impactfem.system.inside import check_inside
from impactfem.system.massless import mass_transfer
from impactfem.system.stretches import Stretches
from impactfem.system.surface import SurfaceNodes, SurfaceStatics

if TYPE_CHECKING:
    from impactfem.marching.layers import Interior
    from impactfem.planning import SolidPlan

Floats = NDArray[np.float64]


@np.errstate(
    over="ignore", invalid="ignore", divide="ignore"
)  # the loop looks itself whether numbers are finite
def run_bodies(
    scene: Scene, plan: "SolidPlan", progress: Progress
) -> tuple[BodiesMotion, SolidFields | None]:
    """March several solids through the duration of their scene (collective).

    Args:
        scene: The scene.
        plan: What to do.
        progress: Told of the stages.

    Returns:
        The motions, on every rank, and the fields on rank 0 (None elsewhere, or if none are asked).

    Raises:
        SceneError: The time step is beyond the stable one, or bodies overlap.
        MeshError: A mesh does not fit.
        ConvergenceError: The first layer was not found. A later failure ends the motion.
    """
    progress.step("meshing and assembling")
    model = bodies_model(scene, degrees(scene), updated=plan.normals == "updated")
    scheme = SOLID_SCHEMES[plan.method]
    surfaces = [model.surface(k) for k in range(len(model.parts))]
    transfers = [
        mass_transfer(part.system, surface, part.mesh)
        if scheme.massless and surface.count
        else None
        for part, surface in zip(model.parts, surfaces, strict=True)
    ]
    for part, surface, transfer in zip(model.parts, surfaces, transfers, strict=True):
        if transfer is not None:
            check_inside(part.solid.name, part.system, surface)
    discretised = {
        part.solid.name: (part, surface, transfer)
        for part, surface, transfer in zip(model.parts, surfaces, transfers, strict=True)
    }
    dt, layers, limit = planned_steps(scene.duration, plan, scheme, discretised)
    progress.step("preparing the layers")
    interiors = [
        _interior(part, scheme, surface, transfer, dt, plan.linear_solver)
        for part, surface, transfer in zip(model.parts, surfaces, transfers, strict=True)
    ]
    interior = Composite(
        interiors, layers,
        [surface.gather((~part.system.constrained).astype(float))
         for part, surface in zip(model.parts, surfaces, strict=True)],
    )  # fmt: skip
    size = max(
        float(np.ptp(gather(model.comm, part.system.positions), axis=0).max())
        for part in model.parts
    )
    gaps = _gaps(model, surfaces, interior)
    tolerance = plan.tolerance * size
    solver = solve_by_active_set(tolerance, plan.max_iterations)
    law = _friction(model, plan, tolerance)
    march = (
        SolidMarch(model.comm, interior, scheme, gaps, solver, layers, tolerance)
        if law is None
        else RubbingMarch(model.comm, interior, scheme, gaps, solver, layers, tolerance, law)
    )
    progress.step("marching")
    try:
        limits = ModelWatch(
            {part.solid.name: Stretches(part.system, part.solid) for part in model.parts},
            [len(part.system.constrained) for part in model.parts],
            layers,
            scene.output.every if scene.output.fields else 0,
        )
        fields = _march(scene, model, march, limits, gaps)
        motion = bodies_motion(
            model, scheme, march, interior, limits, limit, plan.whole, plan.mesh_size
        )
    finally:
        interior.destroy()
        for transfer in transfers:
            if transfer is not None:
                transfer.destroy()
    return motion, fields


def _friction(model: BodiesModel, plan: "SolidPlan", tolerance: float) -> Friction | None:
    """Coefficients of all gaps, in the order of `PairGaps`; None if there is no friction."""
    scene, parts = model.scene, [np.zeros(0)]
    for part in model.parts:
        if part.obstacle is None or not part.obstacle.count:
            continue
        name = part.solid.name
        each = [friction_of(scene, name, o.name) for o in obstacles_of(scene, name)]
        parts.append(np.array(each)[part.obstacle.obstacle])
    parts += [np.full(pair.count, friction_of(scene, *pair.names)) for pair in model.pairs]
    coefficients = np.concatenate(parts)
    if not coefficients.any():
        return None
    return Friction(coefficients, tolerance, 50 * plan.max_iterations)


def _interior(
    part: BodyPart,
    scheme: SolidScheme,
    surface: SurfaceNodes,
    transfer: object,
    dt: float,
    linear_solver: str,
) -> "Interior":
    statics = None if transfer is None else SurfaceStatics(part.system.stiffness, surface)
    if scheme.interior == "leapfrog":
        return Leapfrog(part.system, surface, statics, transfer, dt)
    return Midpoint(part.system, surface, statics, transfer, dt, linear_solver)


def _gaps(model: BodiesModel, surfaces: list[SurfaceNodes], interior: Composite) -> PairGaps:
    """Gaps to obstacles and between bodies."""
    places, initial, obstacles = [], [], []
    for k, (part, surface) in enumerate(zip(model.parts, surfaces, strict=True)):
        moved = surface.gather(part.system.displacement)
        places.append(surface.gather(part.system.positions.ravel()))
        initial.append(moved)
        if part.obstacle is None or not part.obstacle.count:
            continue
        chosen = np.searchsorted(model.numbers[k], part.obstacle.numbers)
        bodies_obstacles = obstacles_of(model.scene, part.solid.name)
        gaps = Gaps(bodies_obstacles, part.obstacle, moved[chosen], updated=model.updated)
        obstacles.append((interior.own(k), chosen.astype(np.int64), gaps))
    meetings = [
        pair.meeting(
            [np.searchsorted(model.numbers[b], model.parts[b].outside.numbers[pair.nodes[side]])
             + interior.offsets[b] for side, b in enumerate(pair.bodies)],
            interior.offsets[-1],
        )
        for pair in model.pairs
    ]  # fmt: skip
    return PairGaps(
        np.concatenate(places), np.concatenate(initial), obstacles, meetings, updated=model.updated
    )


def _march(
    scene: Scene, model: BodiesModel, march: SolidMarch, limits: ModelWatch, gaps: PairGaps
) -> SolidFields | None:
    """Run the loop with what keeps the fields."""
    output, place, passing = None, None, None
    if scene.output.fields:
        if model.comm.rank == 0:
            passing = Path(tempfile.mkdtemp(prefix="impactfem-"))
            place = passing / "fields.vtkhdf"
        output = BodiesOutput(model, place, scene.output.every, march.layers, gaps)
    try:
        march.run([limits] if output is None else [limits, output])
    except ConvergenceError as error:
        if march.layer == 0:
            raise
        march.failure = str(error)  # what was computed is kept
    finally:
        if output is not None:
            output.close()
    return None if place is None else SolidFields(place, passing=passing)
