"""The wall of bars."""

from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.kinds import Name
from impactfem.scene.obstacles.base import Field
from impactfem.scene.obstacles.half_space import HalfSpace
from impactfem.scene.schema import key, table


@table('[[obstacle]] with kind = "wall"')
class Wall:
    """A rigid wall at rest at x = 0, in front of the near end of a bar.

    Raises:
        SceneError: the name is not allowed.
    """

    kind: ClassVar[str] = "wall"
    before_bars: ClassVar[bool] = True
    is_smooth: ClassVar[bool] = True
    is_flat: ClassVar[bool] = True
    motion: ClassVar[None] = None
    rotation: ClassVar[None] = None
    moves: ClassVar[bool] = False

    name: str = key(Name(), "name of the wall", default="wall")

    def gap(self, points: Floats) -> Field:
        """Distances of places (points, 1) from it, shape (points,), and normals, (points, 1)."""
        return points[:, 0], np.ones((len(points), 1))

    def opened(self, folder: Path) -> Self:  # noqa: ARG002  (as the interface has it)
        """The same: it has no file."""
        return self

    @property
    def in_space(self) -> HalfSpace:
        """The same for other bodies on the x axis."""
        return HalfSpace(name=self.name, point=(0.0,), normal=(1.0,))
