"""What joints, springs and masses hold of solids that planes of symmetry cut: one thing on them."""

from collections.abc import Iterator, Sequence

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.content import Content
from impactfem.scene.control import AXES
from impactfem.scene.couplings import WHOLE
from impactfem.scene.joints import GROUND, Joint
from impactfem.scene.laws import side_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

_ON = 1e-9  # share of coordinates within which a place is on a plane
_ALONG = 1e-9  # sine of the angle between directions that are one
_WHOLE = "or model the whole, without symmetry"


def check_cuts(scene: Content, where: str, joint: Joint) -> None:
    """Refuse joints that with their images are several, or that push across a plane of symmetry.

    Raises:
        KeyedError: naming the key.
    """
    bodies = {body.name: body for body in scene.bodies}
    held = [bodies[name] for name, _ in map(side_of, joint.between or ()) if name != GROUND]
    body = next((body for body in held if body.cuts), None)
    if body is None:
        return
    for other in held:
        if other.cuts != body.cuts and not other.attached:
            text = f" = {show(list(joint.between or ()))}: symmetry cuts {body.name}, and not "
            text += f"{other.name} alike; cut both so, put a point_mass for {other.name}, {_WHOLE}."
            raise KeyedError(where, "between", text)
    for key, place, name in _places(scene, joint):
        for axis, level in body.cuts:
            if abs(place[axis] - level) > _ON * np.abs([*place, level]).max():
                text = f" = {show(place.tolist())} is off the plane {AXES[axis]} = {level:.6g} "
                text += f"that cuts {name}, so that it means two such things; give a place on the "
                raise KeyedError(where, key, f"{text}plane, {_WHOLE}.")
    normals = np.eye(scene.dim)[[axis for axis, _ in body.cuts]]
    _check_directions(where, joint, normals)


def _places(scene: Content, joint: Joint) -> Iterator[tuple[str, Floats, str]]:
    """Key, place and side of what a joint holds, of whole surfaces their middles."""
    bodies = {body.name: body for body in scene.bodies}
    for side, name in enumerate(joint.between or ()):
        whole, part = side_of(name)
        if joint.radius == WHOLE:
            shape = getattr(bodies.get(whole), "shape", None)
            middle = shape.middle_of(part[0]) if shape is not None and part else None
            if middle is not None:
                carries = any(mass.name == joint.name for mass in scene.masses)
                key = "surface" if carries else "between"
                yield key, np.asarray(middle, dtype=float), name
        elif joint.places[side]:
            key = "point" if joint.points is None else f"points[{side}]"
            yield key, np.asarray(joint.places[side], dtype=float), name


def _check_directions(where: str, joint: Joint, normals: Floats) -> None:
    """Refuse directions at an angle to planes, and what would push or move across these."""
    for key in ("axis", "second_axis"):
        given = getattr(joint, key)
        if given is None:
            continue
        across = np.abs(normals @ np.asarray(given, dtype=float)) / np.linalg.norm(given)
        if ((across > _ALONG) & (across < 1.0 - _ALONG)).any():
            text = f" = {show(list(given))} is at an angle to a plane of symmetry, so that its "
            text += f"image is another; give one along or across the plane, {_WHOLE}."
            raise KeyedError(where, key, text)
    for axis in np.flatnonzero(normals.any(axis=0)):
        motion = (joint.motion or ())[axis : axis + 1]
        if any(not formula.is_constant for formula in motion):
            text = f"[{axis}] = {show(motion[0].plain)} moves what a plane of symmetry holds; give "
            raise KeyedError(where, "motion", f"{text}0 there, {_WHOLE}.")
    pushing = [name for name in ("motor", "preload", "rest") if getattr(joint, name) is not None]
    pushing += ["position"] * joint.is_driven
    if pushing and _is_still(joint, normals):
        text = " acts across a plane of symmetry, which it would break; remove it, "
        raise KeyedError(where, pushing[0], text + f"{_WHOLE}.")


def _is_still(joint: Joint, normals: Floats) -> bool:
    """Whether the coordinate of a joint cannot change, as planes hold it."""
    if joint.kind_of.given == "points":
        return False
    axis = _unit(joint.axis or (0.0, 0.0, 1.0))
    across = np.abs(np.pad(normals, [(0, 0), (0, 3 - normals.shape[1])]) @ axis)
    turns = joint.kind_of.unit == "rad"
    return bool((across < _ALONG).any() if turns else (across > _ALONG).any())


def _unit(axis: Sequence[float]) -> Floats:
    padded = np.pad(np.asarray(axis, dtype=float), (0, 3 - len(axis)))
    return np.asarray(padded / np.linalg.norm(padded))
