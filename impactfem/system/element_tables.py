"""Shape functions at the points of the quadrature of all cells."""

from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.system.nodes import Nodes


def tabulated(nodes: Nodes, solid: Any, degree: int) -> tuple[Integers, Floats, Floats, Floats]:
    """Of the cells that this rank owns.

    Args:
        nodes: Nodes of the body.
        solid: `impactfem.scene.solids.Solid`.
        degree: Of the quadrature.

    Returns:
        Nodes of each cell, (cells, corners); gradients [1/m], (cells, points, corners, dim); shape
        functions over the distance from the axis [1/m], (cells, points, corners), or with no
        entry; volumes, (cells, points).
    """
    mesh = nodes.space.mesh
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = np.ascontiguousarray(nodes.space.dofmap.list[:owned])
    name, order = mesh.topology.cell_type.name, int(nodes.space.ufl_element().degree)
    points, parts = fem.cell_quadrature(name, degree)
    values, grads = fem.coordinate_basis(name, order, points)
    corners = nodes.positions[cells]
    jacobian = np.einsum("cki,jpk->cpij", corners, grads)
    table = np.einsum("jpk,cpji->cpki", grads, np.linalg.inv(jacobian))
    weights = np.abs(np.linalg.det(jacobian)) * parts
    hoop = np.zeros((0, 0, 0))
    if solid.is_axisymmetric:
        radius = np.einsum("pk,ck->cp", values, corners[:, :, 0])
        hoop = values / radius[:, :, None]
        weights = 2.0 * np.pi * radius * weights
    elif nodes.dim < 3:
        weights = solid.thickness * weights
    table, hoop, weights = (np.ascontiguousarray(part) for part in (table, hoop, weights))
    return cells, table, hoop, weights
