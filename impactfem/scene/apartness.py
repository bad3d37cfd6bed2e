"""Which bodies of a scene are too far apart to meet within its duration."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.pairing import named_body_pairs

if TYPE_CHECKING:
    from impactfem.scene.scene import Scene

type Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Apartness:
    """What is too far apart to meet, whatever strikes what.

    Attributes:
        balls: Radius [m] and centre (dim,) of a ball around each body at t = 0; empty if their ways
            are not certain.
        way: Bound of the ways of two of them within the duration [m].
    """

    balls: Mapping[str, tuple[float, Floats]]
    way: float

    @classmethod
    def of(cls, scene: "Scene") -> "Apartness":
        """Of a scene: what strikes another body passes on at most twice its speed."""
        flights = {body.name: body.swing for body in scene.bodies}
        known = {name: flight for name, flight in flights.items() if flight is not None}
        moved = any(obstacle.moves for obstacle in scene.rigid_obstacles)
        if len(known) < len(flights) or moved or scene.couplings or scene.starts_at_rest:
            return cls({}, math.inf)
        balls = {n: (float(np.linalg.norm(f.half)), np.array(f.center)) for n, f in known.items()}
        pull = float(np.linalg.norm(scene.vector_gravity.values, axis=-1).max(initial=0.0))
        speed = pull * scene.duration
        for body in scene.bodies:
            spin = float(np.linalg.norm(getattr(body, "angular_velocity", None) or 0.0))
            speed += float(np.linalg.norm(known[body.name].velocity)) + spin * balls[body.name][0]
        return cls(balls, scene.duration * speed * 2.0 ** min(len(known), 64))

    def meet(self, one: str, other: str) -> bool:
        """Whether two bodies may meet."""
        if not self.balls:
            return True
        (near, here), (far, there) = self.balls[one], self.balls[other]
        return float(np.linalg.norm(there - here)) <= near + far + self.way


def may_be_struck(scene: "Scene", name: str) -> bool:
    """Whether other bodies of a scene may strike one."""
    others = {body.name for body in scene.bodies} - {name}
    pairs = ((one, two) for _, (one, _), (two, _) in named_body_pairs(scene, [others]))
    apart = Apartness.of(scene)
    return any(name in pair and pair[0] != pair[1] and apart.meet(*pair) for pair in pairs)
