"""Reading of mechanisms: URDF and MJCF files, by Pinocchio."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.scene import Block, Capsule, Hull, Mechanism, Sphere
from impactfem.scene.rigid_forms import Form, form_of
from impactfem.scene.rigid_keys import rotation
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.link_shapes import LinkShape
from impactfem.system.mechanism_checks import Element, checked, fail
from impactfem.system.tree import Tree, import_pinocchio

_FREE = 6  # rates of a free base
_AROUND = 16  # places of the rim of a cylinder
_MOST_CORNERS = 500  # of the hull of a mesh


def read_mechanism(body: Mechanism, folder: Path | None) -> tuple[Tree, list[LinkShape]]:
    """The tree of a mechanism, where its base is at t = 0, and its collision shapes.

    Raises:
        KeyedError: The file cannot be read, holds what is not modelled, or names meshes elsewhere.
        MissingDependencyError: Pinocchio is not installed.
    """
    path = Path(folder or "", body.file)
    root, pin = checked(body, path), import_pinocchio()
    try:
        model, shapes = _read(pin, body, path, root)
    except (ValueError, RuntimeError) as error:
        said = " ".join(str(error).replace(str(path), "it").split()).rstrip(".")
        raise fail(body, f": {said}; correct the file.") from None
    there = pin.SE3(rotation(body.quaternion), np.asarray(body.position, dtype=float))
    _move_base(model, shapes, there)
    _free_base(pin, model)
    return Tree(model), [_shape(body, model, shape) for shape in shapes.geometryObjects]


def _read(pin: Any, body: Mechanism, path: Path, root: Element) -> tuple[Any, Any]:
    """Model and geometry of a file."""
    free, text = body.base == "free", str(path)
    if root.tag != "robot":
        if free:
            word = " of an MJCF file is what the file says: write <freejoint/> there, and remove "
            raise KeyedError(body.kind, "base", f' = "free"{word}base.')
        model = pin.buildModelFromMJCF(text)
        return model, pin.buildGeomFromMJCF(model, text, pin.GeometryType.COLLISION)
    model = pin.buildModelFromUrdf(text, *((pin.JointModelFreeFlyer(),) if free else ()))
    shapes = pin.buildGeomFromUrdf(
        model, text, pin.GeometryType.COLLISION, package_dirs=[str(path.parent)]
    )
    for link in root.iter("link"):
        read = sum(_link(model, shape) == link.get("name") for shape in shapes.geometryObjects)
        if read < len(link.findall("collision")):
            word = f": link {show(link.get('name', '?'))} has a collision shape that is not read: "
            word += 'give box, sphere, cylinder, mesh, or with <robot version="1.2"> capsule.'
            raise fail(body, word)
    return model, shapes


def _move_base(model: Any, shapes: Any, there: Any) -> None:
    """Put what hangs on the world elsewhere."""
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = there * model.jointPlacements[joint]
    for entry in (*list(model.frames)[1:], *shapes.geometryObjects):
        if entry.parentJoint == 0:
            entry.placement = there * entry.placement


def _free_base(pin: Any, model: Any) -> None:
    """Let the coordinates of a free base say where it is at t = 0, not the place of its joint."""
    first = model.joints[1] if model.njoints > 1 else None
    if first is None or model.parents[1] != 0 or first.nv != _FREE:
        return
    known = model.referenceConfigurations
    start = pin.neutral(model)
    if "qpos0" in known:  # of MJCF
        start[:7] = known["qpos0"][:7]
    pose = model.jointPlacements[1] * pin.XYZQUATToSE3(start[:7])
    model.jointPlacements[1] = pin.SE3.Identity()
    start[:7] = pin.SE3ToXYZQUAT(pose)
    known["base"] = start


def _link(model: Any, shape: Any) -> str:
    return str(model.frames[shape.parentFrame].name)


def _shape(body: Mechanism, model: Any, shape: Any) -> LinkShape:
    """A collision shape in the frame of its joint."""
    given, link = shape.geometry, _link(model, shape)
    form = _form(given)
    if form is None:
        text = f": a shape of {link} is a {type(given).__name__}: give boxes, spheres, capsules, "
        raise fail(body, f"{text}cylinders or meshes; what stays where it is as [[obstacle]].")
    if len(form.nodes) > _MOST_CORNERS:
        text = f": the hull of a mesh of {link} has {len(form.nodes)} corners: give a simpler one, "
        raise fail(body, f"{text}of at most {_MOST_CORNERS}.")
    turn, place = shape.placement.rotation, shape.placement.translation
    nodes, points = (np.asarray(place + each @ turn.T) for each in (form.nodes, form.points))
    found = LinkShape(link, int(shape.parentJoint), nodes, form.radius, points, form.cells)
    if type(given).__name__ == "Cylinder":
        way = given.halfLength * turn[:, 2]
        found = replace(found, ends=place + np.stack([-way, way]), girth=float(given.radius))
    return found


def _form(given: Any) -> Form | None:
    """What a shape of coal amounts to in its own frame; None of those that are not modelled."""
    from scipy.spatial import ConvexHull  # noqa: PLC0415  (only mechanisms need it)

    kind, axis = type(given).__name__, [0.0, 0.0, 1.0]
    if kind == "Box":
        half = np.asarray(given.halfSide)
        return form_of(Block(size=(2.0 * half).tolist(), corner=(-half).tolist()))
    if kind == "Sphere":
        return form_of(Sphere(radius=given.radius, center=[0.0, 0.0, 0.0]))
    if kind == "Capsule":
        return form_of(Capsule(radius=given.radius, length=2.0 * given.halfLength, axis=axis))
    if kind == "Cylinder":
        angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
        rim = given.radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(_AROUND)], axis=1)
        up = np.array([0.0, 0.0, given.halfLength])
        return form_of(Hull(points=np.vstack([rim - up, rim + up]).tolist()))
    if kind.startswith(("BVHModel", "Convex")):
        points = np.asarray(given.vertices() if kind.startswith("BVH") else given.points())
        return form_of(Hull(points=points[ConvexHull(points).vertices].tolist()))
    return None
