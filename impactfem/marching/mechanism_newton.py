"""Mechanisms beside bodies under finite strain: steps of any length, solved by iterates.

Joints, their motors, limits and friction are solved for in every iterate, so that the march asks
for contact forces only. These act by the discrete Jacobian D of `impactfem.marching.held_tree`:
what touches at a link goes by D v dt, exactly as the tree has it at both ends, and forces do their
work on these ways. Bases that are free turn by Cayley's rotation: all momenta stay.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ConvergenceError
from impactfem.marching.held_tree import Chords
from impactfem.marching.layers import Sums
from impactfem.marching.mechanism import MechanismMidpoint
from impactfem.scene import PiecewiseVector
from impactfem.system.mechanism import Arm

Floats = NDArray[np.float64]

_ACCURACY = 1e-13  # of rates
_SHARE = 1e-3  # of rates that sets their scale where nothing changes


class MechanismNewton(MechanismMidpoint):
    """Stepper of a mechanism; see `impactfem.marching.newton_bodies.NewtonStepper`."""

    generation = 0

    def __init__(self, bodies: Arm, gravity: PiecewiseVector, dt: float, *, counts: bool) -> None:
        """Begin at t = 0; see `MechanismMidpoint`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self._chords, self._work = bodies.tree.free, 0.0

    @property
    def missing(self) -> dict[str, float]:
        """Nothing: its mass is all there."""
        return {}

    @property
    def surface_velocity(self) -> Floats:
        """Of what touches, at the start of the step [m/s], (count, dim)."""
        return self._velocities(self._q, self._v, self._offset)

    @property
    def surface_iterate(self) -> Floats:
        """Displacement of the contact nodes at the end of the step [m], (count, dim)."""
        return self._place

    @property
    def surface_way(self) -> Floats:
        """How far what touches moves in the step, by the last iterate [m], (count, dim)."""
        way = 0.5 * self.span * (self._v + self._ahead)
        return np.asarray((self._jacobian @ way).reshape(-1, 3))

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        there = self.bodies.tree.integrate(self._q, (end - start) * self._v)
        return self.bodies.places(there) - self._start

    def arms(self, middle: Floats) -> Floats:
        """Where contact nodes are."""
        return middle

    def touch(self, normals: Floats) -> None:
        """Learn where links that roll touch, by the normals of their nodes (count, dim)."""
        self._offset = self.bodies.following - self.bodies.rolling[:, None] * normals
        self._renew_answer()

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times."""
        self.span, self._time = end - start, 0.5 * (start + end)
        self._pull = np.asarray(self._gravity.mean(start, end))
        turns, places = self.bodies.tree.poses(self._q, self.bodies.moving)
        self._begun, self._nodes = (places, turns), self.bodies.places(self._q)
        self._pushed, self._joined = np.zeros((2, len(self._v)))
        self._leans = self._jumps = False
        self._prepare()
        self._settle()
        self.look()

    def foreseen(self) -> Floats:
        """Displacements of the contact nodes at the end of the step, and how forces act on them."""
        bodies, tree, middle = self.bodies, self.bodies.tree, self.way(0.5)
        chords, ended = Chords.of(self, bodies.moving, self._begun), bodies.places(self.way(1.0))
        self._links = chords.rows.reshape(len(bodies.moving), 6, -1)
        origins = (0.5 * (self._begun[0] + chords.ends[0]))[bodies.on]
        self._spans = 0.5 * (self._nodes + ended) - origins
        self._amid = origins - tree.centre(middle)
        if tree.free:
            self._base = middle[:3] - self._q[:3], tree.base(middle)
        self._renew_answer()
        return np.asarray(ended - self._start)

    def unbalanced(self, forces: Floats) -> float:
        """Largest change of rates that the iterate leaves, over what rounding allows."""
        known = self.known()
        self._pushed = np.zeros_like(self._v)
        self._push(forces)
        return self.left(*known)

    def known(self) -> tuple[Floats, Floats]:
        """Rates ahead and ways, by the last iterate."""
        return self._ahead.copy(), self.surface_way

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step, to be solved for."""
        self._pushed = np.zeros_like(self._v)
        self.strike(forces)

    def left(self, ahead: Floats, way: Floats, slack: float = 0.0) -> float:
        """Largest change of rates since they were as given, over what rounding allows."""
        self._change = self.surface_way - way
        mean, inertia = 0.5 * (self._v + self._ahead), self._inertia

        def size(rates: Floats) -> float:
            return float(np.sqrt(rates @ inertia @ rates))

        acting = self._pushed, self.span * self._drive, inertia @ (self._ahead - self._v)
        scale = max(size(self._inverse @ each) for each in acting)
        scale = max(scale, _SHARE * max(size(mean), size(self._v)))
        allowed = _ACCURACY * scale + (self._allowed + slack) * float(np.sqrt(np.trace(inertia)))
        return size(self._ahead - ahead) / float(allowed + np.finfo(float).tiny)

    def strike(self, forces: Floats) -> None:
        """Add contact forces, to be solved for, which turn no rates round."""
        turns = self._leans
        super().strike(forces)
        self._leans = turns

    def _push(self, forces: Floats) -> None:
        """Add contact forces, and solve for the rates: to the end of the step the energy stays.

        Where that is too much to ask, as rates turn round, it is to the order of the step.
        """
        self.strike(forces)
        try:
            self._settle()
        except ConvergenceError:
            self._leans, self._ahead = True, self._v.copy()
            self._settle()

    def linearise(self) -> Floats:
        """How contact nodes move by what balances the iterate."""
        return self._change

    def answers(self, forces: Floats) -> Floats:  # type: ignore[override]
        """How contact nodes answer to forces on them at the iterate, (several, count, dim)."""
        return self.columns(forces)[0]

    def correct(self, forces: Floats) -> None:
        """Move the iterate, with a change of the contact forces (count, dim)."""
        self._push(forces)
        self.look()

    def look(self) -> None:
        """See where nodes are by the iterate, and how they answer."""
        self._place = self.foreseen()
        self.generation += 1

    def accept(self) -> None:
        """End the step at the iterate."""
        self._work += self._go_on()

    def finish(self, layer: int, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface)
        """End the layer and sum up."""
        work, self._work = self._work, 0.0
        return [self._summed(work)]

    def remember(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._leans = False
