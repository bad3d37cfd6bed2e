"""Derivatives of sums of u . K v and u . M v by the material of each element.

K is linear in lambda and mu of each element, or in all its stiffness C, M in its density, so that
with sums S = sum u_e v_e^T of the products of its displacements the derivative by one of these is
that of K_e : S or M_e : S, whatever number of products there are; lumped masses likewise. Of nodes
that move the same sums are taken with the shape functions there (`MaterialSlopes.on`).
"""

from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.fem import dolfinx_fem
from impactfem.scene.orthotropic import PLACES, seen_by
from impactfem.system.element_tables import tabulated
from impactfem.system.materials import first_lame, materials_of
from impactfem.system.matrices import body_forms
from impactfem.system.nodes import Nodes

_AT_ONCE = 2**21  # displacements of elements that are summed up together


def material_numbers(nodes: Nodes, solid: Any) -> Floats:
    """Constants of the elements of this rank, times the thickness, (constants, elements).

    Lambda and mu [Pa] and density [kg/m^3]; of plane stress lambda is 2 lambda mu / (lambda +
    2 mu). Of orthotropic bodies the entries of C [Pa] by rows, lambda of elements that keep their
    volume in the mean, and density (collective).

    Raises:
        SceneError: A formula has a value that is not positive.
    """
    material = materials_of(nodes, solid)
    own = len(_owned(nodes))
    first = first_lame(material, solid.model)
    every: tuple[Any, ...] = first, material.shear, material.density
    if solid.is_orthotropic:
        whole = seen_by(material.whole, solid.model).reshape(len(first), -1)
        every = *whole.T, np.where(material.keeps, first, 0.0), material.density
    found = np.array([np.broadcast_to(each, len(material.ratio))[:own] for each in every])
    return np.asarray(solid.thickness * found)


class MaterialSlopes:
    """Sums of products of displacements, and their derivatives by `material_numbers`.

    Args:
        nodes: Nodes of the body.
        solid: `impactfem.scene.solids.Solid`.
    """

    def __init__(self, nodes: Nodes, solid: Any) -> None:
        """Take what elements are like (collective)."""
        forms = body_forms(nodes, solid)
        self._solid, self._nodes, self._owned_dofs = solid, nodes, nodes.owned * nodes.dim
        self._exchange = dolfinx_fem.Function(nodes.space)
        self._cells, table, hoop, weights = tabulated(nodes, solid, forms.degree)
        *_, masses = tabulated(nodes, solid, forms.mass_degree)
        # Volumes of unit thickness; where there is none it is 1.
        self._weights, self._masses = weights / solid.thickness, masses / solid.thickness
        cell, order = nodes.space.mesh.topology.cell_type.name, forms.space.ufl_element().degree
        points, _ = fem.cell_quadrature(cell, forms.mass_degree)
        self._values, _ = fem.coordinate_basis(cell, int(order), points)
        self._table, self._hoop = table, hoop
        self._dilatation = table.copy()  # at points, by displacements
        if len(hoop):
            self._dilatation[..., 0] += hoop
        if solid.keeps_volume and not (forms.simplex and order == 1):
            points, _ = fem.cell_quadrature(cell, forms.degree)
            constant = forms.simplex or order == 1
            basis = points[:, :0] if constant else points
            kept = materials_of(nodes, solid).keeps[: len(self._cells)]
            self._dilatation[kept] = self._meant(np.insert(basis, 0, 1.0, axis=1))[kept]
        count, corners = self._cells.shape
        size = corners * nodes.dim
        self._stiff, self._heavy = (
            np.zeros((count, size, size)),
            np.zeros((count, corners, corners)),
        )
        self._weighed = np.zeros(len(nodes.positions))
        self._room = max(1, _AT_ONCE // max(1, count * size))
        self._waiting: dict[str, list[tuple[Floats, Floats]]] = {"stiff": [], "heavy": []}

    def stiff(self, one: Floats, other: Floats) -> None:
        """Add one . K other, of owned dofs that supports do not hold (collective)."""
        self._add("stiff", one, other)

    def heavy(self, one: Floats, other: Floats) -> None:
        """Add one . M other (collective)."""
        self._add("heavy", one, other)

    def weigh(self, values: Floats) -> None:
        """Add the sum of the lumped masses of all directions times values, (owned dofs,)."""
        nodal = values.reshape(-1, self._nodes.dim).sum(axis=1)
        self._weighed[: len(nodal)] += nodal

    def weigh_whole(self, factor: float) -> None:
        """Add a factor times the mass of the body."""
        self._weighed[: self._nodes.owned] += factor

    def on(self, nodes: Nodes, solid: Any) -> "MaterialSlopes":
        """The same sums of the same elements, whose nodes are elsewhere (collective).

        Args:
            nodes: Nodes of the body there.
            solid: The body there.
        """
        found = MaterialSlopes(nodes, solid)
        for kind in self._waiting:
            self._sum_up(kind)
        found._stiff, found._heavy, found._weighed = self._stiff, self._heavy, self._weighed
        return found

    def by_material(self) -> Floats:
        """Derivatives by `material_numbers`, (constants, elements) (collective)."""
        for kind in self._waiting:
            self._sum_up(kind)
        flat, strained = self._dilatation.reshape(*self._weights.shape, -1), self._strained()
        pulled = np.einsum("cpi,cij->cpj", flat, self._stiff)
        mean = np.einsum("cp,cpj,cpj->c", self._weights, pulled, flat)
        masses, values = self._masses, self._values
        heavy = np.einsum("cp,pk,pl,ckl->c", masses, values, values, self._heavy, optimize=True)
        owned, dim = self._nodes.owned, self._nodes.dim
        weighed = self._everywhere(np.repeat(self._weighed[:owned], dim))[:, 0]
        heavy += np.einsum("cp,pk,ck->c", masses, values, weighed[self._cells], optimize=True)
        if self._solid.is_orthotropic:
            mean -= strained[:, :3, :3].sum(axis=(1, 2))
            return np.vstack([strained.reshape(len(mean), -1).T, mean, heavy])
        squares = np.einsum("cii->ci", strained)  # of shears 2 eps_xy
        shear = 2.0 * squares[:, :3].sum(axis=1) + squares[:, 3:].sum(axis=1)
        return np.array([mean, shear, heavy])

    def _strained(self) -> Floats:
        """Sums of products of strains, as C has them, times volumes, (cells, 4 or 6, the same)."""
        count, points, corners, dim = self._table.shape
        size = 6 if dim == 3 else 4
        found = np.zeros((count, size, size))
        for p in range(points):
            by = np.zeros((count, size, corners, dim))
            for row, (i, j) in enumerate(PLACES[:size]):
                if max(i, j) < dim:
                    by[:, row, :, i] += self._table[:, p, :, j]
                    by[:, row, :, j] += self._table[:, p, :, i] * (i != j)
            if len(self._hoop):
                by[:, 2, :, 0] += self._hoop[:, p]
            strains = by.reshape(count, size, -1)
            products = strains @ self._stiff @ strains.transpose(0, 2, 1)
            found += self._weights[:, p, None, None] * products
        return found

    def _meant(self, basis: Floats) -> Floats:
        """The dilatation projected onto functions of cells, of values (points, functions)."""
        weights, own = self._weights, self._dilatation.reshape(*self._weights.shape, -1)
        squares = np.einsum("pa,cp,pb->cab", basis, weights, basis)
        right = np.einsum("pa,cp,cpi->cai", basis, weights, own)
        found = np.einsum("pa,cai->cpi", basis, np.linalg.solve(squares, right))
        return np.asarray(found.reshape(self._dilatation.shape))

    def _add(self, kind: str, one: Floats, other: Floats) -> None:
        waiting = self._waiting[kind]
        waiting.append((self._everywhere(one), self._everywhere(other)))
        if len(waiting) >= self._room:
            self._sum_up(kind)

    def _everywhere(self, values: Floats) -> Floats:
        """Values of the owned dofs with those of ghosts, (nodes, dim), a new array (collective)."""
        exchange = self._exchange.x
        exchange.array[: self._owned_dofs] = values
        if self._nodes.comm.size > 1:
            exchange.scatter_forward()
        return np.array(exchange.array).reshape(-1, self._nodes.dim)

    def _sum_up(self, kind: str) -> None:
        if not self._waiting[kind]:
            return
        ones, others = (np.array(each) for each in zip(*self._waiting[kind], strict=True))
        self._waiting[kind].clear()
        count = len(self._cells)
        one, other = ones[:, self._cells], others[:, self._cells]  # (products, cells, corners, dim)
        if kind == "stiff":
            one, other = (each.reshape(len(ones), count, -1) for each in (one, other))
            self._stiff += np.matmul(one.transpose(1, 2, 0), other.transpose(1, 0, 2))
        else:
            one, other = (
                each.transpose(1, 0, 3, 2).reshape(count, -1, each.shape[2])
                for each in (one, other)
            )
            self._heavy += np.matmul(one.transpose(0, 2, 1), other)


def cell_spans(nodes: Nodes) -> tuple[Floats, Floats]:
    """Least and largest x of the elements of this rank [m], (elements,) each."""
    x = nodes.positions[_owned(nodes), 0]
    return x.min(axis=1), x.max(axis=1)


def _owned(nodes: Nodes) -> Any:
    """Nodes of the elements that this rank owns, (elements, corners)."""
    mesh = nodes.space.mesh
    return nodes.space.dofmap.list[: mesh.topology.index_map(mesh.topology.dim).size_local]
