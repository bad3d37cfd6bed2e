"""A watch on rods and beams between the nodes that touch obstacles: corners may pass there."""

import json
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.distance import signed_distance
from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.few import FewMidpoint
from impactfem.marching.rows import Level
from impactfem.runs.verdict import PENETRATION_LIMITS
from impactfem.scene import Scene
from impactfem.scene.pairing import obstacles_of

Floats = NDArray[np.float64]

_PLACES = 8  # along each line, looked at
_LOOKS = 400  # at a run


class AxisWatch:
    """Measures how deep axes lie in obstacles.

    Attributes:
        depth: Of each pair of a body and an obstacle [m], by their names.
    """

    def __init__(self, scene: Scene, few: Sequence[FewMidpoint], layers: int) -> None:
        """Look at some layers of a march."""
        self._every = max(1, layers // _LOOKS)
        self._bodies = [
            (march, name, march.bodies.lines[march.bodies.body[march.bodies.lines[:, 0]] == k])
            for march in few
            for k, name in enumerate(march.bodies.names)
        ]
        self._obstacles = {name: obstacles_of(scene, name) for _, name, _ in self._bodies}
        share = (np.arange(_PLACES) + 0.5) / _PLACES
        self._shares = np.stack([1.0 - share, share])
        self.depth: dict[tuple[str, str], float] = {}

    def __call__(self, level: Level) -> None:
        """Look at a level if it is its turn."""
        if level.layer % self._every:
            return
        for march, name, lines in self._bodies:
            if not len(lines):
                continue
            nodes = march.bodies.places(march.coordinates)
            places = np.einsum("sp,lsd->lpd", self._shares, nodes[lines])
            flat = places.reshape(-1, places.shape[2])
            for obstacle in self._obstacles[name]:
                depth = -float(signed_distance(obstacle, flat, level.time)[0].min())
                pair = name, obstacle.name
                if np.isfinite(depth) and depth > self.depth.get(pair, 0.0):
                    self.depth[pair] = depth

    def findings(self) -> Iterator[Finding]:
        """What was seen."""
        for march, name, lines in self._bodies:
            if not len(lines):
                continue
            nodes = march.bodies.places(march.bodies.position)[lines]
            length = float(np.linalg.norm(nodes[:, 1] - nodes[:, 0], axis=1).sum())
            for (body, obstacle), depth in self.depth.items():
                if body == name:
                    share = depth / length
                    text = f"the axis of {name} lies up to {depth:.2g} m in {obstacle}, "
                    text += f"{percent(share)} of its length: only its nodes touch obstacles"
                    remedy = 'model it as a solid, or as a beam with contact = "along"'
                    yield from by_limits(
                        "penetration", share, PENETRATION_LIMITS, text, name, remedy
                    )

    def state(self) -> str:
        """What was seen, for a checkpoint."""
        return json.dumps([[*pair, depth] for pair, depth in self.depth.items()])

    def restore(self, state: str) -> None:
        """Go on from what was seen."""
        self.depth = {(body, obstacle): depth for body, obstacle, depth in json.loads(state)}
