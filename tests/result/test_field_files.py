"""The field file: written layer by layer, read back by the programs people open it with."""

import subprocess
import sys
import tomllib
import tracemalloc
from importlib.metadata import EntryPoint
from pathlib import Path

import h5py
import numpy as np
import pytest

from impactfem.errors import OutputError, SceneError
from impactfem.result.cell_kinds import KINDS
from impactfem.result.shapes import Shape, joined
from impactfem.result.snapshots import KeptSnapshots
from impactfem.result.spool import POINT_DATA, FieldSpool
from impactfem.result.stored_snapshots import StoredSnapshots

ROOT = Path(__file__).parents[2]
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
        "contact_force": np.stack([7 * node, 8 * node, 9 * node], axis=1),
        "gap": gap,
        "active": node % 2 == 0,
    }


def spooled(path, layers):
    with FieldSpool(
        path, [Shape("body", POINTS, QUADS, KINDS["quadrilateral", 1].vtk_type)]
    ) as spool:
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
    fields = StoredSnapshots(spooled(tmp_path / "fields.vtkhdf", 3))
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


def of_all_kinds(layer):
    """A solid, a beam and two balls, whose files differ in cells and in what is known of them."""
    beam = 0.1 * np.arange(8.0).reshape(4, 2) + layer
    balls = np.array([[5.0, 1.0 + layer], [6.0, 2.0 - layer]])
    return [
        values(layer),
        {"displacement": beam, "velocity": 2 * beam},
        {"displacement": balls, "velocity": -balls},
    ]


SHAPES = [
    Shape("block", POINTS, QUADS, 9),
    Shape.line("beam", np.stack([np.arange(4.0), np.full(4, 7.0)], axis=1), 0.25),
    Shape.vertices("balls", [[1.0, 8.0], [2.0, 9.0]], [0.5, 0.125]),
]


def test_pyvista_reads_bodies_of_all_kinds_at_every_time(tmp_path):
    """By the reader that `pyvista.get_reader` takes once this package is installed."""
    pytest.importorskip("pyvista")
    from impactfem.result.pyvista_reader import HDFReader

    path = tmp_path / "fields.vtkhdf"
    with FieldSpool(path, SHAPES) as spool:
        for layer in range(4):
            spool.append(0.5 * layer, joined(of_all_kinds(layer), POINT_DATA))
    reader = HDFReader(str(path))
    assert reader.time_values == [0.0, 0.5, 1.0, 1.5]
    assert reader.number_time_points == 4
    for step in (2, 0, 3, 1):
        reader.set_active_time_value(0.5 * step)
        assert reader.active_time_value == 0.5 * step
        mesh = reader.read()
        assert mesh.celltypes.tolist() == [9, 9, 3, 3, 3, 1, 1]
        assert mesh.cell_data["body"].tolist() == [0, 0, 1, 1, 1, 2, 2]
        assert mesh.get_cell(1).point_ids == QUADS[1].tolist()
        assert mesh.get_cell(4).point_ids == [8, 9]
        assert mesh.get_cell(6).point_ids == [11]
        assert mesh.point_data["radius"].tolist() == [0.0] * 6 + [0.25] * 4 + [0.5, 0.125]
        assert np.array_equal(mesh.points[:, :2], np.concatenate([s.points for s in SHAPES]))
        given = joined(of_all_kinds(step), POINT_DATA)
        assert {*POINT_DATA, "radius"} <= set(mesh.point_data.keys())
        for name in POINT_DATA:
            assert np.array_equal(mesh.point_data[name], given[name], equal_nan=True), name
        assert np.isnan(mesh.point_data["von_mises"][6:]).all()
    with pytest.raises(ValueError, match="none of 4 steps"):
        reader.set_active_time_value(0.7)


def test_pyvista_finds_that_reader(tmp_path):
    pyvista = pytest.importorskip("pyvista", "0.49")
    from pyvista.core.utilities import reader_registry

    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    (point,) = pyproject["project"]["entry-points"]["pyvista.readers.override"].items()
    kept = reader_registry._save_registry_state()
    try:  # as an installation does
        found = EntryPoint(*point, "pyvista.readers.override").load()
        pyvista.register_reader(point[0], found, override=True)
        reader = pyvista.get_reader(str(spooled(tmp_path / "fields.vtkhdf", 3)))
    finally:
        reader_registry._restore_registry_state(kept)
    assert reader.time_values == [0.0, 0.5, 1.0]
    reader.set_active_time_point(-1)
    assert reader.read().point_data["von_mises"][0] == 1000.0


def test_snapshots_know_their_bodies(tmp_path):
    path = tmp_path / "fields.vtkhdf"
    with FieldSpool(path, SHAPES) as spool:
        for layer in range(3):
            spool.append(layer, joined(of_all_kinds(layer), POINT_DATA))
    stored = StoredSnapshots(path)
    assert stored.names == ("block", "beam", "balls")
    layout = stored.layout
    assert {k: len(cells) for k, cells in layout.blocks.items()} == {1: 2, 3: 3, 9: 2}
    balls = np.array([of_all_kinds(k)[2]["displacement"] + SHAPES[2].points for k in range(3)])
    assert np.array_equal(stored.places("balls")[:, :, :2], balls)
    with pytest.raises(SceneError, match="give block or beam or balls"):
        stored.places("ball")
    with pytest.raises(SceneError, match="several kinds"):
        stored.cells  # noqa: B018
    each = {n: np.array([stored.read(k)[n] for k in range(3)]) for n in ("displacement", "gap")}
    kept = KeptSnapshots(stored.times, SHAPES, each)
    assert np.array_equal(kept.places("beam"), stored.places("beam"))
    kept.write(tmp_path / "kept.vtkhdf")
    again = StoredSnapshots(tmp_path / "kept.vtkhdf")
    assert again.point_data == kept.point_data == {"displacement": 3, "gap": 1}
    assert np.array_equal(again.over_time("gap"), each["gap"], equal_nan=True)


def test_a_reopened_spool_goes_on_after_the_layers_that_are_kept(tmp_path):
    path = spooled(tmp_path / "fields.vtkhdf", 5)
    with FieldSpool.reopen(path, 2) as spool:
        assert len(spool) == 2
        assert spool.point_data == POINT_DATA
        spool.append(9.0, values(7))
    fields = StoredSnapshots(path)
    assert fields.times.tolist() == [0.0, 0.5, 9.0]
    agree(fields, 1)
    assert np.array_equal(fields.read(2)["von_mises"], values(7)["von_mises"])


def test_a_killed_writer_leaves_what_it_has_appended(tmp_path):
    path = tmp_path / "fields.vtkhdf"
    code = f"""
import os, signal, numpy as np
from impactfem.result.shapes import Shape, joined
from impactfem.result.snapshots import KeptSnapshots
from impactfem.result.spool import FieldSpool
spool = FieldSpool({str(path)!r}, [Shape("body", np.eye(3), [[0, 1, 2]], 5)], {{"u": 3}})
for layer in range(4):
    spool.append(layer, {{"u": np.full((3, 3), float(layer))}})
os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -9
    with FieldSpool.reopen(path, 3) as spool:
        spool.append(9.0, {"u": np.full((3, 3), 9.0)})
    fields = StoredSnapshots(path)
    assert fields.times.tolist() == [0.0, 1.0, 2.0, 9.0]
    assert [fields.read(k)["u"][0, 0] for k in range(4)] == [0.0, 1.0, 2.0, 9.0]


def test_only_one_layer_is_in_memory(tmp_path):
    nodes, layers = 50_000, 20
    data = {"u": np.ones((nodes, 3))}
    tracemalloc.start()
    with FieldSpool(
        tmp_path / "f.vtkhdf", [Shape("body", np.zeros((nodes, 3)), [[0, 1, 2]], 5)], {"u": 3}
    ) as spool:
        for layer in range(layers):
            spool.append(layer, data)
    fields = StoredSnapshots(tmp_path / "f.vtkhdf")
    for layer in range(layers):
        fields.read(layer)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * data["u"].nbytes  # all layers would take 20


def test_a_full_disk_is_an_error_that_keeps_the_layers_before(tmp_path, monkeypatch):
    path = tmp_path / "fields.vtkhdf"
    with FieldSpool(path, [Shape("body", POINTS, QUADS, 9)]) as spool:
        spool.append(0.0, values(0))

        def full(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("impactfem.result.spool.reserve", full)
        with pytest.raises(OutputError, match=r"No space left on device.*free some space"):
            spool.append(0.5, values(1))
    agree(StoredSnapshots(path), 0)
    assert len(StoredSnapshots(path)) == 1


def test_the_bound_of_a_layer_holds(tmp_path):
    path = tmp_path / "fields.vtkhdf"
    rng = np.random.default_rng(1)
    nodes = 3_001
    noise = {name: rng.random((nodes, n)[: 1 + (n > 1)]) for name, n in POINT_DATA.items()}
    with FieldSpool(path, [Shape("body", rng.random((nodes, 3)), [[0, 1, 2]], 5)]) as spool:
        before = path.stat().st_size
        for layer in range(10):
            spool.append(layer, noise)
        assert path.stat().st_size - before < 10 * spool.layer_bytes


def test_foreign_files_are_output_errors(tmp_path):
    path = tmp_path / "fields.vtkhdf"
    path.write_text("not HDF5")
    for open_it in (StoredSnapshots, FieldSpool.reopen):
        with pytest.raises(OutputError, match="run the scene again"):
            open_it(path)
    with h5py.File(path, "w") as file:
        file.create_group("VTKHDF")
    with pytest.raises(OutputError, match="run the scene again"):
        StoredSnapshots(path)
    with pytest.raises(OutputError, match="1 time levels are there, 2 are expected"):
        FieldSpool.reopen(spooled(path, 1), 2)
