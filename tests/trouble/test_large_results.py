"""Results of more than 1 GB are opened at once, and read one layer at a time."""

import subprocess
import sys

import h5py
import numpy as np
import pytest
from processes import environment

from impactfem.errors import OutputError
from impactfem.facade import Result
from impactfem.result import FieldSpool, Shape, StoredSnapshots
from impactfem.result.history import Columns, make_history
from impactfem.result.shapes import MOTION
from impactfem.result.spool import POINT_DATA
from impactfem.result.store import LAST
from impactfem.result.stored_snapshots import MAX_LAYERS
from impactfem.scene import Scene
from impactfem.shipped import shipped_scenes

READ = """
import re, sys
from pathlib import Path
from impactfem.facade import Result

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
        env=environment(), check=True, capture_output=True, text=True, timeout=240,
    )  # fmt: skip
    return [float(word) for word in done.stdout.split()]


def saved(folder, scene, rows=3):
    """A result without fields."""
    column = np.linspace(0.0, 1.0, rows)
    momentum = np.repeat(column[:, None], 3, axis=1)
    history = make_history(Columns(*[column] * 6, momentum, np.zeros(rows, dtype=np.int64)))
    used = Scene.from_toml(shipped_scenes()[scene])
    Result(used, history, {"title": "t", "method": "m", "status": "completed"}).save(
        folder, pictures=False
    )
    assert (folder / LAST).exists()


def stretched(folder, shape, layers, fields=POINT_DATA):
    """Layers that were never written: they take no room on the disk."""
    with FieldSpool(folder / "fields.vtkhdf", [shape], fields) as spool:
        pass
    with h5py.File(folder / "fields.vtkhdf", "r+") as file:
        root = file["VTKHDF"]
        root["Steps"].attrs["NSteps"] = layers
        for name in spool.point_data:
            root["PointData"][name].resize(layers * len(shape.points), axis=0)
        for name in spool._steps(0, np.zeros(0)):
            root["Steps"][name].resize(layers, axis=0)
        size = sum(data.size * data.dtype.itemsize for data in root["PointData"].values())
    assert size > 2**30
    assert (folder / "fields.vtkhdf").stat().st_size < 2**26


@pytest.fixture
def solid(tmp_path):
    """2 GB of fields."""
    saved(tmp_path, "dropped_disc")
    nodes = 200_000
    cells = np.arange(nodes - 2)[:, None] + np.arange(3)
    stretched(tmp_path, Shape("body", np.zeros((nodes, 2)), cells, 5), 200)
    return tmp_path


def test_fields_of_a_solid(solid):
    opened, looked = memory(solid, "layer = result.fields.read(150); assert len(layer) == 7")
    assert opened < 300
    assert looked - opened < 80  # a layer has 15 MiB


def test_fields_of_a_bar(tmp_path):
    saved(tmp_path, "bar_impact")
    stretched(tmp_path, Shape.line("bar", np.zeros((1001, 1))), 25_000, MOTION)
    opened, _ = memory(tmp_path, "assert result.fields.counts is None")
    assert opened < 300
    fields = Result.load(tmp_path).fields
    assert "displacement" not in vars(fields)
    with pytest.raises(AttributeError):
        fields.acceleration  # noqa: B018


@pytest.mark.slow
def test_a_history_of_a_million_rows(tmp_path):
    """It is read as a whole: 8 bytes a number, and as much again while it is read."""
    saved(tmp_path, "bar_impact", 1_000_000)
    opened, looked = memory(tmp_path, "assert result.history.sizes['time'] == 1_000_000")
    assert looked < 450
    assert opened > 1e6 * 8 * 8 / 2**20


def test_a_file_that_claims_to_be_endless(tmp_path):
    with h5py.File(tmp_path / "f.vtkhdf", "w") as file:
        root = file.create_group("VTKHDF")
        root["Types"] = [5]
        root["NumberOfPoints"], root["NumberOfCells"] = [3], [1]
        root.create_dataset("Steps/Values", (2**50,), dtype=float, chunks=(1024,))
        root.create_group("Steps/PointDataOffsets")
    assert MAX_LAYERS < 2**50
    with pytest.raises(OutputError, match="its times have the shape"):
        StoredSnapshots(tmp_path / "f.vtkhdf")
