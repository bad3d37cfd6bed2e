"""Checks of scenes with few degrees of freedom: points, rods and beams."""

from typing import Any

from impactfem.scene.contacts import Contact
from impactfem.scene.content import Content
from impactfem.scene.nearest import nearest
from impactfem.scene.pair_checks import check_patterns
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

FAMILY = "points, rods and beams"


def check_vibro(scene: Content) -> None:
    """Refuse a scene of points, a rod or a beam that contradicts itself.

    Args:
        scene: the scene, its fields checked one by one.

    Raises:
        KeyedError: naming the key.
    """
    names = {body.name: body for body in scene.bodies} | {o.name: o for o in scene.obstacles}
    check_patterns(scene)
    laws = scene.laws
    for place, (contact, origin) in enumerate(zip(laws.each, laws.origin, strict=True)):
        _check_contact(names, contact, origin, laws.each[:place])
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
