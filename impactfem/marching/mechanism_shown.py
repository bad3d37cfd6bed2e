"""What columns, files and pictures show of a mechanism: its joints, and the shapes of its links."""

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.pictured import Pictured
from impactfem.result.history import LOST
from impactfem.scene import PiecewiseVector
from impactfem.system.mechanism import Arm
from impactfem.system.tree import cross


class ShownMechanism(Pictured):
    """A mechanism, and what its joints have gone through."""

    bodies: Arm
    _acting: Floats  # where nodes touch amid the layer, from the centre [m], (nodes, 3)

    def __init__(self, bodies: Arm, gravity: PiecewiseVector, dt: float, *, counts: bool) -> None:
        """Begin at t = 0; see `impactfem.marching.few.FewInterior`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self._cells = bodies.picture[2]
        self._angle = bodies.angles_at_start.copy()
        self._lost = np.zeros_like(self._angle)  # what dampers, friction and limits took [J]

    def told(self) -> dict[str, dict[str, float]]:
        """Positions, rates and losses of joints, by the first parts of their columns."""
        name, tree = self.bodies.names[0], self.bodies.tree
        found = {
            f"{name}.{joint}": {
                "q": float(self._angle[at]),
                "v": float(self._v[at]),
                LOST: float(self._lost[at]),
            }
            for joint, at in tree.single.items()
        }
        for joint, (of, ratio, offset) in tree.followers.items():
            q, v = (found[f"{name}.{of}"][key] for key in ("q", "v"))
            found[f"{name}.{joint}"] = {"q": ratio * q + offset, "v": ratio * v, LOST: 0.0}
        if tree.free:
            turned = self._q[[6, 3, 4, 5]]
            spin = tree.base(self._q) @ self._v[3:6]
            found[f"{name}.{tree.root}"] = {
                **dict(zip(("qw", "qx", "qy", "qz"), turned.tolist(), strict=True)),
                **dict(zip(("wx", "wy", "wz"), spin.tolist(), strict=True)),
            }
        return found

    def motion(self, body: int) -> dict[str, Floats]:  # noqa: ARG002  (it is one)
        """Fields at these places now: displacement [m], velocity [m/s], (nodes, dim)."""
        places, rest = self._pictured(self._q), self._pictured(self.bodies.position)
        bodies, tree = self.bodies, self.bodies.tree
        _, origins = tree.poses(self._q, bodies.moving)
        on = np.concatenate([bodies.on, bodies.picture[0]])
        moving = (tree.jacobians(self._q, bodies.moving) @ self._v)[on]
        velocity = moving[:, :3] + cross(moving[:, 3:], places - origins[on])
        return {"displacement": places - rest, "velocity": velocity}

    def _pictured(self, q: Floats) -> Floats:
        bodies = self.bodies
        turns, origins = bodies.tree.poses(q, bodies.moving)
        on = np.concatenate([bodies.on, bodies.picture[0]])
        arms = np.vstack([bodies.arms, bodies.picture[1]])
        return np.asarray(origins[on] + np.einsum("kij,kj->ki", turns[on], arms))

    def _leaning(self, nodes: Integers) -> tuple[Floats, Integers, Floats]:
        """See `Pictured`."""
        points = np.flatnonzero(self.bodies.picture[0] == self.bodies.on[nodes[0]])
        places = self._pictured(self._q)[len(self._start) + points]
        return self._acting[nodes], points, places - self.bodies.tree.centre(self._q)
