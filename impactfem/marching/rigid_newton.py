"""Rigid bodies beside others under finite strain: steps of any length, solved by iterates.

Contact forces push where they act amid the step. Bodies turn by Cayley's rotation of a straight T
(`impactfem.marching.turn_kernels`): what is fixed to a body moves by T x (its mean arm), so that
forces do their work on these ways, to rounding.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.marching.layers import Sums
from impactfem.marching.rigid import RigidBodies
from impactfem.marching.rigid_body import RigidMidpoint
from impactfem.marching.rigid_kernels import carried, frames, turned, turned_further
from impactfem.marching.rigid_sums import applied
from impactfem.system.rigid import in_space

Floats = NDArray[np.float64]

_ACCURACY = 1e-13  # of speeds
_SHARE = 1e-3  # of speeds that sets their scale where nothing changes
_WHOLE = 1.0  # largest tan of a quarter turn that is foretold


class RigidSteps(RigidBodies):
    """The bodies as steps take them; see `impactfem.marching.newton_bodies.NewtonStepper`."""

    generation = 0
    _work: Any = 0.0
    _straight = True

    @property
    def missing(self) -> dict[str, float]:
        """Nothing: their mass is all there."""
        return {}

    @property
    def surface_velocity(self) -> Floats:
        """Of what touches, at the start of the step [m/s], (count, dim)."""
        arms = self._bare + self._around(self._turn) + self._offset
        return self._velocities(self._turn, self.rates, arms)

    @property
    def surface_iterate(self) -> Floats:
        """Displacement of the contact nodes at the end of the step [m], (count, dim)."""
        return self._iterate

    @property
    def surface_way(self) -> Floats:
        """How far what touches moves in the step, by the last iterate [m], (count, dim)."""
        return self._ways(self._speed_ahead, self._half)

    def _ways(self, ahead: Floats, half: Floats) -> Floats:
        way = 0.5 * self._span * (self._speed + ahead)
        turn = 2.0 * applied(self._turn, half)
        return np.asarray(carried(way[None], turn[None], self.apart, self.acting, self._dim)[0])

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        span = end - start
        angle = np.linalg.norm(self._spin, axis=1, keepdims=True)
        tangent = np.minimum(np.tan(np.minimum(0.5 * span * angle, 1.5)), _WHOLE)
        half = self._spin * tangent / np.maximum(angle, np.finfo(float).tiny)
        rotations = frames(turned_further(self._angles, half, 2.0 * np.arctan(half)))
        bare = turned(rotations, self.apart, self._arms)
        return self._places(self._centre + span * self._speed, rotations, bare)

    def arms(self, middle: Floats) -> Floats:
        """Where contact nodes are."""
        return middle

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch, by the normals of their nodes (count, dim)."""
        towards = in_space(normals)
        self._offset = self._following - self._roll * towards
        self._normals = towards if self._rims else self._normals
        self.acting = self._amid + self._around(self._middle) + self._offset

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times."""
        self.prepare(0)
        self._span, self._time = end - start, 0.5 * (start + end)
        self._weight = self._mass * in_space(np.asarray(self._gravity.mean(start, end)))
        self._pushed, self._turned = np.zeros_like(self._speed), np.zeros_like(self._spin)
        self._settle(np.arange(len(self._mass)))
        self.look()

    def unbalanced(self, forces: Floats) -> float:
        """Largest change of speeds that the iterate leaves, over what rounding allows."""
        known = self.known()
        self.lay(forces)
        self._settle(np.arange(len(self._mass)))
        return self.left(*known)

    def known(self) -> tuple[tuple[Floats, Floats], Floats]:
        """Rates ahead and ways, by the last iterate."""
        speeds, spins = self.rates_ahead
        return (speeds.copy(), spins.copy()), self.surface_way

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step, to be solved for."""
        wrench = self._span * self.wrenches(forces[None])[0]
        self._pushed, self._turned = wrench[:, :3], wrench[:, 3:]

    def left(self, ahead: tuple[Floats, Floats], way: Floats, slack: float = 0.0) -> float:
        """Largest change of speeds since they were as given, over what rounding allows."""
        self._change = self.surface_way - way
        left, scale = 0.0, 0.0
        sizes = 1.0, self._gyration
        for new, old, begun, size in zip(self.rates_ahead, ahead, self.rates, sizes, strict=True):
            left = max(left, float((size * np.abs(new - old)).max()))
            changed, moving = np.abs(new - begun), _SHARE * np.abs(begun)
            scale = max(scale, float((size * np.maximum(changed, moving)).max()))
        return left / (_ACCURACY * scale + slack + np.finfo(float).tiny)

    def linearise(self) -> Floats:
        """How contact nodes move by what balances the iterate."""
        return self._change

    def answers(self, forces: Floats) -> Floats:  # type: ignore[override]
        """How contact nodes answer to forces on them at the iterate, (several, count, dim)."""
        return self.columns(forces)[0]

    def correct(self, forces: Floats) -> None:
        """Move the iterate, with a change of the contact forces (count, dim)."""
        self._settle(self.strike(forces))
        self.look()

    def look(self) -> None:
        """See where nodes are by the iterate, and how they answer."""
        self._iterate = self.foreseen()
        self.generation += 1

    def accept(self) -> None:
        """End the step at the iterate."""
        self._work = self._work + self._go_on()

    def finish(self, layer: int, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface)
        """End the layer and sum up."""
        work, self._work = self._work, 0.0
        return self._summed(work)


class RigidNewton(RigidMidpoint):
    """One of the bodies that `RigidSteps` steps."""

    _marches = RigidSteps
