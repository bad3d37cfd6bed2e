"""Reflections of obstacles at planes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

type Floats = NDArray[np.float64]

EQUAL = 1e-9
"""Share of a size below which distances are rounding."""


def signs(axis: int, dim: int) -> Floats:
    """Factors (dim,) by which a reflection across an axis changes the components of a vector."""
    found = np.ones(dim)
    found[axis : axis + 1] = -1.0
    return found


@dataclass(frozen=True)
class Mirror:
    """A plane across an axis.

    Attributes:
        axis: 0, 1 or 2.
        place: Its coordinate on this axis [m].
        size: Length [m] to which distances are small or not.
    """

    axis: int
    place: float
    size: float

    def point(self, point: Sequence[float]) -> Floats:
        """Image of a point."""
        image = np.array(point, dtype=np.float64)
        image[self.axis : self.axis + 1] *= -1.0
        image[self.axis : self.axis + 1] += 2.0 * self.place
        return image

    def direction(self, vector: Sequence[float]) -> Floats:
        """Image of a vector."""
        return np.array(vector, dtype=np.float64) * signs(self.axis, len(vector))

    def near(self, left: Floats, right: Floats) -> bool:
        """Whether points are the same up to rounding."""
        return bool(np.abs(left - right).max() <= EQUAL * self.size)
