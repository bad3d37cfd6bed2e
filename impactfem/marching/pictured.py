"""What bodies of rigid parts show: their contact nodes, and cells that fill them."""

from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.marched import Shown
from impactfem.result.shapes import TETRAHEDRON, TRIANGLE, Shape
from impactfem.system.closest import shares_inside
from impactfem.system.rigid import in_space

if TYPE_CHECKING:
    from impactfem.marching.mechanism import MechanismMidpoint
    from impactfem.marching.rigid_body import RigidMidpoint

_NEAR, _ROUND = 1e-9, 0.05  # how far a probe may lie out of the flat or round cells of a picture


class Pictured(Shown["RigidMidpoint | MechanismMidpoint"]):
    """Cells between points that move rigidly; a rod has none, and shows its axis."""

    def __init__(self, march: "RigidMidpoint | MechanismMidpoint", cells: Integers) -> None:
        """See a body.

        Args:
            march: Of it.
            cells: Of its picture, by the places of its points, (cells, corners).
        """
        super().__init__(march)
        self._cells = cells + len(self._start)

    def drawn(self, body: int, name: str) -> Shape:
        """Its contact nodes, and cells between points of its surface and its centre."""
        if len(self._bodies.lines):
            return super().drawn(body, name)
        kind = TRIANGLE if self._bodies.dim == 2 else TETRAHEDRON
        return Shape(name, self.material(0), self._cells, kind)

    def material(self, body: int) -> Floats:  # noqa: ARG002  (it is one)
        """Places of the same nodes as probes are given, shape (nodes, dim)."""
        return self._march.pictured(self._bodies.position)

    def located(self, body: int, point: Floats) -> tuple[Integers, Floats, bool]:
        """Corners of the cell of its picture around a place, or of the nearest one."""
        if len(self._bodies.lines):
            return super().located(body, point)
        places, cells = self.material(body), self._cells
        if len(cells):
            shares = shares_inside(point, places[cells])
            at = int(np.argmax(shares.min(axis=1)))
            if shares[at].min() >= -(_ROUND if self._bodies.radius.any() else _NEAR):
                return cells[at], shares[at], True
        nearest = int(np.argmin(np.linalg.norm(places - point, axis=1)))
        return np.array([nearest]), np.ones(1), False

    def motion(self, body: int) -> dict[str, Floats]:
        """Fields at these places now: displacement [m], velocity [m/s], (nodes, dim)."""
        places = self._march.pictured(self._march.coordinates)
        speeds = self._march.pictured_speeds(places)
        return {"displacement": places - self.material(body), "velocity": speeds}

    def acting(self, body: int, forces: Floats) -> Floats:
        """Contact forces [N] at these places by those on the contact nodes, (nodes, dim) each.

        What acts on nodes that stand for a whole body is shown as its resultant, at the point of
        the picture where that comes in.
        """
        dim, more = self._bodies.dim, len(self.material(body)) - len(forces)
        shown = np.vstack([forces, np.zeros((more, dim))])
        for carrier in self._bodies.carriers:
            own = carrier.markers
            shown[own] = 0.0
            each = in_space(forces[own])
            force = each.sum(axis=0)
            if (size := float(np.linalg.norm(force))) > 0.0:
                arms, mine, points = self._march.leaning(own)
                way, moment = force / size, np.cross(arms, each).sum(axis=0)
                beside = points - np.cross(way, moment) / size
                along = beside @ way
                off = np.linalg.norm(beside - along[:, None] * way, axis=1)
                at = mine[np.argmin(off + np.maximum(along, 0.0))]
                shown[len(forces) + at] += force[:dim]
        return shown
