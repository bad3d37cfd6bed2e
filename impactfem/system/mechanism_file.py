"""Reading of mechanisms: URDF and MJCF files, by Pinocchio."""

import pickle  # what our own process found
import re
import tempfile
from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from impactfem.reading.apart import ApartError, apart
from impactfem.reading.robot_xml import Defaults
from impactfem.scene import Block, Capsule, Hull, Mechanism, Sphere
from impactfem.scene.rigid_forms import Form, form_of, hull_corners
from impactfem.scene.rigid_keys import rotation
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.actuators import Acting
from impactfem.system.link_shapes import LinkShape, coarser
from impactfem.system.mechanism_checks import checked, fail
from impactfem.system.tree import Tree, import_pinocchio

_UNEVEN = 1e-3  # share of the largest moment of inertia by which the least one may be below 0
_SMALL = 1e-9  # moment of inertia by mass that counts [m^2]
_FREE = 6  # rates of a free base
_AROUND = 16  # places of the rim of a cylinder
_LIBRARY = re.compile(rb"^[ \t]*mtllib[^\n]*", re.MULTILINE)
_PROGRAM = """
import pickle

source, target, kind, free = sys.argv[4:]
try:
    import pinocchio as pin
except (ImportError, OSError) as error:
    print(f"Pinocchio cannot be loaded ({error}); pip install impactfem[robots]", file=sys.stderr)
    sys.exit(3)

def told(model, shape):
    given, placement = shape.geometry, shape.placement
    found = {
        "link": str(model.frames[shape.parentFrame].name), "joint": int(shape.parentJoint),
        "kind": type(given).__name__, "turn": placement.rotation, "place": placement.translation,
    }
    if found["kind"].startswith(("BVHModel", "Convex")):
        points = given.vertices() if found["kind"].startswith("BVH") else given.points()
        found |= {"kind": "mesh", "points": points.copy()}
    return found | {
        key: getattr(given, key) for key in ("halfSide", "radius", "halfLength")
        if hasattr(given, key)
    }

try:
    with bounded():
        if kind == "robot":
            model = pin.buildModelFromUrdf(source, *((pin.JointModelFreeFlyer(),) if free else ()))
            shapes = pin.buildGeomFromUrdf(
                model, source, pin.GeometryType.COLLISION, package_dirs=[os.path.dirname(source)]
            )
        else:
            model = pin.buildModelFromMJCF(source)
            shapes = pin.buildGeomFromMJCF(model, source, pin.GeometryType.COLLISION)
        found = pickle.dumps((model, [told(model, shape) for shape in shapes.geometryObjects]))
except MemoryError:
    sys.exit("it takes more memory than a file of its size may")
except Exception as error:
    said = " ".join(str(error).split()).rpartition("message: ")[2].partition(" Hint:")[0]
    sys.exit(said.rstrip(".") or type(error).__name__)
with open(target, "wb") as file:
    file.write(found)
"""


_ENDLESS = 1e30  # what files without limits become


class Robot(NamedTuple):
    """A mechanism as its file has it.

    Attributes:
        tree: Kinematics and dynamics, its base where it is at t = 0.
        shapes: Collision shapes of its links.
        acting: Actuators and springs by joint.
        left_out: What of the file is not taken as it stands, in words.
    """

    tree: Tree
    shapes: list[LinkShape]
    acting: Mapping[str, Acting]
    left_out: tuple[str, ...]


def read_mechanism(body: Mechanism, folder: Path | None) -> Robot:
    """What the file of a mechanism holds.

    Raises:
        KeyedError: The file cannot be read, holds what is not modelled, or names meshes elsewhere.
        MissingDependencyError: Pinocchio is not installed.
    """
    file = checked(body, Path(folder or "", body.file), folder)
    root = file.root
    pin, free = import_pinocchio(), body.base == "free"
    if free and root.tag != "robot":
        word = " of an MJCF file is what the file says: write <freejoint/> there, and remove "
        raise KeyedError(body.kind, "base", f' = "free"{word}base.')
    free |= root.tag == "robot" and len(root.findall("link")) == 1
    try:
        found = _read(ET.tostring(root), root.tag, tuple(file.meshes), free)
    except ApartError as error:
        raise fail(body, f": {' '.join(str(error).split())}.") from None
    model, given = pickle.loads(found)  # noqa: S301  (our own process wrote it)
    for link in root.iter("link"):
        read = sum(shape["link"] == link.get("name") for shape in given)
        if (missing := len(link.findall("collision")) - read) > 0:
            word = f"link {show(link.get('name', '?'))} has a collision shape that is not read: "
            word += 'give box, sphere, cylinder, mesh, or with <robot version="1.2"> capsule'
            file.leave(word, missing)
    _check_inertias(body, model)
    _limit_slides(model, root)
    there = pin.SE3(rotation(body.quaternion), np.asarray(body.position, dtype=float))
    _move_base(pin, model, given, there)
    _free_base(pin, model, file.spherical)
    try:
        tree = Tree(model, file.mimics, file.spherical)
    except ValueError as error:
        text = f": joint {show(str(error))} mimics itself, or is no joint of one degree of freedom "
        raise fail(body, text + "that others may mimic: correct <mimic>.") from None
    shapes = [_shape(body, shape) for shape in given]
    return Robot(tree, coarser(shapes, file.leave), file.acting, file.told)


@lru_cache(maxsize=4)  # members of ensembles have the file in common
def _read(
    content: bytes, kind: str, meshes: tuple[tuple[str, bytes, str], ...], free: bool
) -> bytes:
    """Model and shapes of a file, read apart and pickled.

    Raises:
        ApartError: Pinocchio does not read it.
    """
    with tempfile.TemporaryDirectory(prefix="impactfem-") as folder:
        source, target = Path(folder, "file.xml"), Path(folder, "found")
        source.write_bytes(content)
        for name, mesh, _ in meshes:
            # An .obj may name further files, which nothing here needs.
            Path(folder, name).write_bytes(_LIBRARY.sub(b"", mesh) if ".obj" in name else mesh)
        size = len(content) + sum(len(mesh) for _, mesh, _ in meshes)
        words = [str(source), str(target), kind, "free" if free else ""]
        try:
            apart(_PROGRAM, words, size, "Pinocchio")
        except ApartError as error:
            text = str(error).replace(f"The file {source}", "it").replace(f"{source}", "it")
            for name, _, given in meshes:
                text = text.replace(f"{Path(folder, name)}", given)
            raise ApartError(text) from None
        return target.read_bytes()


def _limit_slides(model: Any, root: Any) -> None:
    """Limits of joints that slide as an MJCF file has them: Pinocchio turns metres into radians.

    It does where angles are degrees, as they are by default; MuJoCo means metres anyhow.
    """
    known = Defaults(root)
    for joint in root.iter("joint") if root.tag == "mujoco" else ():
        given = known.of(joint)
        name, ends = given.get("name", ""), given.get("range", "").split()
        if given.get("type") != "slide" or len(ends) != 2 or not model.existJointName(name):
            continue
        first = model.idx_qs[model.getJointId(name)]
        for limits, end in zip((model.lowerPositionLimit, model.upperPositionLimit), ends,
                               strict=True):  # fmt: skip
            if abs(limits[first]) < _ENDLESS:
                limits[first] = float(end)


def _move_base(pin: Any, model: Any, shapes: list[dict[str, Any]], there: Any) -> None:
    """Put what hangs on the world elsewhere."""
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = there * model.jointPlacements[joint]
    for entry in list(model.frames)[1:]:
        if entry.parentJoint == 0:
            entry.placement = there * entry.placement
    for shape in shapes:
        if shape["joint"] == 0:
            moved = there * pin.SE3(shape["turn"], shape["place"])
            shape |= {"turn": moved.rotation, "place": moved.translation}


def _free_base(pin: Any, model: Any, spherical: Collection[str]) -> None:
    """Let the coordinates of a free base say where it is at t = 0, not the place of its joint."""
    first = model.joints[1] if model.njoints > 1 else None
    if first is None or model.parents[1] != 0 or first.nv != _FREE or model.names[1] in spherical:
        return
    known = model.referenceConfigurations
    start = pin.neutral(model)
    if "qpos0" in known:  # of MJCF
        start[:7] = known["qpos0"][:7]
    pose = model.jointPlacements[1] * pin.XYZQUATToSE3(start[:7])
    model.jointPlacements[1] = pin.SE3.Identity()
    start[:7] = pin.SE3ToXYZQUAT(pose)
    known["base"] = start


def _check_inertias(body: Mechanism, model: Any) -> None:
    """Refuse links, with all that is fixed to them, whose rotation would have a negative energy."""
    for name, inertia in list(zip(model.names, model.inertias, strict=True))[1:]:
        own = np.linalg.eigvalsh(np.array(inertia.inertia))
        if own[0] < -_UNEVEN * max(abs(own[2]), inertia.mass * _SMALL):
            text = f": what moves with joint {show(name)} has the principal moments "
            text += (
                f"{', '.join(f'{value:.6g}' for value in own)}: all have to be >= 0; check them."
            )
            raise fail(body, text)


def _shape(body: Mechanism, shape: dict[str, Any]) -> LinkShape:
    """A collision shape in the frame of its joint."""
    link, kind = shape["link"], shape["kind"]
    try:
        form = _form(shape)
    except KeyedError as error:
        if kind == "mesh":
            text = f": the mesh of {link} has no volume: give one that is not flat, with finite "
            raise fail(body, f"{text}coordinates.") from None
        why = f"{error.key}{error.text}".partition("; give ")[0].partition(": give")[0]
        text = f": the {kind.lower()} of {link} has no volume, {why}: give sizes > 0."
        raise fail(body, text) from None
    if form is None:
        text = f": a shape of {link} is a {kind}: give boxes, spheres, capsules, "
        raise fail(body, f"{text}cylinders or meshes; what stays where it is as [[obstacle]].")
    turn, place = shape["turn"], shape["place"]
    nodes, points = (np.asarray(place + each @ turn.T) for each in (form.nodes, form.points))
    found = LinkShape(link, shape["joint"], nodes, form.radius, points, form.cells)
    if kind == "Cylinder":
        way = shape["halfLength"] * turn[:, 2]
        found = replace(found, ends=place + np.stack([-way, way]), girth=float(shape["radius"]))
    return found


def _form(shape: dict[str, Any]) -> Form | None:
    """What a shape of coal amounts to in its own frame; None of those that are not modelled.

    Raises:
        KeyedError: It has no volume.
    """
    kind, axis = shape["kind"], [0.0, 0.0, 1.0]
    radius, half = float(shape.get("radius", 0.0)), float(shape.get("halfLength", 0.0))
    if kind == "Box":
        corner = np.asarray(shape["halfSide"])
        return form_of(Block(size=(2.0 * corner).tolist(), corner=(-corner).tolist()))
    if kind == "Sphere":
        return form_of(Sphere(radius=radius, center=[0.0, 0.0, 0.0]))
    if kind == "Capsule":
        return form_of(Capsule(radius=radius, length=2.0 * half, axis=axis))
    if kind == "Cylinder":
        angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
        rim = radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(_AROUND)], axis=1)
        up = np.array([0.0, 0.0, half])
        return form_of(Hull(points=np.vstack([rim - up, rim + up]).tolist()))
    if "points" in shape:
        return form_of(Hull(points=hull_corners(np.asarray(shape["points"])).tolist()))
    return None
