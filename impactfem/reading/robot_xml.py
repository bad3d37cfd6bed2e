"""URDF and MJCF files as XML: parts joined, classes of defaults, planes, rooms of meshes."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

from impactfem.reading.regular import read_regular, reason

Element = ET.Element

MOST_BYTES = 10 * 2**20
DEEPEST = 500
"""Elements within each other."""

_MOST_PARTS = 32
_PACKAGES = ("package://", "model://")


class FileError(Exception):
    """What is wrong with a file: words after its name, with what to do."""


class Plane(NamedTuple):
    """A plane of the world of an MJCF file.

    Attributes:
        name: As the file has it; may be empty.
        point, normal: [m], outward.
    """

    name: str
    point: tuple[float, ...]
    normal: tuple[float, ...]


def parsed(path: Path, rooms: tuple[Path, ...]) -> Element:
    """The XML of a file of a mechanism, with the files that it includes in their places.

    Args:
        path: URDF (.urdf) or MJCF.
        rooms: Folders that included files lie in.

    Raises:
        FileError: It cannot be read, or is none.
    """
    wanted = "robot" if path.suffix.lower() == ".urdf" else "mujoco"
    root = _part(path)
    if root.tag != wanted:
        raise FileError(f" begins with <{root.tag}>, not <{wanted}>: give a URDF or MJCF file.")
    count = 1
    within = [root] if wanted == "mujoco" else []
    while within:
        element = within.pop()
        for at, inner in reversed(list(enumerate(element))):
            if inner.tag != "include":
                within.append(inner)
                continue
            count += 1
            given = inner.get("file", "")
            if count > _MOST_PARTS:
                raise FileError(f" includes more than {_MOST_PARTS} files, or itself: write fewer.")
            there = inside(path.absolute().parent / given, rooms)
            if there is None:
                raise FileError(
                    f" includes {given!r}, outside the folder of the file: put it there."
                )
            try:
                part = _part(there)
            except FileError as error:
                raise FileError(f" includes {given!r}, which{error}") from None
            element[at : at + 1] = list(part)
            within.append(element)
            break
    _check_depth(root)
    return root


def _part(path: Path) -> Element:
    try:
        text = read_regular(path, MOST_BYTES).decode("utf-8-sig").lstrip()
    except (OSError, ValueError) as error:
        raise FileError(f" cannot be read ({reason(error)}): check the path.") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise FileError(" declares a document type, which is not read: remove it.")
    try:
        root = ET.fromstring(text)  # noqa: S314  (no entities, limited size)
    except (ET.ParseError, ValueError) as error:
        raise FileError(f" is not valid XML ({error}): correct it.") from None
    _check_depth(root)
    return root


def _check_depth(root: Element) -> None:
    within, depth = [root], 0
    while within:
        within, depth = [inner for element in within for inner in element], depth + 1
        if depth > DEEPEST:
            raise FileError(
                f" has elements within each other deeper than {DEEPEST}: give a flatter file."
            )


def rooms_of(path: Path, folder: Path | None) -> tuple[Path, ...]:
    """Folders whose files a mechanism may name: its own, that of the scene and its ROS package.

    Args:
        path: Of its file.
        folder: Of the scene; None without one.
    """
    own = path.resolve().parent
    found = [own]
    if folder is not None and own.is_relative_to(folder.resolve()):
        found.append(folder.resolve())
    found += [above for above in own.parents if (above / "package.xml").is_file()][:1]
    return tuple(found)


def inside(path: Path, rooms: tuple[Path, ...]) -> Path | None:
    """Where a path leads to, links followed; None if that is in none of the rooms."""
    there = path.resolve()
    return there if any(there.is_relative_to(room) for room in rooms) else None


def places_of(given: str, own: Path, rooms: tuple[Path, ...]) -> list[Path]:
    """Where a file named by a path, or by a ROS package, may be; none where only ROS knows.

    Args:
        given: The path or address.
        own: Folder of the file that names it.
        rooms: As `rooms_of` has them.
    """
    if "://" not in given:
        return [own / given]
    for start in _PACKAGES:
        package, _, rest = given.removeprefix(start).lstrip("/").partition("/")
        if given.startswith(start) and package not in {"", ".", ".."}:
            within = [room / package / rest for room in rooms]
            folders = (own.resolve(), *own.resolve().parents)
            return within + [above / rest for above in folders if above.name == package]
    return []


class Defaults:
    """Attributes that classes of an MJCF file give.

    Args:
        root: Of the file.
    """

    def __init__(self, root: Element) -> None:
        """Collect them."""
        self._known: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for top in root.findall("default"):
            self._collect(top, {})
        self._child: dict[Element, str] = {}
        within = [(element, "main") for element in root]
        while within:
            element, name = within.pop()
            name = element.get("childclass", name)
            self._child[element] = name
            within += [(inner, name) for inner in element]

    def _collect(self, element: Element, above: Mapping[str, dict[str, str]]) -> None:
        own = {tag: dict(values) for tag, values in above.items()}
        for inner in element:
            if inner.tag != "default":
                own.setdefault(inner.tag, {}).update(inner.attrib)
        self._known[element.get("class", "main")] = own
        for inner in element.findall("default"):
            self._collect(inner, own)

    def of(self, element: Element) -> dict[str, str]:
        """The attributes of an element with those that its class gives."""
        name = element.get("class") or self._child.get(element, "main")
        return self._known.get(name, {}).get(element.tag, {}) | element.attrib


def planes_of(root: Element) -> Iterator[Plane]:
    """Planes of the world of an MJCF file, if it has shapes that could touch them.

    Raises:
        FileError: The place or rotation of one is none.
    """
    world = root.find("worldbody")
    known = Defaults(root)
    if world is None or world.find("body//geom") is None:
        return
    for geom in world.findall("geom"):
        given = known.of(geom)
        if given.get("type") != "plane":
            continue
        try:
            point = tuple(float(word) for word in given.get("pos", "0 0 0").split())
            normal = _normal(given)
        except ValueError:
            normal, point = (), ()
        if len(point) != 3 or len(normal) != 3 or not any(normal):
            name = geom.get("name", "?")
            raise FileError(
                f": the plane {name!r} has no place with a direction: give pos by 3 numbers, and "
                "quat by 4 or zaxis by 3."
            )
        yield Plane(geom.get("name", ""), point, normal)


def _normal(given: Mapping[str, str]) -> tuple[float, ...]:
    """Axis z of a frame of MJCF, of any length."""
    if "zaxis" in given:
        return tuple(float(word) for word in given["zaxis"].split())
    if "quat" in given:
        w, x, y, z = (float(word) for word in given["quat"].split())
        return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z
    if any(key in given for key in ("euler", "axisangle", "xyaxes")):
        return ()
    return 0.0, 0.0, 1.0
