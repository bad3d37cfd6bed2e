"""Sweeps: tables of many runs, resumed after a kill, failures by exit code, bifurcations."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from impactfem import Scene
from impactfem.cli import main
from impactfem.errors import FolderError, SceneError
from impactfem.studies.sweep_point import Asked
from impactfem.studies.sweeping import Axis, sweep

OMEGA, E = 99.3, 0.8
EXISTS = 2.0 * math.pi * (1.0 - E)
TABLE = f"""
title = "Ball on a vibrating table"
duration = 20.0
gravity = [-9.81]
[[parameter]]
name = "gamma"
start = 3.0
[[body]]
name = "ball"
kind = "point"
mass = 0.01
position = [0.00122]
velocity = [0.31]
[[obstacle]]
name = "table"
kind = "half_space"
point = [0.0]
normal = [1.0]
motion = ["gamma*9.81/{2.0 * (1.0 + E) * OMEGA**2}*sin({OMEGA}*t + acos({EXISTS}/gamma))"]
[[contact]]
between = ["ball", "table"]
restitution = {E}
[solve]
method = "event_driven"
[output]
fields = []
"""


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "table.toml"
    path.write_text(TABLE)
    return path


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(TABLE.replace("duration = 20.0", "duration = 2.0"))
    return path


@pytest.mark.parametrize(
    ("text", "key", "values"),
    [
        ("a.b=1:2:3", "a.b", (1.0, 1.5, 2.0)),
        ("solve.dt = 1e-3,2e-3", "solve.dt", (1e-3, 2e-3)),
        ("body.0.kind=bar,rod", "body.0.kind", ("bar", "rod")),
        ("body.0.velocity=[0,1],[2,3]", "body.0.velocity", ([0, 1], [2, 3])),
        ("a=2:2:1", "a", (2.0,)),
    ],
)
def test_values_are_ranges_or_lists(text, key, values):
    found = Axis.parse(text)
    assert (found.key, found.values) == (key, values)


@pytest.mark.parametrize("text", ["a", "a=", "=1:2:3", "a=1:2:1", "a=1:2:0", "a=1:inf:3"])
def test_what_is_no_range_is_refused(text):
    with pytest.raises(SceneError, match="--vary"):
        Axis.parse(text)


def test_the_bifurcation_of_the_vibrating_table_from_the_command_line(table, tmp_path, capsys):
    """Impacts at cos(phase) = 2 pi (1 - e) / gamma up to the flip at 3.8550, then at two phases.

    Guckenheimer and Holmes (1983), of the exact map. The table of the scene begins at that phase.
    """
    out, period = tmp_path / "out", 2.0 * math.pi / OMEGA
    words = ["sweep", str(table), "--vary", "parameter.gamma.start=2.0:4.2:12", "--jobs", "1",
             "--section", "impacts", "--period", repr(period), "--after", "15",
             "--figure", "ball.x.max", "--figure", "contact.impulse"]  # fmt: skip
    assert main([*words, "--out", str(out)]) == 0
    rows = list(csv.DictReader((out / "section.csv").open()))
    flip = math.hypot(EXISTS, 4.0 * (1.0 + E * E) / (1.0 + E))
    assert flip == pytest.approx(3.8550, abs=1e-4)
    for gamma in np.linspace(2.0, 4.2, 12):
        own = [r for r in rows if float(r["parameter.gamma.start"]) == pytest.approx(gamma)]
        phases = np.array([float(r["phase"]) for r in own]) / period
        phases -= np.round(phases)
        assert len(phases) > 70
        if gamma < flip - 0.1:
            assert np.abs(phases).max() < 1e-4, gamma
        elif gamma > flip + 0.1:
            assert np.ptp(phases[::2]) < 1e-4
            assert np.ptp(phases[1::2]) < 1e-4
            assert abs(phases[0] - phases[1]) > 0.1
    told = list(csv.DictReader((out / "sweep.csv").open()))
    assert all(float(row["ball.x.max"]) > 0.0 and row["exit"] == "0" for row in told)
    assert json.loads((out / "summary.json").read_text())["failed"] == 0
    assert (out / "section.png").stat().st_size > 10_000
    capsys.readouterr()


def test_failures_are_rows_with_their_exit_codes(table):
    found = sweep(
        Scene.from_toml(table), {"contact.0.restitution": [0.5, 1.5], "duration": [0.1, -1.0]}
    )
    assert found.column("exit") == [0, 2, 2, 2]
    assert found.failed == 3
    assert "restitution" in found.points[2].message
    assert found.column("duration") == [0.1, -1.0, 0.1, -1.0]


def test_continuation_follows_branches_and_shows_hysteresis(tmp_path, capsys):
    """x - x**3 + p has two rests between the folds at p = 2 / (3 sqrt 3) = 0.385 and its mirror."""
    path = tmp_path / "bistable.toml"
    path.write_text("""
title = "Bistable"
duration = 30.0
gravity = [0.0]
parameter = [{ name = "p", start = 0.0 }]
obstacle = [{ kind = "half_space", point = [-10.0], normal = [1.0] }]
output = { fields = [] }
[[body]]
name = "ball"
kind = "point"
mass = 1.0
position = [-1.2]
force = ["x - x**3 + p - 2*vx"]
""")
    out = tmp_path / "out"
    words = ["sweep", str(path), "--vary", "parameter.p.start=-0.6,0.0,0.6",
             "--continue", "--period", "1", "--section", "ball.x", "--after", "29",
             "--out", str(out)]  # fmt: skip
    assert main([*words, "--figure", "ball.x.last"]) == 0
    rows = list(csv.DictReader((out / "sweep.csv").open()))
    assert [row["way"] for row in rows] == ["there"] * 3 + ["back"] * 3
    for row in rows:
        p = float(row["parameter.p.start"])
        roots = np.roots([-1.0, 0.0, 1.0, p])
        real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
        branch = real[0 if row["way"] == "there" else -1]  # where there is one, it is the only
        assert float(row["ball.x.last"]) == pytest.approx(branch, abs=1e-8), p
    # Killed after the third point, it goes on from the end of that.
    lines = (out / "points.jsonl").read_text().splitlines()
    (out / "points.jsonl").write_text("\n".join([*lines[:4], lines[4][:40]]))
    assert main([*words, "--figure", "ball.x.last"]) == 0
    again = list(csv.DictReader((out / "sweep.csv").open()))
    assert [row["ball.x.last"] for row in again] == [row["ball.x.last"] for row in rows]
    capsys.readouterr()


def test_continuation_finds_the_flip_of_the_vibrating_table(table):
    """One phase at 3.85, two at 3.90 (flip at 3.8550), there and back."""
    period, amplitude = 2.0 * math.pi / OMEGA, 9.81 / (2.0 * (1.0 + E) * OMEGA**2)
    # The table is at 0 at whole periods, whatever gamma; the ball flies and will strike it at
    # cos(phase) = 2 pi (1 - e) / gamma, as it does once in a period.
    phase = math.acos(EXISTS / 3.8)
    wait, down = phase / OMEGA, 0.5 * 9.81 * period
    height = 3.8 * amplitude * math.sin(phase) + down * wait - 0.5 * 9.81 * wait**2
    scene = Scene.from_toml(table).with_settings({
        "duration": 400 * period, "body.0.position": [height], "body.0.velocity":
        [9.81 * wait - down], "obstacle.0.motion": [f"gamma*{amplitude}*sin({OMEGA}*t)"],
    })  # fmt: skip
    asked = Asked(section="impacts", period=period, after=380 * period)
    values = [3.8, 3.85, 3.9, 3.95]
    found = sweep(scene, {"parameter.gamma.start": values}, asked=asked, continued=True)
    phases = [np.array(point.section)[:, 1] / period for point in found.points]
    apart = [np.abs(np.diff(each - np.round(each))).max() for each in phases]
    assert [each > 0.03 for each in apart] == [False] * 2 + [True] * 4 + [False] * 2, apart


@pytest.mark.parametrize(
    ("change", "vary", "period", "words"),
    [
        ({"duration": 1.0}, {"parameter.gamma.start": [3.0, 3.5]}, 0.3, "give duration = 0.8999"),
        ({}, {"parameter.gamma.start": [3.0, 3.5]}, 0.0, "--period T"),
        ({}, {"duration": [1.0], "parameter.gamma.start": [3.0]}, 1.0, "one key, not 2"),
    ],
)
def test_continuations_without_sense_are_refused(table, change, vary, period, words):
    scene = Scene.from_toml(table).with_settings(change)
    with pytest.raises(SceneError, match=words):
        sweep(scene, vary, asked=Asked(period=period), continued=True)


@pytest.mark.parametrize(
    ("vary", "asked", "words"),
    [
        ({"contact.0.restitutio": [0.5, 0.6]}, {}, "restitutio"),
        ({}, {}, "one or more keys"),
        ({"duration": [0.1]}, {"section": "ball.x"}, "--period"),
    ],
)
def test_sweeps_without_sense_are_refused(table, vary, asked, words):
    with pytest.raises(SceneError, match=words):
        sweep(Scene.from_toml(table), vary, asked=Asked(**asked))


def test_unknown_figures_are_told_with_the_point(table):
    asked = Asked(figures=("contact.impuls",))
    found = sweep(Scene.from_toml(table), {"duration": [0.1]}, asked=asked)
    assert found.column("exit") == [2]
    assert "no number in summary.json" in found.points[0].message


def test_a_section_of_a_column_is_seen_once_in_a_period(table):
    asked = Asked(section="ball.x", period=0.05, after=0.2)
    found = sweep(Scene.from_toml(table), {"duration": [0.41]}, asked=asked)
    times = [row[0] for row in found.points[0].section]
    assert times == pytest.approx(np.arange(4, 9) * 0.05)


def test_a_sweep_that_was_killed_goes_on_with_what_it_has(short, tmp_path):
    """Also one of several processes; the table is that of a sweep in one go."""
    out, scene = tmp_path / "out", Scene.from_toml(short)
    vary = "parameter.gamma.start=2.0:3.0:40"
    words = [sys.executable, "-P", "-m", "impactfem", "sweep", str(short), "--jobs", "2",
             "--vary", vary, "--out", str(out)]  # fmt: skip
    run = subprocess.Popen(words, stdout=subprocess.DEVNULL, env=os.environ)
    points = out / "points.jsonl"
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        if points.exists() and points.read_text().count("\n") > 3:
            break
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    run.wait()
    done = points.read_text().count("\n") - 1
    assert 0 < done < 40
    with points.open("a") as file:
        file.write('{"index": 39, "co')  # as a full stop amid a line
    axes = (Axis.parse(vary),)
    found = sweep(scene, axes, folder=out)
    assert done - 1 <= found.taken < 40
    assert found.column("impulse") == sweep(scene, axes).column("impulse")
    with pytest.raises(FolderError, match="another sweep"):
        sweep(scene, {"duration": [0.1]}, folder=out)


def test_a_point_whose_process_dies_is_a_row(table, tmp_path):
    """An extension that ends the process at one value stands for a crash of a library."""
    module = tmp_path / "crashing.py"
    module.write_text(
        "import os, signal\n"
        "from impactfem.extensions import ADDED\n"
        "ADDED['body crashing'] = __name__\n"
        "from impactfem.scene import Scene\n"
        "def with_settings(self, settings, own=Scene.with_settings):\n"
        "    if settings.get('duration') == 0.2:\n"
        "        os.kill(os.getpid(), signal.SIGSEGV)\n"
        "    return own(self, settings)\n"
        "Scene.with_settings = with_settings\n"
    )
    axes = {"duration": [0.1, 0.2, 0.3]}
    found = sweep(Scene.from_toml(table), axes, jobs=2, extensions=[str(module)])
    assert found.column("exit") == [0, 139, 0]
