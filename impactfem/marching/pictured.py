"""What bodies of rigid parts show: their contact nodes, and cells that fill them."""

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.closest import shares_inside
from impactfem.marching.few import FewInterior
from impactfem.result.shapes import TETRAHEDRON, TRIANGLE, Shape

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_NEAR, _ROUND = 1e-9, 0.05  # how far a probe may lie out of the flat or round cells of a picture


class Pictured(FewInterior):
    """An interior whose picture are cells between points that move rigidly."""

    _cells: Integers  # of the picture, by the places of its points

    def _pictured(self, q: Floats) -> Floats:
        """Places [m] of contact nodes, then of the points of the picture, (nodes, dim)."""
        raise NotImplementedError

    def drawn(self, body: int, name: str) -> Shape:  # noqa: ARG002  (it is one)
        """Its contact nodes, and cells between points of its surface and its centre."""
        kind = TRIANGLE if self.bodies.dim == 2 else TETRAHEDRON
        return Shape(name, self.material(0), self._cells + len(self._start), kind)

    def material(self, body: int) -> Floats:  # noqa: ARG002  (it is one)
        """Places of the same nodes as probes are given, shape (nodes, dim)."""
        return self._pictured(self.bodies.position)

    def located(self, body: int, point: Floats) -> tuple[Integers, Floats, bool]:
        """Corners of the cell of its picture around a place, or of the nearest one."""
        places, cells = self.material(body), self._cells + len(self._start)
        if len(cells):
            shares = shares_inside(point, places[cells])
            at = int(np.argmax(shares.min(axis=1)))
            if shares[at].min() >= -(_ROUND if self.bodies.radius.any() else _NEAR):
                return cells[at], shares[at], True
        nearest = int(np.argmin(np.linalg.norm(places - point, axis=1)))
        return np.array([nearest]), np.ones(1), False

    def acting(self, body: int, forces: Floats) -> Floats:
        """Contact forces [N] at these places by those on the contact nodes, (nodes, dim) each."""
        more = len(self.material(body)) - len(forces)
        return np.vstack([forces, np.zeros((more, self.bodies.dim))])
