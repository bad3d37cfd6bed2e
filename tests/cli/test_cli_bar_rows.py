"""The commands for bars in a row: what they print, write and return."""

import json

import numpy as np
import pytest

from impactfem.cli import BAD_INPUT, DONE
from impactfem.shipped import shipped_scenes

NAMES = {"two_bars": ["short", "long"], "wave_cradle": ["striker", "first", "second", "third",
                                                        "fourth", "fifth"]}  # fmt: skip
PICTURES = {"contact_force.png", "energy.png", "strain.png", "velocity.png", "world_lines.png"}


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_run_writes_history_and_pictures_and_runs_again(name, command, work):
    drawn = name == "two_bars"
    done = command("run", name, drawn=drawn)
    assert done.code == DONE, done.err
    folder = work / "results" / name
    written = {path.name for path in folder.iterdir()}
    assert (PICTURES if drawn else set()) | {
        "scene.toml",
        "history.csv",
        "fields.vtkhdf",
        "exact.nc",
    } <= written
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "completed"
    assert summary["error"]["displacement_max"] < 1e-10
    pairs = [" and ".join(pair["between"]) for pair in summary["contact"]["pairs"]]
    assert pairs == [f"{a} and {b}" for a, b in zip(NAMES[name][:-1], NAMES[name][1:], strict=True)]
    assert all(pair in done.out for pair in pairs)
    history = np.genfromtxt(folder / "history.csv", delimiter=",", names=True, deletechars="")
    met = zip(NAMES[name][:-1], NAMES[name][1:], strict=True)
    forces = [history[f"force.{a}.{b}"] for a, b in met]
    assert np.allclose(np.sum(forces, axis=0), history["contact_force"], rtol=1e-12)
    assert history["gap"].min() >= 0.0
    assert {f"{body}.vx" for body in NAMES[name]} <= set(history.dtype.names)
    if name != "two_bars":
        return
    again = command("run", folder / "scene.toml", "--out", work / "again")
    assert again.code == DONE, again.err
    assert (work / "again/history.csv").read_text() == (folder / "history.csv").read_text()
    redrawn = command("plot", folder)
    assert redrawn.code == DONE
    assert "world_lines.png" in redrawn.out


@pytest.mark.parametrize("name", NAMES)
def test_plan_and_validate(name, command):
    assert name in shipped_scenes()
    assert command("validate", name).code == DONE
    done = command("plan", name)
    assert done.code == DONE
    assert "why method" in done.out
    assert "bars in a row" in done.out


@pytest.mark.parametrize("method", ["galerkin", "exact"])
def test_every_method_runs(method, command, work):
    done = command("run", "two_bars", "--set", f"solve.method={method}", "--out", work / "out")
    assert done.code == DONE, done.err
    assert json.loads((work / "out/summary.json").read_text())["method"] == method


def test_overlap_is_bad_input(command):
    done = command("run", "two_bars", "--set", "body.long.gap=0.9")
    assert done.code == BAD_INPUT
    assert "body[1].gap = 0.9" in done.err
    assert "overlap by 0.1 m" in done.err
