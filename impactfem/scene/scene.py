"""The scene: bodies, obstacles, loads and settings, read from TOML or made in Python."""

import os
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Self

from impactfem.errors import SceneError
from impactfem.extensions import load_installed
from impactfem.reading.live import is_kept, keep
from impactfem.scene.card import scene_card
from impactfem.scene.contacts import Contact
from impactfem.scene.content import (
    BODIES,
    MAX_CONTACTS,
    MAX_JOINTS,
    MAX_MASSES,
    MAX_SPRINGS,
    MAX_TIES,
    Content,
)
from impactfem.scene.control import MAX_CONTROLS, Control, acted, named_histories
from impactfem.scene.controllers import MAX_CONTROLLERS, Controller, fed_back
from impactfem.scene.couplings import SpringElement
from impactfem.scene.crosschecks import check_scene
from impactfem.scene.drop import Drop, dropped
from impactfem.scene.fallers import Reach
from impactfem.scene.grammar import FOLDER, naming
from impactfem.scene.inline import plain
from impactfem.scene.inverse import (
    MAX_MEASURES,
    MAX_PARAMETERS,
    Measure,
    Objective,
    Parameter,
    named_numbers,
)
from impactfem.scene.joints import Joint
from impactfem.scene.loads import LoadKind, PiecewiseConstant, PiecewiseVector
from impactfem.scene.masses import PointMass
from impactfem.scene.obstacles import OBSTACLES
from impactfem.scene.probes import MAX_PROBES, Probe
from impactfem.scene.schema import (
    TOP,
    DataclassLike,
    KeyedError,
    check_fields,
    check_keys,
    from_table,
    keys_of,
)
from impactfem.scene.settings import Output, Solve
from impactfem.scene.tables import (
    MAX_BODIES,
    MAX_OBSTACLES,
    assign,
    looked_up,
    own,
    read_objects,
)
from impactfem.scene.ties import Tie
from impactfem.scene.toml import parse_assignment, read_toml, write_table
from impactfem.scene.trajectory import TrajectoryKeys
from impactfem.scene.values import NotAllowedError, is_number, number, show

_RARE = (
    "spring", "tie", "point_mass", "parameter", "control", "controller", "measure", "objective",
)  # fmt: skip
"""Tables that a scene file has only where they say something."""
_LISTS = (
    "spring", "tie", "point_mass", "probe", "parameter", "control", "controller", "measure",
)  # fmt: skip


class Scene(Content):
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

    def __post_init__(self) -> None:
        gravity: object = self.gravity  # as given, for messages
        check_fields(self, "")
        if self.folder is not None:  # absolute, so that a later change of folder does no harm
            object.__setattr__(self, "folder", _absolute(self.folder))
        self._open_files()
        self._add_masses()
        self._add_joints()
        alone = not any(body.marches_alone for body in self.bodies)
        if alone and self.dim == 1 and not self.bars:
            self._turn_gravity()
        check_scene(self, gravity)
        self._start_parameters()
        if not self.bars and not isinstance(self.gravity, PiecewiseVector):
            object.__setattr__(self, "gravity", PiecewiseVector((0.0,), ((0.0,) * self.dim,)))
        if self.drop is not None and not self.mechanisms:
            self.fall()

    def fall(self, reach: Mapping[str, Reach] | None = None) -> None:
        """Start where its drop ends, which scenes with mechanisms leave to who reads their files.

        Args:
            reach: How far the mechanisms reach, by name.

        Raises:
            SceneError: It cannot fall so.
        """
        if self.drop is None:
            return
        given = self.to_dict()
        placed = type(self).from_dict(dropped(self, self.drop, reach or {}), base=self.folder)
        known = {entry.name for entry in fields(self)}
        for name in {*vars(self)} - known:  # cached of what was drawn
            del self.__dict__[name]
        for name in ("bodies", "joints", "springs", "masses", "probes"):
            object.__setattr__(self, name, getattr(placed, name))
        object.__setattr__(self, "drop", None)
        self.__dict__["_given"] = given

    def given(self) -> dict[str, Any]:
        """The tables that settings change: those of `to_dict`, before a drop if there was one."""
        return deepcopy(self.__dict__.get("_given")) or self.to_dict()

    def _turn_gravity(self) -> None:
        """Give bars that the march takes gravity along their axis: a number is towards the wall."""
        if isinstance(self.gravity, PiecewiseConstant) and self.gravity.given is not None:
            signal = self.gravity.given[0].plain
            turned = signal | {"formula": f"-({signal.get('formula', 'signal')})"}
            object.__setattr__(self, "gravity", LoadKind().read([turned]))
        elif isinstance(self.gravity, PiecewiseConstant):
            along = tuple((0.0 - value,) for value in self.gravity.values)
            object.__setattr__(self, "gravity", PiecewiseVector(self.gravity.times, along))

    def _add_masses(self) -> None:
        """Add the points that masses are.

        Raises:
            KeyedError: A mass is on no body that carries it.
        """
        made, taken = list[Any](), set[str]()
        for index, mass in enumerate(self.masses):
            where = f"point_mass[{index}]"
            if mass.name in taken:
                text = f" = {show(mass.name)} is the name of another mass: give another."
                raise KeyedError(where, "name", text)
            taken.add(mass.name)
            made.append(mass.carried(self, where))
        given = [body for body in self.bodies if not body.attached]
        object.__setattr__(self, "bodies", (*given, *made))

    def _add_joints(self) -> None:
        """Add the joints that bodies bring.

        Raises:
            KeyedError: another one has such a name.
        """
        own = self._own_joints
        for index, joint in enumerate(self.joints):
            if joint.name in own and joint != own[joint.name]:
                text = f" = {show(joint.name)} is that of a mass or a support: give another."
                raise KeyedError(f"joint[{index}]", "name", text)
        given = [joint for joint in self.joints if joint.name not in own]
        object.__setattr__(self, "joints", (*given, *own.values()))

    @property
    def _own_joints(self) -> dict[str, Joint]:
        """Those that bodies bring, by name."""
        return {joint.name: joint for body in self.bodies for joint in body.own_joints}

    def _start_parameters(self) -> None:
        """Let parameters with a key start as the scene has it.

        Raises:
            KeyedError: naming the key.
        """
        data = self.to_dict() if self.parameters else {}
        found = []
        for index, parameter in enumerate(self.parameters):
            where = f"parameter[{index}]"
            if parameter.path is not None:
                value = _number_at(data, parameter.path, where)
                if parameter.start is not None and parameter.start != value:
                    text = f" = {parameter.start:g}, but {parameter.path} = {value:g}: remove one."
                    raise KeyedError(where, "start", text)
                try:
                    parameter = replace(parameter, start=value)  # noqa: PLW2901  # checked anew
                except KeyedError as error:
                    raise error.moved(where) from None
            found.append(parameter)
        object.__setattr__(self, "parameters", tuple(found))

    def _open_files(self) -> None:
        """Read the files of rigid bodies and obstacles, where this scene lies.

        Raises:
            KeyedError: naming the key.
        """
        folder = _absolute(self.folder or "")
        for heading, name in (("body", "bodies"), ("obstacle", "obstacles")):
            found = []
            for index, entry in enumerate(getattr(self, name)):
                try:
                    found.append(entry.opened(folder))
                except KeyedError as error:
                    raise error.moved(f"{heading}[{index}]") from None
            object.__setattr__(self, name, tuple(found))
        taken = {entry.name for entry in (*self.bodies, *self.obstacles)}
        planes = [plane for body in self.mechanisms for plane in body.obstacles(folder)]
        # A scene that was written down has them as its own.
        more = tuple(plane for plane in planes if plane.name not in taken)
        if more:
            object.__setattr__(self, "obstacles", (*self.obstacles, *more))

    @property
    def mesh_path(self) -> Path | None:
        """Absolute path of the mesh file, None when the mesh is generated."""
        mesh = self.bodies[0].mesh or self.solve.mesh
        return None if mesh is None else _absolute(Path(self.folder or "", mesh))

    def _repr_html_(self) -> str:
        return scene_card(self)

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
    def from_dict(
        cls,
        data: Mapping[str, Any],
        base: str | os.PathLike[str] | None = None,
        *,
        folder: str | os.PathLike[str] | None = None,
    ) -> Self:
        """Make a scene from tables as TOML has them; keys with the value None count as absent.

        Args:
            data: keys ``title, duration, gravity, start, body, obstacle, contact, joint, spring,
                tie, point_mass, probe, parameter, control, controller, measure, objective,
                trajectory, drop, solve, output``.
            base: folder where relative paths of meshes, robots and tables start; absent: that
                in which the program runs.
            folder: the same by the name of the scene's own attribute.

        Raises:
            SceneError: naming the key, e.g. ``body[0].length``.
        """
        load_installed()
        base = folder if base is None else base
        token = FOLDER.set(None if base is None else Path(base))
        try:
            return cls._from_dict(data, base)
        finally:
            FOLDER.reset(token)

    @classmethod
    def _from_dict(cls, data: Mapping[str, Any], base: str | os.PathLike[str] | None) -> Self:
        fields = {entry.name: name for name, entry in keys_of(cls).items()}
        given = check_keys(data, list(fields), "", TOP)
        values: dict[str, Any] = {k: v for k, v in given.items() if v is not None}
        folder = None if base is None else Path(base)
        parameters: list[Parameter] = []
        if "parameter" in values:
            parameters = read_objects(
                values["parameter"], "parameter", Parameter, MAX_PARAMETERS, 0
            )
            values = _started(values, parameters)
        controls: Sequence[Control] = ()
        if "control" in values:
            controls = read_objects(values["control"], "control", Control, MAX_CONTROLS, 0)
            values = {name: own(value) for name, value in values.items()}  # the caller keeps his
            values["control"] = list(controls := acted(values, controls, _keys_of_tables()))
        known = {
            **named_numbers(parameters), **named_histories(controls, values.get("duration"))
        }  # fmt: skip
        if "controller" in values:
            with naming(known):
                controllers = read_objects(
                    values["controller"], "controller", Controller, MAX_CONTROLLERS, 0
                )
            values = {name: own(value) for name, value in values.items()}
            values["controller"] = controllers
            fed_back(values, controllers, _keys_of_tables())
            known |= {part.name: part.node for each in controllers for part in each.parts}
        with naming(known):
            return cls(**{fields[k]: v for k, v in cls._read(values).items()}, folder=folder)

    @classmethod
    def _read(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Tables as objects."""
        if "body" in values:
            values["body"] = read_objects(values["body"], "body", BODIES, MAX_BODIES)
        if "obstacle" in values:
            values["obstacle"] = read_objects(
                values["obstacle"], "obstacle", OBSTACLES, MAX_OBSTACLES, 0
            )
        lists: tuple[tuple[str, type[Any], int], ...] = (
            ("contact", Contact, MAX_CONTACTS), ("joint", Joint, MAX_JOINTS),
            ("spring", SpringElement, MAX_SPRINGS), ("tie", Tie, MAX_TIES),
            ("point_mass", PointMass, MAX_MASSES),
            ("probe", Probe, MAX_PROBES), ("measure", Measure, MAX_MEASURES),
        )  # fmt: skip
        for name, made, most in lists:
            if name in values:
                values[name] = read_objects(values[name], name, made, most, 0)
        for name, settings in (
            ("objective", Objective), ("trajectory", TrajectoryKeys), ("drop", Drop),
            ("solve", Solve), ("output", Output),
        ):  # fmt: skip
            if name in values:
                values[name] = from_table(settings, values[name], name)
        return values

    def to_dict(self) -> dict[str, Any]:
        """Return plain tables with defaults filled in; keys left to the plan are absent."""
        data = plain(self)
        data["body"] = [entry for entry in data["body"] if not entry.attached]
        for name in ("body", "obstacle"):
            data[name] = [{"kind": entry.kind, **plain(entry)} for entry in data[name]]
        for name in ("contact", "joint", *_LISTS):
            data[name] = [plain(entry) for entry in data[name]]
            if name == "joint":
                own = self._own_joints
                data[name] = [entry for entry in data[name] if entry["name"] not in own]
            if name in _RARE and not data[name]:
                del data[name]
        for parameter in data.get("parameter", ()):
            if "key" in parameter:  # its value stands there
                parameter.pop("start", None)
        asked = {
            name: plain(table)
            for name, table in (
                ("objective", self.objective),
                ("trajectory", self.trajectory),
                ("drop", self.drop),
            )
            if table is not None
        }
        return data | asked | {"solve": plain(self.solve), "output": plain(self.output)}

    def to_toml(self, folder: str | os.PathLike[str] | None = None) -> str:
        """Return the text of a scene file with defaults filled in.

        Args:
            folder: where the file will lie, if not beside the one that was read. A relative path
                of a mesh, mechanism or data is rewritten to resolve from there: still relative if
                it lies in that folder, absolute otherwise.
        """
        data = self.to_dict()
        if folder is not None:
            for home in (*data["body"], *data["obstacle"], *data.get("measure", []), data["solve"]):
                self._from(folder, home, "mesh", "heights", "file", "data", "result")
            for signal in _signals(data):
                self._from(folder, signal, "table")
        bodies, obstacles = data.pop("body"), data.pop("obstacle")
        contacts, joints = data.pop("contact"), data.pop("joint")
        springs, ties = data.pop("spring", []), data.pop("tie", [])
        masses = data.pop("point_mass", [])
        probes, objective = data.pop("probe"), data.pop("objective", None)
        wanted = data.pop("trajectory", None)
        parameters, measures = data.pop("parameter", []), data.pop("measure", [])
        controls, controllers = data.pop("control", []), data.pop("controller", [])
        solve, output = data.pop("solve"), data.pop("output")
        parts: list[tuple[str, type[DataclassLike], dict[str, Any]]] = [
            ("", type(self), data),
            *(("[[body]]", BODIES[entry["kind"]], entry) for entry in bodies),
            *(("[[obstacle]]", OBSTACLES[entry["kind"]], entry) for entry in obstacles),
            *(("[[contact]]", Contact, entry) for entry in contacts),
            *(("[[joint]]", Joint, entry) for entry in joints),
            *(("[[spring]]", SpringElement, entry) for entry in springs),
            *(("[[tie]]", Tie, entry) for entry in ties),
            *(("[[point_mass]]", PointMass, entry) for entry in masses),
            *(("[[probe]]", Probe, entry) for entry in probes),
            *(("[[parameter]]", Parameter, entry) for entry in parameters),
            *(("[[control]]", Control, entry) for entry in controls),
            *(("[[controller]]", Controller, entry) for entry in controllers),
            *(("[[measure]]", Measure, entry) for entry in measures),
            *([] if objective is None else [("[objective]", Objective, objective)]),
            *([] if wanted is None else [("[trajectory]", TrajectoryKeys, wanted)]),
            ("[solve]", Solve, solve),
            ("[output]", Output, output),
        ]
        texts = []
        for heading, cls, content in parts:
            units = {entry.name: entry.unit for entry in keys_of(cls).values()}
            texts.append(write_table(heading, content, units))
        return "\n".join(texts)

    def _from(self, folder: str | os.PathLike[str], home: dict[str, Any], *names: str) -> None:
        """Let the files of a table be found from a folder."""
        for name in names:
            given = home.get(name)
            if given and is_kept(given):
                home[name] = Path(given).name  # a copy is kept there
            elif given and not Path(given).is_absolute():
                there, target = _absolute(Path(self.folder or "", given)), _absolute(folder)
                inside = there.is_relative_to(target)
                home[name] = str(there.relative_to(target) if inside else there)

    def keep_meshes(self, folder: Path) -> None:
        """Copy meshes that a program held to where `to_toml` says that they lie.

        Raises:
            OutputError: There is no room.
        """
        for home in (*self.bodies, *self.obstacles, self.solve):
            path = getattr(home, "mesh", None)
            if path and is_kept(path):
                keep(path, folder)

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
        data = self.given()
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


def _signals(value: object) -> Iterator[dict[str, Any]]:
    """Tables of measured signals in plain tables."""
    if isinstance(value, dict) and isinstance(value.get("table"), str):
        yield value
    elif isinstance(value, dict | list | tuple):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _signals(each)


def _started(values: dict[str, Any], parameters: Sequence[Parameter]) -> dict[str, Any]:
    """The tables with the numbers of parameters that have a key and a start; checked later.

    Raises:
        KeyedError: naming the key.
    """
    found = {name: own(value) for name, value in values.items()}  # the caller keeps his
    for index, parameter in enumerate(parameters):
        if parameter.path is None:
            continue
        if parameter.path.partition(".")[0] in _RARE:
            text = f" = {show(parameter.path)} is no number of what is modelled: give one."
            raise KeyedError(f"parameter[{index}]", "key", text)
        if parameter.start is not None:
            try:
                assign(found, parameter.path, parameter.start)
            except NotAllowedError as error:
                text = f" = {show(parameter.path)}: {error}."
                raise KeyedError(f"parameter[{index}]", "key", text) from None
    found["parameter"] = list(parameters)
    return found


def _keys_of_tables() -> dict[str, set[str]]:
    """Keys that bodies of each kind, and joints, have."""
    tables = {**BODIES, "joint": Joint}
    return {kind: {each.name for each in keys_of(cls).values()} for kind, cls in tables.items()}


def _number_at(data: dict[str, Any], path: str, where: str) -> float:
    """The number at a path of plain tables.

    Raises:
        KeyedError: there is none.
    """
    try:
        value = looked_up(data, path)
    except NotAllowedError as error:
        raise KeyedError(where, "key", f" = {show(path)}: {error}.") from None
    if not is_number(value):
        text = f" = {show(path)} is {show(value)} in the scene: give the path of a number."
        raise KeyedError(where, "key", text)
    return number(value)


def _absolute(path: str | os.PathLike[str]) -> Path:
    # Not Path.resolve: a user who works through a symbolic link wants to read that path.
    return Path(os.path.abspath(path))  # noqa: PTH100
