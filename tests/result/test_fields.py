"""Field files are read back by the programs that people open them with."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import OutputError
from impactfem.result.fields import Fields, read_vtkhdf, write_vtkhdf, write_with_dolfinx


@pytest.fixture
def fields():
    times = np.array([0.0, 0.25, 1.0])
    positions = np.array([0.0, 0.1, 0.4, 1.0, 1.5])  # not uniform
    displacement = np.outer(times, positions) + 0.5
    velocity = np.tile(positions, (3, 1))
    return Fields(times, positions, displacement, velocity)


def test_vtkhdf_reads_back_the_same(fields, tmp_path):
    path = tmp_path / "fields.vtkhdf"
    write_vtkhdf(fields, path)
    again = read_vtkhdf(path)
    for name in ("times", "positions", "displacement", "velocity"):
        assert np.array_equal(getattr(again, name), getattr(fields, name))


def test_vtkhdf_opens_in_pyvista_at_every_time(fields, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    path = tmp_path / "fields.vtkhdf"
    write_vtkhdf(fields, path)
    # By its class: pyvista 0.44 does not know the ending .vtkhdf.
    reader = pyvista.HDFReader(str(path))
    vtk = reader.reader
    vtk.UpdateInformation()
    assert vtk.GetNumberOfSteps() == 3
    for step in range(3):
        vtk.SetStep(step)
        vtk.Update()
        mesh = pyvista.wrap(vtk.GetOutput())
        assert mesh.n_cells == 4
        assert mesh.points[:, 0] == pytest.approx(fields.positions)
        assert mesh.point_data["displacement"][:, 0] == pytest.approx(fields.displacement[step])
        assert mesh.point_data["velocity"][:, 0] == pytest.approx(fields.velocity[step])
        assert np.all(mesh.point_data["displacement"][:, 1:] == 0.0)


def test_pvd_opens_in_pyvista(fields, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    path = tmp_path / "fields.pvd"
    write_with_dolfinx(fields, path, "pvd")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["fields.pvd", "fields_pvd"]
    reader = pyvista.get_reader(str(path))
    assert reader.time_values == pytest.approx(fields.times)
    reader.set_active_time_value(0.25)
    mesh = reader.read()[0]
    order = np.argsort(mesh.points[:, 0])
    assert mesh.points[order, 0] == pytest.approx(fields.positions)
    assert mesh.point_data["displacement"][order, 0] == pytest.approx(fields.displacement[1])


def test_vtx_is_an_adios2_folder_with_mesh_and_fields(fields, tmp_path):
    path = tmp_path / "fields.bp"
    write_with_dolfinx(fields, path, "vtx")
    # ParaView's reader goes by this description, which VTX stores as an attribute.
    metadata = (path / "md.0").read_bytes()
    for name in (b"vtk.xml", b"displacement", b"velocity", b"TIME"):
        assert name in metadata
    data = (path / "data.0").stat().st_size
    last = Fields(fields.times[:1], fields.positions, fields.displacement, fields.velocity)
    write_with_dolfinx(last, tmp_path / "one.bp", "vtx")
    assert data > (tmp_path / "one.bp" / "data.0").stat().st_size


def test_a_foreign_file_is_an_output_error(tmp_path):
    path = tmp_path / "fields.vtkhdf"
    path.write_text("not HDF5")
    with pytest.raises(OutputError, match="run the scene again"):
        read_vtkhdf(path)


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
