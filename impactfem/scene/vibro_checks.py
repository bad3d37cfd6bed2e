"""Checks of scenes with few degrees of freedom: points, rods and beams."""

from typing import Any

from impactfem.scene.contacts import Contact
from impactfem.scene.content import Content
from impactfem.scene.loads import PiecewiseConstant
from impactfem.scene.nearest import nearest
from impactfem.scene.points import Point
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

FAMILY = "points, rods and beams"


def check_vibro(scene: Content, gravity: object) -> None:
    """Refuse a scene of points, a rod or a beam that contradicts itself.

    Args:
        scene: the scene, its fields checked one by one.
        gravity: as given, for messages.

    Raises:
        KeyedError: naming the key.
    """
    dim = scene.dim
    check_gravity(scene, dim, gravity)
    names = {body.name: body for body in scene.bodies} | {o.name: o for o in scene.obstacles}
    for index, contact in enumerate(scene.contacts):
        _check_contact(names, contact, index, scene.contacts[:index])
    if not scene.obstacles and not scene.contacts:
        text = (
            " is missing: nothing can be hit; add an [[obstacle]], or a [[contact]] of two points."
        )
        raise KeyedError("obstacle", "", text)
    if scene.output.checkpoint:
        text = f" = {scene.output.checkpoint}: {FAMILY} are not checkpointed; remove it."
        raise KeyedError("output", "checkpoint", text)
    if set(scene.output.fields) - {"vtkhdf"}:
        text = f' = {show(list(scene.output.fields))}: {FAMILY} are written as ["vtkhdf"]; '
        raise KeyedError("output", "fields", f"{text}give that or [].")


def check_bodies(scene: Content, dim: int) -> None:
    """Refuse points of different dimensions, and springs to what is no point.

    Raises:
        KeyedError: naming the key.
    """
    points = {body.name for body in scene.bodies if isinstance(body, Point)}
    for index, body in enumerate(scene.bodies):
        if not isinstance(body, Point):
            continue
        if body.dim != dim:
            text = f" = {show(list(body.position))} has {body.dim} entries, but that of "
            text += f"{scene.bodies[0].name} has {dim}: give {dim}."
            raise KeyedError(f"body[{index}]", "position", text)
        for number, spring in enumerate(body.springs):
            if spring.to is not None and (spring.to not in points or spring.to == body.name):
                others = " or ".join(show(name) for name in sorted(points - {body.name}))
                text = f" = {show(spring.to)} is no other point: give "
                text += f"{others or 'anchor, a place'}."
                raise KeyedError(f"body[{index}].springs[{number}]", "to", text)


def check_gravity(scene: Content, dim: int, given: object) -> None:
    """Refuse gravity that is no vector with as many entries as the bodies have coordinates.

    Raises:
        KeyedError: naming the key.
    """
    gravity = scene.gravity
    example = ", ".join(["0.0"] * (dim - 1) + ["-9.81"])
    if isinstance(gravity, PiecewiseConstant):
        if gravity.is_constant and gravity.values[0] == 0.0:
            return
        why = f"it is a number, but the bodies move in space; give a vector [{example}]"
    elif gravity.dim != dim:
        why = f"it has {gravity.dim} entries, but the bodies have {dim} coordinates; give a "
        why += f"vector [{example}]"
    else:
        return
    raise KeyedError("", "gravity", f" = {show(given)} is not allowed: {why}.")


def _check_contact(
    names: dict[str, Any], contact: Contact, index: int, earlier: tuple[Contact, ...]
) -> None:
    where = f"contact[{index}]"
    shown = show(list(contact.between))
    for name in contact.between:
        if name not in names:
            near = nearest(name, names)
            meant = f"did you mean {show(near)}? The" if near else "the"
            text = f" = {shown}: there is no {show(name)}; {meant} scene has {', '.join(names)}."
            raise KeyedError(where, "between", text)
    bodies = [name for name in contact.between if hasattr(names[name], "mass")]
    if not bodies:
        raise KeyedError(where, "between", f" = {shown} are two obstacles: name a body and one.")
    if any(set(entry.between) == set(contact.between) for entry in earlier):
        raise KeyedError(where, "between", f" = {shown} is given twice: remove one.")
