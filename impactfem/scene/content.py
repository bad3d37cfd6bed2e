"""What a scene holds, and what follows from it: which bodies there are, and what solves them."""

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from impactfem.errors import SceneError
from impactfem.methods import METHODS
from impactfem.scene.beams import Beam, Rod
from impactfem.scene.bodies import Bar
from impactfem.scene.body import Solver
from impactfem.scene.boundary import supports_of
from impactfem.scene.contacts import Contact
from impactfem.scene.control import MAX_CONTROLS, Control
from impactfem.scene.controllers import MAX_CONTROLLERS, Controller
from impactfem.scene.couplings import SpringElement
from impactfem.scene.drop import Drop
from impactfem.scene.given import Given
from impactfem.scene.inverse import MAX_MEASURES, MAX_PARAMETERS, Measure, Objective, Parameter
from impactfem.scene.joints import Joint
from impactfem.scene.kinds import Choice, Line, Real
from impactfem.scene.laws import Laws, side_of
from impactfem.scene.loads import LoadKind, PiecewiseConstant, PiecewiseVector
from impactfem.scene.masses import PointMass
from impactfem.scene.mechanism import Mechanism
from impactfem.scene.obstacles import OBSTACLES, Rigid, Wall
from impactfem.scene.plate import Plate
from impactfem.scene.points import Point
from impactfem.scene.probes import MAX_PROBES, Probe
from impactfem.scene.rigid import RigidBody
from impactfem.scene.schema import TOP, aside, key, table
from impactfem.scene.settings import Output, Solve
from impactfem.scene.solids import Solid
from impactfem.scene.springs import SpringNet
from impactfem.scene.tables import MAX_BODIES, MAX_OBSTACLES, ObjectsKind, SettingsKind
from impactfem.scene.ties import Tie
from impactfem.scene.trajectory import TrajectoryKeys
from impactfem.scene.values import show

type Body = Bar | Solid | Point | Rod | Beam | RigidBody | Mechanism | SpringNet | Plate
type Obstacle = Wall | Rigid

BODIES: dict[str, type[Any]] = {
    cls.kind: cls for cls in (Bar, Solid, Point, Rod, Beam, RigidBody, Mechanism, SpringNet, Plate)
}
"""All kinds by name; `impactfem.extend` adds others."""
MAX_CONTACTS = 10_000
MAX_JOINTS = 10_000
MAX_SPRINGS = 10_000
MAX_TIES = 10_000
MAX_MASSES = 10_000
STARTS = ("given", "static")


@table(TOP)
class Content:
    """The tables of a scene, which `impactfem.scene.scene.Scene` reads and checks."""

    title: str = key(Line(), "title of figures and reports")
    duration: float = key(Real(above=0), "time to simulate", unit="s")
    gravity: Given[PiecewiseConstant | PiecewiseVector, float | Sequence[Any]] = key(
        LoadKind(),
        "acceleration, of bars towards the wall; in a table, the value from each time on",
        unit="m/s^2",
        default=0.0,
    )
    start: str = key(
        Choice(STARTS),
        "state before velocities are added: as given, or equilibrium of loads, gravity, supports "
        "and contact at t = 0",
        default=STARTS[0],
    )
    bodies: Given[tuple[Body, ...], Sequence[Body]] = key(
        ObjectsKind(BODIES.values(), "[[body]]", MAX_BODIES), "what moves", name="body"
    )
    obstacles: Given[tuple[Obstacle, ...], Sequence[Obstacle]] = key(
        ObjectsKind(OBSTACLES.values(), "[[obstacle]]", MAX_OBSTACLES, 0),
        "what it may hit; only points, rigid bodies and rows of bars may do without",
        name="obstacle",
        default=(),
    )
    contacts: Given[tuple[Contact, ...], Sequence[Contact]] = key(
        ObjectsKind((Contact,), "[[contact]]", MAX_CONTACTS, 0),
        "which pairs meet; every body and obstacle, and every two solids, if there are none",
        name="contact",
        default=(),
    )
    joints: Given[tuple[Joint, ...], Sequence[Joint]] = key(
        ObjectsKind((Joint,), "[[joint]]", MAX_JOINTS, 0),
        "what holds rigid bodies together",
        name="joint",
        default=(),
    )
    springs: Given[tuple[SpringElement, ...], Sequence[SpringElement]] = key(
        ObjectsKind((SpringElement,), "[[spring]]", MAX_SPRINGS, 0),
        "springs and dampers between places",
        name="spring",
        default=(),
    )
    ties: Given[tuple[Tie, ...], Sequence[Tie]] = key(
        ObjectsKind((Tie,), "[[tie]]", MAX_TIES, 0),
        "surfaces that stay together",
        name="tie",
        default=(),
    )
    masses: Given[tuple[PointMass, ...], Sequence[PointMass]] = key(
        ObjectsKind((PointMass,), "[[point_mass]]", MAX_MASSES, 0),
        "masses that bodies carry",
        name="point_mass",
        default=(),
    )
    probes: Given[tuple[Probe, ...], Sequence[Probe]] = key(
        ObjectsKind((Probe,), "[[probe]]", MAX_PROBES, 0),
        "places whose motion is kept in the history",
        name="probe",
        default=(),
    )
    parameters: Given[tuple[Parameter, ...], Sequence[Parameter]] = key(
        ObjectsKind((Parameter,), "[[parameter]]", MAX_PARAMETERS, 0),
        "numbers that may vary",
        name="parameter",
        default=(),
    )
    controls: Given[tuple[Control, ...], Sequence[Control]] = key(
        ObjectsKind((Control,), "[[control]]", MAX_CONTROLS, 0),
        "histories in pieces that may vary",
        name="control",
        default=(),
    )
    controllers: Given[tuple[Controller, ...], Sequence[Controller]] = key(
        ObjectsKind((Controller,), "[[controller]]", MAX_CONTROLLERS, 0),
        "feedback of columns to forces and motors",
        name="controller",
        default=(),
    )
    measures: Given[tuple[Measure, ...], Sequence[Measure]] = key(
        ObjectsKind((Measure,), "[[measure]]", MAX_MEASURES, 0),
        "what is looked at, or was measured",
        name="measure",
        default=(),
    )
    objective: Objective | None = key(
        SettingsKind(Objective, "[objective]"), "what is wanted", default=None,
        absent="the misfits of all measures with data",
    )  # fmt: skip
    trajectory: TrajectoryKeys | None = key(
        SettingsKind(TrajectoryKeys, "[trajectory]"), "a motion that controls shall reach",
        default=None, absent="none",
    )  # fmt: skip
    drop: Drop | None = key(
        SettingsKind(Drop, "[drop]"), "a fall at whose end the scene starts", default=None,
        absent="none",
    )  # fmt: skip
    solve: Solve = key(SettingsKind(Solve, "[solve]"), "how to solve", default=Solve())
    output: Output = key(SettingsKind(Output, "[output]"), "what to write", default=Output())
    folder: Given[Path | None, str | os.PathLike[str]] = aside()

    @cached_property
    def laws(self) -> Laws:
        """Its contact laws, each of two names."""
        names = tuple(body.name for body in self.bodies if not body.attached)
        obstacles = tuple(obstacle.name for obstacle in self.obstacles)
        held = tuple(joint.bodies for joint in self.holding)
        return Laws.among(self.contacts, names, obstacles, held)

    @cached_property
    def holding(self) -> tuple[Joint, ...]:
        """Its joints and ties: what holds bodies together."""
        ties = (tie.rows(self.dim) for tie in self.ties)
        return (*(self._of_part(joint) for joint in self.joints), *ties)

    @cached_property
    def couplings(self) -> tuple[Joint, ...]:
        """These, and its springs as rows that hold nothing."""
        rows = (row for spring in self.springs for row in spring.rows(self.dim))
        return (*self.holding, *map(self._of_part, rows))

    def _of_part(self, joint: Joint) -> Joint:
        """What acts in a joint on the part that planes of symmetry leave of its bodies."""
        cuts = (body.cuts for body in self.bodies if body.name in joint.bodies)
        return joint.of_part(0.5 ** max(map(len, cuts), default=0))

    def table_of(self, coupling: int) -> str:
        """Table of one of its `couplings`, for messages."""
        first, joint = len(self.joints), self.couplings[coupling]
        masses = [mass.name for mass in self.masses]
        if joint.name in masses:
            return f"point_mass[{masses.index(joint.name)}]"
        if coupling >= len(self.holding):
            return joint.heading
        return f"{joint.heading}[{coupling if coupling < first else coupling - first}]"

    def holds_alone(self, coupling: int) -> bool:
        """Whether no other may hold the nodes of one of its `couplings`: springs leave them free.

        Masses on the same place add up.
        """
        masses = {mass.name for mass in self.masses}
        return coupling < len(self.joints) and self.couplings[coupling].name not in masses

    @property
    def sampled(self) -> tuple[Controller, ...]:
        """Its controllers that are sampled, whose outputs are held between samples."""
        return tuple(each for each in self.controllers if not each.in_steps)

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of its bodies."""
        return frozenset(body.kind for body in self.bodies)

    @property
    def said(self) -> tuple[str, ...]:
        """What it names of what extensions may add, as "body frame"."""
        named = [("body", b.kind) for b in self.bodies]
        named += [("obstacle", o.kind) for o in self.obstacles]
        named += [("method", self.solve.method)] if self.solve.method else []
        named += [("law", c.restitution_law or "") for c in self.contacts if c.by_speed]
        return tuple(f"{what} {name}" for what, name in dict.fromkeys(named))

    @property
    def bar(self) -> Bar:
        """The bar of the scene.

        Raises:
            SceneError: there is none, or there are several.
        """
        if len(self.bars) > 1:
            names = ", ".join(bar.name for bar in self.bars)
            raise SceneError(f"body: this needs a single bar, the scene has {names}; give one.")
        return self.bars[0] if self.bars else self._first(Bar)

    @cached_property
    def bars(self) -> tuple[Bar, ...]:
        """The bars of the scene in the order of their axis; none if the march takes them.

        It does beside other bodies, with joints, in a row that falls or starts at rest, and where a
        contact gives way, unless a method is to solve it that knows the spring of a wall: the bar
        then has its stiffness.
        """
        bars = self._all(Bar)
        if len(bars) != len(self.bodies) or self.couplings or self.sampled:
            return ()
        row, on_axis = len(bars) > 1, bars[0].point is None
        pulled = (row and self.starts_at_rest) or ((row or not self.obstacles) and self._falls)
        if pulled and on_axis:
            return ()
        if self.gives_way:
            wall = self._spring_wall
            bars = () if wall is None else (replace(bars[0], wall_stiffness=wall),)
        if not self.starts_at_rest or len(bars) != 1:
            return bars
        from impactfem.scene.bar_rest import resting  # noqa: PLC0415  (rare)

        return (resting(bars[0], float(self.axial_gravity(0.0))),)

    @cached_property
    def _spring_wall(self) -> float | None:
        """Stiffness of the wall of a lone bar [N/m] where the method asked for knows one.

        So does the one of bars that waves do not tell, if none is asked for.
        """
        asked = self.solve.method
        if asked is None and not self._all(Bar)[0].is_plain:
            asked = next(name for name, each in METHODS.items() if each.spring_walls)
        method = METHODS.get(asked or "")
        if method is None or not method.spring_walls or len(self.bodies) + len(self.obstacles) > 2:
            return None
        ends = {each.name for each in (*self.bodies, *self.obstacles)}
        laws = [law for law in self.laws.each if set(law.between) == ends]
        plain = len(laws) == len(self.contacts) == 1 and laws[0].stiffness_exponent == 1.0
        plain = plain and not laws[0].damping
        return laws[0].stiffness if plain and not laws[0].friction_coefficient else None

    @property
    def points(self) -> tuple[Point, ...]:
        """The points of the scene."""
        return self._all(Point)

    @property
    def plates(self) -> tuple[Plate, ...]:
        """The plates of the scene."""
        return self._all(Plate)

    @property
    def mechanisms(self) -> tuple[Mechanism, ...]:
        """The mechanisms of the scene."""
        return self._all(Mechanism)

    @property
    def meshed(self) -> tuple[Any, ...]:
        """The bodies of the scene that have elements."""
        return tuple(body for body in self.bodies if body.meshed)

    @property
    def resized(self) -> tuple[Any, ...]:
        """The bodies on whose elements, made larger or smaller, runs tell the error."""
        along = (body.in_elements and body.turns_far for body in self.bodies)
        return tuple(b for b, far in zip(self.bodies, along, strict=True) if b.meshed or far)

    @property
    def solids(self) -> tuple[Solid, ...]:
        """The solids of the scene."""
        return self._all(Solid)

    @property
    def solid(self) -> Solid:
        """The first solid of the scene.

        Raises:
            SceneError: there is none.
        """
        return self._first(Solid)

    def _all[T](self, cls: type[T]) -> tuple[T, ...]:
        return tuple(body for body in self.bodies if isinstance(body, cls))

    def _first[T](self, cls: type[T]) -> T:
        for body in self._all(cls):
            return body
        given = show(list(self.bodies))
        raise SceneError(f"body = {given}: this needs a {cls.__name__}; give one.")

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return self.bodies[0].dim

    @property
    def starts_at_rest(self) -> bool:
        """Whether bodies are in equilibrium before their velocities are added."""
        return self.start == STARTS[1]

    @property
    def ends(self) -> tuple[float, ...]:
        """Times within the duration at which supports let go [s], in order."""
        every = (each.until for body in self.bodies for each in supports_of(body))
        return tuple(sorted({end for end in every if end is not None and end < self.duration}))

    def after(self, time: float) -> Self:
        """The scene with the supports that are left after a time [s]."""
        bodies: list[Any] = []
        body: Any
        for body in self.bodies:
            kept = tuple(s for s in supports_of(body) if s.until is None or s.until > time)
            gone = len(kept) < len(supports_of(body))
            bodies.append(replace(body, supports=kept) if gone else body)
        return replace(self, bodies=tuple(bodies))

    @property
    def iterated(self) -> str:
        """Why steps are solved by iterates: the first body that asks for it, in words; or empty."""
        each = (f"{body.name} {body.why_iterated}" for body in self.bodies if body.why_iterated)
        return next(each, f"{self._into_itself} meets itself" if self._into_itself else "")

    @cached_property
    def _into_itself(self) -> str:
        """Name of the first body that meets itself; empty if none does."""
        if not any(body.meets_itself for body in self.bodies):
            return ""
        each = ({side_of(name)[0] for name in law.between} for law in self.laws.each)
        return next((sides.pop() for sides in each if len(sides) == 1), "")

    @property
    def marches(self) -> bool:
        """Whether the march of solids, and of bodies of any kind, solves it."""
        return self.solver == "march"

    @property
    def solver(self) -> Solver:
        """What solves it: what its bodies say if they are alike and this does, else the march."""
        if self.in_coordinates and not self.starts_at_rest:
            return "vibro"
        several = len(self.bodies) > 1 or not self.obstacles
        own = {body.solvers[several] for body in self.bodies}
        return own.pop() if len(own) == 1 and self.why_marched is None else "march"

    @property
    def in_coordinates(self) -> bool:
        """Whether a body that else marches has a method named that takes coordinates instead."""
        method = METHODS.get(self.solve.method or "")
        coordinates = all(body.has_coordinates for body in self.bodies)
        return bool(method and coordinates and not method.mixes and self.kinds <= method.bodies)

    @property
    def why_marched(self) -> str | None:
        """Why bodies need the march, in words; None if what they say solves them."""
        return why_marched(self)

    @property
    def _falls(self) -> bool:
        """Whether gravity acts at any time, or is given as of bodies in space."""
        vector = isinstance(self.gravity, PiecewiseVector)
        return vector or not self.gravity.is_constant or self.gravity.values[0] != 0.0

    @property
    def gives_way(self) -> bool:
        """Whether any contact has a stiffness."""
        return any(law.stiffness is not None for law in self.contacts)

    @property
    def axial_gravity(self) -> PiecewiseConstant:
        """Gravity of a bar, towards the wall [m/s^2].

        Raises:
            SceneError: the body is none.
        """
        self._first(Bar)
        return _only(self.gravity, PiecewiseConstant)

    @property
    def vector_gravity(self) -> PiecewiseVector:
        """Gravity of all bodies but bars, with as many entries as they have coordinates [m/s^2].

        Raises:
            SceneError: the body is a bar.
        """
        self._refuse_bar()
        return _only(self.gravity, PiecewiseVector)

    @property
    def rigid_obstacles(self) -> tuple[Rigid, ...]:
        """Obstacles of all bodies but bars.

        Raises:
            SceneError: the body is a bar.
        """
        self._refuse_bar()
        return tuple(entry.in_space for entry in self.obstacles)

    def _refuse_bar(self) -> None:
        if self.bars:
            given = show(list(self.bars))
            raise SceneError(f"body = {given}: this needs one that moves in space; give one.")


def why_marched(scene: Content) -> str | None:
    """Why bodies need the march, in words; None if what they say solves them."""
    kinds = sorted(scene.kinds)
    if len(kinds) > 1:
        return f"bodies of different kinds ({', '.join(kinds)})"
    if scene.sampled or scene.couplings or (scene.starts_at_rest and not scene.bars):
        return _of_scene(scene)
    if scene.bars:
        return None
    if len(scene.bodies) > 1 and not all(body.meets_alike for body in scene.bodies):
        return f"several bodies of kind {kinds[0]}"
    if not any(scene.kinds <= method.bodies for method in METHODS.values()):
        return f"a {kinds[0]}"
    return _of_gravity(scene) or _of_laws(scene)


def _of_scene(scene: Content) -> str:
    """What of a scene besides its bodies other methods do not know, in words."""
    if scene.sampled:
        return f"the controller {scene.sampled[0].name}, which is sampled"
    held = ("joints", scene.joints), ("ties", scene.ties), ("springs between bodies", True)
    what = next(name for name, has in held if has)
    return what if scene.couplings else "a start at rest"


def _of_gravity(scene: Content) -> str | None:
    """What of gravity other methods do not know, in words."""
    slender = any(body.is_slender for body in scene.bodies)
    if slender and not scene.gravity.is_constant:
        return "gravity that changes"
    other = scene.gives_way or any(body.marches_alone for body in scene.bodies)
    return None if other else "gravity of bars without a wall of their own"


def _of_laws(scene: Content) -> str | None:
    """What of laws and obstacles other methods do not know, in words."""
    if not (scene.obstacles or scene.contacts) and all(b.may_meet_nothing for b in scene.bodies):
        return "motion without anything to hit"
    for law in scene.laws.each:
        what = "friction" if law.friction_coefficient > 0.0 else "Poisson's restitution"
        if law.friction_coefficient == 0.0 and law.by_speed:
            what = f"restitution by {law.restitution_law}"
        if law.friction_coefficient > 0.0 or not law.is_newton:
            return f"{what} between {' and '.join(law.between)}"
        if law.adhesion is not None:
            return f"the adhesion of {' and '.join(law.between)}"
        if law.stiffness is not None:
            return f"the stiffness of the contact of {' and '.join(law.between)}"
    return next(filter(None, (_of_obstacle(scene, o) for o in scene.obstacles)), None)


def _of_obstacle(scene: Content, obstacle: Obstacle) -> str | None:
    """What of an obstacle other methods do not know, in words."""
    if obstacle.rotation:
        return f"the rotation of {obstacle.name}"
    found, points = None, all(body.meets_alike for body in scene.bodies)
    if not obstacle.is_smooth:
        found = f"the corners of {obstacle.name}"
    elif not obstacle.is_flat and (obstacle.motion or not points or not obstacle.in_space.core):
        found = f"{obstacle.name}, which is curved"
    elif obstacle.motion and not points:
        found = f"the motion of {obstacle.name}"
    return found


def _only[T](value: object, cls: type[T]) -> T:
    if not isinstance(value, cls):
        raise SceneError(f"gravity = {show(value)}: this needs a {cls.__name__}; give one.")
    return value
