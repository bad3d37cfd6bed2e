"""Checks of scenes with few degrees of freedom: points, rods and beams."""

from typing import TYPE_CHECKING, Any, cast

from impactfem.methods import METHODS
from impactfem.scene.contacts import Contact
from impactfem.scene.content import Content
from impactfem.scene.nearest import meant
from impactfem.scene.pair_checks import check_patterns
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.rigid import RigidBody

FAMILY = "points, rods and beams"
_REMEDY = 'use solve.method = "moreau_jean"'
_OTHERS = ("stiffness", "rolling_resistance", "spinning_resistance")


def check_vibro(scene: Content) -> None:
    """Refuse a scene of points, a rod or a beam that contradicts itself.

    Args:
        scene: the scene, its fields checked one by one.

    Raises:
        KeyedError: naming the key.
    """
    if scene.in_coordinates:
        _check_in_coordinates(scene)
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
        what = f"runs by {scene.solve.method}" if scene.in_coordinates else FAMILY
        text = f" = {scene.output.checkpoint}: {what} are not checkpointed; remove it."
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
            text = f" = {shown}: there is no {show(name)}; {meant(name, names)}."
            raise KeyedError(where, "between", text)
    bodies = [name for name in contact.between if hasattr(names[name], "mass")]
    if not bodies:
        raise KeyedError(where, "between", f" = {shown} are two obstacles: name a body and one.")
    if any(set(entry.between) == set(contact.between) for entry in earlier):
        raise KeyedError(where, "between", f" = {shown} is given twice: remove one.")


def _check_in_coordinates(scene: Content) -> None:
    """Refuse what a body in coordinates does not know, but the march does."""
    method, kinds = str(scene.solve.method), " ".join(scene.kinds)
    why, remedy = f"method = {show(method)} takes one {kinds} body", _REMEDY
    if len(scene.bodies) > 1 or scene.couplings:
        text = f" = {show(method)} takes one {kinds} body without joints: {remedy}."
        raise KeyedError("solve", "method", text)
    for body in scene.bodies:
        if not body.in_elements:
            _check_shape(cast("RigidBody", body), why)
    for index, obstacle in enumerate(scene.obstacles):
        if not (obstacle.is_flat and obstacle.is_smooth) or obstacle.moves or obstacle.rotation:
            text = f" = {show(obstacle.name)}: {why} among half-spaces at rest: {remedy}."
            raise KeyedError(f"obstacle[{index}]", "name", text)
    rigid = not any(body.in_elements for body in scene.bodies)
    rubs = METHODS[method].rubs and scene.dim == 2 and rigid
    for law, index in zip(scene.laws.each, scene.laws.origin, strict=True):
        _check_law(law, f"contact[{index}]", why, rubs=rubs, rigid=rigid)


def _check_shape(body: "RigidBody", why: str) -> None:
    """Refuse bodies whose coordinates are not all that acts."""
    for name in ("force", "moment", "mesh"):
        if getattr(body, name):
            raise KeyedError(body.kind, name, f": {why} of a shape under its weight: {_REMEDY}.")
    if len(body.form.rim) or body.is_curved:
        text = f' = "{body.figure}": {why} of corners or a single ball, no rims: {_REMEDY}.'
        raise KeyedError(body.kind, "shapes" if body.shapes else "shape.kind", text)


def _check_law(law: Contact, where: str, why: str, *, rubs: bool, rigid: bool) -> None:
    """Refuse laws of contact that a body in coordinates does not know."""
    remedy = _REMEDY
    known = {"friction_coefficient", "static_friction_coefficient", "tangential_restitution"}
    for name in (*_OTHERS, *sorted(known)):
        if getattr(law, name) and not (rubs and name in known):
            text = f" = {show(getattr(law, name))}: {why} without it"
            knows = rigid and name in known
            able = f"event_driven in the plane does, or {remedy}" if knows else remedy
            raise KeyedError(where, name, f"{text}; {able}.")
    if not law.is_newton:
        text = f" = {show(law.restitution_law)}: {why} with Newton's: {remedy}."
        raise KeyedError(where, "restitution_law", text)
