"""Distributed meshes of bodies: one numbering, surfaces and measures for any number of ranks."""

import math
from pathlib import Path

import numpy as np
import pytest
from measures import boundary_facets, facet_nodes, nodes_on, smallest_heights
from pytest_mpi import parallel_assert

from impactfem import fem
from impactfem.errors import MeshError
from impactfem.fem import MPI, dolfinx_fem, ufl
from impactfem.mesh.body import build_body_mesh
from impactfem.mesh.shapes import shape_mesh
from impactfem.mesh.structured import structured_mesh
from impactfem.scene.shapes import Block, Disc, Sphere
from impactfem.scene.solids import Solid

COMM = MPI.COMM_WORLD
HERE = Path()
MATERIAL = {"density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3}
DISC = Disc(radius=0.5, center=(0.0, 0.52))
BALL = Sphere(radius=0.5, symmetry=("x",))
CASES = [
    (DISC, 0.1, "simplex", 1), (DISC, 0.1, "simplex", 2), (DISC, 0.1, "hexahedron", 2),
    (BALL, 0.2, "simplex", 1), (BALL, 0.2, "simplex", 2), (BALL, 0.2, "hexahedron", 1),
    (Block(size=(1.0, 1.0, 1.0)), 0.25, "hexahedron", 2),
]  # fmt: skip


def solid(shape=DISC, size=0.1, cells="simplex", **more):
    model = "plane_strain" if shape is None or shape.dim == 2 else "3d"
    keys = {"model": model, "shape": shape, "mesh_size": size, "cells": cells, **MATERIAL}
    return Solid(**(keys | more))


def build(shape=DISC, size=0.1, cells="simplex", degree=1, comm=COMM, **more):
    return build_body_mesh(comm, solid(shape, size, cells, **more), degree, HERE)


def whole(shape, size, cells, degree):
    """The mesh before it is distributed, on every rank."""
    make = shape_mesh if cells == "simplex" else structured_mesh
    return fem.on_root(COMM, lambda: make(shape, size, degree=degree))


def rows(array):
    return {tuple(row) for row in np.sort(array, axis=1).tolist()}


@pytest.mark.parallel([1, 2, 4])
@pytest.mark.parametrize(("shape", "size", "cells", "degree"), CASES)
def test_numbers_are_the_rows_of_the_whole_mesh(shape, size, cells, degree):
    body, raw = build(shape, size, cells, degree), whole(shape, size, cells, degree)
    mesh = body.mesh
    parallel_assert(np.array_equal(mesh.geometry.x[:, : body.gdim], raw.points[body.numbers]))
    owned = mesh.geometry.index_map().size_local
    everywhere = np.sort(fem.gather(COMM, body.numbers[:owned]))
    parallel_assert(np.array_equal(everywhere, np.arange(len(raw.points))))
    parallel_assert(body.num_nodes == len(raw.points))
    parallel_assert(body.num_cells == len(raw.cells))
    local = body.numbers[fem.cell_nodes(mesh)]
    # Simplices keep the order of their nodes; the orientation of cells is as it was.
    parallel_assert({tuple(c) for c in local.tolist()} <= {tuple(c) for c in raw.cells.tolist()})


@pytest.mark.parallel([1, 2, 4])
@pytest.mark.parametrize(("shape", "size", "cells", "degree"), CASES)
def test_surfaces_are_found_on_every_rank(shape, size, cells, degree):
    body, raw = build(shape, size, cells, degree), whole(shape, size, cells, degree)
    facet_map = body.mesh.topology.index_map(body.gdim - 1)
    parallel_assert(set(body.surfaces) == set(shape.surface_names()))
    for name in shape.surface_names():
        facets = body.facets(name)
        corners = raw.surfaces[name].shape[1]
        owned = facets[facets < facet_map.size_local]
        numbers = body.numbers[facet_nodes(body, owned)[:, :corners]]
        found = fem.gather(COMM, numbers)
        parallel_assert(len(found) == len(raw.surfaces[name]))
        parallel_assert(rows(found) == rows(raw.surfaces[name]))
        # Ghost facets of a surface are known too, wherever a rank has them.
        marks = np.zeros(facet_map.size_local + facet_map.num_ghosts, dtype=bool)
        marks[facets] = True
        everywhere = {tuple(r) for r in np.sort(found, axis=1).tolist()}
        ghosts = np.arange(facet_map.size_local, len(marks), dtype=np.int32)
        there = np.sort(body.numbers[facet_nodes(body, ghosts)[:, :corners]], axis=1)
        expected = np.array([tuple(r) in everywhere for r in there.tolist()], dtype=bool)
        parallel_assert(np.array_equal(marks[ghosts], expected))


@pytest.mark.parallel([1, 2, 4])
@pytest.mark.parametrize(("shape", "size", "cells", "degree"), CASES)
def test_volume_and_areas_are_those_of_forms(shape, size, cells, degree):
    body = build(shape, size, cells, degree)
    one = dolfinx_fem.Constant(body.mesh, 1.0)

    def integral(measure):
        return COMM.allreduce(dolfinx_fem.assemble_scalar(dolfinx_fem.form(one * measure)))

    volume = integral(ufl.Measure("dx", body.mesh, metadata={"quadrature_degree": 3 * degree}))
    parallel_assert(volume == pytest.approx(body.volume, rel=1e-12))
    boundary = COMM.allreduce(len(boundary_facets(body)))
    topology = body.mesh.topology
    named = np.concatenate(list(body.surfaces.values()))
    owned = named[named < topology.index_map(topology.dim - 1).size_local]
    parallel_assert(COMM.allreduce(len(owned)) == boundary)
    parallel_assert(np.array_equal(np.sort(owned), boundary_facets(body)))


@pytest.mark.parallel([1, 2, 4])
@pytest.mark.parametrize(("cells", "degree"), [("simplex", 2), ("hexahedron", 1)])
def test_nodes_on_the_boundary_are_agreed_upon(cells, degree):
    body = build(BALL, 0.2, cells, degree)
    on = nodes_on(body, boundary_facets(body))
    x = body.mesh.geometry.x
    expected = (np.abs(np.linalg.norm(x, axis=1) - 0.5) < 1e-12) | (x[:, 0] == 0.0)
    parallel_assert(np.array_equal(on, expected))


@pytest.mark.parallel([1, 4])
def test_cells_behind_shared_facets_are_ghosts():
    body = build(BALL, 0.2)
    index_map = body.mesh.topology.index_map(3)
    parallel_assert((index_map.num_ghosts > 0) == (COMM.size > 1))


def test_heights_of_right_cells():
    edges = 0.25
    squares = build(Block(size=(1.0, 0.5)), edges, "hexahedron", comm=MPI.COMM_SELF)
    np.testing.assert_allclose(smallest_heights(squares), edges, rtol=1e-12)
    curved = build(Block(size=(1.0, 1.0, 0.5)), edges, "hexahedron", 2, comm=MPI.COMM_SELF)
    np.testing.assert_allclose(smallest_heights(curved), edges, rtol=1e-12)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("shape", [Block(size=(1.0, 1.0)), Block(size=(1.0, 1.0, 1.0))])
def test_heights_of_simplices_are_volumes_over_faces(shape, degree):
    body = build(shape, 0.3, degree=degree, comm=MPI.COMM_SELF)
    dim = shape.dim
    corners = body.mesh.geometry.x[fem.cell_nodes(body.mesh)[:, : dim + 1], :dim]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / math.factorial(dim)
    faces = []
    for k in range(dim + 1):
        face = np.delete(corners, k, axis=1)
        u = face[:, 1] - face[:, 0]
        if dim == 2:
            faces.append(np.linalg.norm(u, axis=1))
        else:
            faces.append(0.5 * np.linalg.norm(np.cross(u, face[:, 2] - face[:, 0]), axis=1))
    np.testing.assert_allclose(smallest_heights(body), dim * volumes / np.max(faces, axis=0))


@pytest.mark.parallel([1, 2])
def test_a_surface_that_is_not_there_is_refused_with_those_that_are():
    body = build()
    with pytest.raises(MeshError, match="no surface 'edge'; it has rim"):
        body.facets("edge")


@pytest.mark.parallel([1, 2])
def test_refinement_of_a_lattice_is_refused_on_every_rank():
    with pytest.raises(MeshError, match=r"body 'ball'.*refine works with cells"):
        build(cells="hexahedron", name="ball",
              refine=[{"point": [0, 0], "radius": 0.1, "size": 0.05}])  # fmt: skip


def test_what_it_took_is_told():
    cost = build(comm=MPI.COMM_SELF).cost
    assert 0.0 < cost.seconds < 60.0
    assert cost.peak_memory > 10.0
