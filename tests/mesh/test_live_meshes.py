"""Meshes of DOLFINx that a program holds: the same body as from a file, or refused by name."""

from itertools import product
from pathlib import Path

import basix.ufl
import gmsh
import numpy as np
import pytest
import ufl
from dolfinx import mesh as dolfinx_mesh
from mpi4py import MPI
from pytest_mpi import parallel_assert

import impactfem
from impactfem import fem
from impactfem.errors import MeshError, SceneError
from impactfem.fem.loading import dolfinx_gmsh  # by the name of the version that is installed
from impactfem.mesh.body_files import read_body
from impactfem.mesh.raw import outer_facets
from impactfem.mesh.shapes import shape_mesh
from impactfem.mesh.structured import structured_mesh
from impactfem.reading import live
from impactfem.scene.shapes import Disc, Sphere

COMM = MPI.COMM_WORLD
SOFT = {"density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3}


def tables(mesh, **more):
    body = {
        "kind": "solid", "name": "part", "model": "plane_strain", "mesh": mesh,
        "velocity": ["0.5*y", "-1"], **more,
    }  # fmt: skip
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    return {
        "title": "live", "duration": 0.02, "gravity": [0.0, 0.0], "body": [body],
        "obstacle": [floor], "output": {"fields": []},
    }  # fmt: skip


def scene(mesh, **more):
    return impactfem.Scene.from_dict(tables(mesh, **more))


def square(comm=COMM, n=4):
    return dolfinx_mesh.create_rectangle(comm, [[0.0, 0.002], [0.1, 0.102]], [n, n])


def halves(mesh):
    cells = [
        dolfinx_mesh.locate_entities(mesh, 2, lambda x, s=s: s * (x[1] - 0.052) <= 1e-9)
        for s in (1, -1)
    ]
    foot = dolfinx_mesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[1], 0.002))
    return impactfem.LiveMesh(
        mesh, dict(zip(("soft", "stiff"), cells, strict=True)), {"foot": foot}
    )


def test_the_orders_of_nodes_are_those_of_dolfinx():
    for (cell, nodes), (_, order) in live._CELLS.items():
        assert list(order) == fem.from_gmsh_order(cell, nodes).tolist()


@pytest.mark.parametrize(("model", "degree", "made"), [
    (model, degree, made) for (model, made), degree in product((
        ("plane_strain", shape_mesh), ("plane_strain", structured_mesh), ("3d", shape_mesh),
        ("3d", structured_mesh),
    ), (1, 2))
])  # fmt: skip
def test_cells_and_surfaces_come_back_to_the_bit(model, degree, made):
    shape = (
        Disc(radius=0.1, center=[0.3, 0.2])
        if model == "plane_strain"
        else Sphere(radius=0.1, center=[0.3, 0.2, 0.1])
    )
    raw = made(shape, 0.08, degree=degree)
    mesh = fem.global_mesh(MPI.COMM_SELF, raw.points, raw.cells, raw.cell, degree)
    side = raw.dim - 1
    mesh.topology.create_connectivity(side, raw.dim)
    rim = dolfinx_mesh.exterior_facet_indices(mesh.topology)
    names = dolfinx_mesh.meshtags(mesh, side, np.sort(rim), np.full(len(rim), 7, dtype=np.int32))
    found = read_body(impactfem.LiveMesh(mesh, None, (names, {"rim": 7})).path, model, degree)
    assert found.cell == raw.cell
    assert np.array_equal(found.points[found.cells], raw.points[raw.cells])
    rows = [found.surfaces["rim"], outer_facets(raw)]
    mine, theirs = (
        np.sort(np.sort(mesh.points[own], axis=1).reshape(len(own), -1), axis=0)
        for mesh, own in zip((found, raw), rows, strict=True)
    )
    assert np.array_equal(mine, theirs)


def test_a_run_is_that_of_the_file_and_its_result_stands_alone(tmp_path):
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        face = gmsh.model.occ.addRectangle(0.0, 0.002, 0.0, 0.1, 0.1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [face], 4, name="rubber")
        gmsh.model.addPhysicalGroup(1, [3], 5, name="top")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.03)
        gmsh.model.mesh.generate(2)
        path = tmp_path / "part.msh"
        gmsh.write(str(path))
        data = dolfinx_gmsh.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=2)
    finally:
        gmsh.finalize()
    pull = {"tractions": [{"surface": "top", "value": ["0", "-100*t"]}]}
    if not hasattr(data, "physical_groups"):  # DOLFINx 0.9
        data = impactfem.LiveMesh(data[0], (data[1], {"rubber": 4}), (data[2], {"top": 5}))
    mine = impactfem.solve(scene(data, **SOFT, **pull))
    theirs = impactfem.solve(scene(str(path), **SOFT, **pull))
    force = theirs.rows["contact_force"].values
    # Nodes have other numbers: sums in another order, over the steps of the run.
    bound = np.finfo(float).eps * len(force) * 100 * force.max()
    assert np.abs(mine.rows["contact_force"].values - force).max() < bound
    assert force.max() > 0
    mine.save(tmp_path / "out", pictures=False)
    Path(mine.scene.bodies[0].mesh).rename(tmp_path / "gone.msh")  # as when the program has ended
    again = impactfem.Result.load(tmp_path / "out").scene
    assert (tmp_path / "out" / again.bodies[0].mesh).is_file()
    assert np.array_equal(
        impactfem.solve(again).rows["contact_force"].values, mine.rows["contact_force"].values
    )
    (tmp_path / "gone.msh").rename(mine.scene.bodies[0].mesh)
    impactfem.solve(scene(str(path), **SOFT)).save(tmp_path / "out", pictures=False)
    assert not (tmp_path / "out" / again.bodies[0].mesh).exists()


def test_a_stopped_run_goes_on_with_the_mesh_it_kept(tmp_path, monkeypatch):
    mesh = halves(square())
    materials = {"materials": {"soft": SOFT, "stiff": SOFT | {"youngs_modulus": 4e6}}}
    made = scene(mesh, **materials).with_settings({"output.checkpoint": 5})
    whole = impactfem.solve(made, checkpoints=tmp_path)
    assert (tmp_path / mesh.path.name).read_bytes() == mesh.path.read_bytes()
    monkeypatch.chdir(tmp_path)
    again = impactfem.solve(made, checkpoints=tmp_path, restart=tmp_path)
    assert np.array_equal(again.rows["contact_force"].values, whole.rows["contact_force"].values)
    sim = impactfem.Simulation(made)
    sim.step()
    assert sim.time > 0.0


@pytest.mark.parallel(2)
def test_a_distributed_mesh_is_gathered():
    mesh = halves(square())
    materials = {"soft": SOFT, "stiff": SOFT | {"youngs_modulus": 4e6}}
    result = impactfem.solve(scene(mesh, materials=materials))
    lone = impactfem.solve(scene(halves(square(MPI.COMM_SELF)), materials=materials))
    force = lone.rows["contact_force"].values
    parallel_assert(np.abs(result.rows["contact_force"].values - force).max() < 1e-10 * force.max())


def test_what_cannot_be_a_body_is_refused_by_name():
    prisms = dolfinx_mesh.create_box(
        COMM, [[0, 0, 0], [1, 1, 1]], [1, 1, 1], dolfinx_mesh.CellType.prism
    )
    with pytest.raises(SceneError, match=r"body\[0\]\.mesh.*prism cells of 6 nodes; give triang"):
        scene(prisms, **SOFT)
    cubic = dolfinx_mesh.create_mesh(
        COMM, cells=np.arange(10)[None], x=np.random.default_rng(0).random((10, 2)),
        e=ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 3, shape=(2,))),
    )  # fmt: skip
    with pytest.raises(MeshError, match="triangle cells of 10 nodes"):
        impactfem.LiveMesh(cubic)
    mesh, some = square(), np.arange(5)
    with pytest.raises(MeshError, match="27 of its 32 cells are in none of its cell_tags, 'a'"):
        impactfem.LiveMesh(mesh, {"a": some})
    with pytest.raises(MeshError, match="'a' and 'b' share cells"):
        impactfem.LiveMesh(mesh, {"a": some, "b": some})
    with pytest.raises(MeshError, match="'a' entities that the mesh does not have"):
        impactfem.LiveMesh(mesh, None, {"a": [10**6]})
    with pytest.raises(MeshError, match="'a', and no facet is in it"):
        impactfem.LiveMesh(mesh, None, {"a": []})
    mesh.topology.create_entities(1)
    tags = dolfinx_mesh.meshtags(mesh, 1, some.astype(np.int32), np.full(5, 3, dtype=np.int32))
    with pytest.raises(MeshError, match="cell_tags are of dimension 1; give those of 2"):
        impactfem.LiveMesh(mesh, tags)
    with pytest.raises(MeshError, match="facet_tags are no tags"):
        impactfem.LiveMesh(mesh, None, [1, 2])
    inner = impactfem.LiveMesh(mesh, None, tags)  # named "3"
    held = {"supports": [{"surface": "3", "kind": "fixed"}]}
    with pytest.raises(MeshError, match=r"surface '3': \d of its 5 facets are not on the boundary"):
        impactfem.plan(scene(inner, **SOFT, **held))
    with pytest.raises(SceneError, match=r"body\[0\]\.file"):
        impactfem.Scene.from_dict(
            tables(None) | {"body": [{"kind": "mechanism", "name": "m", "file": mesh}]}
        )
