"""Run the time loop of solids as planned: from the scene to their motions and fields."""

import json
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ConvergenceError
from impactfem.fem import on_root
from impactfem.log import Progress
from impactfem.marching.checkpoint import Checkpoints
from impactfem.marching.collect import Collector
from impactfem.marching.few import FewMidpoint
from impactfem.marching.layers import ContactGaps
from impactfem.marching.mechanism import MechanismMidpoint
from impactfem.marching.model_watch import ModelWatch
from impactfem.marching.net import NetMidpoint
from impactfem.marching.plate import PlateMidpoint
from impactfem.marching.plate_newton import PlateNewton
from impactfem.marching.rigid_body import RigidMidpoint
from impactfem.marching.rows import Level
from impactfem.marching.schemes import scheme_of
from impactfem.marching.time_loop import TimeLoop
from impactfem.marching.wave_bar import WaveBar
from impactfem.models.solids import SolidsModel, solids_model
from impactfem.result.spool import FieldSpool
from impactfem.result.store import SPOOL
from impactfem.result.stored_snapshots import StoredSnapshots
from impactfem.runs.axis_watch import AxisWatch
from impactfem.runs.contact_places import ContactPlaces
from impactfem.runs.line_looks import line_looks
from impactfem.runs.loops import Marched, make_loop
from impactfem.runs.samples import Kept, Places, chosen_places
from impactfem.runs.solid_output import FieldOutput, Followed, Watch, followed, open_spool
from impactfem.runs.solid_probes import SolidProbes
from impactfem.runs.solid_rows import SolidsMotion, solids_motion
from impactfem.runs.solid_steps import planned_steps
from impactfem.scene import Scene
from impactfem.system.few import ElasticBar, FewBodies, Lumped
from impactfem.system.inside import check_inside
from impactfem.system.massless import mass_transfer
from impactfem.system.mechanism import Arm
from impactfem.system.net import Net
from impactfem.system.plate import PlateSystem
from impactfem.system.rigid import Rigid
from impactfem.system.stretches import Stretches

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from impactfem.planning import MarchNumbers, Plan

Floats = NDArray[np.float64]

_INTERIORS: "Mapping[type[FewBodies], Callable[..., Marched]]" = {
    Lumped: FewMidpoint,
    ElasticBar: WaveBar,
    Rigid: RigidMidpoint,
    Arm: MechanismMidpoint,
    Net: NetMidpoint,
    PlateSystem: PlateMidpoint,
}
"""How bodies without meshes are marched."""

_STEPPERS: "Mapping[type[FewBodies], Callable[..., Marched]]" = {
    Lumped: FewMidpoint,
    Rigid: partial(RigidMidpoint, exact=True),
    Arm: partial(MechanismMidpoint, exact=True),
    Net: NetMidpoint,
    PlateSystem: PlateNewton,
}
"""The same where steps are solved by iterates."""

_FIELDS = 1000  # layers of fields that are kept of solids, at most twice as many
_FRAMES = 150  # layers of fields that are kept of bodies without meshes, at most twice as many


# The loop looks itself whether numbers are finite.
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def run_solids(
    scene: Scene,
    plan: "Plan[MarchNumbers]",
    progress: Progress,
    *,
    checkpoints: Path | None = None,
    restart: Path | None = None,
    places: Places | None = None,
) -> tuple[SolidsMotion, StoredSnapshots | None]:
    """March solids through the duration of their scene (collective).

    Args:
        scene: The scene.
        plan: What to do.
        progress: Told of the stages.
        checkpoints: Folder for checkpoints every ``output.checkpoint`` layers, None for none.
        restart: Folder with the checkpoint to continue from, None to begin at t = 0.
        places: Of bodies whose way is kept; None to choose them if the error is estimated.

    Returns:
        The motions, on every rank, and the fields on rank 0 (None elsewhere, or if none are asked).

    Raises:
        SceneError: The time step is beyond the stable one, or bodies overlap.
        MeshError: A mesh does not fit.
        ConvergenceError: The first layer was not found. A later failure ends the motion, which
            then says so in its effort.
        OutputError: The checkpoint cannot be read or written.
    """
    numbers = plan.numbers
    progress.step("meshing and assembling")
    model = solids_model(scene, numbers.degrees, updated=numbers.normals == "updated")
    scheme = scheme_of(plan.method, finite=any(solid.is_finite for solid in scene.solids))
    surfaces = [model.surface(k) for k in range(len(model.parts))]
    transfers = [
        mass_transfer(part.system, surface, part.mesh)
        if scheme.massless and surface.count
        else None
        for part, surface in zip(model.parts, surfaces, strict=True)
    ]
    each = list(zip(model.parts, surfaces, transfers, strict=True))
    for part, surface, transfer in each:
        if transfer is not None:
            check_inside(part.solid.name, part.system, surface)
    discretised = {parts[0].solid.name: parts for parts in each}
    dt, layers, limit = planned_steps(scene.duration, plan, scheme, discretised)
    progress.step("preparing the time steps")
    marches = _STEPPERS if scene.iterated else _INTERIORS
    few = [
        marches[type(bodies)](bodies, scene.vector_gravity, dt, counts=model.comm.rank == 0)
        for bodies in model.few
    ]
    iterates = model.takes_iterates(plan.method, numbers.active_set)
    steps = dt, layers, limit
    loop = make_loop(scene, model, numbers, scheme, iterates, each, few, steps, progress)
    march, offsets = loop.march, loop.offsets
    progress.step("marching")
    try:
        limits = ModelWatch(
            {
                **{p.solid.name: Stretches(p.system, p.solid) for p in model.parts},
                **line_looks(few),
            },
            [*(len(p.system.constrained) for p in model.parts), *(0 for _ in few)],
            layers,
            _every(scene, layers) if scene.output.fields else 0,
        )
        if places is None and numbers.estimate:
            places = chosen_places(model, few, layers)
        kept = Kept.of(places, model, few) if places else None
        joined = [march.interior.told] if model.joints else []
        probes = SolidProbes.of(march, model, few, joined, kept)
        touching = ContactPlaces.of(march, loop.gaps, loop.contacts, model)
        looking: list[Callable[[Level], None]] = [probes] if probes.names else []
        looking += [touching] if touching else []
        others = [
            body
            for k, part in enumerate(few, start=len(each))
            for body in followed(part, slice(offsets[k], offsets[k + 1]))
        ]
        fields, watch = _march(
            scene,
            model,
            march,
            loop.gaps,
            limits,
            AxisWatch(model, few, loop.contacts.places, layers),
            looking,
            others,
            checkpoints,
            restart,
        )
        motion = solids_motion(
            model,
            scheme,
            march,
            watch,
            limits,
            limit,
            numbers.whole,
            numbers.mesh_size,
            probes,
            touching,
            loop.started,
        )
    finally:
        march.interior.destroy()
        for transfer in transfers:
            if transfer is not None:
                transfer.destroy()
    return motion, fields


def _every(scene: Scene, layers: int) -> int:
    """Layers between two that fields are kept of; of small bodies no more than films need."""
    most = _FIELDS if scene.solids else _FRAMES
    return scene.output.every or max(1, layers // most)


def _march(
    scene: Scene,
    model: SolidsModel,
    march: TimeLoop[Any],
    gaps: ContactGaps,
    limits: ModelWatch,
    axes: AxisWatch,
    looking: Sequence["Callable[[Level], None]"],
    others: Sequence[Followed],
    checkpoints: Path | None,
    restart: Path | None,
) -> tuple[StoredSnapshots | None, Watch]:
    """Run the loop with everything that looks at its levels."""
    comm, collector = model.comm, Collector(model.comm, model.own_numbers)
    none = np.zeros((0, model.dim))
    positions = np.concatenate([none, *(part.system.positions for part in model.parts)])
    watch = Watch(model, max(1, march.layers // 50), axes, all_held=gaps.shares_nodes)
    observers: list[Callable[[Level], None]] = [watch, limits, *looking]
    shows = bool(model.parts) or any(np.size(body.shape.cells) for body in others)
    keep = shows and bool(scene.output.fields)  # links without shapes have nothing to show
    place, passing = _spool_place(comm, checkpoints or restart, keep=keep)
    kept = None
    if restart is not None:
        text = scene.to_toml(folder=restart)
        start = Checkpoints(comm, collector, positions, restart, text).read(march)
        watch.depth, watch.message = float(start["depth"]), str(start["message"])
        watch.overlap, watch.folds = float(start["overlap"]), json.loads(str(start["folds"]))
        axes.restore(str(start["axes"]))
        limits.restore(str(start["limits"]))
        kept = int(start["fields"])
    writer = None
    if checkpoints is not None:
        text = scene.to_toml(folder=checkpoints)
        writer = Checkpoints(comm, collector, positions, checkpoints, text)
        if restart is None:
            writer.forget()
    spool = None
    if keep:
        each = zip(model.numbers, model.starts, strict=False)
        own = [np.zeros(0, dtype=np.int64), *(numbers + start for numbers, start in each)]
        contact = np.concatenate(own)
        spool = open_spool(model, collector, place, kept, others)
        observers.append(
            FieldOutput(
                comm, model, collector, contact, gaps, spool, _every(scene, march.layers),
                march.layers, others,
            )
        )  # fmt: skip
    if writer is not None and scene.output.checkpoint:
        every = scene.output.checkpoint
        observers.append(_saver(comm, writer, march, watch, limits, spool, every))
    try:
        march.run(observers)
    except ConvergenceError as error:
        if march.layer == 0:
            raise
        march.failure = str(error)  # what was computed is kept
    finally:
        if spool is not None:
            spool.close()
    if spool is None or place is None:
        return None, watch
    return StoredSnapshots(place, passing=passing), watch


def _saver(
    comm: Any,
    writer: Checkpoints,
    march: TimeLoop[Any],
    watch: Watch,
    limits: ModelWatch,
    spool: FieldSpool | None,
    every: int,
) -> "Callable[[Level], None]":
    """Make an observer that writes a checkpoint every so many layers."""

    def save(level: Level) -> None:
        if level.layer and level.layer % every == 0 and level.layer < march.layers:
            kept = on_root(comm, lambda: 0 if spool is None else len(spool))
            seen: dict[str, float | str] = {
                "depth": watch.depth, "message": watch.message, "overlap": watch.overlap,
                "folds": json.dumps(watch.folds),
                "axes": watch.axes.state(),
                "limits": limits.state(),
            }  # fmt: skip
            writer.write(march, {"fields": kept, **seen})

    return save


def _spool_place(comm: Any, folder: Path | None, *, keep: bool) -> tuple[Path | None, Path | None]:
    """File of the fields on rank 0, and the temporary folder that goes with it."""
    if comm.rank != 0 or not keep:
        return None, None
    if folder is not None:
        return folder / SPOOL, None
    passing = Path(tempfile.mkdtemp(prefix="impactfem-"))
    return passing / "fields.vtkhdf", passing
