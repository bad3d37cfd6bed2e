"""Where what is small of obstacles meets the triangles of plates: corners, edges, balls, wires."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.ball_pairs import Target
from impactfem.contact.obstacle_places import ObstaclePlaces, Tips, edges
from impactfem.scene import Scene
from impactfem.scene.pairing import obstacles_of, pair_name
from impactfem.system.few import FewBodies

_SMALL = 2.0  # sides of triangles in a radius from which nodes see round obstacles well enough
_ALONG = 0.5  # of a side, between places along edges and thin cylinders: triangles are flat
_HIDDEN = 1e-6  # of an obstacle's size, by which a place is looked past


def tip_meetings(
    scene: Scene, few: Sequence[FewBodies], offsets: Sequence[int]
) -> Iterator[tuple[str, tuple[str, str], str, ObstaclePlaces, bool]]:
    """As `convex_meetings` has them, of bodies of triangles whose nodes alone touch obstacles.

    Args:
        scene: The scene.
        few: Its bodies without meshes.
        offsets: Where the contact nodes of each part of the march begin, their number last.
    """
    starts = list(pairwise(offsets))[-len(few) :] if few else []
    for bodies, (start, _) in zip(few, starts, strict=True):
        if bodies.lines.shape[1] < 3 or not bodies.massless or not len(bodies.lines):
            continue
        name, own = bodies.names[0], bodies.meeting(0, None, ("", 0))
        places = bodies.places(bodies.position)[own]
        target = Target.of_axis(own + start, bodies.lines_of(0), bodies.radius[own])
        for obstacle in obstacles_of(scene, name):
            tips = _tips(obstacle, places, places[bodies.lines])
            if tips is not None:
                pair = ObstaclePlaces(obstacle, tips, target, offsets[-1])
                yield pair_name(scene, name, obstacle.name), (name, obstacle.name), name, pair, True


def _tips(obstacle: Any, places: Floats, triangles: Floats) -> Tips | None:
    """What of an obstacle triangles between nodes at places [m] may meet at rest; None: nothing."""
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2)
    side, core = float(np.median(sides)), obstacle.core
    if obstacle.corners is not None:
        found, radius = edges(obstacle.corners, _ALONG * side), 0.0
    elif core is not None and core.side > 0.0 and core.radius < _SMALL * side:
        radius = core.radius
        found = core.center[None]
        if core.axis is not None:
            along = (places - core.center) @ core.axis
            low, high = float(along.min()), float(along.max())
            steps = 1 + int(np.ceil((high - low) / (_ALONG * side)))
            found = core.center + np.outer(np.linspace(low, high, steps), core.axis)
    else:
        return None
    middle = places.mean(axis=0)
    _, _, axes = np.linalg.svd(places - middle, full_matrices=False)
    local, own = (found - middle) @ axes.T, (places - middle) @ axes.T
    over = (np.abs(local[:, :2]) <= np.abs(own[:, :2]).max(axis=0) + radius).all(axis=1)
    # Of corners and edges those that the plate sees.
    size = float(np.ptp(obstacle.corners)) if obstacle.corners is not None else radius
    towards = -np.sign(local[:, 2:]) * axes[2]
    if radius == 0.0:
        over &= obstacle.gap(found + _HIDDEN * size * towards)[0] > 0.1 * _HIDDEN * size
    if obstacle.moves:
        over[:] = True
    return Tips(found[over], np.full(int(over.sum()), radius)) if over.any() else None
