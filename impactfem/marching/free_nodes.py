"""Nodes that joints hold of a solid in explicit steps, from one level to the next.

The forces of a level act on their lumped mass M all the way to the next one, and impulses p of
joints with them; mu is the damping by mass:

    x_b - x_a = dt w,    (1 + mu dt / 2) w = v_a + dt a / 2 + M^-1 J^T p / 2,    v_b = 2 w - v_a,

which is what the solid does (`impactfem.marching.finite_leapfrog`) until its own forces at b are
known, and the step of points that joints hold. No elastic force answers within the step: springs
between levels need no shorter one. What the solid then adds at b to v_b across the joints the next
step takes off.
"""

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.marching.between_levels import Still
from impactfem.marching.layers import Sums
from impactfem.marching.meshless import step_length
from impactfem.scene import PiecewiseVector
from impactfem.system.surface import SurfaceNodes


class FreeNodes(Still):
    """They, the same on every rank; see `impactfem.marching.finite_tipped`.

    Attributes:
        nodes: They, as if this rank owned all.
        generation: Of their answers, which change with the length of the step.
    """

    leaps = True
    velocity: Floats = np.zeros(0)

    def __init__(
        self,
        gravity: PiecewiseVector,
        dt: float,
        inverse: Floats,
        damping: float,
        size: float,
        *,
        counts: bool,
    ) -> None:
        """Begin at t = 0, at rest and where they are.

        Args:
            gravity: [m/s^2].
            dt: Length of a layer [s].
            inverse: Inverse masses, 0 of what supports hold, (nodes, dim).
            damping: By mass [1/s].
            size: Largest extent of the solid [m].
            counts: Whether this rank sums up what joints store.
        """
        super().__init__(gravity, dt, 0)
        self.counts, (count, dim) = counts, inverse.shape
        self.size, self._damping, self._inverse = size, damping, inverse.ravel()
        own = np.arange(count)
        self.nodes = SurfaceNodes(MPI.COMM_SELF, dim, count, own, own)
        self.surface = SurfaceNodes(MPI.COMM_SELF, dim, 0, own[:0], own[:0])
        self.constrained = self._inverse == 0.0
        self.joined: Floats | None = None
        self.span, self.touching_velocity = dt, self.surface_velocity
        none = np.zeros(count * dim)
        self._answer = 0.5 * dt**2 * self._inverse / (1.0 + 0.5 * damping * dt)
        self.take_up(none, none, none)

    def take_up(self, place: Floats, rate: Floats, pull: Floats) -> None:
        """Begin at a level: displacements, velocities and accelerations there, (dofs,) each."""
        self.displacement = self.after = place
        self.velocity, self._pull = rate, pull

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times."""
        span = step_length(start, end, self.dt)
        slow = 1.0 + 0.5 * self._damping * span
        if span != self.span:
            self.span, self.generation = span, self.generation + 1
            self._answer = 0.5 * span**2 * self._inverse / slow
        way = span * (self.velocity + 0.5 * span * self._pull) / slow
        self._free = self.after = self.displacement + np.where(self.constrained, 0.0, way)

    def renew(self) -> None:
        """Nothing: answers go by the length of the step."""

    def answered(self, forces: Floats) -> Floats:
        """Displacements by several forces, (several, dofs)."""
        return forces * self._answer

    def moved(self, forces: Floats) -> Floats:
        """None by contact forces: they do not touch."""
        return np.zeros((len(forces), len(self._answer)))

    def freed(self, impulses: Floats) -> Floats:
        """Velocities by several impulses, (several, dofs)."""
        return impulses * self._inverse

    def shift(self, change: Floats) -> None:
        """Move the end of the step."""
        self.after = self.after + change

    def lay(self, forces: Floats) -> None:  # noqa: ARG002  (as others)
        """Put the end of the step where the joints' forces bring it."""
        self.after = self._free
        if self.joined is not None:
            self.after = self._free + self._answer * self.joined

    def accept(self) -> None:
        """End the step."""
        way = self.after - self.displacement
        self.velocity = np.where(self.constrained, 0.0, 2.0 / self.span * way - self.velocity)
        self.displacement = self.after

    def inertia(self) -> list[Floats]:
        """None besides that of the solid."""
        turns = self.nodes.dim * (self.nodes.dim - 1) // 2
        return [np.zeros((turns, turns))]

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as others)
        """Nothing besides the solid: what joints store comes to it."""
        dim = self.nodes.dim
        none = np.zeros(dim)
        return [Sums(0.0, 0.0, 0.0, none, none.copy(), np.zeros(dim * (dim - 1) // 2))]

    finish = initial
