"""Internal forces of a body under finite strain by compiled kernels, for explicit steps.

The integrals and their quadrature are those of `impactfem.system.finite_strain`.
"""

from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.fem import ADD, MPI, dolfinx_fem
from impactfem.system.force_kernels import plane_forces, space_forces, stiffest, tangents
from impactfem.system.law_kernels import KERNELS
from impactfem.system.materials import materials_of
from impactfem.system.nodes import Nodes


class ElementForces:
    """Forces, energy and tangents of the cells of this rank.

    Attributes:
        cells: Nodes of each cell that this rank owns, (cells, corners).
        place: Displacement of the nodes of this rank, owned and ghosts, which callers set [m].
        displacement: The same as an array, (nodes, dim).
        softest: Least shear modulus of all cells [Pa].
    """

    def __init__(self, nodes: Nodes, solid: Any) -> None:
        """Tabulate shape functions (collective).

        Args:
            nodes: Nodes of the body, of degree 1.
            solid: `impactfem.scene.solids.Solid` with ``strain = "finite"``.
        """
        self._comm, self._dim = nodes.comm, nodes.dim
        mesh = nodes.space.mesh
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        self.cells = np.ascontiguousarray(nodes.space.dofmap.list[:owned])
        own = materials_of(nodes, solid)
        laws = np.where(own.linear, KERNELS["linear"], KERNELS["mooney_rivlin"])
        parts = (part[:owned] for part in (laws, own.lame, own.shear, own.c01))
        self._material: Floats = np.stack([*parts], axis=1).astype(np.float64)
        softest = float(self._material[:, 2].min(initial=np.inf))
        self.softest: float = nodes.comm.allreduce(softest, op=MPI.MIN)
        self._kernel = space_forces if nodes.dim == 3 else plane_forces
        self._data = _tabulated(nodes, self.cells, solid)
        # Vectors that DOLFINx exchanges between ranks.
        self.place, self._force = (dolfinx_fem.Function(nodes.space) for _ in range(2))
        self.displacement = self.place.x.array.reshape(-1, nodes.dim)
        self._forces = self._force.x.array.reshape(-1, nodes.dim)
        self._owned = nodes.owned * nodes.dim

    def put(self, values: Floats) -> None:
        """Set the displacement of the owned dofs, and that of ghosts with it (collective)."""
        self.place.x.array[: self._owned] = values
        self.share()

    def share(self) -> None:
        """Take the displacement of ghosts from the ranks that own them (collective)."""
        if self._comm.size > 1:
            self.place.x.scatter_forward()

    def forces(self) -> tuple[Floats, float, float]:
        """Forces dW/du on the owned dofs [N], energy of this rank [J], least det F of all ranks.

        Once that is not positive the others mean nothing (collective).
        """
        energy, least = self._kernel(
            self._material, self.displacement, self.cells, self.cells, *self._data, self._forces
        )
        if self._comm.size > 1:
            self._force.x.scatter_reverse(ADD)
            least = self._comm.allreduce(least, op=MPI.MIN)
        return self._force.x.array[: self._owned].copy(), energy, least

    def rate(self, inverse: Floats) -> float:
        """A measure of the largest eigenvalue of M^-1 K as the body is [1/s^2] (collective).

        Args:
            inverse: Inverse masses of the owned dofs, (owned dofs,).
        """
        masses = self._force.x
        masses.array[: self._owned] = inverse
        masses.scatter_forward()
        found = stiffest(self._material, self.displacement, self.cells, *self._data, self._forces)
        return float(self._comm.allreduce(found, op=MPI.MAX))

    def part(self, cells: Integers) -> "CellForces":
        """Those of some cells alone."""
        return CellForces(self, cells, self._kernel, self._material, self._data)


class CellForces:
    """Forces of some cells on some nodes, and the tangent between these."""

    def __init__(
        self,
        whole: ElementForces,
        cells: Integers,
        kernel: Any,
        material: Floats,
        data: tuple[Floats, Floats, Floats],
    ) -> None:
        """Take cells of a body, by their place on this rank."""
        self._whole, self._kernel, self._material = whole, kernel, material[cells]
        self.cells = np.ascontiguousarray(whole.cells[cells])
        self._data = tuple(part[cells] if len(part) else part for part in data)

    def forces(self, rows: Any, out: Floats) -> float:
        """Fill ``out`` (rows, dim) with forces [N] added at ``rows``; returns the least det F."""
        place = self._whole.displacement
        _, least = self._kernel(self._material, place, self.cells, rows, *self._data, out)
        return float(least)

    def tangents(self, slots: Any, blocks: Floats) -> None:
        """Fill blocks of the tangent [N/m]; see `force_kernels.tangents`."""
        tangents(self._material, self._whole.displacement, self.cells, slots, *self._data, blocks)


def _tabulated(nodes: Nodes, cells: Any, solid: Any) -> tuple[Floats, Floats, Floats]:
    """Gradients (cells, points, corners, dim), hoop (cells, points, corners) or empty, weights."""
    mesh = nodes.space.mesh
    name, axisymmetric = mesh.topology.cell_type.name, solid.is_axisymmetric
    degree = 1 if fem.is_simplex(mesh) and not axisymmetric else 3
    points, parts = fem.cell_quadrature(name, degree)
    values, grads = fem.coordinate_basis(name, 1, points)
    corners = nodes.positions[cells]
    jacobian = np.einsum("cki,jpk->cpij", corners, grads)
    table = np.einsum("jpk,cpji->cpki", grads, np.linalg.inv(jacobian))
    weights = np.abs(np.linalg.det(jacobian)) * parts
    hoop = np.zeros((0, 0, 0))
    if axisymmetric:
        radius = np.einsum("pk,ck->cp", values, corners[:, :, 0])
        hoop = values / radius[:, :, None]
        weights = 2.0 * np.pi * radius * weights
    elif nodes.dim < 3:
        weights = solid.thickness * weights
    return np.ascontiguousarray(table), np.ascontiguousarray(hoop), np.ascontiguousarray(weights)
