"""Make the time loop of a scene: bodies, their gaps, the solver of contact, their start."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.complementarity import Solver, solve_by_active_set
from impactfem.fem import gather
from impactfem.log import Progress
from impactfem.marching.composite import Composite
from impactfem.marching.coupled_levels import CoupledLevels
from impactfem.marching.few import FewInterior, FewMidpoint
from impactfem.marching.finite import FiniteMidpoint
from impactfem.marching.finite_body import FiniteBody
from impactfem.marching.finite_leapfrog import FiniteLeapfrog
from impactfem.marching.iterated import Iterated, Resolving
from impactfem.marching.jointed import Jointed
from impactfem.marching.jointed_newton import JointedNewton
from impactfem.marching.layers import ContactGaps, Interior, Stepper
from impactfem.marching.leapfrog import Leapfrog
from impactfem.marching.leapfrog_bodies import LeapfrogBodies, LevelStepper
from impactfem.marching.level_march import LevelMarch
from impactfem.marching.mechanism import MechanismMidpoint
from impactfem.marching.midpoint import Midpoint
from impactfem.marching.net import NetMidpoint
from impactfem.marching.newton_bodies import NewtonBodies, NewtonStepper
from impactfem.marching.newton_march import NewtonMarch
from impactfem.marching.plate import PlateMidpoint
from impactfem.marching.plate_newton import PlateNewton
from impactfem.marching.pressing import Pressing
from impactfem.marching.rigid_body import RigidMidpoint
from impactfem.marching.rubbing_march import RubbingMarch
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.solids import SolidMarch
from impactfem.marching.time_loop import LoopSettings, TimeLoop
from impactfem.marching.tipped import TippedMidpoint
from impactfem.marching.wave_bar import WaveBar
from impactfem.models.solids import SolidPart, SolidsModel
from impactfem.planning.solid_choices import fitting_solver
from impactfem.result.history import MOST_PAIRS
from impactfem.runs.contacts import Contacts
from impactfem.runs.static_start import Started, linear_bodies, spin_of, start_at_rest
from impactfem.scene import Scene
from impactfem.system.stations import Stations
from impactfem.system.surface import SurfaceNodes, SurfaceStatics

if TYPE_CHECKING:
    from impactfem.planning import MarchNumbers


_LAYERS = 100  # whose way tells how coordinates round

type Marched = (
    FewMidpoint | WaveBar | RigidMidpoint | MechanismMidpoint | NetMidpoint | PlateMidpoint
)
"""What marches bodies without meshes."""

Discretised = tuple[SolidPart, SurfaceNodes, Any]
"""A solid, its contact nodes on this rank, and what moves mass off these."""


@dataclass(frozen=True)
class Loop:
    """A time loop that is ready to run.

    Attributes:
        march: The loop.
        gaps: All gaps.
        contacts: What they are between.
        offsets: Where the contact nodes of each part of the march begin, and their number.
        started: How the bodies came to rest, if they start so.
    """

    march: TimeLoop[Any]
    gaps: ContactGaps
    contacts: Contacts
    offsets: list[int]
    started: Started | None = None


def make_loop(
    scene: Scene,
    model: SolidsModel,
    numbers: "MarchNumbers",
    scheme: SolidScheme,
    iterates: bool,
    each: Sequence[Discretised],
    few: Sequence[Marched],
    steps: tuple[float, int, float | None],
    progress: Progress,
) -> Loop:
    """Prepare a march (collective).

    Args:
        scene: The scene.
        model: Its bodies.
        numbers: Of the plan.
        scheme: The time scheme.
        iterates: Whether steps are solved by iterates.
        each: The solids.
        few: What marches the bodies without meshes.
        steps: Time step [s], number of layers, and stable step of explicit schemes [s].
        progress: Told of the stages.

    Raises:
        SceneError: Bodies overlap, or loads drive one that starts at rest and is not held.
        ConvergenceError: No equilibrium was found, or a matrix cannot be factored.
    """
    dt, layers, limit = steps
    tolerance = numbers.tolerance * _size(model, few, dt)
    counts = [surface.count for _, surface, _ in each]
    counts += [len(part.surface_displacement) for part in few]
    offsets = [0, *np.cumsum(counts).tolist()]
    surfaces = [surface for _, surface, _ in each]
    contacts = Contacts.of(model, surfaces, offsets, iterates=iterates)
    law = contacts.friction(scene, tolerance, 50 * numbers.max_iterations)
    # Nodes that each have a gap of their own: nothing has to be weighed.
    alone = len(each) == 1 and not few and law is None and not contacts.pairs
    alone = alone and model.joints is None and bool(contacts.obstacles)
    alone = alone and not contacts.obstacles[0].gaps.shares_nodes
    gaps: ContactGaps = contacts.obstacles[0].gaps if alone else contacts.gaps()
    solver, kind = _solver(numbers, tolerance), numbers.linear_solver
    settings = LoopSettings(
        model.comm, scheme, gaps, solver, layers, tolerance, friction=law,
        most_pairs=MOST_PAIRS, springs=contacts.springs(scene),
        restitution=contacts.restitution(scene), poisson=contacts.impulsive(scene),
    )  # fmt: skip
    if iterates:
        if limit is not None:
            explicit = [
                FiniteLeapfrog(
                    part.system, part.solid, surface, transfer, dt,
                    fitting_solver(kind, part.system.num_dofs, model.dim), limit,
                )
                for part, surface, transfer in each
            ]  # fmt: skip
            together: LevelStepper = explicit[0] if alone else LeapfrogBodies(explicit)
            started = _brought_to_rest(explicit, together, model, surfaces, settings, progress)
            level = LevelMarch if alone else CoupledLevels
            march = level(together, replace(settings, rest=_rest(started)))
            return Loop(march, gaps, contacts, offsets, started)
        bodies = [
            FiniteMidpoint(part.system, part.solid, surface, transfer, dt, kind)
            for part, surface, transfer in each
        ]
        beside = [
            cast("NewtonStepper", part)
            if isinstance(part, PlateNewton)
            else Iterated(cast("Resolving", part))
            for part in cast("list[Any]", _steppers(model, few))
        ]
        interior: NewtonStepper = bodies[0] if alone else NewtonBodies([*bodies, *beside])
        if model.joints is not None:
            holding = [few[at - len(each)].held(own) for at, own in model.joints.parts]
            interior = JointedNewton([*bodies, *beside], model.joints, holding)
        plates = cast("Sequence[PlateMidpoint]", few)
        started = _brought_to_rest(bodies, interior, model, surfaces, settings, progress, plates)
        newton = NewtonMarch(interior, replace(settings, rest=_rest(started)))
        return Loop(newton, gaps, contacts, offsets, started)
    tipped = {} if model.joints is None else dict(model.joints.parts)
    tips = {
        k: _tipped(*parts, dt, kind, model.tips[k].nodes, tipped[k])
        for k, parts in enumerate(each)
        if k in tipped
    }
    solids = [tips.get(k) or _interior(*parts, scheme, dt, kind) for k, parts in enumerate(each)]
    parts, movable = [*solids, *_steppers(model, few)], [_free(*parts[:2]) for parts in each]
    composite = Composite(parts, movable)
    if model.joints is not None:
        held = [
            (tips.get(place) or few[place - len(each)]).held(stations)
            for place, stations in model.joints.parts
        ]
        composite = Jointed(parts, movable, model.joints, held)
    started = None
    if scene.starts_at_rest:
        progress.step("bringing the bodies to rest")
        linear = linear_bodies(model, each, kind)
        started = start_at_rest(
            model, linear, surfaces, composite, composite.static, gaps,
            Pressing(solver, tolerance, settings.springs),
            plates=cast("Sequence[PlateMidpoint]", few),
        )  # fmt: skip
    whole: Interior = solids[0] if alone else composite
    settings = replace(settings, rest=_rest(started))
    linear_march = SolidMarch if law is None else RubbingMarch
    return Loop(linear_march(whole, settings), gaps, contacts, offsets, started)


def _steppers(model: SolidsModel, few: Sequence[Marched]) -> list[Interior]:
    """What steps bodies without meshes: those of a kind that follow each other without joints."""
    joined, first = set(), len(model.parts)
    if model.joints is not None:
        joined = {place - first for place, _ in model.joints.parts}
    kinds = [type(part) for part in few]
    for (made, held), places in groupby(range(len(few)), lambda k: (kinds[k], k in joined)):
        if not held:
            made.step_together([few[k] for k in places])
    return list(dict.fromkeys(part.stepper for part in few))


def _rest(started: Started | None) -> tuple[Floats, Floats] | None:
    """What a march takes of the equilibrium that it starts from."""
    return None if started is None else (started.rest.multiplier, started.static)


def _brought_to_rest(
    bodies: Sequence[FiniteBody],
    interior: Stepper,
    model: SolidsModel,
    surfaces: Sequence[SurfaceNodes],
    settings: LoopSettings,
    progress: Progress,
    plates: Sequence[PlateMidpoint] = (),
) -> Started | None:
    """Start bodies among which some have finite strain at rest, if their scene asks for it.

    Args:
        bodies: The solids.
        interior: What marches all bodies.
        model: See `make_loop`, and so are the others.
        surfaces: Contact nodes of the solids.
        settings: Of the march.
        progress: See there.
        plates: What marches plates.

    Returns:
        How they came to rest; None if it was not asked for.
    """
    scene = model.scene
    if not scene.starts_at_rest:
        return None
    progress.step("bringing the bodies to rest")
    gravity = np.asarray(scene.vector_gravity.at(0.0))
    spins = [spin_of(part) for part in model.parts]
    resting = [
        body.at_rest(part.solid.name, gravity, spin)
        for body, part, spin in zip(bodies, model.parts, spins, strict=True)
    ]
    ends = np.cumsum([0, *(surface.count for surface in surfaces)])

    def arms(there: Floats, places: Sequence[Floats]) -> Floats:
        """As the march has them: solids of small strains turn none, they move with the centre."""
        found = there.copy()  # of plates, which come last, where they are
        for part, place, own in zip(model.parts, places, pairwise(ends), strict=False):
            if not part.solid.is_finite:
                found[slice(*own)] = part.system.mean(place)
        return found

    started = start_at_rest(
        model, resting, surfaces, interior, np.zeros_like, settings.gaps,
        Pressing(settings.active_set, settings.tolerance, settings.springs), arms, plates,
    )  # fmt: skip
    for body, spin in zip(bodies, spins, strict=True):
        body.turn(spin)
    return started


def _size(model: SolidsModel, few: Sequence[FewInterior], dt: float) -> float:
    """Largest extent of the bodies [m], of bodies without meshes what coordinates round by.

    Their places may be 0, and a point has no extent: so their ways count too (collective).
    """
    positions = (gather(model.comm, part.system.positions) for part in model.parts)
    sizes = [float(np.ptp(each, axis=0).max()) for each in positions]
    for march in few:
        bodies, speed = march.bodies, np.abs(march.surface_velocity).max()
        sizes += [float(np.abs(bodies.places(bodies.position)).max()), float(bodies.radius.max())]
        sizes.append(float(rounding(model.scene, speed, dt)))
    return max(sizes)


def rounding(scene: Scene, speed: Floats, dt: float) -> Floats:
    """Ways in some layers of places with speeds at t = 0 [m/s], by which coordinates round [m]."""
    some = _LAYERS * dt
    pull = float(np.linalg.norm(scene.vector_gravity.values, axis=1).max())
    return speed * some + 0.5 * pull * some**2


def _solver(numbers: "MarchNumbers", tolerance: float) -> Solver:
    if numbers.active_set == "snes_vi":
        from impactfem.contact.snes_vi import solve_by_snes_vi  # noqa: PLC0415  (rarely asked)

        return solve_by_snes_vi(tolerance, numbers.max_iterations)
    return solve_by_active_set(tolerance, numbers.max_iterations)


def _tipped(
    part: SolidPart,
    surface: SurfaceNodes,
    transfer: object,
    dt: float,
    linear_solver: str,
    nodes: SurfaceNodes,
    stations: Stations,
) -> TippedMidpoint:
    statics = None if transfer is None else SurfaceStatics(part.system.stiffness, surface)
    return TippedMidpoint(
        part.system, surface, statics, transfer, dt, linear_solver, nodes, stations
    )


def _interior(
    part: SolidPart,
    surface: SurfaceNodes,
    transfer: object,
    scheme: SolidScheme,
    dt: float,
    linear_solver: str,
) -> Interior:
    statics = None if transfer is None else SurfaceStatics(part.system.stiffness, surface)
    if scheme.explicit:
        return Leapfrog(part.system, surface, statics, transfer, dt)
    return Midpoint(part.system, surface, statics, transfer, dt, linear_solver)


def _free(part: SolidPart, surface: SurfaceNodes) -> Floats:
    """1 where a contact node may move and 0 where a support holds it, (count, dim)."""
    return surface.gather((~part.system.constrained).astype(float))
