"""Checks of URDF and MJCF files before Pinocchio reads them: what it would pass over or hide."""

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from impactfem.reading.regular import MAX_BYTES, read_regular, reason
from impactfem.scene import Mechanism
from impactfem.scene.rigid_keys import inertia_fault
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import MOST, show
from impactfem.system.link_shapes import named

Element = ET.Element

MESHES = (".stl", ".obj", ".dae")
"""Endings of the meshes of collision shapes."""

_MOST_BYTES = 10 * 2**20
_MOST_LINKS = 1000  # their inertia matrix is dense; MJCF takes 1 GiB for 300 in one chain
_DEEPEST = 500  # elements within each other
_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_HINGES = ("hinge", "slide", "ball", "free")
_UNKNOWN = ("actuator", "equality", "tendon", "include", "replicate", "composite", "flexcomp")
# Attributes that are no numbers, whatever they look like; that may be infinite; that are >= 0.
_NAMES = {"name", "link", "joint", "filename", "file", "class", "childclass", "mesh", "material",
          "model"}  # fmt: skip
_LIMITS = {"lower", "upper", "effort", "velocity", "range"}
_SIZES = {"damping", "friction", "frictionloss", "armature", "mass", "density"}
_TOPS = {"link", "joint"}
_READ = {"body", "joint", "freejoint", "geom", "inertial", "mesh"}  # of MJCF
# How many numbers attributes have: links and joints with others are read in part, or passed over.
_COUNTS = {
    "robot": {"xyz": 3, "rpy": 3, "size": 3, "scale": 3}
    | dict.fromkeys(("radius", "length", "lower", "upper", "effort", "velocity", "damping"), 1)
    | dict.fromkeys(("friction", "ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 1),
    "mujoco": {"pos": 3, "axis": 3, "quat": 4, "euler": 3, "axisangle": 4, "fromto": 6, "range": 2}
    | {"diaginertia": 3, "fullinertia": 6}
    | dict.fromkeys(("damping", "frictionloss", "armature", "mass", "density"), 1),
}  # fmt: skip


def checked(body: Mechanism, path: Path) -> tuple[Element, list[tuple[str, bytes, str]]]:
    """The XML of the file of a mechanism, and what meshes it names: name, content, path as given.

    They are named ``mesh0.stl`` and so on in the XML, in order; what nothing reads is taken out.

    Raises:
        KeyedError: It cannot be read, holds what is not modelled, or names meshes elsewhere.
    """
    root = _parsed(body, path)
    _check_names(body, root)
    _check_numbers(body, root)
    if root.tag == "robot":
        _check_joints(body, root)
        _check_tree(body, root)
        meshes = _urdf_meshes(root)
    else:
        _check_mjcf(body, root)
        _check_classes(body, root)
        meshes = _mjcf_meshes(root)
    _check_masses(body, root)
    return root, _contents(body, meshes, path.absolute().parent)


def fail(body: Mechanism, text: str) -> KeyedError:
    """The error of a file."""
    return KeyedError(body.kind, "file", f" = {show(body.file)}{text}")


def _parsed(body: Mechanism, path: Path) -> Element:
    try:
        text = read_regular(path, _MOST_BYTES).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        raise fail(body, f" cannot be read ({reason(error)}): check the path.") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise fail(body, " declares a document type, which is not read: remove it.")
    try:
        root = ET.fromstring(text)  # noqa: S314  (no entities, limited size)
    except (ET.ParseError, ValueError) as error:
        raise fail(body, f" is not valid XML ({error}): correct it.") from None
    wanted = "robot" if path.suffix.lower() == ".urdf" else "mujoco"
    if root.tag != wanted:
        raise fail(body, f" begins with <{root.tag}>, not <{wanted}>: give a URDF or MJCF file.")
    within, depth = [root], 0
    while within:
        within, depth = [inner for element in within for inner in element], depth + 1
        if depth > _DEEPEST:
            text = f" has elements within each other deeper than {_DEEPEST}: give a flatter file."
            raise fail(body, text)
    return root


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
    """Refuse links and joints that have one name, and a robot without any."""
    robot = root.tag == "robot"
    if robot and "name" not in root.attrib:
        raise fail(body, ': its <robot> has no name: write <robot name="...">.')
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


def _check_joints(body: Mechanism, root: Element) -> None:
    links = [link.get("name", "?") for link in root.iter("link")]
    for joint in root.findall("joint"):
        kind, name = joint.get("type"), _name(joint)
        if kind not in _JOINTS:
            text = f": joint {name} has type = {show(kind)}: give one of {', '.join(_JOINTS)}."
            raise fail(body, text)
        if joint.find("mimic") is not None:
            text = f": joint {name} mimics another one, which is not modelled: remove <mimic>."
            raise fail(body, text)
        if kind in {"revolute", "prismatic"}:
            _check_limit(body, joint.find("limit"), name)
        ends = joint.findall("parent"), joint.findall("child")
        if [*map(len, ends)] != [1, 1]:
            raise fail(body, f": joint {name} needs one <parent> and one <child>.")
        for (end,) in ends:
            if (link := end.get("link", "")) not in links:
                raise named(body.kind, "file", link, links, f"link in {body.file} named")


def _check_limit(body: Mechanism, limit: Element | None, name: str) -> None:
    """Refuse a joint without the limits that its type has, or with none between them."""
    missing = {"effort", "velocity"}.difference({} if limit is None else limit.attrib)
    if limit is None or missing:
        what = "<limit>" if limit is None else f"{min(missing)} in its <limit>"
        text = f": joint {name} has no {what}: give lower, upper, effort and velocity, or make it "
        raise fail(body, f"{text}continuous.")
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


def _check_masses(body: Mechanism, root: Element) -> None:
    """Refuse masses and inertias that no body has."""
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
        if fault := inertia_fault(moments, thin=True):
            raise fail(body, f"{who.rstrip()}{fault}")
        if heavy == 0.0 and moments.any():
            raise fail(body, f"{who}has inertia, but no mass: give both, or neither.")


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


def _check_mjcf(body: Mechanism, root: Element) -> None:
    for tag in _UNKNOWN:
        if any(len(found) or found.attrib for found in root.iter(tag)):
            remedy = "give motors by joints" if tag == "actuator" else "write the file without"
            raise fail(body, f": <{tag}> is not modelled: {remedy}.")
    for joint in root.iter("joint"):
        if any(spring.strip("0.") for spring in joint.get("stiffness", "0").split()):
            text = f": joint {_name(joint)} has a spring, which is not read: "
            raise fail(body, f'{text}give it by joints, as motor = "-10*q".')
        if (kind := joint.get("type", _HINGES[0])) not in _HINGES:
            text = f": joint {_name(joint)} has type = {show(kind)}: give one of "
            raise fail(body, f"{text}{', '.join(_HINGES)}.")
    world = root.find("worldbody")
    roots = [] if world is None else world.findall("body")
    if len(roots) != 1:
        text = f": its <worldbody> has {len(roots)} bodies: give one tree, others as [[body]]."
        raise fail(body, text)
    for link in root.iter("body"):
        if link.find("inertial") is None and any("mesh" in g.attrib for g in link.findall("geom")):
            text = f": body {_name(link)} has its mass from a mesh, which is not read: give it "
            raise fail(body, f"{text}<inertial>.")


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
    body: Mechanism, meshes: Iterator[tuple[str, str, Element, str]], folder: Path
) -> list[tuple[str, bytes, str]]:
    """Read meshes, and refuse those that are missing, no meshes, or outside the folder."""
    found: dict[Path, tuple[str, bytes, str]] = {}
    room = MAX_BYTES
    for who, given, element, key in meshes:
        path = (folder / given).resolve()
        text, remedy = f": {who} has the mesh {show(given)}", "put it there and name it by its path"
        remedy += f" from {folder}."
        if "://" in given:
            raise fail(body, f"{text}, whose place only ROS knows: {remedy}")
        if Path(given).is_absolute() or not path.is_relative_to(folder.resolve()):
            raise fail(body, f"{text}, outside the folder of the file: {remedy}")
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
