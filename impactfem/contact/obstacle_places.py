"""Places of an obstacle that lie between nodes of a surface: corners, edges, small balls.

Nodes meet obstacles where they are; what is smaller than the triangles between them meets these.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.ball_pairs import BallPair, Target
from impactfem.contact.meeting import Anew, Meeting, Turning
from impactfem.scene.obstacles.rotation import placement

_STILL = Turning(None)  # obstacles take any moment


@dataclass(frozen=True)
class Tips:
    """Places at rest [m], (places, dim), about which the obstacle has a radius [m], (places,)."""

    places: Floats
    radius: Floats


class ObstaclePlaces(Anew):
    """Triangles that are held off an obstacle's places; see `impactfem.contact.meeting.Led`."""

    touch = speed = 0.0

    def __init__(self, obstacle: Any, tips: Tips, target: Target, total: int) -> None:
        """Take places.

        Args:
            obstacle: What says how they move.
            tips: The places.
            target: Triangles between contact nodes.
            total: Number of all contact nodes.
        """
        self._obstacle, self._tips, self._total = obstacle, tips, total
        self.count, self.nodes = len(tips.places), target.nodes
        # Beside the nodes their places are those of balls that follow them.
        balls = total + np.arange(self.count)
        self._pair = BallPair(balls, tips.radius, target, total + self.count)
        self.thickness = self._pair.thickness
        self._time = self._acting = 0.0
        self._first = placement(obstacle, 0.0)

    def tell(self, time: float, acting: float) -> None:
        """At which times the next answer's places are, and forces act [s]."""
        self._time, self._acting = time, acting

    def shift(self, time: float) -> Floats:
        """How far the places have moved with the obstacle since t = 0 [m], (gaps, dim)."""
        moved = placement(self._obstacle, time).since(self._first, self._tips.places)
        return np.zeros_like(self._tips.places) + moved

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with the contact nodes at some places, forces acting at others [m]."""
        then, now = self.shift(self._acting), self.shift(self._time)
        if self._time > self._acting:
            fast = float(np.linalg.norm(now - then, axis=1).max()) / (self._time - self._acting)
            self.speed = max(self.speed, fast)
        met = self._pair(
            np.concatenate([places, self._tips.places + now]),
            np.concatenate([acting, self._tips.places + then]),
        )
        weights = -met.weights[:, : self._total]
        return Meeting(weights, met.gap, -met.normal, met.area, lambda: _STILL)


def edges(corners: Floats, step: float) -> Floats:
    """Corners of a box, in the order of `np.ndindex`, and places along its edges, (places, dim)."""
    found = [corners]
    for one in range(len(corners)):
        for bit in (1 << k for k in range(corners.shape[1])):
            if not one & bit:
                way = corners[one | bit] - corners[one]
                count = int(np.ceil(np.linalg.norm(way) / step))
                found.append(corners[one] + np.outer(np.arange(1, count) / count, way))
    return np.concatenate(found)
