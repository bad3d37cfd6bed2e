"""Checks of URDF and MJCF files before Pinocchio reads them: what it would pass over or hide."""

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from impactfem.scene import Mechanism
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.link_shapes import named

Element = ET.Element

_MOST_BYTES = 10 * 2**20
_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_UNKNOWN = ("actuator", "equality", "tendon", "include", "replicate", "composite", "flexcomp")


def checked(body: Mechanism, path: Path) -> Element:
    """The XML of the file of a mechanism.

    Raises:
        KeyedError: It cannot be read, holds what is not modelled, or names meshes elsewhere.
    """
    root = _parsed(body, path)
    if root.tag == "robot":
        _check_joints(body, root)
        _check_links(body, root)
        meshes = _urdf_meshes(root)
    else:
        _check_mjcf(body, root)
        meshes = _mjcf_meshes(root)
    _check_meshes(body, meshes, path.absolute().parent)
    return root


def fail(body: Mechanism, text: str) -> KeyedError:
    """The error of a file."""
    return KeyedError(body.kind, "file", f" = {show(body.file)}{text}")


def _parsed(body: Mechanism, path: Path) -> Element:
    try:
        size = path.stat().st_size
        text = path.read_text(encoding="utf-8-sig") if size <= _MOST_BYTES else ""
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise fail(body, f" cannot be read ({why}): check the path.") from None
    if size > _MOST_BYTES:
        raise fail(body, " is larger than 10 MiB: give the file of one mechanism.")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise fail(body, " declares a document type, which is not read: remove it.")
    try:
        root = ET.fromstring(text)  # noqa: S314  (no entities, limited size)
    except ET.ParseError as error:
        raise fail(body, f" is not valid XML ({error}): correct it.") from None
    wanted = "robot" if path.suffix.lower() == ".urdf" else "mujoco"
    if root.tag != wanted:
        raise fail(body, f" begins with <{root.tag}>, not <{wanted}>: give a URDF or MJCF file.")
    return root


def _check_joints(body: Mechanism, root: Element) -> None:
    links = [link.get("name", "?") for link in root.iter("link")]
    for joint in root.findall("joint"):
        kind, name = joint.get("type"), show(joint.get("name", "?"))
        if kind not in _JOINTS:
            text = f": joint {name} has type = {show(kind)}: give one of {', '.join(_JOINTS)}."
            raise fail(body, text)
        if joint.find("mimic") is not None:
            text = f": joint {name} mimics another one, which is not modelled: remove <mimic>."
            raise fail(body, text)
        for end in (*joint.findall("parent"), *joint.findall("child")):
            if (link := end.get("link", "")) not in links:
                raise named(body.kind, "file", link, links, f"link in {body.file} named")


def _check_links(body: Mechanism, root: Element) -> None:
    for link in root.iter("link"):
        mass = link.find("inertial/mass")
        if mass is not None and not _is_mass(value := mass.get("value", "")):
            text = f": link {show(link.get('name', '?'))} has the mass {show(value)}: give a "
            raise fail(body, f"{text}number >= 0.")


def _is_mass(text: str) -> bool:
    """Whether a text is a finite number from 0 on."""
    try:
        return 0.0 <= float(text) < math.inf
    except ValueError:
        return False


def _check_mjcf(body: Mechanism, root: Element) -> None:
    for tag in _UNKNOWN:
        if any(len(found) or found.attrib for found in root.iter(tag)):
            remedy = "give motors by joints" if tag == "actuator" else "write the file without"
            raise fail(body, f": <{tag}> is not modelled: {remedy}.")
    for joint in root.iter("joint"):
        if any(spring.strip("0.") for spring in joint.get("stiffness", "0").split()):
            text = f": joint {show(joint.get('name', '?'))} has a spring, which is not read: "
            raise fail(body, f'{text}give it by joints, as motor = "-10*q".')
    world = root.find("worldbody")
    roots = [] if world is None else world.findall("body")
    if len(roots) != 1:
        text = f": its <worldbody> has {len(roots)} bodies: give one tree, others as [[body]]."
        raise fail(body, text)


def _urdf_meshes(root: Element) -> Iterator[tuple[str, str]]:
    """Who names a mesh for contact, and its path."""
    for link in root.iter("link"):
        for mesh in link.findall("collision/geometry/mesh"):
            yield f"link {show(link.get('name', '?'))}", mesh.get("filename", "")


def _mjcf_meshes(root: Element) -> Iterator[tuple[str, str]]:
    """Names of meshes, and their paths."""
    compiler = root.find("compiler")
    where = "" if compiler is None else compiler.get("meshdir", compiler.get("assetdir", ""))
    for mesh in root.iter("mesh"):
        if (given := mesh.get("file")) is not None:
            yield f"mesh {show(mesh.get('name', given))}", str(Path(where, given))


def _check_meshes(body: Mechanism, meshes: Iterator[tuple[str, str]], folder: Path) -> None:
    """Refuse meshes that are missing, or outside the folder of the file."""
    for who, given in meshes:
        shown, remedy = show(given), f"put it there and name it by its path from {folder}"
        if "://" in given:
            text = f": {who} has the mesh {shown}, whose place only ROS knows: {remedy}."
            raise fail(body, text)
        found = (folder / given).resolve()
        if Path(given).is_absolute() or not found.is_relative_to(folder.resolve()):
            text = f": {who} has the mesh {shown}, outside the folder of the file: {remedy}."
            raise fail(body, text)
        if not found.is_file():
            raise fail(body, f": {who} has the mesh {shown}, which does not exist: {remedy}.")
