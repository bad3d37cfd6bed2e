"""Results of more than 1 GB are opened at once, and read one layer at a time."""

import subprocess
import sys

import h5py
import numpy as np
import pytest
from trouble_process import environment

from impactfem.errors import OutputError
from impactfem.result import FieldSpool, Result, SolidFields
from impactfem.result.fields import MAX_LAYERS, read_vtkhdf
from impactfem.result.history import Columns, make_history
from impactfem.result.store import LAST
from impactfem.scene import Scene
from impactfem.shipped import shipped_scenes

READ = """
import re, sys
from pathlib import Path
from impactfem.result import Result

def peak():  # of this program: that of getrusage begins with the parent's
    return int(re.search(r"VmHWM:\\s*(\\d+)", Path("/proc/self/status").read_text())[1]) / 1024

result = Result.load(sys.argv[1])
opened = peak()
{then}
print(opened, peak())
"""


def memory(folder, then):
    """Memory [MiB] of a process that opens a result, and after it has looked at it."""
    done = subprocess.run(
        [sys.executable, "-c", READ.format(then=then), str(folder)],
        env=environment(), check=True, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    return [float(word) for word in done.stdout.split()]


def saved(folder, scene, rows=3):
    """A result without fields."""
    column = np.linspace(0.0, 1.0, rows)
    history = make_history(Columns(*[column] * 7, np.zeros(rows, dtype=np.int64)))
    used = Scene.from_toml(shipped_scenes()[scene])
    Result(used, history, {"title": "t", "method": "m", "status": "completed"}).save(
        folder, pictures=False
    )
    assert (folder / LAST).exists()


@pytest.fixture
def solid(tmp_path):
    """2 GB of fields that were never written: they take no room on the disk."""
    saved(tmp_path, "dropped_disc")
    nodes, layers = 200_000, 200
    cells = np.arange(nodes - 2)[:, None] + np.arange(3)
    with FieldSpool(tmp_path / "fields.vtkhdf", np.zeros((nodes, 2)), cells, 5) as spool:
        pass
    assert spool.point_data
    with h5py.File(tmp_path / "fields.vtkhdf", "r+") as file:
        root = file["VTKHDF"]
        root["Steps"].attrs["NSteps"] = layers
        for name in spool.point_data:
            root["PointData"][name].resize(layers * nodes, axis=0)
        for name in spool._steps(0, 0.0):
            root["Steps"][name].resize(layers, axis=0)
        size = sum(data.size * data.dtype.itemsize for data in root["PointData"].values())
    assert size > 2**30
    assert (tmp_path / "fields.vtkhdf").stat().st_size < 2**26
    return tmp_path


def test_fields_of_a_solid(solid):
    opened, looked = memory(solid, "layer = result.fields.read(150); assert len(layer) == 6")
    assert opened < 300
    assert looked - opened < 80  # a layer has 15 MiB


def test_fields_of_a_bar(tmp_path):
    saved(tmp_path, "bar_impact")
    nodes, layers = 1001, 25_000
    with h5py.File(tmp_path / "fields.vtkhdf", "w") as file:
        root = file.create_group("VTKHDF")
        root["Types"] = np.full(nodes - 1, 3, dtype=np.uint8)
        root["Points"] = np.zeros((nodes, 3))
        root["Connectivity"] = np.repeat(np.arange(nodes), 2)[1:-1]
        root["Steps/Values"] = np.arange(layers, dtype=float)
        for name in ("displacement", "velocity"):
            root.create_dataset(f"PointData/{name}", (layers * nodes, 3), dtype=float)
    opened, _ = memory(tmp_path, "assert result.fields.counts is None")
    assert opened < 300
    fields = Result.load(tmp_path).fields
    assert "displacement" not in vars(fields)
    with pytest.raises(AttributeError):
        fields.acceleration  # noqa: B018


def test_a_history_of_a_million_rows(tmp_path):
    """It is read as a whole: 8 bytes a number, and as much again while it is read."""
    saved(tmp_path, "bar_impact", 1_000_000)
    opened, looked = memory(tmp_path, "assert result.history.sizes['time'] == 1_000_000")
    assert looked < 450
    assert opened > 1e6 * 8 * 8 / 2**20


def test_a_file_that_claims_to_be_endless(tmp_path):
    for kind, reader in ((5, SolidFields), (3, read_vtkhdf)):
        with h5py.File(tmp_path / "f.vtkhdf", "w") as file:
            root = file.create_group("VTKHDF")
            root["Types"] = [kind]
            root["NumberOfPoints"], root["NumberOfCells"] = [3], [1]
            root.create_dataset("Steps/Values", (2**50,), dtype=float, chunks=(1024,))
            root.create_group("Steps/PointDataOffsets")
        assert MAX_LAYERS < 2**50
        with pytest.raises(OutputError, match="its times have the shape"):
            reader(tmp_path / "f.vtkhdf")
