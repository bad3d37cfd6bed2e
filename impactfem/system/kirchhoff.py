"""Stiffness of the discrete Kirchhoff triangle: w and both slopes at each vertex.

The slopes of an element are quadratic. At vertices they are degrees of freedom; in the middle of an
edge of length l along s, from vertex i to j, they follow from w as a cubic along the edge and from
the slopes of its ends, whose normal part is linear:

    s . b = 3 (w_j - w_i) / (2 l) - s . (b_i + b_j) / 4,   n . b = n . (b_i + b_j) / 2.

Curvatures are linear in an element, so that their energy c . D c is integrated exactly. Source:
J.-L. Batoz, K.-J. Bathe, L.-W. Ho, Int. J. Numer. Meth. Eng. 15 (1980) 1771-1812. With shear a part
phi / (1 + phi) of what an edge misses is shear (I. Katili, Int. J. Numer. Meth. Eng. 36 (1993)
1859-1883), phi by the stiffnesses along the edge.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.scene.laminate import Section
from impactfem.system.plate_mesh import PlateMesh

DOFS = 3
"""Degrees of freedom of a vertex: w [m] and its slopes along x and y."""

_EDGES = ((1, 2), (0, 2), (0, 1))  # vertices of the edges of a triangle, opposite to 0, 1 and 2
_LINEAR = (np.ones((3, 3)) + np.eye(3)) / 12.0
"""Integrals of products of the linear functions of the corners, by the area."""


@dataclass(frozen=True)
class Triangles:
    """The elements of a plate that nothing holds.

    Degree of freedom 3 v is w of vertex v, 3 v + 1 and 3 v + 2 are its slopes.

    Attributes:
        mesh: Of the mid-surface.
        section: Of the plate where its thickness is that.
        ratio: Thickness of the triangles by that of the section, (cells,).
        shears: Whether it shears.
    """

    mesh: PlateMesh
    section: Section
    ratio: Floats
    shears: bool = False

    @cached_property
    def rising(self) -> Floats:
        """Gradients of the linear functions of the corners [1/m], (cells, 3, 2)."""
        corners = self.mesh.points[self.mesh.cells]
        inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).swapaxes(1, 2))
        return np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)

    @cached_property
    def stiffness(self) -> csr_matrix:
        """Of bending and shear, (3 vertices, 3 vertices) [N/m, N, N m]."""
        return self.assembled(self.elements)

    @property
    def elements(self) -> Floats:
        """The same of each triangle, (cells, 9, 9)."""
        bent, bending = self._bent, self.section.bending
        weights = self.mesh.areas * self.ratio**3
        each = np.einsum(
            "c,ij,ciad,ab,cjbe->cde", weights, _LINEAR, bent, bending, bent, optimize=True
        )
        if self.shears:
            along, ways, _ = self._missed
            strain = along * (self._softness / (1.0 + self._softness))[:, :, None]
            at = np.empty((len(self.mesh.cells), 3, 2, 3 * DOFS))
            for corner in range(3):  # by both edges there, linear between
                beside = [k for k, pair in enumerate(_EDGES) if corner in pair]
                at[:, corner] = np.linalg.solve(ways[:, beside], strain[:, beside])
            weights, shear = self.mesh.areas * self.ratio, self.section.shear
            each += np.einsum(
                "c,ij,ciad,ab,cjbe->cde", weights, _LINEAR, at, shear, at, optimize=True
            )
        return np.asarray(each)

    def tension(self, force: float) -> Floats:
        """Stiffness of each triangle by a tension, alike in all directions, (cells, 9, 9).

        Args:
            force: Of the section, by its length [N/m].
        """
        # Of linear w: slopes of their own would shun a large tension, and tones fall by a tenth.
        rise = np.zeros((len(self.mesh.cells), 2, 3 * DOFS))
        rise[:, :, ::DOFS] = self.rising.swapaxes(1, 2)
        weights = force * self.ratio * self.mesh.areas
        return np.asarray(np.einsum("c,cad,cae->cde", weights, rise, rise, optimize=True))

    @property
    def curvatures(self) -> csr_matrix:
        """Curvatures b_xx, b_yy and b_xy + b_yx of vertices, 3 rows each [1/m].

        Those of the triangles at a vertex, weighted by their areas.
        """
        cells, areas = self.mesh.cells, self.mesh.areas
        around = 3.0 * self.mesh.lumped(np.ones(len(cells)))
        shares = areas[:, None] / around[cells]
        each = (self._bent * shares[:, :, None, None]).reshape(len(self.mesh.cells), 9, -1)
        return self.assembled(each)

    @cached_property
    def freedoms(self) -> Integers:
        """Of the corners of elements, (cells, 9)."""
        return _freedoms(self.mesh.cells)

    @cached_property
    def _bent(self) -> Floats:
        """Curvatures at the corners of elements, linear between, (cells, 3, 3, 9)."""
        slopes, rising = self._slopes, self.rising
        found = np.empty((len(self.mesh.cells), 3, 3, 3 * DOFS))
        for corner in range(3):
            # Derivatives there of the quadratic functions of vertices, then of the edges' middles.
            shapes = np.zeros((len(self.mesh.cells), 6, 2))
            shapes[:, :3] = -rising
            shapes[:, corner] = 3.0 * rising[:, corner]
            for k, pair in enumerate(_EDGES):
                if corner in pair:
                    shapes[:, 3 + k] = 4.0 * rising[:, sum(pair) - corner]
            each = np.einsum("cna,cnbd->cabd", shapes, slopes)
            found[:, corner] = np.stack(
                [each[:, 0, 0], each[:, 1, 1], each[:, 0, 1] + each[:, 1, 0]], axis=1
            )
        return found

    @cached_property
    def _slopes(self) -> Floats:
        """At the vertices and then amid the edges of elements, (cells, 6, 2, 9)."""
        found = np.zeros((len(self.mesh.cells), 6, 2, 3 * DOFS))
        for corner in range(3):
            for axis in range(2):
                found[:, corner, axis, DOFS * corner + 1 + axis] = 1.0
        along, ways, _ = self._missed
        more = 1.5 / (1.0 + self._softness)[:, :, None] * along
        for k, (one, two) in enumerate(_EDGES):
            mean = 0.5 * (found[:, one] + found[:, two])
            found[:, 3 + k] = mean + ways[:, k, :, None] * more[:, k, None]
        return found

    @cached_property
    def _softness(self) -> Floats:
        """Phi of edges: 12 D_ss / (S_ss l^2) in their directions s; 0 without shear, (cells, 3)."""
        _, ways, lengths = self._missed
        if not self.shears:
            return np.zeros_like(lengths)
        x, y = ways[..., 0], ways[..., 1]
        bent = np.stack([x * x, y * y, 2.0 * x * y], axis=-1)
        bending = np.einsum("...a,ab,...b", bent, self.section.bending, bent)
        shear = np.einsum("...a,ab,...b", ways, self.section.shear, ways)
        return np.asarray(12.0 * self.ratio[:, None] ** 2 * bending / (shear * lengths**2))

    @cached_property
    def _missed(self) -> tuple[Floats, Floats, Floats]:
        """(w_j - w_i) / l - s . (b_i + b_j) / 2 of edges by degrees of freedom, (cells, 3, 9).

        Also their directions, (cells, 3, 2), and lengths [m], (cells, 3).
        """
        corners = self.mesh.points[self.mesh.cells]
        found = np.zeros((len(corners), 3, 3 * DOFS))
        first, last = (corners[:, [pair[k] for pair in _EDGES]] for k in (0, 1))
        lengths = np.linalg.norm(last - first, axis=2)
        ways = (last - first) / lengths[:, :, None]
        for k, (one, two) in enumerate(_EDGES):
            found[:, k, DOFS * two] = 1.0 / lengths[:, k]
            found[:, k, DOFS * one] = -1.0 / lengths[:, k]
            for end in (one, two):
                found[:, k, DOFS * end + 1 : DOFS * end + 3] = -0.5 * ways[:, k]
        return found, ways, lengths

    def assembled(self, values: Floats) -> csr_matrix:
        """Sum of matrices of elements, (cells, 9, 9), three rows to each corner."""
        found = _assembled(values, self.freedoms, len(self.mesh.points))
        found.eliminate_zeros()
        return found


def edge_stiffness(
    points: Floats, pairs: Integers, stiffness: float, rotational: float
) -> csr_matrix:
    """Stiffness of springs along an edge, (3 vertices, 3 vertices).

    Args:
        points: Vertices [m], (vertices, 2).
        pairs: Of vertices along it, (pairs, 2).
        stiffness: To deflection, by the length [N/m^2].
        rotational: To rotation about the edge, by the length [N].
    """
    way = points[pairs[:, 1]] - points[pairs[:, 0]]
    length = np.linalg.norm(way, axis=1)
    across = np.stack([way[:, 1], -way[:, 0]], axis=1) / length[:, None]
    springs = np.zeros((len(pairs), DOFS, DOFS))
    springs[:, 0, 0] = stiffness
    springs[:, 1:, 1:] = rotational * np.einsum("pa,pb->pab", across, across)
    linear = (np.ones((2, 2)) + np.eye(2)) / 6.0
    each = np.einsum("p,ij,pab->piajb", length, linear, springs).reshape(len(pairs), 6, 6)
    return _assembled(each, _freedoms(pairs), len(points))


def _freedoms(vertices: Integers) -> Integers:
    """Degrees of freedom of the vertices of elements or edges, (several, 3 vertices of each)."""
    found = DOFS * vertices[:, :, None] + np.arange(DOFS)
    return np.asarray(found.reshape(len(vertices), -1))


def _assembled(values: Floats, freedoms: Integers, vertices: int) -> csr_matrix:
    """Sum of matrices (several, m, m), at rows and columns (several, m), of so many vertices."""
    row, column = (
        np.broadcast_to(each, values.shape) for each in (freedoms[:, :, None], freedoms[:, None])
    )
    entries = values.ravel(), (row.ravel(), column.ravel())
    return csr_matrix(coo_matrix(entries, shape=(DOFS * vertices, DOFS * vertices)))
