"""Which bodies of a scene may meet which others, by its contact laws."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from impactfem.scene.content import Content
from impactfem.scene.laws import Side, default_name, name_of, side_of
from impactfem.scene.obstacles import Rigid

if TYPE_CHECKING:
    from impactfem.scene.contacts import Contact


def pair_name(scene: Content, one: str, two: str) -> str:
    """Name of the pair of two names: that of its contact, or a body's and an obstacle's."""
    law = law_of(scene, one, two)
    return default_name(one, two) if law is None else name_of(law)


def named_body_pairs(
    scene: Content, alike: Sequence[Collection[str]] = ()
) -> Iterable[tuple[str, Side, Side]]:
    """Names of the pairs of `body_pairs`, and these.

    Bodies that a joint holds together meet only where a contact law says so.

    Args:
        scene: The scene.
        alike: Groups of names within which no pairs are wanted where there is no contact law, as
            they may be millions.
    """
    if scene.contacts:
        return scene.laws.between_bodies
    return _all_pairs(scene, alike)


def _all_pairs(
    scene: Content, alike: Sequence[Collection[str]]
) -> Iterator[tuple[str, Side, Side]]:
    names = list(dict.fromkeys(body.name for body in scene.bodies if not body.attached))
    held = {joint.bodies for joint in scene.holding}
    every = list(enumerate(names))
    others = {id(group): [each for each in every if each[1] not in group] for group in alike}
    own = {name: others[id(group)] for group in alike for name in group}
    for k, one in every:
        for j, two in own.get(one, every[k + 1 :]):
            if j > k and not (held and frozenset((one, two)) in held):
                yield default_name(one, two), (one, None), (two, None)


def body_pairs(scene: Content) -> list[tuple[Side, Side]]:
    """Pairs of bodies that may meet: those of ``[[contact]]``, or all where there is none."""
    return [(one, two) for _, one, two in named_body_pairs(scene)]


def bodies_met(scene: Content, name: str) -> list[str]:
    """Bodies that a body may meet, as `body_pairs` has them."""
    names = [body.name for body in scene.bodies if not body.attached]
    if scene.contacts:
        known = set(names)
        return [other for other in scene.laws.partners.get(name, ()) if other in known]
    held = {other for joint in scene.holding if name in (on := joint.bodies) for other in on}
    alone = name not in names  # another body carries it
    return [other for other in names if not alone and other != name and other not in held]


def self_meeting(scene: Content) -> list[str]:
    """Bodies that may meet themselves, by the contact laws."""
    return [one for (one, _), (two, _) in body_pairs(scene) if one == two]


def law_of(scene: Content, one: str, two: str) -> "Contact | None":
    """The law between two names; None where none is given."""
    return next(iter(scene.laws.of.get(frozenset((one, two)), ())), None)


def friction_of(scene: Content, one: str, two: str) -> float:
    """Coefficient of friction between two names; 0 where none is given."""
    law = law_of(scene, one, two)
    return 0.0 if law is None else law.friction_coefficient


def surfaces_on(scene: Content, body: str, obstacle: str) -> tuple[str, ...] | None:
    """Surfaces with which a body meets an obstacle, "" for those of its bare name.

    None where no contact law names the pair.
    """
    found: list[str] = []
    for entry in scene.laws.of.get(frozenset((body, obstacle)), ()):
        sides = dict(side_of(name) for name in entry.between)
        found += list(sides[body] or ("",))
    return tuple(found) or None


def obstacles_of(scene: Content, name: str) -> Sequence[Rigid]:
    """Obstacles that a body may meet: those of ``[[contact]]``, or all where there is none."""
    if any(body.attached and body.name == name for body in scene.bodies):
        return ()
    if not scene.contacts:
        return scene.rigid_obstacles
    partners = scene.laws.partners.get(name, ())
    return tuple(obstacle for obstacle in scene.rigid_obstacles if obstacle.name in partners)
