"""Field files of bars are read back by the programs that people open them with."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import OutputError
from impactfem.result.export import needed_bytes, write_fields
from impactfem.result.fields import Fields, StoredFields
from impactfem.result.stored_snapshots import StoredSnapshots


@pytest.fixture
def fields():
    times = np.array([0.0, 0.25, 1.0])
    positions = np.array([0.0, 0.1, 0.4, 1.0, 1.5])  # not uniform
    displacement = np.outer(times, positions) + 0.5
    velocity = np.tile(positions, (3, 1))
    return Fields(times, positions, displacement, velocity, bars=("bar",))


@pytest.fixture
def row():
    times, positions = np.array([0.0, 0.5]), np.array([0.0, 0.1, 0.4, 0.0, 0.7])
    displacement = np.outer(1.0 + times, positions) + 0.5
    return Fields(times, positions, displacement, 2 * displacement, (3, 2), ("one", "two"))


@pytest.mark.parametrize("given", ["fields", "row"])
def test_vtkhdf_reads_back_the_same(given, request, tmp_path):
    fields, path = request.getfixturevalue(given), tmp_path / "fields.vtkhdf"
    fields.write(path)
    assert path.stat().st_size <= needed_bytes(fields, "vtkhdf")
    again = StoredFields(StoredSnapshots(path))
    for name in ("times", "positions", "displacement", "velocity", "starts"):
        assert np.array_equal(getattr(again, name), getattr(fields, name))
    assert again.counts == fields.counts
    assert again.names == fields.names
    last = fields.names[-1]
    assert np.array_equal(again.places(last), fields.places(last))
    own = fields.positions[-2:] if last == "two" else fields.positions
    assert fields.places(last)[1, :, 0] == pytest.approx(own + fields.displacement[1, -len(own) :])
    again.write(tmp_path / "copy.vtkhdf")
    assert (tmp_path / "copy.vtkhdf").read_bytes() == path.read_bytes()


def test_pvd_opens_in_pyvista(fields, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    path = tmp_path / "fields.pvd"
    write_fields(fields, path, "pvd")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["fields.pvd", "fields_pvd"]
    reader = pyvista.get_reader(str(path))
    assert reader.time_values == pytest.approx(fields.times)
    reader.set_active_time_value(0.25)
    mesh = reader.read()[0]
    order = np.argsort(mesh.points[:, 0])
    assert mesh.points[order, 0] == pytest.approx(fields.positions)
    assert mesh.point_data["displacement"][order, 0] == pytest.approx(fields.displacement[1])


def test_vtx_is_an_adios2_folder_with_mesh_and_fields(fields, row, tmp_path):
    path = tmp_path / "fields.bp"
    write_fields(fields, path, "vtx")
    # ParaView's reader goes by this description, which VTX stores as an attribute.
    metadata = (path / "md.0").read_bytes()
    for name in (b"vtk.xml", b"displacement", b"velocity", b"TIME"):
        assert name in metadata
    data = (path / "data.0").stat().st_size
    last = Fields(fields.times[:1], fields.positions, fields.displacement, fields.velocity)
    write_fields(last, tmp_path / "one.bp", "vtx")
    assert data > (tmp_path / "one.bp" / "data.0").stat().st_size
    write_fields(row, tmp_path / "row.bp", "vtx")
    assert np.float64(row.displacement[1, 4]).tobytes() in (tmp_path / "row.bp/data.0").read_bytes()


def test_a_foreign_file_is_an_output_error(fields, tmp_path):
    path = tmp_path / "fields.vtkhdf"
    fields.write(path)
    again = StoredFields(StoredSnapshots(path))
    path.write_text("not HDF5")
    with pytest.raises(OutputError, match="run the scene again"):
        StoredSnapshots(path)
    with pytest.raises(OutputError, match="run the scene again"):
        again.displacement  # noqa: B018


def test_every_keeps_the_asked_layers_and_the_last():
    scene = impactfem.Scene(
        title="every",
        duration=1.05,
        bodies=[impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=2.0)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(elements=20),
        output=impactfem.Output(fields=["vtkhdf"], every=8),
    )
    kept = impactfem.solve(scene).fields
    assert kept.times == pytest.approx([0.0, 0.4, 0.8, 1.05])
    exact = impactfem.solve(scene, method="exact").fields
    assert exact.times == pytest.approx(kept.times)
