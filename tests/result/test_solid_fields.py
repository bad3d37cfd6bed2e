"""Fields of solids: written layer by layer, read back by the programs people open them with."""

import subprocess
import sys
import tracemalloc

import h5py
import numpy as np
import pytest

from impactfem.errors import OutputError
from impactfem.result.cell_kinds import KINDS
from impactfem.result.solid_fields import POINT_DATA, FieldSpool, SolidFields

POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]])
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])


def values(layer):
    """Different numbers in every field, node and layer."""
    nodes = len(POINTS)
    node = np.arange(nodes) + 100.0 * layer
    gap = np.where(np.arange(nodes) < 3, 0.1 * node, np.nan)
    return {
        "displacement": np.stack([node, -node], axis=1),
        "velocity": np.stack([2 * node, 3 * node, 4 * node], axis=1),
        "von_mises": 5 * node,
        "contact_pressure": 6 * node,
        "gap": gap,
        "active": node % 2 == 0,
    }


def spooled(path, layers):
    with FieldSpool(path, POINTS, QUADS, KINDS["quadrilateral", 1].vtk_type) as spool:
        for layer in range(layers):
            spool.append(0.5 * layer, values(layer))
    return path


def agree(fields, layer):
    read, given = fields.read(layer), values(layer)
    assert set(read) == set(POINT_DATA)
    assert np.array_equal(read["displacement"][:, :2], given["displacement"])
    assert np.all(read["displacement"][:, 2] == 0.0)
    for name in set(POINT_DATA) - {"displacement"}:
        assert np.array_equal(read[name], given[name], equal_nan=name == "gap"), name


def test_layers_read_back_the_same(tmp_path):
    fields = SolidFields(spooled(tmp_path / "fields.vtkhdf", 3))
    assert fields.times == pytest.approx([0.0, 0.5, 1.0])
    assert np.array_equal(fields.points[:, :2], POINTS)
    assert np.array_equal(fields.cells, QUADS)
    assert len(fields) == 3
    for layer in range(3):
        agree(fields, layer)
    assert set(fields.read(-1, "gap")) == {"gap"}
    assert fields.read(-1)["von_mises"][0] == 1000.0
    with pytest.raises(IndexError):
        fields.read(3)


def test_pyvista_reads_every_layer_in_any_order(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    path = tmp_path / "fields.vtkhdf"
    with FieldSpool(path, POINTS, QUADS, 9) as spool:
        for layer in range(3):
            spool.append(0.5 * layer, values(layer))
    reader = pyvista.HDFReader(str(path)).reader
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 3
    for step in (2, 0, 1):
        reader.SetStep(step)
        reader.Update()
        mesh = pyvista.wrap(reader.GetOutput())
        assert mesh.n_cells == 2
        assert mesh.cells.reshape(-1, 5)[:, 1:].tolist() == QUADS.tolist()
        assert mesh.points[:, :2] == pytest.approx(POINTS)
        given = values(step)
        assert set(mesh.point_data.keys()) >= set(POINT_DATA)
        assert mesh.point_data["displacement"][:, :2] == pytest.approx(given["displacement"])
        assert mesh.point_data["velocity"] == pytest.approx(given["velocity"])
        assert mesh.point_data["gap"] == pytest.approx(given["gap"], nan_ok=True)
        assert np.array_equal(mesh.point_data["active"], given["active"])


def test_a_reopened_spool_goes_on_after_the_layers_that_are_kept(tmp_path):
    path = spooled(tmp_path / "fields.vtkhdf", 5)
    with FieldSpool.reopen(path, 2) as spool:
        assert len(spool) == 2
        assert spool.point_data == POINT_DATA
        spool.append(9.0, values(7))
    fields = SolidFields(path)
    assert fields.times.tolist() == [0.0, 0.5, 9.0]
    agree(fields, 1)
    assert np.array_equal(fields.read(2)["von_mises"], values(7)["von_mises"])


def test_a_killed_writer_leaves_what_it_has_appended(tmp_path):
    path = tmp_path / "fields.vtkhdf"
    code = f"""
import os, signal, numpy as np
from impactfem.result.solid_fields import FieldSpool
spool = FieldSpool({str(path)!r}, np.eye(3), [[0, 1, 2]], 5, {{"u": 3}})
for layer in range(4):
    spool.append(layer, {{"u": np.full((3, 3), float(layer))}})
os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -9
    with FieldSpool.reopen(path, 3) as spool:
        spool.append(9.0, {"u": np.full((3, 3), 9.0)})
    fields = SolidFields(path)
    assert fields.times.tolist() == [0.0, 1.0, 2.0, 9.0]
    assert [fields.read(k)["u"][0, 0] for k in range(4)] == [0.0, 1.0, 2.0, 9.0]


def test_only_one_layer_is_in_memory(tmp_path):
    nodes, layers = 50_000, 20
    data = {"u": np.ones((nodes, 3))}
    tracemalloc.start()
    with FieldSpool(tmp_path / "f.vtkhdf", np.zeros((nodes, 3)), [[0, 1, 2]], 5, {"u": 3}) as spool:
        for layer in range(layers):
            spool.append(layer, data)
    fields = SolidFields(tmp_path / "f.vtkhdf")
    for layer in range(layers):
        fields.read(layer)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * data["u"].nbytes  # all layers would take 20


def test_a_full_disk_is_an_error_that_keeps_the_layers_before(tmp_path, monkeypatch):
    path = tmp_path / "fields.vtkhdf"
    with FieldSpool(path, POINTS, QUADS, 9) as spool:
        spool.append(0.0, values(0))

        def full(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("impactfem.result.solid_fields.reserve", full)
        with pytest.raises(OutputError, match=r"No space left on device.*free some space"):
            spool.append(0.5, values(1))
    agree(SolidFields(path), 0)
    assert len(SolidFields(path)) == 1


def test_the_bound_of_a_layer_holds(tmp_path):
    path = tmp_path / "fields.vtkhdf"
    rng = np.random.default_rng(1)
    nodes = 3_001
    noise = {name: rng.random((nodes, n)[: 1 + (n > 1)]) for name, n in POINT_DATA.items()}
    with FieldSpool(path, rng.random((nodes, 3)), [[0, 1, 2]], 5) as spool:
        before = path.stat().st_size
        for layer in range(10):
            spool.append(layer, noise)
        assert path.stat().st_size - before < 10 * spool.layer_bytes


def test_foreign_files_are_output_errors(tmp_path):
    path = tmp_path / "fields.vtkhdf"
    path.write_text("not HDF5")
    for open_it in (SolidFields, FieldSpool.reopen):
        with pytest.raises(OutputError, match="run the scene again"):
            open_it(path)
    with h5py.File(path, "w") as file:
        file.create_group("VTKHDF")
    with pytest.raises(OutputError, match="run the scene again"):
        SolidFields(path)
    with pytest.raises(OutputError, match="1 layers are there, 2 are expected"):
        FieldSpool.reopen(spooled(path, 1), 2)
