"""DOLFINx in one place: its import, and every difference between versions 0.9 and 0.11.

Nothing else in impactfem asks for a version of DOLFINx.
"""

from impactfem.fem.assembly import (
    assemble_petsc,
    assemble_rows,
    assemble_vector,
    compile_form,
    products_in_order,
    rectangular_matrix,
    set_entries,
    sparse_matrix,
)
from impactfem.fem.loading import ADD, MPI, PETSc, dolfinx_fem, dolfinx_mesh, form_cache, ufl
from impactfem.fem.meshes import (
    cell_nodes,
    cell_quadrature,
    coordinate_basis,
    facet_nodes,
    facet_submesh,
    facet_vertices,
    from_gmsh_order,
    global_mesh,
    input_numbers,
    is_simplex,
    mesh_from_gmsh,
    node_vector,
    num_vertices,
    reference_nodes,
    refine_edges,
    serial_mesh,
    tag_facets,
)
from impactfem.fem.ranks import gather, on_root, raise_together

__all__ = [
    "ADD",
    "MPI",
    "PETSc",
    "assemble_petsc",
    "assemble_rows",
    "assemble_vector",
    "cell_nodes",
    "cell_quadrature",
    "compile_form",
    "coordinate_basis",
    "dolfinx_fem",
    "dolfinx_mesh",
    "facet_nodes",
    "facet_submesh",
    "facet_vertices",
    "form_cache",
    "from_gmsh_order",
    "gather",
    "global_mesh",
    "input_numbers",
    "is_simplex",
    "mesh_from_gmsh",
    "node_vector",
    "num_vertices",
    "on_root",
    "products_in_order",
    "raise_together",
    "rectangular_matrix",
    "reference_nodes",
    "refine_edges",
    "serial_mesh",
    "set_entries",
    "sparse_matrix",
    "tag_facets",
    "ufl",
]
