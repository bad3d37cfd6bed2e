"""What a scene holds, and what follows from it: which bodies there are, and what solves them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from impactfem.errors import SceneError
from impactfem.methods import METHODS
from impactfem.scene.beams import Beam, Rod
from impactfem.scene.bodies import Bar
from impactfem.scene.contacts import Contact
from impactfem.scene.kinds import Line, Real
from impactfem.scene.loads import LoadKind, PiecewiseConstant, PiecewiseVector
from impactfem.scene.obstacles import OBSTACLES, Rigid, Wall
from impactfem.scene.points import Point
from impactfem.scene.probes import MAX_PROBES, Probe
from impactfem.scene.schema import key
from impactfem.scene.settings import Output, Solve
from impactfem.scene.solids import Solid
from impactfem.scene.tables import MAX_BODIES, MAX_OBSTACLES, ObjectsKind, SettingsKind
from impactfem.scene.values import show

type Body = Bar | Solid | Point | Rod | Beam
type Obstacle = Wall | Rigid

BODIES: Mapping[str, type[Any]] = {cls.kind: cls for cls in (Bar, Solid, Point, Rod, Beam)}
MAX_CONTACTS = 10_000


@dataclass(frozen=True, kw_only=True)
class Content:
    """The tables of a scene, which `impactfem.scene.scene.Scene` reads and checks."""

    title: str = key(Line(), "title of figures and reports")
    duration: float = key(Real(above=0), "time to simulate", unit="s")
    gravity: PiecewiseConstant | PiecewiseVector = key(  # noqa: RUF009  # a field
        LoadKind(),
        "acceleration, of bars towards the wall; in a table, the value from each time on",
        unit="m/s^2",
        default=0.0,
    )
    bodies: tuple[Body, ...] = key(
        ObjectsKind(tuple(BODIES.values()), "[[body]]", MAX_BODIES), "what moves", name="body"
    )
    obstacles: tuple[Obstacle, ...] = key(
        ObjectsKind(tuple(OBSTACLES.values()), "[[obstacle]]", MAX_OBSTACLES, 0),
        "what it may hit; only points and rows of bars may do without",
        name="obstacle",
        default=(),
    )
    contacts: tuple[Contact, ...] = key(
        ObjectsKind((Contact,), "[[contact]]", MAX_CONTACTS, 0),
        "which pairs meet; every body and obstacle, and every two solids, if there are none",
        name="contact",
        default=(),
    )
    probes: tuple[Probe, ...] = key(
        ObjectsKind((Probe,), "[[probe]]", MAX_PROBES, 0),
        "places whose motion is kept in the history",
        name="probe",
        default=(),
    )
    solve: Solve = key(  # noqa: RUF009  # a field
        SettingsKind(Solve, "[solve]"), "how to solve", default=Solve()
    )
    output: Output = key(  # noqa: RUF009  # a field
        SettingsKind(Output, "[output]"), "what to write", default=Output()
    )
    folder: Path | None = field(default=None, compare=False, repr=False)

    @property
    def bar(self) -> Bar:
        """The bar of the scene.

        Raises:
            SceneError: the body is another one, or there are several.
        """
        if self.is_bar_row:
            names = ", ".join(bar.name for bar in self.bars)
            raise SceneError(f"body: this needs a single bar, the scene has {names}; give one.")
        return _only(self.bodies[0], Bar)

    @property
    def bars(self) -> tuple[Bar, ...]:
        """The bars of the scene in the order of their axis; none if there are other bodies."""
        bars = tuple(body for body in self.bodies if isinstance(body, Bar))
        return bars if len(bars) == len(self.bodies) else ()

    @property
    def points(self) -> tuple[Point, ...]:
        """The points of the scene; none if its bodies are others."""
        return tuple(body for body in self.bodies if isinstance(body, Point))

    @property
    def is_bar_row(self) -> bool:
        """Whether several bars meet each other."""
        return len(self.bars) > 1

    @property
    def solids(self) -> tuple[Solid, ...]:
        """The solids of the scene; none if its bodies are others."""
        return tuple(body for body in self.bodies if isinstance(body, Solid))

    @property
    def solid(self) -> Solid:
        """The solid of the scene.

        Raises:
            SceneError: the body is another one.
        """
        return _only(self.bodies[0], Solid)

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return self.bodies[0].dim

    @property
    def has_pairs(self) -> bool:
        """Whether it is one of solids that strike each other, or rub."""
        return bool(self.solids) and (len(self.bodies) > 1 or bool(self.contacts))

    @property
    def is_vibro(self) -> bool:
        """Whether methods of few degrees of freedom solve it: points, a rod or a beam."""
        return not self.bodies[0].waves and self.why_marched is None

    @property
    def marches(self) -> bool:
        """Whether the march of solids, and of bodies of any kind, solves it."""
        return not self.bars and not self.is_vibro

    @property
    def solver(self) -> Literal["bar", "bar_row", "march", "vibro"]:
        """What solves it: methods of one bar, of bars in a row, the march, or of few degrees."""
        if self.marches:
            return "march"
        if self.is_vibro:
            return "vibro"
        return "bar_row" if self.is_bar_row else "bar"

    @property
    def why_marched(self) -> str | None:
        """Why points, rods and beams need the march, in words; None if other methods do."""
        return why_marched(self)

    @property
    def axial_gravity(self) -> PiecewiseConstant:
        """Gravity of a bar, towards the wall [m/s^2].

        Raises:
            SceneError: the body is none.
        """
        _only(self.bodies[0], Bar)
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
        return tuple(
            entry.half_space if isinstance(entry, Wall) else entry for entry in self.obstacles
        )

    def _refuse_bar(self) -> None:
        if self.bars:
            raise SceneError(
                f"body[0] is {show(self.bodies[0])}: this needs one that moves in space; give one."
            )


def why_marched(scene: Content) -> str | None:
    """Why points, rods and beams need the march, in words; None if other methods do."""
    kinds = {body.kind for body in scene.bodies}
    if len(kinds) > 1:
        return f"bodies of different kinds ({', '.join(sorted(kinds))})"
    if len(scene.bodies) > 1 and not scene.bodies[0].meets_alike:
        return f"several bodies of kind {scene.bodies[0].kind}"
    if not any(kinds <= method.bodies for method in METHODS.values()):
        return f"a {scene.bodies[0].kind}"
    rubbing = [law.between for law in scene.contacts if law.friction_coefficient > 0.0]
    if rubbing:
        return f"friction between {' and '.join(rubbing[0])}"
    return next(filter(None, (_of_obstacle(scene, o) for o in scene.obstacles)), None)


def _of_obstacle(scene: Content, obstacle: Obstacle) -> str | None:
    """What of an obstacle other methods do not know, in words."""
    found, points = None, scene.bodies[0].meets_alike
    if not obstacle.is_smooth:
        found = f"the corners of {obstacle.name}"
    elif not obstacle.is_flat and (obstacle.motion or not points):
        found = f"{obstacle.name}, which is curved"
    elif obstacle.motion and not points:
        found = f"the motion of {obstacle.name}"
    return found


def _only[T](value: object, cls: type[T]) -> T:
    if not isinstance(value, cls):
        raise SceneError(f"body[0] is {show(value)}: this needs a {cls.__name__}; give one.")
    return value
