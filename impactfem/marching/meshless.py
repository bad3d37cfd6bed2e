"""What steppers of bodies without meshes have in common."""

from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.pair_responses import Roots
from impactfem.scene import PiecewiseVector

_ROUNDS = 4.0 * float(np.finfo(float).eps)  # by which times round


def step_length(start: float, end: float, dt: float) -> float:
    """Length of a step [s]: dt where it is a whole one, whose ends round the more the later."""
    span = end - start
    return dt if abs(span - dt) <= _ROUNDS * abs(end) else span


class Meshless:
    """What steppers of bodies without meshes have in common: no node of them is massless.

    Attributes:
        counts: Whether this rank sums the bodies up.
    """

    surface_iterate: Any
    velocity_ahead: Any
    whole_columns: int | None = None
    share = 1.0
    apart: Integers | None = None

    def __init__(self, gravity: PiecewiseVector, dt: float, *, counts: bool) -> None:
        """Begin at t = 0.

        Args:
            gravity: [m/s^2].
            dt: Time step [s].
            counts: Whether this rank sums the bodies up.
        """
        self.dt, self.counts, self._gravity = dt, counts, gravity

    @property
    def rolling(self) -> bool:
        """Whether it touches at places that change."""
        return False

    @property
    def velocity(self) -> Floats:
        """None: its velocities are in `memory`, the same on all ranks."""
        return np.zeros(0)

    def gravity(self, start: float, end: float) -> Floats:
        """Mean gravity of a layer [m/s^2], shape (dim,)."""
        if self._gravity.is_constant:  # asked for in every layer
            return np.array(self._gravity.values[0])
        return np.asarray(self._gravity.mean(start, end))

    def reaching(self, span: float) -> Floats:
        """Displacement of the contact nodes a time [s] after the step, as it is solved now."""
        return np.asarray(self.surface_iterate + span * self.velocity_ahead)

    def roots(self) -> Roots | None:
        """None: nodes are asked."""
        return None

    def static(self, forces: Floats) -> Floats:
        """Nothing is massless."""
        return np.zeros_like(forces)

    def placed(self, static: Floats) -> Floats:  # noqa: ARG002  (as the interface has it)
        """None, as `velocity`."""
        return np.zeros(0)

    def state(self) -> dict[str, Any]:
        """None, as `velocity`."""
        return {}

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Nothing: all of it is in `memory`."""

    def destroy(self) -> None:
        """Nothing to free."""
