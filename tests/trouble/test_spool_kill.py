"""A run is killed while it writes its fields: what was appended is found again."""

import os
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest
from processes import environment

from impactfem.errors import OutputError
from impactfem.result import FieldSpool, Shape, StoredSnapshots

NODES = 4

WRITER = """
import sys
import numpy as np
from impactfem.errors import OutputError
from impactfem.result import FieldSpool, Shape
shape = Shape("body", np.zeros((4, 2)), [[0, 1, 2], [1, 2, 3]], 5)
spool = FieldSpool(sys.argv[1], [shape], {"u": 3, "gap": 1})
for layer in range(10_000):
    spool.append(layer, {"u": np.full((4, 3), layer), "gap": np.full(4, -layer)})
    print(layer, flush=True)
"""


def written(path, lines, delay):
    """Start a writer and kill it a moment after it has appended some layers; returns how many."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)],
        env=environment(), stdout=subprocess.PIPE,
    )  # fmt: skip
    try:
        for _ in range(lines):
            assert process.stdout.readline()
        # Further layers are written meanwhile; the moment is anywhere in one.
        for _ in range(delay):
            os.sched_yield()
    finally:
        process.send_signal(signal.SIGKILL)
        rest, _ = process.communicate()
    return lines + rest.count(b"\n")


# Around 64 layers the index of the chunks grows.
@pytest.mark.slow
@pytest.mark.parametrize("lines", [1, 2, 62, 64, 65])
def test_what_was_appended_before_a_kill_is_found(tmp_path, lines):
    path = tmp_path / "fields.vtkhdf"
    done = written(path, lines, 7 * lines)
    with FieldSpool.reopen(path, done) as spool:
        spool.append(-1.0, {"u": np.full((NODES, 3), 0.5), "gap": np.zeros(NODES)})
    fields = StoredSnapshots(path)
    assert fields.times.tolist() == [*range(done), -1.0]
    for layer in {0, done // 2, done - 1}:
        assert (fields.read(layer)["u"] == layer).all()
        assert (fields.read(layer)["gap"] == -layer).all()
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("libver", ["earliest", "latest"])
def test_files_of_others_are_refused_and_left_alone(tmp_path, libver):
    path = tmp_path / "a.vtkhdf"
    with h5py.File(path, "w", libver=libver) as file:
        file["x"] = np.arange(5)
    before = path.read_bytes()
    with pytest.raises(OutputError, match=r"a\.vtkhdf"):
        FieldSpool.reopen(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("content", [b"", b"\x89HDF", b"\x89HDF\r\n\x1a\n" + bytes(60), b"x" * 99])
def test_what_is_no_file_of_fields_is_left_alone(tmp_path, content):
    path = tmp_path / "a"
    path.write_bytes(content)
    with pytest.raises(OutputError):
        FieldSpool.reopen(path)
    assert path.read_bytes() == content


def test_a_link_in_place_of_the_fields_is_not_followed(tmp_path):
    (tmp_path / "victim").write_text("dear")
    link = tmp_path / "fields.vtkhdf"
    link.symlink_to("victim")
    FieldSpool(link, [Shape("body", np.zeros((NODES, 2)), [[0, 1, 2]], 5)], {"u": 3}).close()
    assert (tmp_path / "victim").read_text() == "dear"
