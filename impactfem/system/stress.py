"""Stress and strain at the nodes of a body."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.fem import dolfinx_fem, ufl
from impactfem.forms.elasticity import ElasticForms
from impactfem.system.nodes import Nodes


class NodalFields:
    """Fields of each node: means of the elements around it, weighted by volume.

    An element's value is the mean in it. Jumps between elements show the error of the mesh; the
    mean hides them, hence peaks at concentrations are low on coarse meshes.

    Attributes:
        components: Of each field, 1 or 9.
    """

    components: Mapping[str, int]

    def __init__(
        self,
        nodes: Nodes,
        forms: ElasticForms,
        fields: Callable[[Any], tuple[Mapping[str, Any], Any]],
    ) -> None:
        """Compile the form and assemble the weights (collective).

        Args:
            nodes: Nodes of the body.
            forms: Its weak forms.
            fields: See `impactfem.system.finite_strain.shown`.
        """
        mesh = nodes.space.mesh
        cells = dolfinx_fem.functionspace(mesh, ("Discontinuous Lagrange", 0))
        self._displacement = dolfinx_fem.Function(nodes.space)
        shown, self._refresh = fields(self._displacement)
        self.components = {name: 9 if field.ufl_shape else 1 for name, field in shown.items()}
        flat = [
            field[i, j] if field.ufl_shape else field
            for field in shown.values()
            for i, j in (np.ndindex(3, 3) if field.ufl_shape else [(0, 0)])
        ]
        several = dolfinx_fem.functionspace(mesh, ("Discontinuous Lagrange", 0, (len(flat),)))
        values = ufl.inner(ufl.as_vector(flat), ufl.TestFunction(several))
        self._form = fem.compile_form(forms.measured(values))
        volumes = fem.assemble_vector(fem.compile_form(forms.volume(cells)))
        owned_cells = len(volumes)
        around = nodes.space.dofmap.list[:owned_cells]
        blocks = nodes.space.dofmap.index_map
        first_cell = cells.dofmap.index_map.local_range[0]
        columns = first_cell + np.repeat(np.arange(owned_cells), around.shape[1])
        rows = blocks.local_to_global(np.ravel(around).astype(np.int32))
        # Sums of the integrals of the elements around a node, then the same of their volumes.
        sizes = (
            (blocks.size_local, blocks.size_global),
            (owned_cells, cells.dofmap.index_map.size_global),
        )
        self._sum = fem.rectangular_matrix(mesh.comm, *sizes)
        fem.set_entries(self._sum, rows, columns, np.ones(len(rows)), add=True)
        self._integrals, self._sums = self._sum.createVecs()
        self._volumes = self._summed(volumes)

    def at(self, displacement: Floats) -> dict[str, Floats]:
        """Fields of each owned node, (owned nodes, components) (collective).

        Args:
            displacement: Owned degrees of freedom [m].
        """
        self._displacement.x.array[: len(displacement)] = displacement
        self._displacement.x.scatter_forward()
        if self._refresh is not None:
            self._refresh()
        cells = fem.assemble_vector(self._form).reshape(-1, sum(self.components.values()))
        nodes = np.stack([self._summed(column) / self._volumes for column in cells.T], axis=1)
        ends = np.cumsum(list(self.components.values()))[:-1]
        return dict(zip(self.components, np.split(nodes, ends, axis=1), strict=True))

    def _summed(self, integrals: Floats) -> Floats:
        """Sums of the elements around each owned node (collective)."""
        self._integrals.array_w[:] = integrals
        self._sum.mult(self._integrals, self._sums)
        found: Floats = self._sums.array_r.copy()
        return found

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self._sum, self._integrals, self._sums):
            thing.destroy()
