"""Forces in the gaps at a level of explicit steps under finite strain, and what they do."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.marching.layers import ContactGaps
from impactfem.marching.newton_steps import LayerSums
from impactfem.marching.rubbing import in_space, told, turned


@dataclass(frozen=True)
class LevelForces:
    """Forces along normals, with friction along tangents too, where a level has the bodies.

    Attributes:
        directions: Normals, with friction followed by tangents, (gaps, ways, dim).
        force: Along them [N], (gaps, ways).
        rubbing: Of the tangential ones, on the contact nodes [N], (nodes, dim).
    """

    directions: Floats
    force: Floats
    rubbing: Floats

    @classmethod
    def of(cls, gaps: ContactGaps, directions: Floats, force: Floats) -> "LevelForces":
        """Forces along directions, which `spread` of the gaps puts on nodes."""
        return cls(directions, force, gaps.spread(in_space(directions[:, 1:], force[:, 1:])))

    @property
    def vectors(self) -> Floats:
        """The forces as vectors [N], (gaps, dim)."""
        return in_space(self.directions, self.force)

    def act(self, done: LayerSums, moved: Floats, shift: Floats, span: float) -> None:
        """Add what they do in the half of a step that is nearer to their level.

        Args:
            done: Sums of the layer.
            moved: How contact nodes moved in the step [m], (nodes, dim).
            shift: How obstacles did [m], (gaps, dim).
            span: Length of the step [s].
        """
        half, vectors = 0.5 * span, self.vectors
        done.impulse += half * self.force[:, 0]
        done.vectors += half * vectors
        done.obstacles += 0.5 * float((vectors * shift).sum())
        if self.force.shape[1] > 1:
            tangential = in_space(self.directions[:, 1:], self.force[:, 1:])
            work = float((self.rubbing * moved).sum() - (tangential * shift).sum())
            done.friction += 0.5 * work
            acting, _ = told(self.directions, self.force, np.zeros_like(self.force[:, 1:]))
            done.rubbed += half * acting[:, 1:]

    def slid(self, done: LayerSums, way: Floats, pressed: NDArray[np.bool_]) -> None:
        """Add the ways (gaps, dim) [m] along the tangents of what was pressed in the step."""
        if self.force.shape[1] > 1:
            _, slid = told(self.directions, self.force, turned(self.directions, way)[:, 1:])
            done.slid += np.where(pressed, slid, 0.0)
