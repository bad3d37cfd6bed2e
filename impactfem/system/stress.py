"""Von Mises stress at the nodes of a body."""

import numpy as np

from impactfem import fem
from impactfem.fem import dolfinx_fem
from impactfem.forms.elasticity import ElasticForms
from impactfem.forms.finite_strain import FiniteForms
from impactfem.system.nodes import Floats, Nodes


class NodalStress:
    """Von Mises stress of each node: the mean of the elements around it, weighted by volume.

    An element's value is the mean of the von Mises stress in it. Jumps between elements show the
    error of the mesh; the mean hides them, hence peaks at concentrations are low on coarse meshes.
    """

    def __init__(self, nodes: Nodes, forms: ElasticForms | FiniteForms) -> None:
        """Compile the form and assemble the weights (collective).

        Args:
            nodes: Nodes of the body.
            forms: Its weak forms; under finite strain the stress is the true (Cauchy) one.
        """
        mesh = nodes.space.mesh
        cells = dolfinx_fem.functionspace(mesh, ("Discontinuous Lagrange", 0))
        self._displacement = dolfinx_fem.Function(nodes.space)
        self._form = fem.compile_form(forms.mises_stress(self._displacement, cells))
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
        self._integrals.array_w[:] = volumes
        self._sum.mult(self._integrals, self._sums)
        self._volumes = self._sums.array_r.copy()

    def at(self, displacement: Floats) -> Floats:
        """Von Mises stress [Pa] of each owned node, shape (owned nodes,) (collective).

        Args:
            displacement: Owned degrees of freedom [m].
        """
        self._displacement.x.array[: len(displacement)] = displacement
        self._displacement.x.scatter_forward()
        self._integrals.array_w[:] = fem.assemble_vector(self._form)
        self._sum.mult(self._integrals, self._sums)
        stress: Floats = self._sums.array_r / self._volumes
        return stress

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self._sum, self._integrals, self._sums):
            thing.destroy()
