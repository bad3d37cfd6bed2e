"""Run the time loop of a solid as planned: from the scene to its motion and fields."""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.complementarity import Solver, solve_by_active_set
from impactfem.contact.gaps import Gaps
from impactfem.errors import ConvergenceError
from impactfem.fem import cell_nodes, gather, on_root
from impactfem.log import Progress
from impactfem.marching.checkpoint import Checkpoints
from impactfem.marching.collect import Collector
from impactfem.marching.leapfrog import Leapfrog
from impactfem.marching.midpoint import Midpoint
from impactfem.marching.model_watch import ModelWatch
from impactfem.marching.schemes import SOLID_SCHEMES
from impactfem.marching.solid_output import FieldOutput, Watch
from impactfem.marching.solids import Level, SolidMarch
from impactfem.models.solid import SolidModel, solid_model
from impactfem.result.cell_kinds import KINDS
from impactfem.result.solid_fields import FieldSpool, SolidFields
from impactfem.result.solid_motion import SolidMotion
from impactfem.result.store import SPOOL
from impactfem.runs.solid_rows import solid_motion
from impactfem.runs.solid_steps import planned_steps
from impactfem.scene import Scene
from impactfem.system.massless import mass_transfer
from impactfem.system.stretches import Stretches
from impactfem.system.surface import SurfaceNodes, SurfaceStatics

if TYPE_CHECKING:
    from collections.abc import Callable

    from impactfem.marching.layers import Interior
    from impactfem.planning import SolidPlan

Floats = NDArray[np.float64]


@np.errstate(
    over="ignore", invalid="ignore", divide="ignore"
)  # the loop looks itself whether numbers are finite
def run_solid(
    scene: Scene,
    plan: "SolidPlan",
    progress: Progress,
    *,
    checkpoints: Path | None = None,
    restart: Path | None = None,
) -> tuple[SolidMotion, SolidFields | None]:
    """March a solid through the duration of its scene (collective).

    Args:
        scene: The scene.
        plan: What to do.
        progress: Told of the stages.
        checkpoints: Folder for checkpoints every ``output.checkpoint`` layers, None for none.
        restart: Folder with the checkpoint to continue from, None to begin at t = 0.

    Returns:
        The motion, on every rank, and the fields on rank 0 (None elsewhere, or if none are asked).

    Raises:
        SceneError: The time step is beyond the stable one.
        MeshError: The mesh does not fit.
        ConvergenceError: The first layer was not found. A later failure ends the motion, which
            then says so in its effort.
        OutputError: The checkpoint cannot be read or written.
    """
    progress.step("meshing and assembling")
    model = solid_model(scene, plan.degree)
    scheme = SOLID_SCHEMES[plan.method]
    surface = SurfaceNodes.of(
        model.comm, model.solid.dim, model.contact.numbers, model.system.numbers
    )
    massless = scheme.massless and surface.count > 0
    statics = SurfaceStatics(model.system.stiffness, surface) if massless else None
    transfer = mass_transfer(model.system, surface, model.mesh) if massless else None
    discretised = {model.solid.name: (model, surface, transfer)}
    dt, layers, limit = planned_steps(scene.duration, plan, scheme, discretised)
    progress.step("preparing the layers")
    interior: Interior
    if scheme.interior == "leapfrog":
        interior = Leapfrog(model.system, surface, statics, transfer, dt)
    else:
        interior = Midpoint(model.system, surface, statics, transfer, dt, plan.linear_solver)
    size = float(np.ptp(gather(model.comm, model.system.positions), axis=0).max())
    initial = surface.gather(model.system.displacement)
    updated = plan.normals == "updated"
    gaps = Gaps(scene.obstacles, model.contact, initial, updated=updated)
    solver = _solver(plan, size)
    march = SolidMarch(model.comm, interior, scheme, gaps, solver, layers, plan.tolerance * size)
    progress.step("marching")
    try:
        bodies = {model.solid.name: Stretches(model.system, model.solid)}
        kept = scene.output.every if scene.output.fields else 0
        limits = ModelWatch(bodies, [len(model.system.constrained)], layers, kept)
        fields, watch = _march(scene, model, march, limits, checkpoints, restart)
        motion = solid_motion(
            model, scheme, march, watch, limits, limit, plan.whole, plan.mesh_size
        )
    finally:
        interior.destroy()
        if transfer is not None:
            transfer.destroy()
    return motion, fields


def _solver(plan: "SolidPlan", size: float) -> Solver:
    tolerance = plan.tolerance * size
    if plan.active_set == "snes_vi":
        from impactfem.contact.snes_vi import solve_by_snes_vi  # noqa: PLC0415  (rarely asked)

        return solve_by_snes_vi(tolerance, plan.max_iterations)
    return solve_by_active_set(tolerance, plan.max_iterations)


def _march(
    scene: Scene,
    model: SolidModel,
    march: SolidMarch,
    limits: ModelWatch,
    checkpoints: Path | None,
    restart: Path | None,
) -> tuple[SolidFields | None, Watch]:
    """Run the loop with everything that looks at its levels."""
    system, comm = model.system, model.comm
    collector = Collector(comm, system.numbers)
    watch = Watch(
        comm, model.contact, scene.obstacles, system.numbers, system.positions,
        max(1, march.layers // 50),
    )  # fmt: skip
    observers: list[Callable[[Level], None]] = [watch, limits]
    place, passing = _spool_place(comm, checkpoints or restart, keep=bool(scene.output.fields))
    kept = None
    if restart is not None:
        kept = _continue(scene, model, march, collector, watch, limits, restart)
    writer = None
    if checkpoints is not None:
        text = scene.to_toml(folder=checkpoints)
        writer = Checkpoints(comm, collector, system.positions, checkpoints, text)
        if restart is None:
            writer.forget()
    spool = None
    if scene.output.fields:
        spool = _open_spool(model, place, kept)
        observers.append(
            FieldOutput(
                collector, system.dim, spool, model.contact, system.stress_at, comm,
                scene.output.every, march.layers,
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
    return SolidFields(place, passing=passing), watch


def _continue(
    scene: Scene,
    model: SolidModel,
    march: SolidMarch,
    collector: Collector,
    watch: Watch,
    limits: ModelWatch,
    restart: Path,
) -> int:
    """Take up the state of a checkpoint; returns how many layers its fields have."""
    text = scene.to_toml(folder=restart)
    reader = Checkpoints(model.comm, collector, model.system.positions, restart, text)
    start = reader.read(march)
    watch.depth, watch.message = float(start["depth"]), str(start["message"])
    limits.restore(str(start["limits"]))
    return int(start["fields"])


def _saver(
    comm: Any,
    writer: Checkpoints,
    march: SolidMarch,
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
                "depth": watch.depth, "message": watch.message, "limits": limits.state(),
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


def _open_spool(model: SolidModel, place: Path | None, kept: int | None) -> FieldSpool | None:
    """Open the file of the fields on rank 0 (collective)."""
    mesh, comm = model.mesh, model.comm
    own = mesh.mesh.topology.index_map(mesh.mesh.topology.dim).size_local
    cells = mesh.numbers[cell_nodes(mesh.mesh)[:own]]
    original = mesh.mesh.topology.original_cell_index[:own]
    collector = Collector(comm, model.system.numbers)
    points = collector.collect(model.system.positions.ravel(), model.solid.dim)
    everything = comm.gather((original, cells), root=0)

    def make() -> FieldSpool | None:
        if place is None or everything is None or points is None:
            return None
        if kept is not None:
            return FieldSpool.reopen(place, kept)
        order = np.concatenate([part[0] for part in everything])
        ordered = np.empty((len(order), cells.shape[1]), dtype=np.int64)
        ordered[order] = np.concatenate([part[1] for part in everything])
        kind = KINDS[mesh.cell, mesh.degree]
        return FieldSpool(place, points, ordered[:, list(kind.order)], kind.vtk_type)

    found: list[FieldSpool | None] = []
    on_root(comm, lambda: found.append(make()))
    return found[0] if found else None
