"""Checks of URDF and MJCF files before Pinocchio reads them: what it would pass over or hide."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from impactfem.reading.regular import MAX_BYTES, read_regular, reason
from impactfem.reading.robot_xml import (
    Defaults,
    FileError,
    inside,
    parsed,
    places_of,
    planes_of,
    rooms_of,
)
from impactfem.scene import Mechanism
from impactfem.scene.rigid_keys import inertia_fault
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import MOST, show
from impactfem.system.actuators import Acting, acting_in
from impactfem.system.link_shapes import named

Element = ET.Element

MESHES = (".stl", ".obj", ".dae")
"""Endings of the meshes of collision shapes."""

_MOST_LINKS = 1000  # their inertia matrix is dense; MJCF takes 1 GiB for 300 in one chain
_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical")
_HINGES = ("hinge", "slide", "ball", "free")
_GROWING = ("replicate", "composite", "flexcomp", "attach", "frame")  # bodies that are not there
_UNREAD = {
    "tendon": "tendons", "contact": "pairs and exclusions of contact", "sensor": None,
    "keyframe": "key frames", "deformable": "deformable bodies", "extension": "plug-ins",
}  # fmt: skip
# Attributes that are no numbers, whatever they look like; that may be infinite; that are >= 0.
_NAMES = {"name", "link", "joint", "filename", "file", "class", "childclass", "mesh", "material",
          "model"}  # fmt: skip
_LIMITS = {"lower", "upper", "effort", "velocity", "range"}
_SIZES = {"damping", "friction", "frictionloss", "armature", "mass", "density"}
_TOPS = {"link", "joint"}
_MIMIC = (("multiplier", "1"), ("offset", "0"))
_READ = {"body", "joint", "freejoint", "geom", "inertial", "mesh"}  # of MJCF
_SMALL = 1e-12  # moment of inertia by mass that is none [m^2]
# How many numbers attributes have: links and joints with others are read in part, or passed over.
_COUNTS = {
    "robot": {"xyz": 3, "rpy": 3, "size": 3, "scale": 3}
    | dict.fromkeys(("radius", "length", "lower", "upper", "effort", "velocity", "damping"), 1)
    | dict.fromkeys(("friction", "ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 1),
    "mujoco": {"pos": 3, "axis": 3, "quat": 4, "euler": 3, "axisangle": 4, "fromto": 6, "range": 2}
    | {"diaginertia": 3, "fullinertia": 6}
    | dict.fromkeys(("damping", "frictionloss", "armature", "mass", "density"), 1),
}  # fmt: skip


@dataclass
class Checked:
    """A file of a mechanism whose parts Pinocchio takes, and what it has besides.

    Attributes:
        body: The mechanism.
        root: The XML for Pinocchio.
        meshes: That it names: name there, content, path as given.
        mimics: Joints that follow another one: this, ratio and offset.
        spherical: Joints of URDF that turn about a place: for Pinocchio they float.
        acting: Actuators and springs by joint.
        left_out: What is not taken as it stands, in words, and how often.
    """

    body: Mechanism
    root: Element
    meshes: list[tuple[str, bytes, str]] = field(default_factory=list)
    mimics: dict[str, tuple[str, float, float]] = field(default_factory=dict)
    spherical: set[str] = field(default_factory=set)
    acting: Mapping[str, Acting] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)

    def leave(self, what: str, count: int = 1) -> None:
        """Note what is left out.

        Raises:
            KeyedError: The scene wants the file as it stands.
        """
        if self.body.strict:
            raise fail(self.body, f": {what}: correct the file, or remove strict = true.")
        self.left_out[what] = self.left_out.get(what, 0) + count

    @property
    def told(self) -> tuple[str, ...]:
        """What is left out, in words."""
        return tuple(f"{what}{f' ({n} times)' * (n > 1)}" for what, n in self.left_out.items())


def checked(body: Mechanism, path: Path, folder: Path | None = None) -> Checked:
    """The file of a mechanism: its XML, the meshes that it names, and what it has besides.

    Meshes are named ``mesh0.stl`` and so on in the XML, in order; what nothing reads is taken out.

    Args:
        body: The mechanism.
        path: Of the file.
        folder: Of the scene.

    Raises:
        KeyedError: It cannot be read, holds what is not modelled, or names meshes elsewhere.
    """
    rooms = rooms_of(path, folder)
    try:
        root = parsed(path, rooms)
        list(planes_of(root))  # which the scene has as obstacles
    except FileError as error:
        raise fail(body, str(error)) from None
    found = Checked(body, root)
    _check_names(body, root)
    if root.tag == "robot":
        _ease(found)
        _check_numbers(body, root)
        _check_joints(found)
        _check_tree(body, root)
        meshes = _urdf_meshes(root)
    else:
        _check_numbers(body, root)
        _check_mjcf(found)
        _take_equalities(found)
        _check_classes(body, root)
        found.acting = acting_in(found.root, found.leave)
        _part_joints(root)
        meshes = _mjcf_meshes(root)
    _check_masses(found)
    found.meshes = _contents(body, meshes, path.absolute().parent, rooms)
    return found


def _ease(found: Checked) -> None:
    """Put in what a robot of URDF needs not say, and take out what a fixed joint needs not."""
    root = found.root
    root.attrib.setdefault("name", "robot")
    for joint in root.findall("joint"):
        for axis in joint.findall("axis") if joint.get("type") == "fixed" else ():
            joint.remove(axis)
        own = found.body.joints.get(joint.get("name", ""))
        for limit in joint.findall("limit"):
            if own is not None and own.motor is not None and _number(limit.get("effort", "")):
                found.leave("limits of effort do nothing: write them into motor", 1)
            for key in ("effort", "velocity"):
                limit.attrib.setdefault(key, "0")
    for tag, what in (("transmission", "transmissions"), ("gazebo", "<gazebo>")):
        if count := len(root.findall(tag)):
            found.leave(f"{what} of the file", count)


def fail(body: Mechanism, text: str) -> KeyedError:
    """The error of a file."""
    return KeyedError(body.kind, "file", f" = {show(body.file)}{text}")


def _name(element: Element) -> str:
    return show(element.get("name", "?"))


def _parts(root: Element) -> Iterator[tuple[Element, str]]:
    """Elements that are read, and whose they are."""
    robot = root.tag == "robot"
    within = [(root, "")]
    while within:
        element, owner = within.pop()
        owner = f" of {_name(element)}" if "name" in element.attrib else owner
        within += [
            (inner, owner)
            for inner in element
            if inner.tag != "visual" and (element is not root or not robot or inner.tag in _TOPS)
        ]
        if robot or element.tag in _READ:
            yield element, owner


def _check_names(body: Mechanism, root: Element) -> None:
    """Refuse links and joints that have one name, or none."""
    robot = root.tag == "robot"
    known: set[tuple[str, str | None]] = set()
    links = 0
    for element in root if robot else root.iterfind("worldbody//"):
        what = "link" if element.tag == "body" else element.tag
        if what not in _TOPS:
            continue
        links += what == "link"
        name = element.get("name")
        if robot and not name:
            raise fail(body, f": a {what} has no name: give it one.")
        if name and (what, name) in known:
            raise fail(body, f": two {what}s have the name {show(name)}: give each its own.")
        known.add((what, name))
    if links > _MOST_LINKS:
        raise fail(body, f" has {links} links, more than the {_MOST_LINKS} that are read.")


def _check_numbers(body: Mechanism, root: Element) -> None:
    """Refuse attributes with other numbers than they have, or that are not finite."""
    counts = _COUNTS[root.tag]
    for element, owner in _parts(root):
        for key, text in element.attrib.items():
            words = [] if key in _NAMES else text.split()
            numbers = [value for value in map(_number, words) if value is not None]
            count, fault = counts.get(key, len(words)), ""
            if key in counts and not len(words) == len(numbers) == count:
                fault = f"{count} number{'s' * (count > 1)}"
            elif not all(_is_usable(value, key) for value in numbers):
                fault = f"finite numbers up to {MOST:g}"
            elif key in _SIZES and min(numbers, default=0.0) < 0.0:
                fault = "a number >= 0"
            elif (key in {"axis", "quat"} or element.tag == "axis") and not any(numbers):
                fault = "a direction or rotation, not only 0"
            elif key == "range" and counts.get(key) and numbers[0] > numbers[1]:
                fault = "the lower limit first"
            if fault:
                shown = f": <{element.tag}>{owner} has {key} = {show(text)}: give {fault}."
                raise fail(body, shown)


def _is_usable(value: float, key: str) -> bool:
    return abs(value) <= MOST or (key in _LIMITS and math.isinf(value))


def _number(text: str) -> float | None:
    """A number in a text; None of a word."""
    try:
        return float(text)
    except ValueError:
        return None


def _numbers(element: Element, key: str, count: int) -> list[float] | None:
    """Numbers of an attribute; None if there are not as many, which Pinocchio tells."""
    found = [_number(word) for word in element.get(key, "").split()]
    given = [value for value in found if value is not None]
    return given if len(found) == len(given) == count else None


def _check_joints(found: Checked) -> None:
    body, root = found.body, found.root
    links = [link.get("name", "?") for link in root.iter("link")]
    kinds = {joint.get("name", "?"): joint.get("type") for joint in root.findall("joint")}
    for joint in root.findall("joint"):
        kind, name = joint.get("type"), _name(joint)
        if kind not in _JOINTS:
            text = f": joint {name} has type = {show(kind)}: give one of {', '.join(_JOINTS)}."
            raise fail(body, text)
        for mimic in joint.findall("mimic"):
            if kind != "fixed":
                _take_mimic(found, joint, mimic, kinds)
            joint.remove(mimic)
        if kind in {"revolute", "prismatic"}:
            _check_limit(body, joint.find("limit"), name)
        ends = joint.findall("parent"), joint.findall("child")
        if [*map(len, ends)] != [1, 1]:
            raise fail(body, f": joint {name} needs one <parent> and one <child>.")
        for (end,) in ends:
            if (link := end.get("link", "")) not in links:
                raise named(body.kind, "file", link, links, f"link in {body.file} named")
        if kind == "spherical":
            joint.set("type", "floating")
            found.spherical.add(joint.get("name", ""))


def _take_mimic(
    found: Checked, joint: Element, mimic: Element, kinds: Mapping[str, str | None]
) -> None:
    """A joint that follows another one."""
    body, name, other = found.body, joint.get("name", ""), mimic.get("joint", "")
    if other not in kinds or other == name:
        what = f"other joint for {show(name)} to mimic,"
        raise named(body.kind, "file", other, list(kinds), what)
    numbers = (_number(mimic.get(key, each)) for key, each in _MIMIC)
    ratio, offset = (math.nan if each is None else each for each in numbers)
    if not (math.isfinite(ratio) and math.isfinite(offset)):
        raise fail(body, f": <mimic> of joint {show(name)} has no finite multiplier and offset.")
    if offset == 0.0 and kinds[other] == "fixed":  # nor does this one move
        joint.set("type", "fixed")
    else:
        found.mimics[name] = other, ratio, offset


def _check_limit(body: Mechanism, limit: Element | None, name: str) -> None:
    """Refuse a joint without the limits that its type has, or with none between them."""
    if limit is None:
        text = f": joint {name} has no <limit>: give lower and upper, or make it continuous."
        raise fail(body, text)
    lower, upper = (float(limit.get(key, "0")) for key in ("lower", "upper"))
    if lower > upper:
        text = f": joint {name} has the limits {lower:g} to {upper:g}: give the lower one first."
        raise fail(body, text)


def _check_tree(body: Mechanism, root: Element) -> None:
    """Refuse links that hang on two joints, on nothing, or on themselves."""
    above: dict[str, str] = {}
    names = {link.get("name", "?") for link in root.findall("link")}
    for joint in root.findall("joint"):
        parent, child = (next(joint.iter(end)).get("link", "") for end in ("parent", "child"))
        if child in above:
            text = f": link {show(child)} hangs on two joints: a mechanism is a tree, close loops "
            raise fail(body, f"{text}by [[joint]].")
        above[child] = parent
    roots = sorted(names.difference(above))
    if len(roots) > 1:
        shown = ", ".join(map(show, roots[:4]))
        text = f" has {len(roots)} first links, {shown}{', ...' * (len(roots) > 4)}: join them."
        raise fail(body, text)
    known = set(roots)
    for link in sorted(names):
        way: list[str] = []
        while link not in known and link not in way:
            way.append(link)
            link = above[link]  # noqa: PLW2901  (the one that it hangs on)
        if link in way:
            text = f": link {show(link)} hangs on itself: a mechanism is a tree with a first link."
            raise fail(body, text)
        known.update(way)


def _check_masses(found: Checked) -> None:
    """Refuse masses and inertias with which nothing moves; tell those that no body has."""
    body, root = found.body, found.root
    for link in (*root.iter("link"), *root.iter("body")):
        own = link.find("inertial")
        if own is None:
            continue
        mass, inner = own.find("mass"), own.find("inertia")
        source, key = (own, "mass") if mass is None else (mass, "value")
        heavy, who = _number(source.get(key, "")), f": link {_name(link)} "
        if heavy is None or heavy < 0.0:
            text = f"{who}has the mass {show(source.get(key, ''))}: give a number >= 0."
            raise fail(body, text)
        moments = _moments(own if inner is None else inner)
        if moments is None:
            if root.tag != "robot":
                continue
            text = f"{who}has no inertia: give <inertia ixx iyy izz ixy ixz iyz> beside the mass."
            raise fail(body, text)
        negligible = np.abs(moments).max() <= _SMALL * heavy
        if not negligible and (fault := inertia_fault(moments, thin=True)):
            if not np.isfinite(moments).all():
                raise fail(body, f"{who.rstrip()}{fault}")
            found.leave(f"{who[2:].rstrip()}{fault.partition(';')[0]}, and is taken as it stands")
        if heavy == 0.0 and moments.any():
            found.leave(f"{who[2:]}has inertia, but no mass, and is taken as it stands")


def _moments(element: Element) -> NDArray[np.float64] | None:
    """Inertia of an element of URDF or MJCF, (3, 3); None if it gives none."""
    if (found := _numbers(element, "diaginertia", 3)) is not None:
        return np.diag(found)
    full = _numbers(element, "fullinertia", 6)
    if full is None and "ixx" in element.attrib:
        each = [_numbers(element, f"i{key}", 1) for key in ("xx", "yy", "zz", "xy", "xz", "yz")]
        full = [value for entry in each for value in entry or ()]
    if full is None or len(full) < 6:
        return None
    xx, yy, zz, xy, xz, yz = full
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _check_mjcf(found: Checked) -> None:
    body, root = found.body, found.root
    for tag in _GROWING:
        if next(root.iter(tag), None) is not None:
            raise fail(body, f": <{tag}> is not modelled: write the file without.")
    for joint in root.iter("joint"):
        if (kind := joint.get("type", _HINGES[0])) not in _HINGES:
            text = f": joint {_name(joint)} has type = {show(kind)}: give one of "
            raise fail(body, f"{text}{', '.join(_HINGES)}.")
    world = root.find("worldbody")
    roots = [] if world is None else world.findall("body")
    if world is None or len(roots) != 1:
        text = f": its <worldbody> has {len(roots)} bodies: give one tree, others as [[body]]."
        raise fail(body, text)
    for link in root.iter("body"):
        if link.find("inertial") is None and any("mesh" in g.attrib for g in link.findall("geom")):
            text = f": body {_name(link)} has its mass from a mesh, which is not read: give it "
            raise fail(body, f"{text}<inertial>.")
    _leave_out(found, world)


def _leave_out(found: Checked, world: Element) -> None:
    """Take out what nothing reads of MJCF, and tell what would change the motion."""
    root, known = found.root, Defaults(found.root)
    for tag, what in _UNREAD.items():
        for element in root.findall(tag):
            if what is not None and len(element):
                found.leave(f"{what} of the file are not read", len(element))
            root.remove(element)
    for option in root.findall("option"):
        if given := sorted({"gravity", "wind", "density", "viscosity"}.intersection(option.attrib)):
            found.leave(f"<option> {', '.join(given)} of the file: the scene has its own")
    still = world.findall("geom")
    if others := sum(known.of(geom).get("type") != "plane" for geom in still):
        found.leave("shapes of the world that are no planes: give [[obstacle]]", others)
    for geom in still:
        world.remove(geom)
    if any("friction" in geom.attrib for geom in root.iter("geom")):
        found.leave("friction of shapes: [[contact]] has friction_coefficient")


def _part_joints(root: Element) -> None:
    """Give each of several joints of a body of MJCF a body of its own, the last one what it holds.

    Pinocchio would make one joint of them, without their names and limits.
    """
    for body in list(root.iter("body")):
        for joint in body.findall("joint")[:-1]:
            inner = Element("body", {k: body.attrib.pop(k) for k in ("name",) if k in body.attrib})
            held = [each for each in body if each is not joint]
            for each in held:
                body.remove(each)
            inner.extend(held)
            body.append(inner)
            body = inner  # noqa: PLW2901  (the next joint is in there)
    # Without a name Pinocchio passes over what moves it.
    known = {body.get("name") for body in root.iter("body")}
    free = (f"body_{k}" for k in range(1, 10 * _MOST_LINKS) if f"body_{k}" not in known)
    for body in root.iter("body"):
        if not body.get("name"):
            body.set("name", next(free))


def _take_equalities(found: Checked) -> None:
    """Joints that follow another one, of MJCF; tell other equalities."""
    root = found.root
    known = [joint.get("name") for joint in root.iterfind("worldbody//joint")]
    for group in root.findall("equality"):
        for entry in group:
            one, other = entry.get("joint1"), entry.get("joint2")
            numbers = [_number(word) for word in entry.get("polycoef", "0 1 0 0 0").split()]
            linear = len(numbers) >= 2 and None not in numbers and not any(numbers[2:])
            if entry.tag == "joint" and one in known and other in known and linear and one != other:
                offset, ratio = numbers[:2]
                found.mimics[str(one)] = str(other), float(ratio or 0.0), float(offset or 0.0)
            else:
                found.leave(f"<equality> {entry.tag}: close loops by [[joint]]")
        root.remove(group)


def _check_classes(body: Mechanism, root: Element) -> None:
    """Refuse classes of defaults that the file does not have."""
    known = ["main", *(found.get("class", "main") for found in root.iter("default"))]
    for element in root.iter():
        for key in ("class", "childclass"):
            name = element.get(key)
            if name is not None and name not in known:
                what = f"<default class> in {body.file} for <{element.tag} {key}>, named"
                raise named(body.kind, "file", name, sorted({*known}), what)


def _urdf_meshes(root: Element) -> Iterator[tuple[str, str, Element, str]]:
    """Who names a mesh for contact, its path, and where it stands."""
    for link in root.iter("link"):
        for seen in link.findall("visual"):
            link.remove(seen)
        for mesh in link.findall("collision/geometry/mesh"):
            yield f"link {_name(link)}", mesh.get("filename", ""), mesh, "filename"


def _mjcf_meshes(root: Element) -> Iterator[tuple[str, str, Element, str]]:
    """The same of MJCF, whose meshes have names."""
    compiler = root.find("compiler")
    where = ""
    if compiler is not None:
        folders = [compiler.attrib.pop(key, None) for key in ("meshdir", "assetdir")]
        where = next((folder for folder in folders if folder is not None), "")
    for mesh in root.iter("mesh"):
        if (given := mesh.get("file")) is not None:
            mesh.set("name", mesh.get("name", Path(given).stem))  # the file has another one now
            yield f"mesh {_name(mesh)}", str(Path(where, given)), mesh, "file"


def _contents(
    body: Mechanism,
    meshes: Iterator[tuple[str, str, Element, str]],
    folder: Path,
    rooms: tuple[Path, ...],
) -> list[tuple[str, bytes, str]]:
    """Read meshes, and refuse those that are missing, no meshes, or outside the folders."""
    found: dict[Path, tuple[str, bytes, str]] = {}
    room = MAX_BYTES
    for who, given, element, key in meshes:
        text, remedy = f": {who} has the mesh {show(given)}", "put it there and name it by its path"
        remedy += f" from {folder}."
        places = [Path(given)] if Path(given).is_absolute() else places_of(given, folder, rooms)
        if not places:
            raise fail(body, f"{text}, whose place only ROS knows: {remedy}")
        there = [each for each in places if each.exists()] or places
        within = [path for path in (inside(each, rooms) for each in there) if path is not None]
        if not within or Path(given).is_absolute():
            what = "outside the folder of the file, of the scene, and of a package (package.xml)"
            raise fail(body, f"{text}, {what}: {remedy}")
        path = within[0]
        ending = path.suffix.lower()
        if ending not in MESHES:
            raise fail(body, f"{text}: give one of {', '.join(MESHES)}.")
        if path not in found:
            try:
                content = read_regular(path, room)
            except FileNotFoundError:
                raise fail(body, f"{text}, which does not exist: {remedy}") from None
            except (OSError, ValueError) as error:
                why = f"{text}, which cannot be read ({reason(error)}): {remedy}"
                raise fail(body, why) from None
            room -= len(content)
            found[path] = f"mesh{len(found)}{ending}", content, given
        element.set(key, found[path][0])
    return [*found.values()]
