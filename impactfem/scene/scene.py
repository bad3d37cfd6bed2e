"""The scene: bodies, obstacles, loads and settings, read from TOML or made in Python."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from impactfem.errors import SceneError
from impactfem.scene.beams import Beam, Rod
from impactfem.scene.bodies import Bar
from impactfem.scene.card import scene_card
from impactfem.scene.contacts import Contact
from impactfem.scene.crosschecks import check_scene
from impactfem.scene.inline import plain
from impactfem.scene.kinds import Line, Real
from impactfem.scene.loads import LoadKind, PiecewiseConstant, PiecewiseVector
from impactfem.scene.mixed import why_marched
from impactfem.scene.obstacles import OBSTACLES, Rigid, Wall
from impactfem.scene.points import Point
from impactfem.scene.probes import MAX_PROBES, Probe
from impactfem.scene.schema import (
    TOP,
    DataclassLike,
    check_fields,
    check_keys,
    from_table,
    key,
    keys_of,
    table,
)
from impactfem.scene.settings import Output, Solve
from impactfem.scene.solids import Solid
from impactfem.scene.tables import (
    MAX_BODIES,
    MAX_OBSTACLES,
    ObjectsKind,
    SettingsKind,
    assign,
    read_objects,
)
from impactfem.scene.toml import parse_assignment, read_toml, write_table
from impactfem.scene.values import NotAllowedError, show

type Body = Bar | Solid | Point | Rod | Beam
type Obstacle = Wall | Rigid

BODIES: Mapping[str, type[Any]] = {cls.kind: cls for cls in (Bar, Solid, Point, Rod, Beam)}
MAX_CONTACTS = 10_000


@table(TOP)
@dataclass(frozen=True, kw_only=True)
class Scene:
    """What is modelled, for how long, and how: everything a run needs.

    Any bodies meet each other and rigid obstacles; bars alone stand in a row, the first one perhaps
    before a wall. `bodies`,
    `obstacles` and `contacts` may be given as lists; `gravity` as a number or a table
    ``[[0.0, 1.0], [0.6, 0.0]]`` for bars, as a vector or a table
    ``[[0.0, [0.0, -9.81]], [1.0, [0.0, 0.0]]]`` for others. Relative mesh paths start at `folder`,
    where the scene file lies; scenes in different folders can be equal.

    Raises:
        SceneError: a value is missing or not allowed, or the scene contradicts itself.
    """

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

    if TYPE_CHECKING:  # type checkers learn that lists and numbers may be given

        def __init__(
            self,
            *,
            title: str,
            duration: float,
            bodies: Sequence[Body],
            obstacles: Sequence[Obstacle] = (),
            contacts: Sequence[Contact] = (),
            probes: Sequence[Probe] = (),
            gravity: float | Sequence[Any] | PiecewiseConstant | PiecewiseVector = 0.0,
            solve: Solve = ...,
            output: Output = ...,
            folder: str | os.PathLike[str] | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        gravity: object = self.gravity  # as given, for messages
        check_fields(self, "")
        if self.folder is not None:  # absolute, so that a later change of folder does no harm
            object.__setattr__(self, "folder", _absolute(self.folder))
        check_scene(self, gravity)
        if not self.bars and not isinstance(self.gravity, PiecewiseVector):
            object.__setattr__(self, "gravity", PiecewiseVector((0.0,), ((0.0,) * self.dim,)))

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

    @property
    def mesh_path(self) -> Path | None:
        """Absolute path of the mesh file, None when the mesh is generated."""
        mesh = self._mesh
        return None if mesh is None else _absolute(Path(self.folder or "", mesh))

    def _repr_html_(self) -> str:
        return scene_card(self)

    def _refuse_bar(self) -> None:
        if self.bars:
            raise SceneError(
                f"body[0] is {show(self.bodies[0])}: this needs one that moves in space; give one."
            )

    @property
    def _mesh(self) -> str | None:
        body = self.bodies[0]
        return body.mesh if isinstance(body, Solid) else self.solve.mesh

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Self:
        """Read a scene file.

        Raises:
            SceneError: naming the file and the key, or the line of a TOML error.
        """
        data = read_toml(path)
        try:
            return cls.from_dict(data, base=Path(path).parent)
        except SceneError as error:
            raise SceneError(f"{path}: {error}") from None

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], base: str | os.PathLike[str] | None = None) -> Self:
        """Make a scene from tables as TOML has them; keys with the value None count as absent.

        Args:
            data: keys ``title, duration, gravity, body, obstacle, contact, probe, solve, output``.
            base: folder where relative mesh paths start.

        Raises:
            SceneError: naming the key, e.g. ``body[0].length``.
        """
        fields = {entry.name: name for name, entry in keys_of(cls).items()}
        given = check_keys(data, list(fields), "", TOP)
        values: dict[str, Any] = {k: v for k, v in given.items() if v is not None}
        if "body" in values:
            values["body"] = read_objects(values["body"], "body", BODIES, MAX_BODIES)
        if "obstacle" in values:
            values["obstacle"] = read_objects(
                values["obstacle"], "obstacle", OBSTACLES, MAX_OBSTACLES, 0
            )
        if "contact" in values:
            values["contact"] = read_objects(values["contact"], "contact", Contact, MAX_CONTACTS, 0)
        if "probe" in values:
            values["probe"] = read_objects(values["probe"], "probe", Probe, MAX_PROBES, 0)
        if "solve" in values:
            values["solve"] = from_table(Solve, values["solve"], "solve")
        if "output" in values:
            values["output"] = from_table(Output, values["output"], "output")
        folder = None if base is None else Path(base)
        return cls(**{fields[k]: v for k, v in values.items()}, folder=folder)

    def to_dict(self) -> dict[str, Any]:
        """Return plain tables with defaults filled in; keys left to the plan are absent."""
        data = plain(self)
        for name in ("body", "obstacle"):
            data[name] = [{"kind": entry.kind, **plain(entry)} for entry in data[name]]
        for name in ("contact", "probe"):
            data[name] = [plain(entry) for entry in data[name]]
        return data | {"solve": plain(self.solve), "output": plain(self.output)}

    def to_toml(self, folder: str | os.PathLike[str] | None = None) -> str:
        """Return the text of a scene file with defaults filled in.

        Args:
            folder: where the file will lie, if not beside the one that was read. A relative mesh
                path is rewritten to resolve from there: still relative if the mesh lies in that
                folder, absolute otherwise.
        """
        data = self.to_dict()
        given, mesh = self._mesh, self.mesh_path
        if folder is not None and given and mesh and not Path(given).is_absolute():
            target = _absolute(folder)
            inside = mesh.is_relative_to(target)
            home = data["body"][0] if isinstance(self.bodies[0], Solid) else data["solve"]
            home["mesh"] = str(mesh.relative_to(target) if inside else mesh)
        bodies, obstacles = data.pop("body"), data.pop("obstacle")
        contacts, probes = data.pop("contact"), data.pop("probe")
        solve, output = data.pop("solve"), data.pop("output")
        parts: list[tuple[str, type[DataclassLike], dict[str, Any]]] = [
            ("", type(self), data),
            *(("[[body]]", BODIES[entry["kind"]], entry) for entry in bodies),
            *(("[[obstacle]]", OBSTACLES[entry["kind"]], entry) for entry in obstacles),
            *(("[[contact]]", Contact, entry) for entry in contacts),
            *(("[[probe]]", Probe, entry) for entry in probes),
            ("[solve]", Solve, solve),
            ("[output]", Output, output),
        ]
        texts = []
        for heading, cls, content in parts:
            units = {entry.name: entry.unit for entry in keys_of(cls).values()}
            texts.append(write_table(heading, content, units))
        return "\n".join(texts)

    def with_settings(self, settings: Mapping[str, Any] | Sequence[str]) -> Self:
        """Return a scene with some keys changed.

        Args:
            settings: values by path, e.g. ``{"solve.elements": 80, "body.bar.gap": 0.2}``, or
                texts such as ``["solve.elements=80"]``. Bodies and obstacles are named by index
                or name. The value None removes a key, so that its default holds.

        Raises:
            SceneError: naming the assignment.
        """
        if not isinstance(settings, Mapping):
            texts = [settings] if isinstance(settings, str) else settings
            settings = dict(parse_assignment(text) for text in texts)
        data = self.to_dict()
        for path, value in settings.items():
            try:
                assign(data, str(path), value)
            except NotAllowedError as error:
                raise SceneError(f"setting {path} = {show(value)}: {error}.") from None
        try:
            return type(self).from_dict(data, base=self.folder)
        except SceneError as error:
            shown = ", ".join(f"{path} = {show(value)}" for path, value in settings.items())
            raise SceneError(f"after setting {shown}: {error}") from None


def _absolute(path: str | os.PathLike[str]) -> Path:
    # Not Path.resolve: a user who works through a symbolic link wants to read that path.
    return Path(os.path.abspath(path))  # noqa: PTH100


def _only[T](value: object, cls: type[T]) -> T:
    if not isinstance(value, cls):
        raise SceneError(f"body[0] is {show(value)}: this needs a {cls.__name__}; give one.")
    return value
