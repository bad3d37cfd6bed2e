"""A rigid body as it is marched, alone or with others, and shown."""

from collections.abc import Sequence
from functools import partial
from typing import cast

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.marched import Marched
from impactfem.marching.pictured import Pictured
from impactfem.marching.rigid import RigidBodies
from impactfem.marching.stations import Held, HeldRigid
from impactfem.scene import PiecewiseVector
from impactfem.system.rigid import Rigid, frame, in_space
from impactfem.system.stations import Stations


class RigidMidpoint(Marched):
    """One of the bodies that `RigidBodies` steps, at first the only one."""

    bodies: Rigid

    def __init__(
        self, bodies: Rigid, gravity: PiecewiseVector, dt: float, *, counts: bool,
        exact: bool = False,
    ) -> None:  # fmt: skip
        """Begin at t = 0; see `RigidBodies`."""
        self.bodies, self.dt = bodies, dt
        self._stepped = partial(RigidBodies, gravity=gravity, dt=dt, counts=counts, exact=exact)
        self._march, self._at = self._stepped([bodies]), 0
        self.shown = Pictured(self, bodies.picture[1])

    @property
    def stepper(self) -> RigidBodies:
        """What steps it."""
        return self._march

    @classmethod
    def step_together(cls, alike: Sequence[Marched]) -> None:
        """Step bodies at once."""
        each = cast("Sequence[RigidMidpoint]", alike)
        march = each[0]._stepped([part.bodies for part in each])  # noqa: SLF001
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
        """See `Marched`."""
        self._march.apply(self._at, force, moment)
        return True

    def pictured(self, q: Floats) -> Floats:
        """Places [m] of contact nodes, then of the points of the picture, (nodes, dim)."""
        centre, turn = frame(q)
        arms = np.vstack([self.bodies.arms, self.bodies.picture[0]])
        return np.asarray((centre + arms @ turn.T)[:, : self.bodies.dim])

    def pictured_speeds(self, places: Floats) -> Floats:
        """Velocities of what is at the places of these now [m/s], (nodes, dim)."""
        speed, spin = (each[self._at] for each in self._march.rates)
        centre, turn = (each[self._at] for each in self._march.frame)
        velocity = speed + np.cross(turn @ spin, in_space(places) - centre)
        return np.asarray(velocity[:, : self.bodies.dim])

    def leaning(self, nodes: Integers) -> tuple[Floats, Integers, Floats]:
        """Where forces act that come in by markers; see `MechanismMidpoint`."""
        points, turn = self.bodies.picture[0], self._march.frame[1][self._at]
        return self._march.acting[self._own][nodes], np.arange(len(points)), points @ turn.T
