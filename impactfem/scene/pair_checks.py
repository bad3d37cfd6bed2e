"""Checks of scenes with several solids that may strike each other."""

from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise

from impactfem.methods import METHODS
from impactfem.scene.contacts import Contact
from impactfem.scene.content import Content
from impactfem.scene.laws import is_pattern, side_of, sides_of
from impactfem.scene.nearest import meant
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

_HOLDING = ("moreau_jean", "conserving", "massless")
"""Methods whose steps take adhesion."""


def check_pairs(scene: Content) -> None:
    """Refuse several solids that contradict each other, and laws of contact without sense.

    Raises:
        KeyedError: naming the key.
    """
    for index, (before, body) in enumerate(pairwise(scene.solids), start=1):
        if body.model != before.model:
            text = f" = {show(body.model)}, but body[{index - 1}] has {show(before.model)}: "
            raise KeyedError(f"body[{index}]", "model", f"{text}all bodies need the same model.")
    check_laws(scene)
    for contact, origin in zip(scene.laws.each, scene.laws.origin, strict=True):
        _check_contact(contact, f"contact[{origin}]")
    rubs = any(contact.friction_coefficient > 0.0 for contact in scene.contacts)
    active_set = scene.solve.active_set
    if rubs and active_set not in {None, "pdas"}:
        text = f" = {show(active_set)} solves inequalities of the gaps, and friction makes a cone"
        raise KeyedError("solve", "active_set", f"{text}; remove it.")


def _check_contact(contact: Contact, where: str) -> None:
    for law in contact.laws_of_mass:
        text = f" = {show(getattr(contact, law))} is for points, rods, beams and rigid bodies: "
        raise KeyedError(where, law, f"{text}solids have their own elasticity; remove it.")


def check_springs(scene: Content) -> None:
    """Refuse a stiffness of contacts that are no single places.

    Raises:
        KeyedError: naming the key.
    """
    if not scene.gives_way or scene.bars:
        return
    method = scene.solve.method
    if method is not None and not METHODS[method].mixes:
        text = f" = {show(method)} does not know contacts that give way: give "
        text += " or ".join(show(name) for name, each in METHODS.items() if each.mixes)
        raise KeyedError("solve", "method", f"{text}, or remove stiffness.")
    known = {body.name: body for body in scene.bodies}
    # Corners of bodies on these are the same places in each layer.
    cornered = {each.name: each for each in scene.rigid_obstacles if each.meets_corners}
    for contact, index in zip(scene.laws.each, scene.laws.origin, strict=True):
        if contact.stiffness is None:
            continue
        shown = f" = {show(contact.stiffness)}: "
        names = [side_of(entry)[0] for entry in contact.between]
        for name, other in zip(names, reversed(names), strict=True):
            body = known.get(name)
            if contact.damping and body in scene.solids:
                text = f" = {show(contact.damping)}: nodes of {name} that may touch have no mass, "
                text += "so that no dashpot acts on them; remove it, and give the solid "
                text += "rayleigh_stiffness."
                raise KeyedError(f"contact[{index}]", "damping", text)
            if body is None or (body.lined and other not in known):
                continue
            if body.has_corners and other in cornered and not cornered[other].meets_sides(body):
                continue
            # Of a plate on another plate all vertices may touch.
            broad = body.has_surface and (other not in known or known[other].has_surface)
            # An axis may lie on an obstacle, but a ball touches it at one place.
            single = body.is_slender and other in known and known[other].is_ball
            if broad or not (body.dents or single):
                text = f"{shown}{name}, a {body.kind}, may touch at many places, or gives way by "
                text += "itself; remove it, or take a point, a rigid ball, a bar, a plate, or a "
                text += "half_space."
                raise KeyedError(f"contact[{index}]", "stiffness", text)


def check_adhesion(scene: Content) -> None:
    """Refuse adhesion of what touches at many places, and where steps do not know it.

    Raises:
        KeyedError: naming the key.
    """
    known = {body.name: body for body in scene.bodies}
    for contact, index in zip(scene.laws.each, scene.laws.origin, strict=True):
        if contact.adhesion is None:
            continue
        shown = f" = {{ force = {show(contact.adhesion.force)}, ... }}: "
        for name, _ in map(side_of, contact.between):
            body = known.get(name)
            if body is not None and (not body.dents or body.meshed or body.lined):
                text = f"{shown}{name}, a {body.kind}, may touch at many places; take a point, "
                text += "a rigid ball, or the end of a rod or beam."
                raise KeyedError(f"contact[{index}]", "adhesion", text)
        meshed = next((body for body in scene.bodies if body.meshed or body.lined), None)
        if meshed is not None or scene.iterated:
            name = scene.iterated if meshed is None else f"{meshed.name}, a {meshed.kind}"
            text = f"{shown}steps beside {name} do not take it; remove one of them."
            raise KeyedError(f"contact[{index}]", "adhesion", text)
        method = scene.solve.method
        if method is not None and method not in _HOLDING:
            text = f" = {show(method)} knows no adhesion: give {' or '.join(map(show, _HOLDING))}."
            raise KeyedError("solve", "method", text)


def check_itself(scene: Content) -> None:
    """Refuse bodies that meet themselves and cannot.

    Raises:
        KeyedError: naming the key.
    """
    for contact, index in zip(scene.laws.each, scene.laws.origin, strict=True):
        (one, _), (two, _) = map(side_of, contact.between)
        if one != two:
            continue
        shown = f" = {show(list(contact.between))}: {one} cannot meet itself"
        body = next((body for body in scene.bodies if body.name == one), None)
        if body is None or not body.meets_itself:
            text = f"{shown}; name two, or give a solid."
            raise KeyedError(f"contact[{index}]", "between", text)


def check_laws(scene: Content) -> None:
    """Refuse laws whose names are none, and those that contradict each other.

    Raises:
        KeyedError: naming the key.
    """
    check_patterns(scene)
    places: dict[frozenset[str], list[int]] = defaultdict(list)
    for index, contact in enumerate(scene.contacts):
        if any(map(is_pattern, contact.between)):
            continue
        check_sides(scene, contact, f"contact[{index}]")
        same = places[sides_of(contact)]
        for earlier in same:
            check_twice(scene, scene.contacts[earlier], contact, f"contact[{earlier}]", index)
        same.append(index)


def check_patterns(scene: Content) -> None:
    """Refuse laws whose patterns match nothing.

    Raises:
        KeyedError: naming the key.
    """
    stands = set(scene.laws.origin)
    for index, contact in enumerate(scene.contacts):
        if index not in stands:
            text = f" = {show(list(contact.between))} matches no two that may meet and have no law "
            raise KeyedError(f"contact[{index}]", "between", f"{text}yet; change or remove it.")


def check_sides(scene: Content, contact: Contact, where: str) -> None:
    """Refuse names that are none, and surfaces that a body does not have.

    Raises:
        KeyedError: naming the key.
    """
    shown = show(list(contact.between))
    bodies = {body.name for body in scene.bodies}
    obstacles = {obstacle.name for obstacle in scene.obstacles}
    names = [side_of(entry)[0] for entry in contact.between]
    for name in names:
        if name not in bodies | obstacles:
            known = [*(b.name for b in scene.bodies), *(o.name for o in scene.obstacles)]
            text = f" = {shown}: there is no {show(name)}; {meant(name, known)}."
            raise KeyedError(where, "between", text)
    if not bodies & set(names):
        raise KeyedError(where, "between", f" = {shown} are two obstacles: name a body and one.")
    for entry in contact.between:
        name, surfaces = side_of(entry)
        if surfaces is not None and name in obstacles:
            text = f" = {shown}: the obstacle {show(name)} has no surfaces; leave the slash out."
            raise KeyedError(where, "between", text)
        own = None if name in obstacles else _surfaces(scene, name)
        for surface in surfaces or ():
            if own is not None and surface not in own:
                text = f" = {shown}: {show(name)} has no surface {show(surface)}"
                remedy = meant(surface, own) if own else "it has none: leave the slash out"
                raise KeyedError(where, "between", f"{text}; {remedy}.")


def check_twice(scene: Content, one: Contact, two: Contact, where: str, index: int) -> None:
    """Refuse laws that cover the same faces, or differ for the same two bodies.

    Args:
        scene: Their scene.
        one: A law.
        two: Another one.
        where: The first one in messages.
        index: Place of the second one.

    Raises:
        KeyedError: naming the key.
    """
    # A bare name is all of a body, of a bar one end.
    whole = {body.name: body.whole_side for body in scene.bodies}
    sides = [
        {name: on or whole.get(name) for name, on in map(side_of, entry.between)}
        for entry in (one, two)
    ]
    shown = show(list(two.between))
    if all(
        sides[0][name] is None or sides[1][name] is None or sides[0][name] == sides[1][name]
        for name in sides[0]
    ):
        text = f" = {shown}: {where} is about the same faces; remove one."
        raise KeyedError(f"contact[{index}]", "between", text)
    for law in ("friction_coefficient", "restitution", "tangential_restitution"):
        given, other = getattr(two, law), getattr(one, law)
        if given != other:
            text = f" = {show(given)}, but {where} has {show(other)} for the same bodies: "
            raise KeyedError(f"contact[{index}]", law, f"{text}give both the same.")


def _surfaces(scene: Content, name: str) -> Sequence[str] | None:
    """Surfaces of a body; None if a mesh file has them."""
    return next(body.surface_names for body in scene.bodies if body.name == name)
