"""Bodies of few degrees of freedom beside others under finite strain: steps solved by iterates."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.marching.few import FewMidpoint
from impactfem.marching.layers import Sums

Floats = NDArray[np.float64]

_ACCURACY = 1e-13  # of impulses
_SHARE = 1e-3  # of momenta that sets their scale where no force acts


class FewNewton(FewMidpoint):
    """The same rule in steps of any length; see `newton_bodies.NewtonStepper`.

    Contact forces act on the nodes where these are amid the step.
    """

    generation = 0
    _work: Any = 0.0

    @property
    def missing(self) -> dict[str, float]:
        """Nothing: their mass is all there."""
        return {}

    @property
    def surface_iterate(self) -> Floats:
        """Displacement of the contact nodes at the end of the step [m], (count, dim)."""
        return self.bodies.places(self._end(self._ahead)) - self._start

    @property
    def surface_way(self) -> Floats:
        """How far the contact nodes move in the step [m], (count, dim)."""
        return self.surface_iterate - self.surface_displacement

    def touch(self, normals: Floats) -> None:
        """Nothing: nodes touch themselves."""

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        return self.bodies.places(self._q + (end - start) * self._v) - self._start

    def arms(self, middle: Floats) -> Floats:
        """Where contact nodes are."""
        return middle

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times."""
        self._span, self._time = end - start, 0.5 * (start + end)
        self._weight = self.bodies.weights @ np.asarray(self._gravity.mean(start, end))
        self._ahead = self._v.copy()
        self._prepare(self._time)
        self.generation += 1

    def unbalanced(self, forces: Floats) -> float:
        """Largest impulse that the iterate leaves, over what rounding allows."""
        middle, mean = self._middle(self._ahead), 0.5 * (self._v + self._ahead)
        self._jacobian = self.bodies.jacobian(middle)
        self._renew_answer()
        force = self._force(middle, mean) + self._weight + self._jacobian.T @ forces.ravel()
        gained = self._mass @ (self._ahead - self._v)
        self._missing = self._span * force - gained
        momentum = _SHARE * np.abs(self._mass @ self._v).max(initial=0.0)
        scale = max(np.abs(self._span * force).max(initial=0.0), np.abs(gained).max(), momentum)
        left = float(np.abs(self._missing).max(initial=0.0))
        return left / (_ACCURACY * float(scale) + np.finfo(float).tiny)

    def linearise(self) -> Floats:
        """Solve for what balances the iterate; how contact nodes move by it."""
        self._change = self._inverse @ self._missing
        moved = 0.5 * self._span * self._jacobian @ self._change
        return np.asarray(moved.reshape(self._start.shape))

    def answers(self, forces: Floats) -> Floats:  # type: ignore[override]
        """How contact nodes answer to forces on them at the iterate, (several, count, dim)."""
        return self.columns(forces)[0]

    def correct(self, forces: Floats) -> None:
        """Move the iterate, with a change of the contact forces (count, dim)."""
        self._ahead = self._ahead + self._change + self._answer @ forces.ravel()

    def accept(self) -> None:
        """End the step at the iterate."""
        end, mean = self._end(self._ahead), 0.5 * (self._v + self._ahead)
        if self.bodies.load is not None:
            ends = self._time - 0.5 * self._span, self._time + 0.5 * self._span
            load = self.bodies.load(*ends, self._middle(self._ahead), mean)
            self._work = self._work + load * (end - self._q)
        self._q, self._v = end, self._ahead

    def finish(self, layer: int, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface)
        """End the layer and sum up."""
        work, self._work = self._work, 0.0
        return self._summed(np.broadcast_to(work, self._q.shape))
