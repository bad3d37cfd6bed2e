"""A rigid body as it is marched, alone or with others, and shown."""

from collections.abc import Sequence
from typing import cast

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.few import FewInterior
from impactfem.marching.pictured import Pictured
from impactfem.marching.rigid import RigidBodies
from impactfem.marching.stations import Held, HeldRigid
from impactfem.scene import PiecewiseVector
from impactfem.system.rigid import Rigid, frame, in_space
from impactfem.system.stations import Stations


class RigidMidpoint(Pictured):
    """One of the bodies that `RigidBodies` steps, at first the only one."""

    bodies: Rigid

    def __init__(
        self, bodies: Rigid, gravity: PiecewiseVector, dt: float, *, counts: bool,
        exact: bool = False,
    ) -> None:  # fmt: skip
        """Begin at t = 0; see `FewInterior` and `RigidBodies`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self._cells, self._exact = bodies.picture[1], exact
        self._march, self._at = self._marched([bodies]), 0

    def _marched(self, bodies: Sequence[Rigid]) -> RigidBodies:
        return RigidBodies(bodies, self._gravity, self.dt, counts=self.counts, exact=self._exact)

    @property
    def stepper(self) -> RigidBodies:
        """What steps it."""
        return self._march

    @classmethod
    def step_together(cls, alike: Sequence[FewInterior]) -> None:
        """Step bodies at once."""
        each = cast("Sequence[RigidMidpoint]", alike)
        march = each[0]._marched([part.bodies for part in each])  # noqa: SLF001
        for k, part in enumerate(each):
            part._march, part._at = march, k  # noqa: SLF001

    @property
    def _own(self) -> slice:
        return self._march.owns[self._at]

    @property
    def coordinates(self) -> Floats:
        """Centre and angle or quaternion now."""
        return self._march.coordinates(self._at)

    @property
    def surface_displacement(self) -> Floats:
        """Of its contact nodes since t = 0 [m], (count, dim)."""
        return self._march.surface_displacement[self._own]

    @property
    def surface_velocity(self) -> Floats:
        """Of its contact nodes [m/s], (count, dim)."""
        return self._march.surface_velocity[self._own]

    def held(self, stations: Stations) -> Held:  # noqa: ARG002  (it is one)
        """All that are stepped with it, as joints hold them."""
        return HeldRigid(self._march)

    def apply(self, body: int, force: Floats, moment: Floats) -> bool:  # noqa: ARG002  (it is one)
        """See `FewInterior`."""
        self._march.apply(self._at, force, moment)
        return True

    def motion(self, body: int) -> dict[str, Floats]:  # noqa: ARG002  (it is one)
        """Fields at these places now: displacement [m], velocity [m/s], (nodes, dim)."""
        places, rest = self._pictured(self.coordinates), self._pictured(self.bodies.position)
        speed, spin = (each[self._at] for each in self._march.rates)
        centre, turn = (each[self._at] for each in self._march.frame)
        velocity = speed + np.cross(turn @ spin, in_space(places) - centre)
        return {"displacement": places - rest, "velocity": velocity[:, : self.bodies.dim]}

    def _pictured(self, q: Floats) -> Floats:
        """Places [m] of contact nodes, then of the points of the picture, (nodes, dim)."""
        centre, turn = frame(q)
        arms = np.vstack([self.bodies.arms, self.bodies.picture[0]])
        return np.asarray((centre + arms @ turn.T)[:, : self.bodies.dim])

    def _leaning(self, nodes: Integers) -> tuple[Floats, Integers, Floats]:
        """See `Pictured`."""
        points, turn = self.bodies.picture[0], self._march.frame[1][self._at]
        return self._march.acting[self._own][nodes], np.arange(len(points)), points @ turn.T


class RodMidpoint(RigidMidpoint):
    """A rod: a line between its ends, which are its contact nodes."""

    drawn = FewInterior.drawn
    located = FewInterior.located
