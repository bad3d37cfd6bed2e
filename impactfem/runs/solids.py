"""Run the time loop of solids as planned: from the scene to their motions and fields."""

import math
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from impactfem.errors import ConvergenceError
from impactfem.extensions import needed
from impactfem.fem import on_root
from impactfem.log import Progress
from impactfem.marching.checkpoint import Checkpoints
from impactfem.marching.collect import Collector
from impactfem.marching.few import FewMidpoint
from impactfem.marching.flexible_beam import FlexibleMidpoint
from impactfem.marching.marched import Marched
from impactfem.marching.mechanism import MechanismMidpoint
from impactfem.marching.net import NetMidpoint
from impactfem.marching.plate import PlateMidpoint
from impactfem.marching.plate_newton import PlateNewton
from impactfem.marching.rigid_body import RigidMidpoint
from impactfem.marching.rows import Level
from impactfem.marching.schemes import scheme_of
from impactfem.marching.wave_bar import WaveBar
from impactfem.models.solids import SolidsModel, solids_model
from impactfem.result.history import write_csv
from impactfem.result.store import PARTIAL, SPOOL
from impactfem.result.stored_snapshots import StoredSnapshots
from impactfem.runs.loops import make_loop
from impactfem.runs.observed import Observed, Observer
from impactfem.runs.rewinding import State
from impactfem.runs.run import Checkpointing, checkpoint_every
from impactfem.runs.samples import Places
from impactfem.runs.solid_output import FieldOutput, Followed, followed
from impactfem.runs.solid_rows import SolidsMotion, solids_motion
from impactfem.runs.solid_steps import planned_steps, starts_amid
from impactfem.scene import Scene
from impactfem.system.few import ElasticBar, FewBodies, Lumped
from impactfem.system.flexible_beam import FlexibleBeam
from impactfem.system.inside import check_inside
from impactfem.system.massless import mass_transfer
from impactfem.system.mechanism import Arm
from impactfem.system.net import Net
from impactfem.system.plate import PlateSystem
from impactfem.system.rigid import Rigid, RigidRod

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from impactfem.planning import MarchNumbers, Plan


_INTERIORS: "Mapping[type[FewBodies], Callable[..., Marched]]" = {
    Lumped: FewMidpoint,
    ElasticBar: WaveBar,
    Rigid: RigidMidpoint,
    RigidRod: RigidMidpoint,
    Arm: MechanismMidpoint,
    Net: NetMidpoint,
    FlexibleBeam: FlexibleMidpoint,
    PlateSystem: PlateMidpoint,
}
"""How bodies without meshes are marched."""

_STEPPERS: "Mapping[type[FewBodies], Callable[..., Marched]]" = {
    **_INTERIORS,
    Rigid: partial(RigidMidpoint, exact=True),
    RigidRod: partial(RigidMidpoint, exact=True),
    Arm: partial(MechanismMidpoint, exact=True),
    PlateSystem: PlateNewton,
}
"""The same where steps are solved by iterates."""

_NOWHERE = Checkpointing()
_SELDOM = 10.0  # seconds between two that the history so far is written
_FIELDS = 1000  # layers of fields that are kept of solids, at most twice as many
_FRAMES = 150  # layers of fields that are kept of bodies without meshes, at most twice as many


@dataclass(frozen=True)
class Ready:
    """A march of a scene that is ready to run, with what looks at its levels.

    Attributes:
        scene: The scene.
        seen: The march and its observers.
        few: What marches bodies without meshes.
        others: These, as files of fields follow them.
        every: Layers between two that fields are kept of.
        transfers: What moves mass off contact nodes.
        steps: Time step [s], number of layers, and the stable step of explicit schemes [s].
        ends: Layer at which supports let go, and `later` goes on; the last one if none do.
        later: The march after that.
    """

    scene: Scene
    seen: Observed
    few: Sequence[Marched]
    others: Sequence[Followed]
    every: int
    transfers: Sequence[Any]
    steps: tuple[float, int, float | None]
    ends: int
    later: "Ready | None" = None

    def handed(self) -> "Ready":
        """What goes on where supports let go: a march as one that is taken up again (collective).

        What they moved goes on at the speed that it has then.
        """
        later, state = self.next, State.of(self.seen)
        inside, first, loosened = dict(state.inside), 0, []
        for part, other in zip(self.seen.model.parts, later.seen.model.parts, strict=True):
            held, kept = part.system.supports, other.system.supports
            own = slice(first, first := first + len(held.constrained))
            loose = held.constrained & ~kept.constrained
            speeds = np.zeros(len(loose))
            speeds[held.moved] = held.motion(self.ends * self.seen.march.interior.dt)[1]
            if "velocity" in inside:  # else of steps, which are those that were made
                inside["velocity"][own][loose] = speeds[loose]
            loosened.append(loose)
        replace(state, inside=inside).restore(later.seen)
        later.seen.march.release(np.concatenate(loosened))
        return later

    @property
    def next(self) -> "Ready":
        """The later march, which knows how this one began."""
        assert self.later is not None  # noqa: S101  (asked for at its end only)
        seen = self.later.seen
        loop = replace(seen.loop, started=self.seen.loop.started)
        return replace(self.later, seen=replace(seen, loop=loop))

    def at(self, layer: int) -> "Ready":
        """The march that has done a layer: this one, or a later one."""
        found = self
        while found.later is not None and found.ends < layer:
            found = found.next
        return found

    def destroy(self) -> None:
        """Free what it holds (collective)."""
        self.seen.march.interior.destroy()
        for transfer in self.transfers:
            if transfer is not None:
                transfer.destroy()
        if self.later is not None:
            self.later.destroy()


# The loop looks itself whether numbers are finite.
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def run_solids(
    scene: Scene,
    plan: "Plan[MarchNumbers]",
    progress: Progress,
    saved: Checkpointing = _NOWHERE,
    *,
    places: Places | None = None,
) -> tuple[SolidsMotion, StoredSnapshots | None]:
    """March solids through the duration of their scene (collective).

    Args:
        scene: The scene.
        plan: What to do.
        progress: Told of the stages.
        saved: Checkpoints to write every ``output.checkpoint`` layers, and that to continue from.
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
    ready = prepare(scene, plan, progress, places)
    try:
        own = checkpoint_every(scene, plan)
        layers = ready.seen.march.layers
        steps = int(own) if own >= 1.0 else max(1, round(own * layers)) * (own > 0.0)
        last, fields = _march(scene, ready, steps, saved)
        motion = solids_motion(last.seen)
    finally:
        ready.destroy()
    return motion, fields


def prepare(
    scene: Scene, plan: "Plan[MarchNumbers]", progress: Progress, places: Places | None = None,
    model: SolidsModel | None = None,
) -> Ready:  # fmt: skip
    """Prepare a march; see `run_solids`. A model of the scene that there is already is taken."""
    numbers = plan.numbers
    progress.step("meshing and assembling")
    if model is None:
        model = solids_model(scene, numbers.degrees, updated=numbers.normals == "updated")
    ready = None
    # The last one first: what the least supports hold is the stiffest in explicit steps.
    for end in reversed((None, *scene.ends)):
        left = scene if end is None else scene.after(end)
        own = model if end is None else model.beside(left, later=True)
        ready = _prepared(scene, left, own, plan, progress, places, ready, rests=end is None)
    return cast("Ready", ready)


def _prepared(
    whole: Scene, scene: Scene, model: SolidsModel, plan: "Plan[MarchNumbers]",
    progress: Progress, places: Places | None, later: Ready | None, *, rests: bool,
) -> Ready:  # fmt: skip
    """Prepare a march with the supports of a scene, after which a later one may go on."""
    numbers = plan.numbers
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
    steps = planned_steps(whole, plan, scheme, discretised) if later is None else later.steps
    dt, layers, _ = steps
    progress.step("preparing the time steps")
    marches = _STEPPERS if scene.iterated else _INTERIORS
    few = [
        marches[type(bodies)](bodies, scene.vector_gravity, dt, counts=model.comm.rank == 0)
        for bodies in model.few
    ]
    iterates = model.takes_iterates(plan.method, numbers.active_set)
    loop = make_loop(
        scene, model, numbers, scheme, iterates, each, few, steps, progress,
        rests=rests and scene.starts_at_rest,
    )  # fmt: skip
    if model.joints:
        loop.joined.mirror(list(numbers.whole.levels))
    progress.step("marching")
    every = _every(scene, layers)
    try:
        kept = every if scene.output.fields else 0
        seen = Observed.of(model, few, scheme, numbers, loop, steps[2], kept, places)
        others = [
            body
            for k, part in enumerate(few, start=len(each))
            for body in followed(part, slice(*loop.offsets[k : k + 2]))
        ]
    except BaseException:
        loop.march.interior.destroy()
        raise
    ends = layers
    if later is not None:
        at = scene.ends[0]
        ends = min(layers, round(at / dt + starts_amid(scheme))) if at else 0
    return Ready(scene, seen, few, others, every, transfers, steps, ends, later)


def _every(scene: Scene, layers: int) -> int:
    """Layers between two that fields are kept of; of small bodies no more than films need."""
    most = _FIELDS if scene.solids else _FRAMES
    return scene.output.every or max(1, layers // most)


def _march(
    scene: Scene, ready: Ready, steps: int, saved: Checkpointing
) -> tuple[Ready, StoredSnapshots | None]:
    """Run the loop with everything that looks at its levels; what ran last, and the fields.

    Checkpoints are written every so many layers (0: none).
    """
    model = ready.seen.model
    comm, collector = model.comm, Collector(model.comm, model.own_numbers)
    none = np.zeros((0, model.dim))
    positions = np.concatenate([none, *(part.system.positions for part in model.parts)])

    def checkpoints(folder: Path) -> Checkpoints:
        text = scene.to_toml(folder=folder)
        return Checkpoints(comm, collector, positions, folder, text, needed(scene.said))

    shows = bool(model.parts) or any(np.size(body.shape.cells) for body in ready.others)
    keep = shows and bool(scene.output.fields)  # links without shapes have nothing to show
    place, passing = _spool_place(comm, saved.folder or saved.restart, keep=keep)
    kept = None
    if saved.restart is not None:
        known = checkpoints(saved.restart)
        ready = ready.at(known.layer())
        start = known.read(ready.seen.march)
        ready.seen.restore(start)
        kept = int(start["fields"])
    writer = None if saved.folder is None else checkpoints(saved.folder)
    if saved.folder is not None:
        on_root(comm, partial(scene.keep_meshes, saved.folder))
    if writer is not None and saved.restart is None:
        writer.forget()

    def watched(ready: Ready, kept: int | None) -> tuple[list[Observer], FieldOutput | None]:
        """What looks at the levels of a march."""
        seen, output = ready.seen, None
        observers = seen.observers()
        if keep:
            often = ready.every, seen.march.layers
            output = FieldOutput(seen.model, collector, seen.march.gaps, ready.others, often)
            output.open(place, kept)
            observers.append(output)
        if writer is not None and saved.folder is not None and steps:
            observers.append(_saver(writer, seen, output, steps, saved.folder))
        return observers, output

    last = _marched(ready, watched, kept)
    return last, None if place is None else StoredSnapshots(place, passing=passing)


def _marched(
    ready: Ready,
    watched: "Callable[[Ready, int | None], tuple[list[Observer], FieldOutput | None]]",
    kept: int | None,
) -> Ready:
    """March to the end, through all times at which supports let go; what ran last."""
    begun = False
    while True:
        observers, output = watched(ready, kept)
        march = ready.seen.march
        try:
            if not begun:
                march.begin(observers)
            march.go_on(observers, ready.ends)
            kept = None if output is None else output.count()
        except ConvergenceError as error:
            if march.layer == 0:
                raise
            march.failure = str(error)  # what was computed is kept
        finally:
            if output is not None:
                output.close()
        if ready.later is None or march.failure:
            return ready
        ready, begun = ready.handed(), True


def _saver(
    writer: Checkpoints, seen: Observed, output: FieldOutput | None, every: int, folder: Path
) -> Observer:
    """Make an observer that writes a checkpoint every so many layers.

    With the first one, and then seldom, it writes the history so far, for whoever looks at a run
    that was killed.
    """
    march, comm, written = seen.march, seen.model.comm, [-math.inf]

    def save(level: Level) -> None:
        if not level.layer or level.layer % every or level.layer >= march.layers:
            return
        if seen.touching is not None:
            seen.touching.sum_up()
        kept = 0 if output is None else output.count()
        writer.write(march, {"fields": kept, **seen.state()})
        now = time.monotonic()
        if not comm.bcast(now - written[0] >= _SELDOM):
            return
        history = solids_motion(seen).history
        if comm.rank == 0:
            with suppress(OSError):  # the checkpoint is there, which is what counts
                # Forces of the last row of explicit steps are known one step later.
                write_csv(history.first(-1), folder / f".{PARTIAL}")
                (folder / f".{PARTIAL}").replace(folder / PARTIAL)
        written[0] = time.monotonic()

    return save


def _spool_place(comm: Any, folder: Path | None, *, keep: bool) -> tuple[Path | None, Path | None]:
    """File of the fields on rank 0, and the temporary folder that goes with it."""
    if comm.rank != 0 or not keep:
        return None, None
    if folder is not None:
        return folder / SPOOL, None
    passing = Path(tempfile.mkdtemp(prefix="impactfem-"))
    return passing / "fields.vtkhdf", passing
