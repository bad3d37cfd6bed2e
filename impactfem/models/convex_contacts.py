"""Which rigid bodies meet each other, and obstacles, with edges and faces."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np

from impactfem.contact.ball_pairs import RollingPair, Target
from impactfem.contact.convex_nodes import CornersOnFaces, NodesOnConvex
from impactfem.contact.convex_pairs import ConvexPair, LedPair, Marked, Placed
from impactfem.contact.crossings import AxisPair
from impactfem.contact.ridges import OnRidges
from impactfem.contact.terrain import OnTerrain, Terrain
from impactfem.scene import Scene
from impactfem.scene.obstacles.faces import square_to
from impactfem.scene.pairing import named_body_pairs, obstacles_of, pair_name, surfaces_on
from impactfem.system.convex import Carrier, Convex
from impactfem.system.few import FewBodies
from impactfem.system.rigid import in_space

type Still = ConvexPair | OnRidges | OnTerrain

TOUCH = 5e-10
"""Share of the extent of the bodies by which they may be apart and touch: rounding of places."""
_ENDLESS = 2.0  # an endless obstacle is taken so many reaches of a body to both sides


def on_others(
    body: Marked, target: Target, total: int, *, crosses: bool
) -> Iterator[tuple[bool, NodesOnConvex | CornersOnFaces | RollingPair | AxisPair]]:
    """Gaps between a rigid body and one that deforms, and whether forces on the first are told.

    A ball is held off what is between nodes only: it would roll over nodes as over teeth.

    Args:
        body: The rigid one.
        target: The other one: its nodes, and what is between them.
        total: Number of all contact nodes.
        crosses: Whether that is an axis in space, which edges may cross between nodes.
    """
    shape, nodes = body.shape, body.nodes
    if len(shape.vertices) == 1:
        followers, radius = nodes[body.dim + 1 :], np.array([shape.radius])
        yield (
            True,
            RollingPair(nodes[:1], radius, target, total, followers=followers, unit=body.unit),
        )
        return
    on_body = NodesOnConvex(target, body, total)
    if crosses:
        yield False, AxisPair(target, body, on_body, CornersOnFaces.of(body, target, total))
        return
    yield False, on_body
    if target.simplices.shape[1] > 1:
        yield True, CornersOnFaces.of(body, target, total)


def convex_meetings(
    scene: Scene, few: Sequence[FewBodies], offsets: Sequence[int]
) -> Iterator[tuple[str, tuple[str, str], str, Still | LedPair, bool]]:
    """Name, both sides, the one that carries, gaps, and False, of each pair of convex bodies.

    Args:
        scene: The scene.
        few: Its bodies without meshes.
        offsets: Where the contact nodes of each part of the march begin, their number last.
    """
    shapes, total = Shapes.of(few, offsets), offsets[-1]
    if not shapes.known:
        return
    places = np.concatenate([bodies.places(bodies.position) for bodies in few])
    touch = TOUCH * float(np.ptp(places, axis=0).max())
    for label, (one, on_one), (two, on_two) in named_body_pairs(scene):
        both = shapes.meeting(one, on_one, two), shapes.meeting(two, on_two, one)
        for own, other in product(*both):
            yield label, (one, two), one, ConvexPair(own, other, total, touch), False
    for name in shapes.known:
        for obstacle in obstacles_of(scene, name):
            on = surfaces_on(scene, name, obstacle.name)
            label, names = pair_name(scene, name, obstacle.name), (name, obstacle.name)
            terrain = None if obstacle.surface is None else Terrain(obstacle.surface)
            for own in shapes.meeting(name, on, obstacle.name):
                placed = _placed(obstacle, own.shape.reach)
                still: Still = ConvexPair(own, placed, total, touch)
                if terrain is not None:
                    still = OnTerrain(own, placed, terrain, total, touch)
                elif obstacle.ridges is not None:
                    still = OnRidges(own, placed, obstacle, obstacle.ridges, total, touch)
                led = LedPair(still, placed, obstacle) if obstacle.moves else still
                yield label, names, name, led, False


@dataclass(frozen=True)
class Shapes:
    """Convex shapes of bodies without meshes that edges and faces may meet.

    Attributes:
        known: By the name of the body.
    """

    known: Mapping[str, Sequence[tuple[Carrier, Marked]]]

    @classmethod
    def of(cls, few: Sequence[FewBodies], offsets: Sequence[int]) -> "Shapes":
        """Of bodies whose contact nodes are the last ones of a march; see `convex_meetings`."""
        starts = list(pairwise(offsets))[-len(few) :] if few else []
        return cls(
            {
                bodies.names[0]: [(c, Marked.of(c, start, bodies.dim)) for c in bodies.carriers]
                for bodies, (start, _) in zip(few, starts, strict=True)
                if bodies.carriers
            }
        )

    def meeting(self, name: str, surfaces: Sequence[str] | None, other: str) -> list[Marked]:
        """Those of a body that may meet another one, or an obstacle, by surfaces of a law."""
        return [made for own, made in self.known.get(name, ()) if own.meets(other, surfaces)]


def _placed(obstacle: Any, reach: float) -> Placed:
    """An obstacle, of an endless one what a body with some reach may meet."""
    if obstacle.plane is not None:
        ways, far = np.stack(square_to(normal := np.array(obstacle.plane.normal))), _ENDLESS * reach
        square = far * (np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) @ ways)
        below = np.concatenate([square, square - far * normal])
        return Placed(Convex.of(below), np.array(obstacle.plane.point, dtype=float), ways)
    corners = obstacle.corners if obstacle.ridges is None else obstacle.ridges.places
    if obstacle.surface is not None:
        low, high = (pick(obstacle.surface.points, axis=0) for pick in (np.min, np.max))
        thick = np.maximum(high - low, 1e-3 * (high - low).max())  # what is flat
        corners = low + np.array(list(np.ndindex(2, 2, 2))) * thick
    if corners is not None:
        centre = corners.mean(axis=0)
        return Placed(Convex.of(corners - centre), in_space(centre))
    core = obstacle.core
    if core.axis is None:
        return Placed(
            Convex.of(np.zeros((1, len(core.center))), core.radius), in_space(core.center)
        )
    ends = _ENDLESS * (reach + core.radius) * np.stack([-core.axis, core.axis])
    return Placed(Convex.of(ends, core.radius), core.center, core.axis[None])
