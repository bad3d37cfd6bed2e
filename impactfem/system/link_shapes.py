"""Collision shapes of links: what of them can touch, what may meet what, and their picture."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.scene import Mechanism, Scene
from impactfem.scene.nearest import nearest
from impactfem.scene.pairing import friction_of, named_body_pairs, obstacles_of, surfaces_on
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

type Partner = tuple[str, int]
"""A body or an obstacle by its name, and the number of its face."""


@dataclass(frozen=True)
class LinkShape:
    """A collision shape of a link.

    Attributes:
        link: Name of the link.
        joint: What it moves with, 0 if it is fixed.
        nodes: What can touch, in the frame of the joint [m], (nodes, 3).
        radius: Of balls around the nodes [m], (nodes,).
        points: Of its picture, in the frame of the joint [m], (points, 3).
        cells: Tetrahedra of the picture, (cells, 4).
    """

    link: str
    joint: int
    nodes: Floats
    radius: Floats
    points: Floats
    cells: Integers

    @property
    def has_edges(self) -> bool:
        """Whether it is no single ball."""
        return len(self.nodes) > 1 or not self.radius.all()


@dataclass(frozen=True)
class LinkNodes:
    """Contact nodes of a mechanism: each partner has its own, since balls roll.

    Attributes:
        on: Joint of each node, as Pinocchio counts them, (nodes,).
        arms: In its frame [m], (nodes, 3).
        radius: Of balls around the nodes [m], (nodes,).
        rolling: Radius with which they roll [m], (nodes,): none beside bodies with waves.
        meets: Nodes of each partner.
    """

    on: Integers
    arms: Floats
    radius: Floats
    rolling: Floats
    meets: Mapping[Partner, Integers]

    @classmethod
    def of(
        cls, scene: Scene, body: Mechanism, shapes: Sequence[LinkShape], links: Sequence[str]
    ) -> "LinkNodes":
        """Contact nodes of a mechanism with some shapes.

        Raises:
            KeyedError: A link is not known, or its edges and faces would not be seen.
        """
        waves = {other.name: other.waves for other in scene.bodies}
        # The march asks for a place: the base, which meets nothing.
        on, arms, radius, rolling = ([np.zeros((1, *shape))] for shape in ((), (3,), (), ()))
        meets, count = {}, 1
        for partner, touching in _partners(scene, body, shapes, links).items():
            first = count
            for shape in touching:
                count += len(shape.nodes)
                on.append(np.full(len(shape.nodes), float(shape.joint)))
                arms.append(shape.nodes)
                radius.append(shape.radius)
                rolling.append(shape.radius * (not waves.get(partner[0], False)))
            meets[partner] = np.arange(first, count)
        joints = np.concatenate(on).astype(np.int64)
        return cls(joints, np.vstack(arms), np.concatenate(radius), np.concatenate(rolling), meets)


def _partners(
    scene: Scene, body: Mechanism, shapes: Sequence[LinkShape], links: Sequence[str]
) -> dict[Partner, list[LinkShape]]:
    """Shapes that may meet each other body, and each face of an obstacle."""
    found: dict[Partner, list[LinkShape]] = {}
    for obstacle in obstacles_of(scene, body.name):
        mine = _chosen(body, shapes, links, obstacle.name, surfaces_on(scene, body.name,
                                                                       obstacle.name))  # fmt: skip
        if not obstacle.meets_corners:
            _refuse_edges(body, obstacle.name, mine)
        faces = 1 if obstacle.other_gap(np.zeros((0, 3))) is None else 2
        found |= {(obstacle.name, face): mine for face in range(faces)}
    waves = {other.name: other.waves for other in scene.bodies}
    for _, *sides in named_body_pairs(scene):
        names = [name for name, _ in sides]
        if body.name not in names:
            continue
        (_, on), (other, _) = sides if names[0] == body.name else reversed(sides)
        mine = _chosen(body, shapes, links, other, on)
        _refuse_edges(body, other, mine)
        if waves[other] and friction_of(scene, body.name, other):
            text = f" of {body.name} and {other} is not available with friction, as {other} has "
            raise KeyedError("contact", "", f"{text}waves; remove friction_coefficient.")
        found[other, 0] = [*found.get((other, 0), ()), *mine]
    return found


def _chosen(
    body: Mechanism,
    shapes: Sequence[LinkShape],
    links: Sequence[str],
    other: str,
    on: Sequence[str] | None,
) -> list[LinkShape]:
    """Shapes that move of the links that a contact law names."""
    for name in on or ():
        if name and name not in links:
            raise named("contact", "between", f"{body.name}/{name}", links, "link")
    mine = [s for s in shapes if s.joint and (not on or "" in on or s.link in on)]
    if not mine:
        asked = ", ".join(name for name in on or () if name) or body.name
        text = f" of {body.name} and {other}: {asked} has no collision shape that moves; give "
        text += f"<collision> in {body.file}, or list the pairs that may meet by [[contact]]."
        raise KeyedError("contact", "", text)
    return mine


def _refuse_edges(body: Mechanism, other: str, mine: Sequence[LinkShape]) -> None:
    edged = next((shape.link for shape in mine if shape.has_edges), None)
    if edged is not None:
        text = f" of {body.name} and {other} is not available: edges and faces of link {edged} may "
        text += "meet it, which touches with its corners; name by [[contact]] what may meet, as "
        text += f'between = ["{body.name}/LINK", "{other}"] with a link that is a ball.'
        raise KeyedError("contact", "", text)


def named(kind: str, key: str, name: str, known: Sequence[str], what: str) -> KeyedError:
    """The error of a name that the file of a mechanism does not have."""
    near = nearest(name.rpartition("/")[2], known)
    meant = f"did you mean {show(near)}? " if near else ""
    text = f": there is no {what} {show(name)}; {meant}Give one of {', '.join(known)}."
    return KeyedError(kind, key, text)


def picture(
    shapes: Sequence[LinkShape], place: Callable[[int], int]
) -> tuple[Integers, Floats, Integers]:
    """Where points of all shapes are, these [m], (points, 3), and their cells.

    Args:
        shapes: Of the links.
        place: Number of each joint.
    """
    on: list[Floats] = [np.zeros(0)]
    points: list[Floats] = [np.zeros((0, 3))]
    cells: list[Floats] = [np.zeros((0, 4))]
    first = 0
    for shape in shapes:
        on.append(np.full(len(shape.points), place(shape.joint), dtype=np.float64))
        points.append(shape.points)
        cells.append((shape.cells + first).astype(np.float64))
        first += len(shape.points)
    whole = np.vstack(cells).astype(np.int64)
    return np.concatenate(on).astype(np.int64), np.vstack(points), whole
