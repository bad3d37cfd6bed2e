"""What a watch asks bodies without meshes of solids: where obstacles may pass unseen."""

from collections.abc import Iterator

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.findings import Finding
from impactfem.system.few import FewBodies


class Watched:
    """Bodies that touch with their contact nodes, joined by axes.

    Attributes:
        bodies: What moves.
        measure: What a depth of what contact nodes do not guard is compared with.
    """

    bodies: FewBodies
    measure = "length"

    @property
    def coordinates(self) -> Floats:
        """Q now, shape (d,)."""
        raise NotImplementedError

    def unguarded(self, lines: Integers) -> tuple[Floats, float]:
        """Where obstacles may pass between contact nodes now, and how near they may come.

        Args:
            lines: Contact nodes joined by axes, (lines, 2).

        Returns:
            Corners of lines or triangles [m], (several, corners, dim), and a distance [m].
        """
        return self.bodies.places(self.coordinates)[lines], 0.0

    @property
    def nodes_sink(self) -> bool:
        """Whether contact nodes sink in as their law has it; deeper between them is none of it."""
        return False

    def unguarded_in_words(self, lines: Integers) -> tuple[float, str, str]:
        """Size [m] that a depth is compared with, what lies so deep, and what helps."""
        nodes = self.bodies.places(self.bodies.position)[lines]
        length = float(np.linalg.norm(nodes[:, 1] - nodes[:, 0], axis=1).sum())
        remedy = 'model it as a solid, or as a beam with contact = "along"'
        return length, "the axis of {name} lies", remedy

    def findings(self) -> Iterator[Finding]:
        """What was seen of limits of its model."""
        yield from ()
