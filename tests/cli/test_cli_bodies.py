"""The commands for solids that strike each other: what they print, write and return."""

import json

import numpy as np
import pytest
from conftest import launch
from processes import BARE

from impactfem.cli import DONE
from impactfem.facade import Result
from impactfem.result import StoredSnapshots

DISCS = """
title = "Two discs"
duration = 1.2

[[body]]
name = "left"
kind = "solid"
model = "plane_strain"
shape = { kind = "disc", radius = 0.5, center = [-0.51, 0.0] }
mesh_size = 0.1
density = 1.0
youngs_modulus = 1.0
poisson_ratio = 0.3
velocity = [0.1, 0.0]

[[body]]
name = "right"
kind = "solid"
model = "plane_strain"
shape = { kind = "disc", radius = 0.5, center = [0.51, 0.1] }
mesh_size = 0.075
density = 1.0
youngs_modulus = 1.0
poisson_ratio = 0.3

[output]
every = 5
"""


@pytest.fixture
def discs(work):
    (work / "discs.toml").write_text(DISCS, encoding="utf-8")
    return work / "discs.toml"


def test_plan_tells_bodies_pairs_and_sliding(discs, command):
    oblique = ("--set", "body.right.shape.center=[0.51, 0.5]", "--set", "duration=10.0")
    done = command("plan", discs, *oblique)
    assert done.code == DONE, done.err
    assert "left: disc in plane strain" in done.out
    assert "why contact right and left  right is the slave side" in done.out
    assert "right and left move along each other by about 0." in done.out


def test_run_writes_a_result_with_both_bodies(discs, command, work):
    done = command("run", discs, "--set", 'body.right.cells="hexahedron"', drawn=True)
    assert done.code == DONE, done.err
    folder = work / "results/discs"
    assert {"body.png", "velocity.png", "motion.gif", "energy.png", "contact_force.png"} <= {
        path.name for path in folder.iterdir()
    }
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "completed"
    assert summary["contact"]["max_force"] > 0.0
    assert summary["details"]["carriers"] == {"right and left": "right"}
    result = Result.load(folder)
    history = result.history
    assert [body.name for body in result.scene.bodies] == ["left", "right"]
    assert float(history["left.vx"][0]) == pytest.approx(0.1)
    assert float(history["right.vx"][-1]) > 0.0
    assert float(history["right.vy"][-1]) > 0.0  # it lies above the way of the left one
    momentum = history["momentum"].values  # along the way of the left one, from nothing outside
    assert list(history["momentum"].attrs["direction"]) == [1.0, 0.0, 0.0]
    assert np.ptp(momentum) < 1e-12 * abs(momentum[0])
    fields = result.fields
    assert isinstance(fields, StoredSnapshots)
    assert fields.names == ("left", "right")
    assert set(fields.layout.blocks) == {5, 9}  # triangles and quadrilaterals in one file
    assert fields.places("right")[0, :, 0].min() == pytest.approx(0.01)
    last = fields.read(-1, "displacement", "contact_pressure")
    assert len(last["displacement"]) == summary["details"]["nodes"]
    touched = max(
        fields.read(layer, "contact_pressure")["contact_pressure"].max()
        for layer in range(len(fields))
    )
    assert touched > 0.0


@pytest.mark.slow
def test_pictures_are_drawn_again(discs, command, work):
    assert command("run", discs).code == DONE
    folder = work / "results/discs"
    assert not (folder / "body.png").exists()
    assert command("plot", folder).code == DONE
    assert (folder / "body.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.parametrize("method", ["explicit", "massless"])
def test_two_ranks_write_the_same_history(method, discs, command, work):
    quiet = (*BARE, "--set", "output.fields=[]", "--set", f"solve.method={method}")
    assert command("run", discs, "--out", "one", *quiet).code == DONE
    done = launch(work, 2, "-m", "impactfem", "run", discs, "--out", "two", *quiet)
    assert done.code == DONE, done.err
    one, two = Result.load(work / "one").history, Result.load(work / "two").history
    assert float(one["contact_force"].max()) > 0.0
    for name in one.data_vars:
        a, b = one[name].values, two[name].values
        scale = max(np.nanmax(np.abs(a)), 0.1)
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-10 * scale, err_msg=name)
