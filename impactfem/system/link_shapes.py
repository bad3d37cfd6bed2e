"""Collision shapes of links: what of them can touch, what may meet what, and their picture."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.scene import Mechanism, Scene
from impactfem.scene.nearest import meant
from impactfem.scene.pairing import friction_of, named_body_pairs, obstacles_of, surfaces_on
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.convex import Carrier, Convex

_CORNERS = 500  # of all hulls of meshes that move, together
_LOOKS = 256  # directions in which hulls are compared
_MARKED = 0.25  # arm of markers, as a share of the reach of a shape

type Partner = tuple[str, int]
"""A body or an obstacle by its name, and the number of its face."""


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A collision shape of a link.

    Attributes:
        link: Name of the link.
        joint: What it moves with, 0 if it is fixed.
        nodes: What can touch, in the frame of the joint [m], (nodes, 3).
        radius: Of balls around the nodes [m], (nodes,).
        points: Of its picture, in the frame of the joint [m], (points, 3).
        cells: Tetrahedra of the picture, (cells, 4).
        ends: Of a round cylinder the middles of its ends [m], (2, 3).
        girth: Radius of that cylinder [m].
    """

    link: str
    joint: int
    nodes: Floats
    radius: Floats
    points: Floats
    cells: Integers
    ends: Floats | None = None
    girth: float = 0.0

    @property
    def has_edges(self) -> bool:
        """Whether it is no single ball."""
        return len(self.nodes) > 1 or not self.radius.all()

    @cached_property
    def middle(self) -> Floats:
        """Mean place of its nodes, in the frame of the joint [m], (3,)."""
        return np.asarray(self.nodes.mean(axis=0))

    @cached_property
    def convex(self) -> Convex:
        """What edges and faces meet, from its middle."""
        if self.ends is not None:
            return Convex.cylinder(self.ends - self.middle, self.girth)
        return Convex.of(self.nodes - self.middle, float(self.radius.max()))


def coarser(shapes: Sequence[LinkShape], leave: Callable[[str], None]) -> list[LinkShape]:
    """Shapes with fewer corners, where the hulls of those that move have more than are followed.

    Corners are taken where what is left stands out farthest, in evenly spread directions.

    Args:
        shapes: Of all links.
        leave: Is told what is left out.
    """
    hulls = [k for k, s in enumerate(shapes) if s.joint and s.ends is None and len(s.nodes) > 8]
    if sum(len(shapes[k].nodes) for k in hulls) <= _CORNERS:
        return list(shapes)
    turn = np.arange(_LOOKS) + 0.5
    high, angle = 1.0 - 2.0 * turn / _LOOKS, np.pi * (1.0 + np.sqrt(5.0)) * turn
    wide = np.sqrt(1.0 - high**2)
    ways = np.hstack([np.eye(3), -np.eye(3), [wide * np.cos(angle), wide * np.sin(angle), high]])
    reach = [shapes[k].nodes @ ways for k in hulls]
    kept = [list(dict.fromkeys(each.argmax(axis=0)[:6].tolist())) for each in reach]
    lacks = [
        each.max(axis=0) - each[own].max(axis=0) for each, own in zip(reach, kept, strict=True)
    ]
    worst = np.array([each.max() for each in lacks])
    for _ in range(_CORNERS - sum(map(len, kept))):
        k = int(np.argmax(worst))
        if worst[k] <= 0.0:
            break
        kept[k].append(int(np.argmax(reach[k][:, np.argmax(lacks[k])])))
        lacks[k] = np.minimum(lacks[k], reach[k].max(axis=0) - reach[k][kept[k][-1]])
        worst[k] = lacks[k].max()
    found = list(shapes)
    for k, nodes in zip(hulls, kept, strict=True):
        found[k] = replace(shapes[k], nodes=shapes[k].nodes[nodes], radius=shapes[k].radius[nodes])
    leave(
        f"hulls of meshes have {sum(len(shapes[k].nodes) for k in hulls)} corners, of which "
        f"{sum(map(len, kept))} are kept: they stand at most {worst.max():.2g} m inside"
    )
    return found


@dataclass(frozen=True)
class LinkNodes:
    """Contact nodes of a mechanism: each partner has its own, since balls roll.

    Attributes:
        on: Joint of each node, as Pinocchio counts them, (nodes,).
        arms: In its frame [m], (nodes, 3).
        following: Arms along the axes of space besides [m], (nodes, 3); see `Carrier`.
        radius: Of balls around the nodes [m], (nodes,).
        rolling: Radius with which they roll [m], (nodes,): none beside solids.
        meets: Links and nodes of each partner.
        carriers: What edges and faces meet; its markers are nodes after those of `meets`.
    """

    on: Integers
    arms: Floats
    following: Floats
    radius: Floats
    rolling: Floats
    meets: Mapping[Partner, Sequence[tuple[str, Integers]]]
    carriers: tuple[Carrier, ...]

    @classmethod
    def of(
        cls, scene: Scene, body: Mechanism, shapes: Sequence[LinkShape], links: Sequence[str]
    ) -> "LinkNodes":
        """Contact nodes of a mechanism with some shapes.

        Raises:
            KeyedError: A link is not known, or its edges and faces would not be seen.
        """
        solids = {solid.name for solid in scene.solids}
        # The march asks for a place: the base, which meets nothing.
        on, radius, rolling = ([np.zeros(1)] for _ in range(3))
        arms, following = ([np.zeros((1, 3))] for _ in range(2))
        count = 1

        def add(
            shape: LinkShape, own: Floats, space: Floats, radii: Floats, roll: bool
        ) -> Integers:
            nonlocal count
            first, count = count, count + len(own)
            on.append(np.full(len(own), float(shape.joint)))
            arms.append(own)
            following.append(space)
            radius.append(radii)
            rolling.append(radii * roll)
            return np.arange(first, count)

        meets: dict[Partner, list[tuple[str, Integers]]] = {}
        touching, edged = _partners(scene, body, shapes, links)
        for partner, mine in touching.items():
            roll = partner[0] not in solids
            meets[partner] = [
                (s.link, add(s, s.nodes, 0.0 * s.nodes, s.radius, roll)) for s in mine
            ]
        carriers = []
        for shape, partners in edged.items():
            unit = _MARKED * shape.convex.reach
            turning, space = Carrier.arms(4 + 3 * shape.convex.rounds, 3, unit)
            markers = add(shape, shape.middle + turning, space, np.zeros(len(space)), False)
            carriers.append(Carrier(shape.convex, markers, unit, frozenset(partners), shape.link))
        return cls(
            np.concatenate(on).astype(np.int64), np.vstack(arms), np.vstack(following),
            np.concatenate(radius), np.concatenate(rolling), meets, tuple(carriers),
        )  # fmt: skip


def _partners(
    scene: Scene, body: Mechanism, shapes: Sequence[LinkShape], links: Sequence[str]
) -> tuple[dict[Partner, list[LinkShape]], dict[LinkShape, set[str]]]:
    """Shapes that meet each other body and face of an obstacle with nodes; partners of others."""
    nodes: dict[Partner, list[LinkShape]] = defaultdict(list)
    edged: dict[LinkShape, set[str]] = defaultdict(set)
    given = scene, body, shapes, links
    for shape, partner, by_edges in (*_at_obstacles(*given), *_at_bodies(*given)):
        if by_edges:
            edged[shape].add(partner[0])
        elif shape not in nodes[partner]:
            nodes[partner].append(shape)
    return nodes, edged


def _at_obstacles(
    scene: Scene, body: Mechanism, shapes: Sequence[LinkShape], links: Sequence[str]
) -> Iterator[tuple[LinkShape, Partner, bool]]:
    """Shapes, faces of obstacles that they may meet, and whether with edges and faces."""
    for obstacle in obstacles_of(scene, body.name):
        on, name = surfaces_on(scene, body.name, obstacle.name), obstacle.name
        faces = 1 if obstacle.other_gap(np.zeros((0, 3))) is None else 2
        for shape in _chosen(body, shapes, links, name, on):
            rolls = shape.ends is not None and obstacle.plane is not None
            by_edges = rolls or (shape.has_edges and not obstacle.meets_corners)
            if by_edges and not (rolls or obstacle.is_convex or obstacle.surface is not None):
                raise _unseen(body, name, shape)
            for face in range(faces):
                yield shape, (name, face), by_edges


def _at_bodies(
    scene: Scene, body: Mechanism, shapes: Sequence[LinkShape], links: Sequence[str]
) -> Iterator[tuple[LinkShape, Partner, bool]]:
    """Shapes, bodies that they may meet, and whether with edges and faces."""
    bodies = {other.name: other for other in scene.bodies}
    solids = {solid.name for solid in scene.solids}
    for _, *sides in named_body_pairs(scene):
        names = [name for name, _ in sides]
        if body.name not in names:
            continue
        (_, on), (name, _) = sides if names[0] == body.name else reversed(sides)
        other, rubs = bodies[name], friction_of(scene, body.name, name) > 0.0
        for shape in _chosen(body, shapes, links, name, on):
            by_edges = shape.has_edges or other.has_corners or other.has_links
            by_edges |= rubs and name in solids  # where balls roll
            if by_edges and not other.sees_edges:
                raise _unseen(body, name, shape)
            yield shape, (name, 0), by_edges


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


def _unseen(body: Mechanism, other: str, shape: LinkShape) -> KeyedError:
    """The error of edges and faces that another one does not see."""
    text = f" of {body.name} and {other} is not available: edges and faces of link {shape.link} "
    text += "may meet it, which sees none, or is not convex; name by [[contact]] what may meet, "
    text += f'as between = ["{body.name}/LINK", "{other}"] with a link that is a ball.'
    return KeyedError("contact", "", text)


def named(kind: str, key: str, name: str, known: Sequence[str], what: str) -> KeyedError:
    """The error of a name that the file of a mechanism does not have."""
    found = meant(name.rpartition("/")[2], known)
    return KeyedError(kind, key, f": there is no {what} {show(name)}; {found}.")


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
