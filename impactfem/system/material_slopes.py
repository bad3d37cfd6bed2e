"""Derivatives of sums of u . K v and u . M v by the material of each element.

K is linear in lambda and mu of each element, M in its density, so that with sums S = sum u_e v_e^T
of the products of its displacements the derivative by one of these numbers is that of
K_e : S or M_e : S, whatever number of products there are; lumped masses likewise.
"""

from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.fem import dolfinx_fem
from impactfem.system.element_tables import tabulated
from impactfem.system.materials import first_lame, materials_of
from impactfem.system.matrices import body_forms
from impactfem.system.nodes import Nodes

_AT_ONCE = 2**21  # displacements of elements that are summed up together


def material_numbers(nodes: Nodes, solid: Any) -> Floats:
    """Lambda and mu [Pa] and density [kg/m^3] of the elements of this rank, times the thickness.

    Shape (3, elements); of plane stress lambda is 2 lambda mu / (lambda + 2 mu) (collective).

    Raises:
        SceneError: A formula has a value that is not positive.
    """
    material = materials_of(nodes, solid)
    own = len(_owned(nodes))
    every = first_lame(material, solid.model), material.shear, material.density
    found = np.array([np.broadcast_to(each, len(material.ratio))[:own] for each in every])
    return np.asarray(solid.thickness * found)


class MaterialSlopes:
    """Sums of products of displacements, and their derivatives by `material_numbers`.

    Args:
        nodes: Nodes of the body.
        solid: `impactfem.scene.solids.Solid`, without a law of other directions.
    """

    def __init__(self, nodes: Nodes, solid: Any) -> None:
        """Take what elements are like (collective)."""
        if solid.is_orthotropic:
            raise SceneError("its stiffness has other directions")
        forms = body_forms(nodes, solid)
        self._nodes, self._owned_dofs = nodes, nodes.owned * nodes.dim
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

    def by_material(self) -> Floats:
        """Derivatives by the numbers of the elements of this rank, (3, elements) (collective)."""
        for kind in self._waiting:
            self._sum_up(kind)
        count, corners = self._cells.shape
        dim, table, weights = self._nodes.dim, self._table, self._weights
        products = self._stiff.reshape(count, corners, dim, corners, dim)
        found = np.empty((3, count))
        flat = self._dilatation.reshape(*weights.shape, -1)
        pulled = np.einsum("cpi,cij->cpj", flat, self._stiff)
        found[0] = np.einsum("cp,cpj,cpj->c", weights, pulled, flat)
        # 2 eps(u) : eps(v) = grad u : grad v + grad u : grad v^T.
        alike = np.einsum("ckili->ckl", products)
        found[1] = np.einsum("cp,cpkj,ckl,cplj->c", weights, table, alike, table, optimize=True)
        found[1] += np.einsum(
            "cp,cpkj,ckilj,cpli->c", weights, table, products, table, optimize=True
        )
        if len(self._hoop):
            around, hoop = products[:, :, 0, :, 0], self._hoop
            found[1] += 2.0 * np.einsum(
                "cp,cpk,ckl,cpl->c", weights, hoop, around, hoop, optimize=True
            )
        masses, values = self._masses, self._values
        found[2] = np.einsum("cp,pk,pl,ckl->c", masses, values, values, self._heavy, optimize=True)
        weighed = self._everywhere(np.repeat(self._weighed[: self._nodes.owned], dim))[:, 0]
        found[2] += np.einsum("cp,pk,ck->c", masses, values, weighed[self._cells], optimize=True)
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
