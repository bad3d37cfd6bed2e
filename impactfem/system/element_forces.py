"""Internal forces of a body under finite strain by compiled kernels, for explicit steps.

The integrals and their quadrature are those of `impactfem.system.finite_strain`.
"""

from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.fem import ADD, MPI, dolfinx_fem
from impactfem.system.element_tables import tabulated
from impactfem.system.force_kernels import plane_forces, space_forces, stiffest, tangents
from impactfem.system.materials import law_rows, materials_of
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
        degree = 1 if fem.is_simplex(mesh) and not solid.is_axisymmetric else 3
        self.cells, *data = tabulated(nodes, solid, degree)
        self._data = (data[0], data[1], data[2])
        own = materials_of(nodes, solid).at(slice(len(self.cells)))
        self._material = law_rows(own, solid, own.lame)
        softest = float(own.shear.min(initial=np.inf))
        self.softest: float = nodes.comm.allreduce(softest, op=MPI.MIN)
        self._kernel = space_forces if nodes.dim == 3 else plane_forces
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
