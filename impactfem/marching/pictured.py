"""What bodies of rigid parts show: their contact nodes, and cells that fill them."""

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.few import FewInterior
from impactfem.result.shapes import TETRAHEDRON, TRIANGLE, Shape
from impactfem.system.closest import shares_inside
from impactfem.system.rigid import in_space

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

    def _leaning(self, nodes: Integers) -> tuple[Floats, Integers, Floats]:
        """Where forces act that come in by markers.

        Args:
            nodes: The markers of a carrier.

        Returns:
            Places of these in the last layer [m], (nodes, 3); which points of the picture move with
            them, (points,), and where these are from the same place [m], (points, 3).
        """
        raise NotImplementedError

    def acting(self, body: int, forces: Floats) -> Floats:
        """Contact forces [N] at these places by those on the contact nodes, (nodes, dim) each.

        What acts on nodes that stand for a whole body is shown as its resultant, at the point of
        the picture where that comes in.
        """
        dim, more = self.bodies.dim, len(self.material(body)) - len(forces)
        shown = np.vstack([forces, np.zeros((more, dim))])
        for carrier in self.bodies.carriers:
            own = carrier.markers
            shown[own] = 0.0
            each = in_space(forces[own])
            force = each.sum(axis=0)
            if (size := float(np.linalg.norm(force))) > 0.0:
                arms, mine, points = self._leaning(own)
                way, moment = force / size, np.cross(arms, each).sum(axis=0)
                beside = points - np.cross(way, moment) / size
                along = beside @ way
                off = np.linalg.norm(beside - along[:, None] * way, axis=1)
                at = mine[np.argmin(off + np.maximum(along, 0.0))]
                shown[len(forces) + at] += force[:dim]
        return shown
