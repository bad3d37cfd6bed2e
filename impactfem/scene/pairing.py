"""Which bodies of a scene may meet which others, by its contact laws."""

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from impactfem.scene.obstacles import Rigid
    from impactfem.scene.scene import Scene

type Side = tuple[str, tuple[str, ...] | None]
"""Name of a body and its surfaces; None for all that may touch."""


def side_of(name: str) -> Side:
    """Read "ball" or "ball/skin"."""
    body, slash, surface = name.partition("/")
    return body, (surface,) if slash else None


def body_pairs(scene: "Scene") -> list[tuple[Side, Side]]:
    """Pairs of bodies that may meet: those of ``[[contact]]``, or all where there is none."""
    names = [body.name for body in scene.bodies]
    if not scene.contacts:
        return [((one, None), (two, None)) for one, two in combinations(names, 2)]
    sides = [tuple(side_of(name) for name in entry.between) for entry in scene.contacts]
    return [(one, two) for one, two in sides if one[0] in names and two[0] in names]


def friction_of(scene: "Scene", one: str, two: str) -> float:
    """Coefficient of friction between two names; 0 where none is given."""
    for entry in scene.contacts:
        if {side_of(name)[0] for name in entry.between} == {one, two}:
            return entry.friction_coefficient
    return 0.0


def obstacles_of(scene: "Scene", name: str) -> Sequence["Rigid"]:
    """Obstacles that a body may meet: those of ``[[contact]]``, or all where there is none."""
    if not scene.contacts:
        return scene.rigid_obstacles
    partners = {
        other
        for entry in scene.contacts
        for one, other in (entry.between, reversed(tuple(entry.between)))
        if side_of(one)[0] == name
    }
    return tuple(obstacle for obstacle in scene.rigid_obstacles if obstacle.name in partners)
