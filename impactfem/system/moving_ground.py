"""The ground as joints hold it: at rest, and wherever a joint moves it as given."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.formula import Formula
from impactfem.scene.jets import motion_at

_SAMPLES = 101


@dataclass(frozen=True)
class MovingGround:
    """Stations of the ground, of which the first one does not move.

    Attributes:
        motions: Displacements of the others by formulas in t [m], each of 2 or 3.
    """

    motions: tuple[Sequence[Formula], ...] = ()

    @property
    def count(self) -> int:
        """Number of stations."""
        return 1 + len(self.motions)

    @cached_property
    def still(self) -> Floats:
        """Zeros, (stations, 3)."""
        return np.zeros((self.count, 3))

    @cached_property
    def turns(self) -> Floats:
        """Rotations: none, (stations, 3, 3)."""
        return np.tile(np.eye(3), (self.count, 1, 1))

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Places [m] and velocities [m/s] at a time, (stations, 3) each."""
        if not self.motions:
            return self.still, self.still
        places, speeds = np.zeros((2, self.count, 3))
        for k, motion in enumerate(self.motions, start=1):
            for axis, formula in enumerate(motion):
                jet = motion_at(formula, t)
                places[k, axis], speeds[k, axis] = jet.value, jet.rate
        return places, speeds

    def fastest(self, duration: float) -> float:
        """Largest speed of any until some time, of samples [m/s]."""
        times = np.linspace(0.0, duration, _SAMPLES)
        each = [np.abs(motion_at(f, times).rate).max() for m in self.motions for f in m]
        return float(np.max(each, initial=0.0))


def drive_at(formulas: Sequence[Formula | None], t: float) -> tuple[Floats, Floats]:
    """Coordinates [rad or m] and rates of driven joints at a time; 0 of others, (joints,) each."""
    found = np.zeros((2, len(formulas)))
    for k, formula in enumerate(formulas):
        if formula is not None:
            jet = motion_at(formula, t)
            found[:, k] = jet.value, jet.rate
    return found[0], found[1]
