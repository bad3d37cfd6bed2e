"""The whole of a scene of which planes of symmetry leave only a part to be computed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from impactfem.arrays import Floats

_AXES = "xyz"


@dataclass(frozen=True)
class Whole:
    """Half, quarter or eighth that is computed, and the whole that is told of.

    Forces, energies and masses of the whole are `factor` times those of the part. Vectors of all
    images sum up to one in every plane: what a part has across a plane, its image cancels.

    Attributes:
        planes: Axis ("x", "y", "z") that each plane is square to, and its coordinate [m].
    """

    planes: tuple[tuple[str, float], ...] = ()

    @property
    def factor(self) -> int:
        """Number of parts."""
        return int(2 ** len(self.planes))

    @property
    def levels(self) -> dict[int, float]:
        """Coordinate [m] of each plane by the number of its axis."""
        return {_AXES.index(axis): level for axis, level in self.planes}

    def mean(self, vectors: Floats) -> Floats:
        """Means over all parts of vectors of the computed one, shape (..., 2 or 3)."""
        found = vectors.copy()
        found[..., list(self.levels)] = 0.0
        return found

    def mean_turn(self, vectors: Floats) -> Floats:
        """Means over all parts of turns or moments, shape (..., 3): images turn the other way.

        Only about an axis across a plane does an image turn alike.
        """
        found = vectors.copy()
        for axis in self.levels:
            found[..., [k for k in range(3) if k != axis]] = 0.0
        return found

    def mean_place(self, places: Floats) -> Floats:
        """Means over all parts of places in the computed one [m], shape (..., 2 or 3)."""
        found = places.copy()
        for axis, level in self.levels.items():
            found[..., axis] = level
        return found

    def details(self) -> dict[str, Any]:
        """What summaries say of it."""
        return {"symmetry_factor": self.factor, "symmetry_planes": dict(self.planes)}

    @classmethod
    def of_summary(cls, summary: Mapping[str, Any]) -> Self:
        """What `details` has left in a summary."""
        planes = summary.get("details", {}).get("symmetry_planes", {})
        return cls(tuple((str(axis), float(level)) for axis, level in planes.items()))
