"""Which rigid bodies meet each other, and obstacles, with edges and faces."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.ball_pairs import Target
from impactfem.contact.convex_nodes import CornersOnFaces, NodesOnConvex
from impactfem.contact.convex_pairs import ConvexPair, LedPair, Marked, Placed
from impactfem.scene import Scene
from impactfem.scene.pairing import named_body_pairs, obstacles_of, pair_name
from impactfem.system.convex import Convex
from impactfem.system.few import FewBodies
from impactfem.system.rigid import in_space

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

TOUCH = 5e-10
"""Share of the extent of the bodies by which they may be apart and touch: rounding of places."""
_ENDLESS = 2.0  # an endless obstacle is taken so many reaches of a body to both sides


def on_edges(body: Marked, target: Target, total: int) -> Iterator[NodesOnConvex | CornersOnFaces]:
    """Gaps between a rigid body with edges and faces and one that deforms.

    Args:
        body: The rigid one.
        target: The other one: its nodes, and what is between them.
        total: Number of all contact nodes.
    """
    yield NodesOnConvex(target.nodes, target.radius, body, total)
    if target.simplices.shape[1] > 1:
        yield CornersOnFaces.of(body, target, total)


def convex_meetings(
    scene: Scene, few: Sequence[FewBodies], offsets: Sequence[int]
) -> Iterator[tuple[str, tuple[str, str], str, ConvexPair | LedPair, bool]]:
    """Name, both sides, the one that carries, gaps, and False, of each pair of convex bodies.

    Args:
        scene: The scene.
        few: Its bodies without meshes.
        offsets: Where the contact nodes of each part of the march begin, their number last.
    """
    marked, total = marked_bodies(few, offsets), offsets[-1]
    if not marked:
        return
    places = np.concatenate([bodies.places(bodies.position) for bodies in few])
    touch = TOUCH * float(np.ptp(places, axis=0).max())
    corners = {body.name: body.has_corners for body in scene.bodies}
    for label, (one, _), (two, _) in named_body_pairs(scene):
        if one in marked and two in marked and (corners[one] or corners[two]):
            pair = ConvexPair(marked[one], marked[two], total, touch)
            yield label, (one, two), one, pair, False
    for name, own in marked.items():
        for obstacle in obstacles_of(scene, name) if corners[name] else ():
            if not obstacle.meets_corners:
                other = _placed(obstacle, own.shape.reach)
                label, names = pair_name(scene, name, obstacle.name), (name, obstacle.name)
                still = ConvexPair(own, other, total, touch)
                led = LedPair(still, other, obstacle) if obstacle.moves else still
                yield label, names, name, led, False


def marked_bodies(few: Sequence[FewBodies], offsets: Sequence[int]) -> Mapping[str, Marked]:
    """Rigid bodies with markers, by their names."""
    starts = list(pairwise(offsets))[-len(few) :] if few else []
    return {
        bodies.names[0]: Marked(bodies.convex[0], start + bodies.convex[1], *bodies.convex[2:])
        for bodies, (start, _) in zip(few, starts, strict=True)
        if bodies.convex is not None
    }


def _placed(obstacle: Any, reach: float) -> Placed:
    """An obstacle, of an endless one what a body with some reach may meet."""
    if obstacle.corners is not None:
        centre = obstacle.corners.mean(axis=0)
        return Placed(Convex.of(obstacle.corners - centre), in_space(centre))
    core = obstacle.core
    if core.axis is None:
        return Placed(
            Convex.of(np.zeros((1, len(core.center))), core.radius), in_space(core.center)
        )
    ends = _ENDLESS * (reach + core.radius) * np.stack([-core.axis, core.axis])
    return Placed(Convex.of(ends, core.radius), core.center, core.axis)
