"""Make the time loop of a scene: bodies, their gaps, the solver of contact, their start."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.complementarity import Solver, solve_by_active_set
from impactfem.contact.gaps_beside import GapsBeside
from impactfem.errors import SceneError
from impactfem.fem import gather
from impactfem.log import Progress
from impactfem.marching.between_levels import BetweenLevels, LevelsBeside, Still
from impactfem.marching.composite import Composite
from impactfem.marching.coupled_levels import CoupledLevels
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
from impactfem.marching.marched import Marched
from impactfem.marching.midpoint import Midpoint
from impactfem.marching.newton_bodies import NewtonBodies, NewtonStepper
from impactfem.marching.newton_march import NewtonMarch
from impactfem.marching.plate_newton import PlateNewton
from impactfem.marching.pressing import Pressing
from impactfem.marching.resting import Resting
from impactfem.marching.rubbing_march import RubbingMarch
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.solids import SolidMarch
from impactfem.marching.staggered import Staggered
from impactfem.marching.static_start import Arms
from impactfem.marching.stations import Held
from impactfem.marching.time_loop import LoopSettings, TimeLoop
from impactfem.marching.tipped import TippedMidpoint
from impactfem.models.solids import SolidPart, SolidsModel
from impactfem.planning.solid_choices import fitting_solver
from impactfem.result.history import MOST_PAIRS
from impactfem.runs.contacts import Contacts
from impactfem.runs.static_start import Started, linear_bodies, spin_of, start_at_rest
from impactfem.scene import Scene
from impactfem.system.stations import Stations
from impactfem.system.surface import SurfaceNodes, SurfaceStatics

if TYPE_CHECKING:
    from impactfem.contact.impact_law import Law
    from impactfem.planning import MarchNumbers


_LAYERS = 100  # whose way tells how coordinates round

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
        joined: What joints hold, with them; None without any.
    """

    march: TimeLoop[Any]
    gaps: ContactGaps
    contacts: Contacts
    offsets: list[int]
    started: Started | None = None
    joined: Any = None


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
    *,
    rests: bool,
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
        rests: Whether it starts from equilibrium.

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
    contacts = Contacts.of(model, surfaces, offsets)
    law = contacts.friction(scene, tolerance, 50 * numbers.max_iterations)
    # Nodes that each have a gap of their own: nothing has to be weighed.
    alone = len(each) == 1 and not few and law is None and not contacts.pairs
    alone = alone and model.joints is None and bool(contacts.obstacles)
    alone = alone and not contacts.obstacles[0].gaps.shares_nodes
    gaps: ContactGaps = contacts.obstacles[0].gaps if alone else contacts.gaps()
    solver = _solver(numbers, tolerance)
    settings = LoopSettings(
        model.comm, scheme, gaps, solver, layers, tolerance, friction=law,
        most_pairs=MOST_PAIRS, springs=contacts.springs(scene), bonds=contacts.bonds(scene),
        restitution=contacts.restitution(scene), speed_laws=contacts.speed_laws(scene),
        poisson=contacts.impulsive(scene),
        impact_law=cast("Law", scene.solve.impact_law or "simultaneous"),
    )  # fmt: skip
    made = _Making(
        model, numbers.linear_solver, scheme, each, few, surfaces, contacts, settings, progress, dt,
        alone, rests,
    )  # fmt: skip
    if not iterates:
        started, joined, march = made.linear()
    elif limit is None:
        started, joined, march = made.iterated()
    else:
        started, joined, march = made.levels(limit)
    return Loop(march, march.gaps, contacts, offsets, started, joined if model.joints else None)


@dataclass(frozen=True)
class _Making:
    """What marches are made of; see `make_loop`.

    Attributes:
        kind: Of the linear solver.
        surfaces: Contact nodes of the solids.
        settings: Of the march, but for its start.
        dt: Time step [s].
        alone: Whether each contact node of one solid has one gap.
        rests: Whether the march starts from equilibrium.
    """

    model: SolidsModel
    kind: str
    scheme: SolidScheme
    each: Sequence[Discretised]
    few: Sequence[Marched]
    surfaces: Sequence[SurfaceNodes]
    contacts: Contacts
    settings: LoopSettings
    progress: Progress
    dt: float
    alone: bool
    rests: bool

    def _beginning(self, started: Started | None) -> LoopSettings:
        """The settings, with what a march takes of the equilibrium that it starts from."""
        if started is None:
            return self.settings
        rest = started.rest
        return replace(self.settings, rest=(rest.multiplier, started.static, rest.rubbing))

    def _brought_to_rest(
        self, bodies: Sequence[FiniteBody], interior: Stepper, joined: NewtonBodies | None = None
    ) -> Started | None:
        """Start bodies among which some have finite strain at rest, if their scene asks for it.

        Args:
            bodies: The solids.
            interior: What marches all bodies.
            joined: Those among which joints are, if they are stepped apart.

        Returns:
            How they came to rest; None if it was not asked for.
        """
        model = self.model
        if not self.rests:
            return None
        gravity = np.asarray(model.scene.vector_gravity.at(0.0))
        spins = [spin_of(part) for part in model.parts]
        resting = [
            body.at_rest(part.solid.name, gravity, spin)
            for body, part, spin in zip(bodies, model.parts, spins, strict=True)
        ]
        ends = np.cumsum([0, *(surface.count for surface in self.surfaces)])

        def arms(there: Floats, places: Sequence[Floats]) -> Floats:
            """As the march has them: solids of small strains turn none, they move with the centre.

            Others, which come last, are where they are.
            """
            found = there.copy()
            for part, place, own in zip(model.parts, places, pairwise(ends), strict=False):
                if not part.solid.is_finite:
                    found[slice(*own)] = part.system.mean(place)
            return found

        started = self._start(resting, interior, np.zeros_like, arms, joined or interior)
        for body, spin in zip(bodies, spins, strict=True):
            body.turn(spin)
        return started

    def _start(
        self, resting: Sequence[Resting], interior: Stepper, static: Callable[[Floats], Floats],
        arms: Arms | None, joined: Any,
    ) -> Started:  # fmt: skip
        """Bring bodies to rest; see `start_at_rest`."""
        self.progress.step("bringing the bodies to rest")
        settings = self.settings
        # Levels that share forces with the layer before t = 0 know no friction there.
        rubs = None if self.scheme.shares_forces else settings.friction
        pressing = Pressing(settings.active_set, settings.tolerance, settings.springs)
        others = list(dict.fromkeys(part.stepper for part in self.few))
        joints, first, jointed = self.model.joints, len(self.each), None
        if joints is not None:
            steppers = [
                self.few[at - first].stepper if at >= first else None for at, _ in joints.parts
            ]
            held = [
                at if stepper is None else first + others.index(stepper)
                for (at, _), stepper in zip(joints.parts, steppers, strict=True)
            ]
            jointed = joined, held
        return start_at_rest(
            self.model, resting, self.surfaces, interior, static, settings.gaps, pressing, arms,
            others, rubs, jointed,
        )  # fmt: skip

    def levels(self, limit: float) -> tuple[Started | None, Any, TimeLoop[Any]]:
        """Of solids under finite strain in explicit steps, stable up to a limit [s]."""
        kind, dim = self.kind, self.model.dim
        bodies = [
            FiniteLeapfrog(
                part.system, part.solid, surface, transfer, self.dt,
                fitting_solver(kind, part.system.num_dofs, dim), limit,
            )
            for part, surface, transfer in self.each
        ]  # fmt: skip
        together: LevelStepper = bodies[0] if self.alone else LeapfrogBodies(bodies)
        tipped, gravity = {k: bodies[k] for k in self._tipped}, self.model.scene.vector_gravity
        if not (self.few or tipped):
            march = LevelMarch if self.alone else CoupledLevels
            started = self._brought_to_rest(bodies, together)
            return started, None, march(together, self._beginning(started))
        count, tips = sum(surface.count for surface in self.surfaces), dict[int, NewtonStepper]()
        for k, body in tipped.items():
            nodes, system = self.model.tips[k].nodes, self.each[k][0].system
            free, places = body.hold(nodes, gravity), nodes.gather(system.positions.ravel())
            given = free, free.nodes, self._tipped[k], places.ravel()
            tips[k] = _finite_tipped(*given, counts=free.counts)
        still = cast("NewtonStepper", Still(gravity, self.dt, count))
        joined = self._joined([still, *tips.values()], tips)
        started = self._brought_to_rest(bodies, together, joined)
        settings, solids = self._beginning(started), {part.solid.name for part in self.model.parts}
        gaps = GapsBeside(*(each.gaps() for each in self.contacts.split(solids)))
        own = np.array([bool({*names} & solids) for names in self.contacts.names], dtype=bool)
        among = replace(settings.of(np.flatnonzero(~own), gaps.second), layers=0)
        beside = BetweenLevels(joined, among, count, tipped)
        settings = settings.of(np.argsort(~own, kind="stable"), cast("ContactGaps", gaps))
        every = LevelsBeside(bodies, beside)
        return started, joined, CoupledLevels(every, settings, beside)

    def _joined(
        self, solids: Sequence[NewtonStepper], tips: Mapping[int, NewtonStepper]
    ) -> NewtonBodies:
        """Bodies without meshes behind others, in steps by iterates, with what joints hold.

        Args:
            solids: What is in front of them.
            tips: Those of it that joints hold, by the places of their solids.
        """
        joints, first = self.model.joints, len(self.each)
        beside = [
            cast("NewtonStepper", part)
            if isinstance(part, PlateNewton)
            else Iterated(cast("Resolving", part))
            for part in cast("list[Any]", _steppers(self.model, self.few))
        ]
        if joints is None:
            return NewtonBodies([*solids, *beside])
        each = joints.parts
        held = _held([(tips[a] if a < first else self.few[a - first], own) for a, own in each])
        return JointedNewton([*solids, *beside], joints, held)

    @property
    def _tipped(self) -> dict[int, Stations]:
        """Tips of the solids that joints hold."""
        joints = self.model.joints
        each = () if joints is None else joints.parts
        return {at: stations for at, stations in each if at < len(self.each)}

    def iterated(self) -> tuple[Started | None, Any, TimeLoop[Any]]:
        """Of bodies whose steps are solved by iterates; what joints hold is with them."""
        kind, held, bodies = self.kind, self._tipped, list[FiniteMidpoint]()
        steppers = list[NewtonStepper]()
        for k, (part, surface, transfer) in enumerate(self.each):
            made = FiniteMidpoint(part.system, part.solid, surface, transfer, self.dt, kind)
            bodies.append(made)
            steppers.append(cast("NewtonStepper", made))
            if k in held:
                places = part.system.positions.ravel() if part.solid.is_finite else None
                counts, nodes = part.system.comm.rank == 0, self.model.tips[k].nodes
                steppers[k] = _finite_tipped(made, nodes, held[k], places, counts=counts)
        interior = steppers[0] if self.alone else self._joined(steppers, dict(enumerate(steppers)))
        started = self._brought_to_rest(bodies, interior)
        return started, interior, NewtonMarch(interior, self._beginning(started))

    def linear(self) -> tuple[Started | None, Any, TimeLoop[Any]]:
        """Of bodies whose steps are linear but for contact; what joints hold is with them."""
        model, joints, settings = self.model, self.model.joints, self.settings
        kind, few = self.kind, self.few
        tipped = self._tipped
        # Solids in explicit steps of which joints hold some take steps that end amid layers, too.
        led = self.scheme.explicit and bool(tipped)
        solids = [
            _interior(
                *parts, self.scheme, self.dt, kind,
                (model.tips[k].nodes, tipped.get(k)) if led or k in tipped else None,
            )
            for k, parts in enumerate(self.each)
        ]  # fmt: skip
        steppers, movable = _steppers(model, few), [_free(*parts[:2]) for parts in self.each]
        every, holds = [*solids, *few], () if joints is None else joints.parts
        held = _held([(every[at], own) for at, own in holds])
        amid = self.scheme.explicit and (led or steppers)  # bodies whose steps end amid layers
        inner, free = ([*solids, *steppers], movable)
        if amid and not led:
            inner, free = steppers, []
        if joints is not None:
            joined: Any = Jointed(inner, free, joints, held)
        else:
            joined = Composite(inner, free) if amid or len(inner) > 1 or free else inner[0]
        whole = joined
        if amid:
            staggered = Staggered(joined).as_interior()
            whole = staggered if led else Composite([*solids, staggered], movable)
        started = None
        if self.rests:
            linear = linear_bodies(model, self.each, kind)
            started = self._start(linear, whole, whole.static, None, joined)
        march = SolidMarch if settings.friction is None else RubbingMarch
        interior = solids[0] if self.alone else whole
        return started, joined, march(interior, self._beginning(started))


def _steppers(model: SolidsModel, few: Sequence[Marched]) -> list[Interior]:
    """What steps bodies without meshes: those of a kind that follow each other, held or not."""
    joined, first = set(), len(model.parts)
    if model.joints is not None:
        joined = {place - first for place, _ in model.joints.parts}
    kinds = [type(part) for part in few]
    for (made, _), places in groupby(range(len(few)), lambda k: (kinds[k], k in joined)):
        made.step_together([few[k] for k in places])
    return list(dict.fromkeys(part.stepper for part in few))


def _held(each: Sequence[tuple[Any, Stations]]) -> list[Held]:
    """What joints hold, in order; bodies that are stepped together are held at once."""
    found = dict[Any, Held]()
    for body, stations in each:
        stepper = getattr(body, "stepper", body)
        if stepper not in found:
            found[stepper] = body.held(stations)
    return list(found.values())


def _size(model: SolidsModel, few: Sequence[Marched], dt: float) -> float:
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


def _interior(
    part: SolidPart,
    surface: SurfaceNodes,
    transfer: object,
    scheme: SolidScheme,
    dt: float,
    linear_solver: str,
    tips: tuple[SurfaceNodes, Stations | None] | None,
) -> Interior:
    """What steps a solid; with ``tips`` as joints hold it, or beside one that they hold."""
    statics = None if transfer is None else SurfaceStatics(part.system.stiffness, surface)
    given = part.system, surface, statics, transfer, dt
    if scheme.explicit:
        if tips is None:
            return Leapfrog(*given)
        from impactfem.marching.tipped_leapfrog import TippedLeapfrog  # noqa: PLC0415  (rarely)

        return cast("Interior", TippedLeapfrog(*given).with_tips(*tips))
    if not callable(scheme.interior):
        if tips is None:
            return Midpoint(*given, linear_solver)
        return TippedMidpoint(*given, linear_solver).with_tips(*tips)
    if tips is not None:
        name = getattr(scheme.interior, "__name__", "")
        raise SceneError(
            f"solve.method: the inside of {part.solid.name} is moved by {name}, and joints hold "
            'solids in the midpoint rule only; give another, as "massless", or leave the joint out'
        )
    if part.solid.relaxing:
        raise SceneError(
            f"solve.method: an extension moves the inside of {part.solid.name}, and its "
            'Maxwell terms (viscoelastic) relax in the midpoint rule only; give "massless"'
        )
    made: Interior = scheme.interior(*given, linear_solver)
    return made


def _finite_tipped(*given: Any, counts: bool) -> NewtonStepper:
    """See `FiniteTipped`."""
    from impactfem.marching.finite_tipped import FiniteTipped  # noqa: PLC0415  (if joints hold it)

    return cast("NewtonStepper", FiniteTipped(*given, counts=counts))


def _free(part: SolidPart, surface: SurfaceNodes) -> Floats:
    """1 where a contact node may move and 0 where a support holds it, (count, dim)."""
    return surface.gather((~part.system.constrained).astype(float))
