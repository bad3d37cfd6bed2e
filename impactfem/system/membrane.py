"""Stretching of the mid-surface of a plate as it bends (von Karman).

With in-plane displacements u and the deflection w, both linear in triangles,

    e = sym grad u + grad w x grad w / 2,    N = A e,    energy = 1/2 int e . A e,

where u is in equilibrium with N at once: waves in the plane are far faster than those of bending.
Between two deflections a and b the forces

    f = int grad(.) . mean(N_a, N_b) grad (w_a + w_b) / 2

do exactly the work of the energy (J. C. Simo, N. Tarnow, ZAMP 43 (1992) 757-792).
Source: T. von Karman, Encyklopaedie der math. Wissenschaften IV/4 (1910) 349.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, bsr_matrix, csc_matrix, csr_matrix, eye_array, kron
from scipy.sparse.linalg import SuperLU, splu

from impactfem.arrays import Booleans, Floats
from impactfem.system.kirchhoff import Triangles
from impactfem.system.surface import CHOLESKY


@dataclass(frozen=True)
class Membrane:
    """The triangles of a plate as they stretch.

    Attributes:
        triangles: Of the plate.
        held: Vertices that do not move in its plane, (vertices,).
    """

    triangles: Triangles
    held: Booleans

    @cached_property
    def gradients(self) -> csr_matrix:
        """Gradients of triangles by values of the vertices [1/m], (2 cells, vertices)."""
        return self._of_corners(self.triangles.rising[..., None])

    @cached_property
    def strains(self) -> csr_matrix:
        """Strains e_xx, e_yy, 2 e_xy by u of the vertices that move, (3 cells, freedoms)."""
        rising = self.triangles.rising
        each = np.zeros((*rising.shape[:2], 3, 2))  # cell, corner, strain, axis
        each[:, :, 0, 0] = each[:, :, 2, 1] = rising[..., 0]
        each[:, :, 1, 1] = each[:, :, 2, 0] = rising[..., 1]
        return csr_matrix(self._of_corners(each)[:, self._moving])

    def _of_corners(self, each: Floats) -> csr_matrix:
        """A matrix of blocks of the corners of triangles, (cells, 3, rows, columns)."""
        cells = self.triangles.mesh.cells
        ends = 3 * np.arange(len(cells) + 1)
        blocks = bsr_matrix(
            (each.reshape(-1, *each.shape[2:]), cells.ravel(), ends),
            (each.shape[2] * len(cells), each.shape[3] * len(self.held)),
        )
        return csr_matrix(blocks)

    @cached_property
    def _moving(self) -> NDArray[np.int64]:
        """Freedoms 2 v and 2 v + 1 of u; where nothing holds it rigid motions are held."""
        still = np.repeat(self.held, 2)
        points = self.triangles.mesh.points
        corner = int(np.argmax(still[::2])) if self.held.any() else 0
        if self.held.sum() < 2:  # the next keeps its distance: it must not turn
            way = points - points[corner]
            far = int(np.argmax(np.linalg.norm(way, axis=1)))
            across = int(abs(way[far, 0]) > abs(way[far, 1]))
            still[[2 * corner, 2 * corner + 1, 2 * far + across]] = True
        return np.flatnonzero(~still)

    @cached_property
    def stiffness(self) -> csr_matrix:
        """Of u [N/m], (freedoms, freedoms)."""
        return csr_matrix(self.strains.T @ self.weighted(self.strains))

    @cached_property
    def _factor(self) -> SuperLU:
        return splu(self.stiffness.tocsc(), **CHOLESKY)

    @cached_property
    def _moduli(self) -> Floats:
        """A times the areas of the triangles [N m], (cells, 3, 3)."""
        triangles = self.triangles
        weights = triangles.mesh.areas * triangles.ratio
        return np.asarray(weights[:, None, None] * triangles.section.stretching)

    def weighted(self, strains: csr_matrix) -> csr_matrix:
        """A times the areas times strains by any freedoms (3 cells, several)."""
        return csr_matrix(_by_triangle(self._moduli) @ strains)

    def settled(self, slopes: Floats, pulls: Floats | float = 0.0) -> tuple[Floats, Floats]:
        """Strains of triangles with slopes (cells, 2), and u in equilibrium with them.

        Args:
            slopes: Of the triangles.
            pulls: Forces on u [N], (freedoms,).

        Returns:
            Shapes (cells, 3) and (freedoms,).
        """
        x, y = slopes.T
        own = np.stack([0.5 * x * x, 0.5 * y * y, x * y], axis=1)
        u = self.answer(pulls - self.strains.T @ self.tension(own).ravel())
        return np.asarray(own + (self.strains @ u).reshape(-1, 3)), u

    def answer(self, forces: Floats) -> Floats:
        """What forces on u do to it, (freedoms,) each."""
        return np.asarray(self._factor.solve(forces))

    def contracted(self, slopes: Floats, ways: Floats) -> Floats:
        """Changes of forces on u with those of slopes, (cells, 2) each, (freedoms,)."""
        (x, y), (dx, dy) = slopes.T, ways.T
        own = np.stack([x * dx, y * dy, x * dy + y * dx], axis=1)
        return np.asarray(self.strains.T @ self.tension(own).ravel())

    def at(self, spots: csr_matrix) -> csr_matrix:
        """Displacements in the plane of means over vertices (count, vertices), (2 count, freedoms).

        Those along both axes of one after those of the other.
        """
        return csr_matrix(csr_matrix(kron(spots, eye_array(2)))[:, self._moving])

    def slopes(self, deflection: Floats) -> Floats:
        """Of triangles with deflections of the vertices [m], (cells, 2)."""
        return np.asarray((self.gradients @ deflection).reshape(-1, 2))

    def at_vertices(self, each: Floats) -> Floats:
        """Strains of triangles (cells, 3) as means at the vertices by area, (vertices, 3)."""
        mesh = self.triangles.mesh
        around = mesh.lumped(np.ones(len(each)))
        return np.stack([mesh.lumped(part) for part in each.T], axis=1) / around[:, None]

    def tension(self, strains: Floats) -> Floats:
        """N times the areas [N m], (cells, 3)."""
        return np.asarray(np.einsum("cab,cb->ca", self._moduli, strains))

    def energy(self, strains: Floats) -> float:
        """[J]."""
        return 0.5 * float((self.tension(strains) * strains).sum())

    def force(self, tension: Floats, slopes: Floats) -> Floats:
        """Forces on deflections of vertices by tensions times areas and slopes, (vertices,)."""
        (x, y), (xx, yy, xy) = slopes.T, tension.T
        pulled = np.stack([xx * x + xy * y, xy * x + yy * y], axis=1)
        return np.asarray(self.gradients.T @ pulled.ravel())

    def rising(self, slopes: Floats) -> csr_matrix:
        """Strains by deflections of vertices where slopes are (cells, 2), (3 cells, vertices)."""
        x, y = slopes.T
        none = np.zeros_like(x)
        blocks = np.stack([x, none, none, y, y, x], axis=1).reshape(-1, 3, 2)
        return csr_matrix(_by_triangle(blocks) @ self.gradients)

    def pulling(self, tension: Floats) -> csr_matrix:
        """Forces by deflections under tensions times areas (cells, 3), (vertices, vertices)."""
        xx, yy, xy = tension.T
        blocks = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
        return csr_matrix(self.gradients.T @ (_by_triangle(blocks) @ self.gradients))

    def tangent(
        self, vertices: csr_matrix, own: csr_matrix, tension: Floats, mean: Floats, last: Floats
    ) -> csc_matrix:
        """Derivative of forces on a plate by its coordinates, and then by u, square.

        Forces are those of `force` with the mean of tensions and of slopes at both ends of a step,
        and what is not in the plane; below them are those on u, which are 0.

        Args:
            vertices: Forces on coordinates by those on deflections of vertices, (d, vertices).
            own: Derivative of what is not in the plane, (d, d).
            tension: Mean of a step, times the areas [N m], (cells, 3).
            mean: Of the slopes in it, (cells, 2).
            last: Slopes at its end, (cells, 2).
        """
        before, after = (self.rising(each) @ vertices.T for each in (mean, last))
        pulled = vertices @ self.pulling(tension) @ vertices.T
        return bmat(
            [
                [own + 0.5 * (pulled + before.T @ self.weighted(after)),
                 0.5 * before.T @ self.weighted(self.strains)],
                [self.strains.T @ self.weighted(after), self.stiffness],
            ],
            format="csc",
        )  # fmt: skip


def _by_triangle(blocks: Floats) -> bsr_matrix:
    """A matrix of blocks (cells, rows, columns) along its diagonal."""
    count = len(blocks)
    return bsr_matrix((blocks, np.arange(count), np.arange(count + 1)))
