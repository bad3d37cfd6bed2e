"""Mass and stiffness of a body as PETSc matrices, with supports built in."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.errors import MeshError
from impactfem.fem import PETSc, dolfinx_fem
from impactfem.forms.elasticity import ElasticForms
from impactfem.scene.orthotropic import seen_by
from impactfem.scene.solids import RESIDUAL
from impactfem.system.loads import FormulaValues
from impactfem.system.materials import constants_of, first_lame, materials_of
from impactfem.system.nodes import Nodes
from impactfem.system.supports import Supports


@dataclass(frozen=True)
class BodyMatrices:
    """Matrices of a body; constrained rows and columns are emptied.

    Attributes:
        stiffness: [N/m], with 1 on the diagonal of constrained rows.
        mass: Consistent mass [kg].
        moved_stiffness: Columns of the stiffness that belong to moved degrees of freedom, with all
            rows, shape (owned dofs, owned moved dofs); None where nothing is moved.
        moved_mass: The same of the mass.
    """

    stiffness: Any
    mass: Any
    moved_stiffness: Any
    moved_mass: Any

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for matrix in (self.stiffness, self.mass, self.moved_stiffness, self.moved_mass):
            if matrix is not None:
                matrix.destroy()


def body_forms(nodes: Nodes, solid: Any, share: Floats | None = None) -> ElasticForms:
    """Weak forms of a solid (collective).

    Of one material they have constants, so that compiled code serves all such bodies, of several
    or of one that varies functions that are constant in each cell.

    Args:
        nodes: Nodes of the body.
        solid: `impactfem.scene.solids.Solid`.
        share: Of the stiffness of each cell, (cells,); None: all of it.

    Raises:
        SceneError: A formula of the material has a value that is not positive.
    """
    material, made = materials_of(nodes, solid), constants_of(nodes, solid)
    every = np.ones(len(material.ratio)) if share is None else share
    nu, mu = material.ratio, material.shear * every
    first = first_lame(material, solid.model) * every
    several = solid.materials and solid.keeps_volume
    return ElasticForms(
        space=nodes.space,
        model=solid.model,
        simplex=fem.is_simplex(nodes.space.mesh),
        density=made(material.density),
        first_lame=made(first),
        shear_modulus=made(mu),
        across=made(-nu / (1.0 - nu)),
        thickness=dolfinx_fem.Constant(nodes.space.mesh, float(solid.thickness)),
        kept=made(np.where(material.keeps & (every > 0.0), 1.0, 0.0)) if several else None,
        whole=made(every[:, None, None] * seen_by(material.whole, solid.model))
        if solid.is_orthotropic
        else None,
        residual=_residual(nodes, solid),
    )


def _residual(nodes: Nodes, solid: Any) -> Any:
    """Residual stress of a solid as a tensor of functions; None of bodies without (collective).

    Raises:
        SceneError: A formula has no finite value.
    """
    if not solid.has_residual_stress:
        return None
    mesh, dim = nodes.space.mesh, nodes.dim
    degree = int(nodes.space.ufl_element().degree)
    space = dolfinx_fem.functionspace(mesh, ("Discontinuous Lagrange", degree))
    places = space.tabulate_dof_coordinates()[:, :dim]
    found = [dolfinx_fem.Function(space) for _ in RESIDUAL[dim]]
    every: dict[str, Any] = {"": np.arange(len(space.dofmap.list))}
    for group, cells in (nodes.groups if solid.materials else every).items():
        own = solid.of_groups[group] if group else solid
        dofs = np.ravel(space.dofmap.list[cells])
        each = zip(RESIDUAL[dim], own.residual_stress or (), found, strict=False)
        for name, formula, made in each:
            values = FormulaValues(
                formula, f"residual_stress {name}", places[dofs], nodes.comm, "body"
            )
            made.x.array[dofs] = values.mean(0.0, 0.0)
    order = [[0, 2], [2, 1]] if dim == 2 else [[0, 3, 5], [3, 1, 4], [5, 4, 2]]
    return fem.ufl.as_tensor([[found[k] for k in row] for row in order])


def body_matrices(
    nodes: Nodes, forms: ElasticForms, supports: Supports, *, keeps_volume: bool
) -> BodyMatrices:
    """Assemble mass and stiffness (collective).

    Raises:
        MeshError: A matrix is not finite.
    """
    stiffness = body_stiffness(nodes, forms, keeps_volume=keeps_volume)
    mass = fem.assemble_petsc(fem.compile_form(forms.mass))
    for matrix, what in ((stiffness, "stiffness"), (mass, "mass")):
        if not np.isfinite(matrix.norm()):
            raise MeshError(
                f"the {what} of the body is not finite: its elements are degenerate or its "
                "material's data too large; check the mesh, and that all units are SI"
            )
    any_moved = bool(supports.formulas)
    columns = [_columns(matrix, supports) if any_moved else None for matrix in (stiffness, mass)]
    held = supports.constrained.nonzero()[0] + stiffness.getOwnershipRange()[0]
    for matrix, diagonal in ((stiffness, 1.0), (mass, 0.0)):
        matrix.zeroRowsColumns(held.astype(PETSc.IntType), diag=diagonal)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    _attach_rigid_motions(nodes, stiffness, supports)
    return BodyMatrices(stiffness, mass, *columns)


def to_blocked(matrix: Any) -> Any:
    """Copy a matrix into PETSc's block format (BAIJ), for products only."""
    return matrix.convert("baij", PETSc.Mat())


def rigid_motions(nodes: Nodes) -> Floats:
    """Translations and infinitesimal rotations of the owned nodes, shape (motions, owned dofs)."""
    x = nodes.positions[: nodes.owned]
    motions = []
    for direction in range(nodes.dim):
        motion = np.zeros_like(x)
        motion[:, direction] = 1.0
        motions.append(motion)
    for a, b in ((0, 1), (1, 2), (2, 0))[: 1 if nodes.dim == 2 else 3]:
        motion = np.zeros_like(x)
        motion[:, a], motion[:, b] = -x[:, b], x[:, a]
        motions.append(motion)
    return np.array(motions).reshape(len(motions), -1)


def body_stiffness(nodes: Nodes, forms: ElasticForms, *, keeps_volume: bool) -> Any:
    """Assemble the stiffness of a body that nothing holds (collective)."""
    degree = int(nodes.space.ufl_element().degree)
    if not keeps_volume or (forms.simplex and degree == 1):
        return fem.assemble_petsc(fem.compile_form(forms.stiffness))
    element = ("Discontinuous Lagrange", 0) if forms.simplex or degree == 1 else ("DPC", 1)
    dilatations = dolfinx_fem.functionspace(nodes.space.mesh, element)
    coupling, weights = forms.mean_dilatation(dilatations)
    stiffness = fem.assemble_petsc(fem.compile_form(forms.deviatoric_stiffness))
    mean = fem.assemble_petsc(fem.compile_form(coupling))
    inverse = _inverted_blocks(dilatations, fem.assemble_petsc(fem.compile_form(weights)))
    with fem.products_in_order(nodes.comm):
        volumetric = inverse.ptap(mean)
    stiffness.axpy(1.0, volumetric, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    for matrix in (mean, inverse, volumetric):
        matrix.destroy()
    return stiffness


def _inverted_blocks(space: Any, matrix: Any) -> Any:
    """Invert a matrix that couples the degrees of freedom of one cell only, in place."""
    owned = space.dofmap.index_map.size_local
    first, _ = matrix.getOwnershipRange()
    cells = space.dofmap.list
    cells = cells[(cells < owned).all(axis=1)].astype(np.int64)
    size = cells.shape[1]
    starts, columns, values = matrix.getValuesCSR()
    # Rows hold exactly one block each, with columns in increasing order, as do sorted cells.
    cells = np.sort(cells, axis=1)
    entries = starts[cells].astype(np.int64)[:, :, None] + np.arange(size)
    rows = np.broadcast_to((first + cells)[:, :, None], entries.shape)
    inverse = np.linalg.inv(values[entries])
    matrix.zeroEntries()
    fem.set_entries(
        matrix, rows.ravel().astype(np.int64), columns[entries].ravel(), inverse.ravel(), add=False
    )
    return matrix


def _columns(matrix: Any, supports: Supports) -> Any:
    """Columns of moved degrees of freedom (collective)."""
    first, last = matrix.getOwnershipRange()
    rows = PETSc.IS().createStride(last - first, first, 1, comm=matrix.comm)
    moved = (first + supports.moved).astype(PETSc.IntType)
    columns = PETSc.IS().createGeneral(moved, matrix.comm)
    part = matrix.createSubMatrix(rows, columns)
    rows.destroy()
    columns.destroy()
    return part


def _attach_rigid_motions(nodes: Nodes, stiffness: Any, supports: Supports) -> None:
    """Tell multigrid what hardly strains the body."""
    vectors: list[Any] = []
    for motion in rigid_motions(nodes):
        motion[supports.constrained] = 0.0
        vector = stiffness.createVecLeft()
        vector.array_w[:] = motion
        whole = vector.norm()
        for other in vectors:
            vector.axpy(-vector.dot(other), other)
        size = vector.norm()
        if size > 1e-10 * whole:
            vector.scale(1.0 / size)
            vectors.append(vector)
        else:
            vector.destroy()
    if vectors:
        space = PETSc.NullSpace().create(vectors=vectors, comm=stiffness.comm)
        stiffness.setNearNullSpace(space)
        space.destroy()
        for vector in vectors:
            vector.destroy()
