"""Where plates touch: on a face, half the thickness off the vertices that carry the forces.

A force F on what touches at the arm a = -t/2 n from the mid-surface, n the normal of the gap, is F
there and the moment a x F. Places of the face go with the mid-surface and the rotation of its
normal, omega = (w_y, -w_x, 0) along the axes of the plate, so that F does the work

    F . (w e_z + u + omega x a),

u the displacement in the plane where it stretches. Nodes that follow a vertex with arms t/2 along
the axes of space carry the arm (`impactfem.contact.faces`); without friction there are none.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.system.kirchhoff import DOFS

IN_PLANE = 2
"""Components of what is in the plane, behind deflection and slopes."""


@dataclass(frozen=True)
class PlateFaces:
    """How contact nodes follow vertices: the vertices first, then what follows along each axis.

    Attributes:
        spots: Means over vertices that contact nodes are, (count, vertices).
        rows: Deflections of them by q, (count, d), and with friction both slopes.
        axes: Of the plate, its normal last, (3, 3) by rows.
        half: Of the thickness there [m], (count,).
    """

    spots: csr_matrix
    rows: tuple[csr_matrix, ...]
    axes: Floats
    half: Floats

    @classmethod
    def of(
        cls, spots: csr_matrix, basis: csr_matrix, axes: Floats, half: Floats, *, rubs: bool
    ) -> "PlateFaces":
        """By w and slopes of all vertices as q has them, (3 vertices, d)."""
        parts = range(DOFS if rubs else 1)
        return cls(spots, tuple(csr_matrix(spots @ basis[k::DOFS]) for k in parts), axes, half)

    @property
    def rubs(self) -> bool:
        """Whether faces are told from the mid-surface."""
        return len(self.rows) > 1

    @property
    def followers(self) -> Integers:
        """What follows each vertex along the axes of space, (count, 3); none without friction."""
        count = len(self.half) * self.rubs
        return np.arange(count, 4 * count).reshape(3, count).T

    @property
    def arms(self) -> Floats:
        """Of all contact nodes from their vertices [m], (nodes, 3)."""
        still = np.zeros((len(self.half), 3))
        if not self.rubs:
            return still
        return np.concatenate([still, *(np.outer(self.half, axis) for axis in np.eye(3))])

    def told(self, q: Floats) -> Floats:
        """Deflections, and slopes where it rubs, of the vertices by q, (1 or 3, count)."""
        return np.stack([row @ q for row in self.rows])

    def moved(self, told: Floats) -> Floats:
        """Displacements of the contact nodes [m], (nodes, 3).

        Args:
            told: As `told` has them, and what is in the plane below, (1, 3 or 5, count).
        """
        first = np.outer(told[0], self.axes[2])
        if not self.rubs:
            return first
        if len(told) > DOFS:
            first = first + told[DOFS:].T @ self.axes[:2]
        spin = np.outer(told[2], self.axes[0]) - np.outer(told[1], self.axes[1])
        arms = self.half[:, None]
        return np.concatenate([first, *(first + arms * np.cross(spin, e) for e in np.eye(3))])

    def pressing(self, forces: Floats) -> Floats:
        """What forces on the contact nodes (..., nodes, 3) do the work by, (..., 1, 3 or 5, count).

        The transpose of `moved`.
        """
        if not self.rubs:
            return np.asarray((forces @ self.axes[2])[..., None, :])
        each = forces.reshape(*forces.shape[:-2], 4, len(self.half), 3)
        total = each.sum(axis=-3)
        moment = self.half[:, None] * np.cross(np.eye(3)[:, None], each[..., 1:, :, :]).sum(axis=-3)
        x, y, z = self.axes
        parts = [total @ z, -moment @ y, moment @ x, total @ x, total @ y]
        return np.stack(parts, axis=-2)

    def at_vertices(self, forces: Floats) -> Floats:
        """Forces on the contact nodes (nodes, 3) by the vertices they act at, (count, 3)."""
        return np.asarray(forces.reshape(-1, len(self.half), 3).sum(axis=0))

    def pulled(self, pressing: Floats) -> Floats:
        """Forces on q by what `pressing` gives, (d,)."""
        first, *others = (row.T @ part for row, part in zip(self.rows, pressing, strict=False))
        return np.asarray(sum(others, first))
