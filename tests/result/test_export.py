"""Fields of solids in all formats, for all kinds of cells."""

import gc

import numpy as np
import pytest

from impactfem.result.cell_kinds import KINDS
from impactfem.result.export import needed_bytes, write_fields
from impactfem.result.shapes import Shape
from impactfem.result.spool import POINT_DATA, FieldSpool
from impactfem.result.stored_snapshots import StoredSnapshots

EACH = pytest.mark.parametrize("kind", KINDS.values(), ids=lambda k: f"{k.shape}{k.degree}")
TIMES = (0.0, 0.25)


def grid(kind, number=2):
    """Unit square or cube of several cells: points and cells in VTK's order."""
    from impactfem.fem import MPI, dolfinx_fem, dolfinx_mesh

    cell = getattr(dolfinx_mesh.CellType, kind.shape)
    make = dolfinx_mesh.create_unit_square if kind.dim == 2 else dolfinx_mesh.create_unit_cube
    mesh = make(MPI.COMM_SELF, *(kind.dim * [number]), cell_type=cell)
    space = dolfinx_fem.functionspace(mesh, ("Lagrange", kind.degree))
    return space.tabulate_dof_coordinates(), space.dofmap.list[:, list(kind.order)]


def values(points, time):
    """Fields that tell every place and time apart, linear or not."""
    x, y, z = points.T
    return {
        "displacement": np.stack([x + 2 * y, y - 3 * z, z + time], axis=1),
        "velocity": np.stack([x * y, y + time, x * z], axis=1),
        "von_mises": 1e6 * (1.0 + x + y * y + 7 * z + time),
        "contact_pressure": np.where(abs(y) < 1e-9, 5.0 + x + time, 0.0),
        "contact_force": np.where(abs(y[:, None]) < 1e-9, points + time, 0.0),
        "gap": np.where(abs(y) < 1e-9, x + time, np.nan),
        "active": (abs(y) < 1e-9).astype(np.uint8),
    }


def spooled(path, kind, number=2):
    points, cells = grid(kind, number)
    with FieldSpool(path, [Shape("body", points, cells, kind.vtk_type)]) as spool:
        for time in TIMES:
            spool.append(time, values(points, time))
    return StoredSnapshots(path)


def check(mesh, kind, time):
    expected = values(mesh.points, time)
    for name in POINT_DATA:
        assert mesh.point_data[name] == pytest.approx(expected[name], nan_ok=True), name
    sizes = mesh.compute_cell_sizes(length=False)["Area" if kind.dim == 2 else "Volume"]
    assert sizes.min() > 0.0
    assert sizes.sum() == pytest.approx(1.0)


@EACH
def test_vtkhdf_opens_in_pyvista(kind, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    fields = spooled(tmp_path / "spool.vtkhdf", kind)
    write_fields(fields, tmp_path / "fields.vtkhdf", "vtkhdf")
    reader = pyvista.HDFReader(str(tmp_path / "fields.vtkhdf")).reader
    reader.UpdateInformation()
    for step, time in enumerate(TIMES):
        reader.SetStep(step)
        reader.Update()
        check(pyvista.wrap(reader.GetOutput()), kind, time)


@EACH
def test_pvd_opens_in_pyvista(kind, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    (tmp_path / "out").mkdir()
    path = tmp_path / "out/fields.pvd"
    write_fields(spooled(tmp_path / "spool.vtkhdf", kind), path, "pvd")
    assert sorted(entry.name for entry in path.parent.iterdir()) == ["fields.pvd", "fields_pvd"]
    reader = pyvista.get_reader(str(path))
    assert reader.time_values == pytest.approx(TIMES)
    for time in TIMES:
        reader.set_active_time_value(time)
        check(reader.read()[0], kind, time)


@EACH
def test_vtx_holds_all_fields(kind, tmp_path):
    path = tmp_path / "fields.bp"
    write_fields(spooled(tmp_path / "spool.vtkhdf", kind), path, "vtx")
    metadata = (path / "md.0").read_bytes()  # ParaView's reader goes by this description
    for name in (b"vtk.xml", b"TIME", *(name.encode() for name in POINT_DATA)):
        assert name in metadata
    # Values are stored raw: those of one field in some order of the nodes, in each layer.
    data = (path / "data.0").read_bytes()
    points = grid(kind)[0]
    for time in TIMES:
        for value in values(points, time)["von_mises"]:
            assert np.float64(value).tobytes() in data


@pytest.mark.parametrize("form", ["vtkhdf", "vtx", "pvd"])
@pytest.mark.parametrize("cell", [("triangle", 1), ("hexahedron", 1), ("tetrahedron", 2)])
def test_the_room_that_is_reserved_suffices(form, cell, tmp_path):
    kind = KINDS[cell]
    points, cells = grid(kind, 6)
    rng = np.random.default_rng(1)
    shape = Shape("body", rng.random(points.shape), cells, kind.vtk_type)
    with FieldSpool(tmp_path / "spool.vtkhdf", [shape]) as spool:
        for time in range(5):
            noise = {
                name: -1e-105 * rng.random((len(points), n)[: 1 + (n > 1)])
                for name, n in POINT_DATA.items()
            }
            spool.append(time, noise | {"active": rng.integers(2, size=len(points))})
    fields = StoredSnapshots(tmp_path / "spool.vtkhdf")
    (tmp_path / "out").mkdir()
    write_fields(fields, tmp_path / f"out/fields.{form}", form)
    size = sum(path.stat().st_size for path in (tmp_path / "out").rglob("*") if path.is_file())
    assert 0.2 < size / needed_bytes(fields, form) <= 1.0


def test_a_passing_file_is_linked_and_goes_with_its_fields(tmp_path):
    kind = KINDS["triangle", 1]
    passing = tmp_path / "passing"
    passing.mkdir()
    spooled(passing / "spool.vtkhdf", kind)
    fields = StoredSnapshots(passing / "spool.vtkhdf", passing=passing)
    write_fields(fields, tmp_path / "fields.vtkhdf", "vtkhdf")
    assert (tmp_path / "fields.vtkhdf").stat().st_ino == fields.path.stat().st_ino
    expected = fields.read(1)
    del fields
    gc.collect()
    assert not passing.exists()
    kept = StoredSnapshots(tmp_path / "fields.vtkhdf")
    assert np.array_equal(kept.read(1)["displacement"], expected["displacement"])
    write_fields(kept, tmp_path / "copy.vtkhdf", "vtkhdf")
    assert (tmp_path / "copy.vtkhdf").stat().st_ino != kept.path.stat().st_ino
