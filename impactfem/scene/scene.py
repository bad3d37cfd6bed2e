"""The scene: bodies, obstacles, loads and settings, read from TOML or made in Python."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike, path as ospath
from pathlib import Path
from typing import Any, ClassVar, Self

from impactfem.errors import SceneError
from impactfem.scene.bodies import Bar
from impactfem.scene.kinds import Kind, Line, NotAllowedError, Real, one_of, show
from impactfem.scene.loads import LoadKind, PiecewiseConstant
from impactfem.scene.obstacles import Wall
from impactfem.scene.schema import (
    TOP,
    DataclassLike,
    KeyFault,
    check_fields,
    check_keys,
    from_table,
    key,
    keys_of,
    table,
)
from impactfem.scene.settings import Output, Solve
from impactfem.scene.toml import parse_assignment, read_toml, write_table

BODIES: Mapping[str, type[Bar]] = {"bar": Bar}
OBSTACLES: Mapping[str, type[Wall]] = {"wall": Wall}


@dataclass(frozen=True)
class _One(Kind):
    """A table of settings."""

    type_name: ClassVar[str] = "table"
    cls: type[Any]
    heading: str

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        return f"the keys of {self.heading}"

    def read(self, value: object) -> Any:  # noqa: ANN401
        """Return the settings; raise NotAllowedError saying why not."""
        if not isinstance(value, self.cls):
            raise NotAllowedError(f"it is not of class {self.cls.__name__}")
        return value

    def default_text(self, default: object, required: object) -> str:
        """Return the default as the scene reference shows it."""
        return "its defaults" if default is not required else "required"


@dataclass(frozen=True)
class _Only(Kind):
    """A list with exactly one object."""

    type_name: ClassVar[str] = "list of tables"
    classes: tuple[type[Any], ...]
    heading: str

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        return f"exactly one {self.heading}, of kind " + " or ".join(
            f'"{c.kind}"' for c in self.classes
        )

    def read(self, value: object) -> tuple[Any, ...]:
        """Return a tuple; raise NotAllowedError saying why not."""
        if isinstance(value, self.classes):
            raise NotAllowedError("it is not in a list, write [...] around it")
        if not isinstance(value, list | tuple):
            raise NotAllowedError("it is not a list")
        for entry in value:
            if not isinstance(entry, self.classes):
                names = " or ".join(c.__name__ for c in self.classes)
                raise NotAllowedError(f"{show(entry)} is not a {names}")
        if len(value) != 1:
            raise NotAllowedError(
                f"there are {len(value)}, but this version models one bar and one wall"
            )
        return tuple(value)


@table(TOP)
@dataclass(frozen=True, kw_only=True)
class Scene:
    """What is modelled, for how long, and how: everything a run needs.

    `bodies` and `obstacles` may be given as lists, `gravity` as a number or as a table ``[[0.0, 1.0], [0.6, 0.0]]``.
    `folder` is where the scene file lies; relative mesh paths start there. It does not count for equality.

    Raises:
        SceneError: a value is missing or not allowed, or the scene contradicts itself.
    """

    title: str = key(Line(), "title of figures and reports")
    duration: float = key(Real(above=0), "time to simulate", unit="s")
    gravity: PiecewiseConstant = key(
        LoadKind(),
        "acceleration towards the wall, a table gives the value from each time on",
        unit="m/s^2",
        default=0.0,
    )
    bodies: tuple[Bar, ...] = key(_Only((Bar,), "[[body]]"), "what moves", name="body")
    obstacles: tuple[Wall, ...] = key(
        _Only((Wall,), "[[obstacle]]"), "what stands in the way", name="obstacle"
    )
    solve: Solve = key(_One(Solve, "[solve]"), "how to solve", default=Solve())
    output: Output = key(_One(Output, "[output]"), "what to write", default=Output())
    folder: Path | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        check_fields(self, "")
        if self.folder is not None:
            object.__setattr__(self, "folder", Path(self.folder))
        seen: set[str] = set()
        for heading, group in (("body", self.bodies), ("obstacle", self.obstacles)):
            for index, entry in enumerate(group):
                if entry.name in seen:
                    raise KeyFault(
                        f"{heading}[{index}]",
                        "name",
                        f' = "{entry.name}" is used twice: give every body and obstacle a name of its own.',
                    )
                seen.add(entry.name)
        if self.solve.dt is not None and self.solve.dt > self.duration:
            raise KeyFault(
                "solve",
                "dt",
                f" = {self.solve.dt} is longer than duration = {self.duration}: give a shorter time step.",
            )

    @property
    def mesh_path(self) -> Path | None:
        """Absolute path of the mesh file, None when the mesh is generated."""
        if self.solve.mesh is None:
            return None
        return Path(ospath.abspath(Path(self.folder or "", self.solve.mesh)))  # noqa: PTH100  # keeps symlinks

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> Self:
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
    def from_dict(cls, data: Mapping[str, Any], base: str | PathLike[str] | None = None) -> Self:
        """Make a scene from tables as TOML has them; keys with the value None count as absent.

        Args:
            data: keys ``title, duration, gravity, body, obstacle, solve, output``.
            base: folder where relative mesh paths start.

        Raises:
            SceneError: naming the key, e.g. ``body[0].length``.
        """
        by_toml = {entry.name: name for name, entry in keys_of(cls).items()}
        given = check_keys(data, list(by_toml), "")
        values: dict[str, Any] = {k: v for k, v in given.items() if v is not None}
        if "body" in values:
            values["body"] = _read_list(values["body"], "body", BODIES)
        if "obstacle" in values:
            values["obstacle"] = _read_list(values["obstacle"], "obstacle", OBSTACLES)
        if "solve" in values:
            values["solve"] = from_table(Solve, values["solve"], "solve")
        if "output" in values:
            values["output"] = from_table(Output, values["output"], "output")
        named = {by_toml[k]: v for k, v in values.items()}
        return cls(**named, folder=None if base is None else Path(base))

    def to_dict(self) -> dict[str, Any]:
        """Return plain tables with defaults filled in; keys left to the plan are absent."""
        top = _plain(self)
        for heading in ("body", "obstacle"):
            top[heading] = [{"kind": entry.kind, **_plain(entry)} for entry in top[heading]]
        return top | {"solve": _plain(self.solve), "output": _plain(self.output)}

    def to_toml(self, folder: str | PathLike[str] | None = None) -> str:
        """Return the text of a scene file with defaults filled in.

        Args:
            folder: where the file will lie. The mesh path is then rewritten so that it still resolves: relative
                if the mesh lies in that folder, else absolute. Without it the path stays as given.
        """
        data = self.to_dict()
        mesh = self.mesh_path
        if folder is not None and mesh is not None:
            target = Path(ospath.abspath(folder))  # noqa: PTH100  # as in mesh_path
            inside = mesh.is_relative_to(target)
            data["solve"]["mesh"] = str(mesh.relative_to(target) if inside else mesh)
        parts = [("", Scene, {k: v for k, v in data.items() if not isinstance(v, list | dict)})]
        parts[0][2]["gravity"] = data["gravity"]
        parts += [("[[body]]", BODIES[entry["kind"]], entry) for entry in data["body"]]
        parts += [("[[obstacle]]", OBSTACLES[entry["kind"]], entry) for entry in data["obstacle"]]
        parts += [("[solve]", Solve, data["solve"]), ("[output]", Output, data["output"])]
        blocks = []
        for heading, cls, content in parts:
            units = {entry.name: entry.unit for entry in keys_of(cls).values()}
            blocks.append(
                "\n".join([*([heading] if heading else []), *write_table(content, units)])
            )
        return "\n\n".join(blocks) + "\n"

    def with_settings(self, settings: Mapping[str, Any] | Sequence[str]) -> Self:
        """Return a scene with some keys changed.

        Args:
            settings: values by path, e.g. ``{"solve.elements": 80, "body.bar.gap": 0.2}``, or texts such as
                ``"solve.elements=80"``. Bodies and obstacles are named by index or name. None removes a key.

        Raises:
            SceneError: naming the assignment.
        """
        if isinstance(settings, str):
            settings = [settings]
        if not isinstance(settings, Mapping):
            settings = dict(parse_assignment(text) for text in settings)
        data = self.to_dict()
        for path, value in settings.items():
            _assign(data, path, value)
        try:
            return type(self).from_dict(data, base=self.folder)
        except SceneError as error:
            shown = ", ".join(f"{path} = {show(value)}" for path, value in settings.items())
            raise SceneError(f"after setting {shown}: {error}") from None


def _plain(instance: DataclassLike) -> dict[str, Any]:
    return {
        entry.name: entry.kind.write(getattr(instance, name))
        for name, entry in keys_of(type(instance)).items()
        if getattr(instance, name) is not None
    }


def _read_list(value: object, heading: str, classes: Mapping[str, type[Any]]) -> list[Any]:
    """Read the tables of ``[[body]]`` or ``[[obstacle]]``, each by its kind."""
    if not isinstance(value, list | tuple):
        raise KeyFault(
            heading, "", f" = {show(value)} is not allowed: write [[{heading}]] with two brackets."
        )
    entries = []
    for index, entry in enumerate(value):
        where = f"{heading}[{index}]"
        kinds = tuple(classes)
        allowed = " or ".join(f'"{kind}"' for kind in kinds)
        if not isinstance(entry, Mapping):
            raise KeyFault(
                where, "", f" = {show(entry)} is not a table: write it as [[{heading}]]."
            )
        if entry.get("kind") is None:
            known = [entry_.name for cls in classes.values() for entry_ in keys_of(cls).values()]
            check_keys(entry, ["kind", *known], where)
            raise KeyFault(where, "kind", f" is missing: add kind = {allowed}.")
        try:
            kind = one_of(entry["kind"], kinds)
        except NotAllowedError as error:
            raise KeyFault(
                where, "kind", f" = {show(entry['kind'])} is not allowed: {error}; give {allowed}."
            ) from None
        entries.append(from_table(classes[kind], entry, where, "kind"))
    return entries


def _assign(data: dict[str, Any], path: str, value: object) -> None:
    """Put a value at a path of plain tables."""
    name = f"setting {path} = {show(value)}"
    parts = path.replace("[", ".").replace("]", "").split(".")
    *parents, last = [part.strip() for part in parts]
    place: Any = data
    for part in parents:
        if isinstance(place, list):
            found = [e for i, e in enumerate(place) if part in {str(i), e.get("name")}]
            if not found:
                names = ", ".join(f"{i} or {e['name']}" for i, e in enumerate(place))
                raise SceneError(f"{name}: there is no {show(part)}; name it by {names}.")
            place = found[0]
        elif isinstance(place, dict) and isinstance(place.get(part), dict | list):
            place = place[part]
        else:
            tables = ", ".join(k for k, v in data.items() if isinstance(v, dict | list))
            raise SceneError(f"{name}: there is no table {show(part)}; tables are {tables}.")
    if not isinstance(place, dict):
        names = ", ".join(f"{e['name']}.{last}" for e in place)
        raise SceneError(f"{name}: say of which one, such as {'.'.join(parents)}.{names}.")
    place[last] = value
