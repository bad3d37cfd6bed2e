"""Plates drawn with their deflection magnified, and with it what is above and below them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.distance import signed_distance
from impactfem.report.skin import Skin
from impactfem.scene import Scene
from impactfem.scene.rigid import RigidBody

_SHARE = 0.1  # of the plate's size, that its largest deflection is drawn at
_MOST = 400  # nodes that are asked for their distance from an obstacle
_FARTHEST = 0.8  # share of the size by which other bodies are moved at most
_TINY = 1e-300  # gap of what touches, which still has a side
_SQUARE = 0.9  # cosine from which an obstacle lies square above or below the plate


@dataclass(frozen=True)
class Relief:
    """The surface of a plate whose heights and gaps are magnified.

    Attributes:
        factor: By which.
        normal: Of the plate, shape (3,).
        half: Half of its thickness [m]: gaps begin at its faces, but its middle is drawn.
        points: Its nodes at rest [m], shape (nodes, 3).
        own: Whether a node is one of it, shape (all nodes,).
        others: Nodes of each other body, its gap [m], below the plate negative, and the number of
            the plate's node that is nearest to its middle.
        farthest: By how much these are moved at most [m].
    """

    factor: float
    normal: Floats
    half: float
    points: Floats
    own: Booleans
    others: tuple[tuple[Integers, float, int], ...]
    farthest: float

    def drawn(self, rest: Floats, places: Floats) -> Floats:
        """Where nodes are drawn, shape (nodes, 3)."""
        found, more = places.copy(), self.factor - 1.0
        heights = (places - rest) @ self.normal
        found[self.own] += more * heights[self.own, None] * self.normal
        for nodes, gap, beside in self.others:
            side, moved = float(np.sign(gap)), float(heights[nodes].mean())
            apart = max(side * (gap + moved - heights[beside]), 0.0)  # dents are not magnified
            way = self.factor * (heights[beside] + side * apart) - moved - gap - side * self.half
            found[nodes] += np.clip(way, -self.farthest, self.farthest) * self.normal
        return found

    def shift(self, obstacle: Any, time: float) -> Floats:
        """By which an obstacle is moved [m], shape (3,)."""
        distance, away = signed_distance(obstacle, self.points, time)
        nearest = int(np.argmin(distance))
        if abs(away[nearest] @ self.normal) < _SQUARE:
            return np.zeros(3)
        gap = float(distance[nearest]) - self.half
        return np.asarray((float(distance[nearest]) - self.factor * gap) * away[nearest])


def relief_of(scene: Scene, skin: Skin) -> Relief | None:
    """The relief of a plate that is alone or among rigid bodies, if its deflection is small."""
    plates = scene.plates
    if len(plates) != 1 or plates[0].name not in skin.names or skin.mirrors:
        return None
    own = skin.bodies == skin.names.index(plates[0].name)
    if (skin.is_stressed & ~own).any():
        return None
    points = skin.points[own]
    normal = np.asarray(plates[0].frame[1][2])
    first, last = np.flatnonzero(own)[[0, -1]]
    ways = skin.fields.over_time("displacement", slice(int(first), int(last) + 1)) @ normal
    largest = float(np.abs(ways[np.isfinite(ways)]).max(initial=0.0))
    size = float(np.ptp(points, axis=0).max())
    factor = float(f"{_SHARE * size / largest:.2g}") if largest else 1.0
    if factor <= 1.0:
        return None
    half = 0.5 * plates[0].depth
    others = [
        _other(scene, skin, int(body), points, normal, half, int(first))
        for body in np.unique(skin.bodies[~own])
    ]
    thinned = points[:: max(1, len(points) // _MOST)]
    return Relief(factor, normal, half, thinned, own, tuple(others), _FARTHEST * size)


def _other(
    scene: Scene, skin: Skin, number: int, points: Floats, normal: Floats, half: float, first: int
) -> tuple[Integers, float, int]:
    """Nodes of a body, its gap to the plate [m], and the node of the plate beside it."""
    nodes = np.flatnonzero(skin.bodies == number)
    places, radius = skin.points[nodes], skin.radius[nodes]
    beside = first + int(np.linalg.norm(points - places.mean(axis=0), axis=1).argmin())
    body = next((body for body in scene.bodies if body.name == skin.names[number]), None)
    if isinstance(body, RigidBody) and not (
        len(body.form.rim) or body.is_curved
    ):  # its picture has facets
        places = body.center + (body.form.nodes - body.center) @ body.rotation.T
        radius = body.form.radius
    heights = (places - points[0]) @ normal
    side = 1.0 if heights.mean() >= 0.0 else -1.0
    return nodes, side * max(float((side * heights - radius).min()) - half, _TINY), beside
