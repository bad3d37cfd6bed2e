"""Pressures from nodal forces that UFL integrates."""

from itertools import product

import numpy as np
import pytest
from bodies import grid

from impactfem import fem
from impactfem.contact.boundary import boundary
from impactfem.contact.pressure import pressure_map
from impactfem.fem import MPI, dolfinx_fem, dolfinx_mesh, ufl

KINDS = [(dim, simplex, degree, False) for dim, simplex, degree in product((2, 3), (0, 1), (1, 2))]
KINDS += [(2, simplex, degree, True) for simplex, degree in product((0, 1), (1, 2))]


def recovered(dim, simplex, degree, axisymmetric, pressure, n=4):
    """Places on the bottom of a block, and the pressures found there."""
    counts, ends = (n, 1, n)[:dim], (1.0, 0.5, 1.0)[:dim]
    body = grid(MPI.COMM_SELF, counts, (0.0,) * dim, ends, simplex=bool(simplex), degree=degree)
    mesh = body.mesh
    space = dolfinx_fem.functionspace(mesh, ("Lagrange", degree))
    facets = np.sort(body.surfaces["bottom"])
    tags = dolfinx_mesh.meshtags(mesh, dim - 1, facets, np.ones(len(facets), dtype=np.int32))
    x, v = ufl.SpatialCoordinate(mesh), ufl.TestFunction(space)
    weight = 2 * np.pi * x[0] if axisymmetric else 1.0
    ds = ufl.Measure("ds", mesh, subdomain_data=tags, metadata={"quadrature_degree": 6})
    vector = dolfinx_fem.assemble_vector(dolfinx_fem.form(pressure(x) * weight * v * ds(1)))
    outside = boundary(body, axisymmetric=axisymmetric)
    force = np.zeros(len(outside.numbers))
    at = np.searchsorted(outside.numbers, body.numbers)
    of_node = np.empty(len(body.numbers))
    of_node[fem.cell_nodes(mesh)] = vector.array[space.dofmap.list]
    there = np.isin(body.numbers, outside.numbers)
    force[at[there]] = of_node[there]
    bottom = outside.on(["bottom"])
    on = outside.touched(bottom)
    found = pressure_map(outside, bottom, axisymmetric=axisymmetric) @ force
    assert (found[~on] == 0.0).all()
    return outside.points[on], found[on]


@pytest.mark.parametrize("kind", KINDS)
def test_constant_pressure_is_exact(kind):
    _, found = recovered(*kind, lambda x: 3.0 + 0.0 * x[0])
    np.testing.assert_allclose(found, 3.0, rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_curved_pressure_is_found_with_second_order(kind):
    def worst(n):
        points, found = recovered(*kind, lambda x: 2.0 - x[0] ** 2, n)
        # At its rim a surface has faces on one side only: the mean over them lies beside.
        inner = (points[:, ::2] < 1 - 1e-9).all(axis=1)
        inner &= (points[:, 2:] > 1e-9).all(axis=1)
        return np.abs(found - (2.0 - points[:, 0] ** 2))[inner].max()

    coarse, fine = worst(4), worst(8)
    assert fine <= 0.03
    assert coarse / fine >= 3.0
