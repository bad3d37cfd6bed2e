"""Modules of users that register kinds: through the command line, restart, ranks and report."""

import json
import shutil
import sys
import warnings

import numpy as np
import pytest
from howto import block

import impactfem
from impactfem import extensions
from impactfem.errors import ImpactWarning
from impactfem.extensions import ADDED
from impactfem.marching.checkpoint import FILE
from impactfem.marching.schemes import SCHEMES, SOLID_SCHEMES
from impactfem.marching.time_loop import TimeLoop
from impactfem.methods import METHODS
from impactfem.scene import schema
from impactfem.scene.contacts import RESTITUTION_LAWS
from impactfem.scene.content import BODIES
from impactfem.scene.obstacles import OBSTACLES
from impactfem.signals import InterruptedRunError

from conftest import launch  # isort: skip

LISTS = (ADDED, BODIES, OBSTACLES, METHODS, RESTITUTION_LAWS, SCHEMES, SOLID_SCHEMES)
LISTS += (schema._TABLES,)
DISC = """
title = "a disc on an ellipse"
duration = 0.02
gravity = [0.0, -9.81]

[[body]]
name = "disc"
kind = "solid"
model = "plane_strain"
shape = { kind = "disc", radius = 0.05, center = [0.03, 0.08] }
mesh_size = 0.02
density = 1100.0
youngs_modulus = 1e6
poisson_ratio = 0.4
velocity = [0.0, -0.5]

[[body]]
kind = "frame"
mass = 0.3
radius = 0.004
corners = [[-0.05, 0.04], [-0.09, 0.05], [-0.06, 0.1]]
angular_velocity = 6.0

[[obstacle]]
kind = "ellipse"
center = [0.0, 0.0]
size = [0.2, 0.06]

[[contact]]
between = ["*", "*"]
friction_coefficient = 0.3

[output]
checkpoint = 10

[solve]
estimate = false
dt = 2e-4
"""
MORE = """
[[body]]
kind = "point"
mass = 0.02
position = [0.25, 1.103]
radius = 0.1

[[contact]]
between = ["*", "*"]
friction_coefficient = 0.2

[output]
checkpoint = 20
"""
BOTH = ("--extension", "ellipse.py", "--extension", "frames.py")


@pytest.fixture
def fresh():
    """No extension is loaded, and those of the test go with it."""
    before, modules = [dict(each) for each in LISTS], set(sys.modules)
    yield
    for each, was in zip(LISTS, before, strict=True):
        each.clear()
        each.update(was)
    for name in set(sys.modules) - modules:
        if not name.startswith(("impactfem", "numba")):
            del sys.modules[name]


@pytest.fixture
def scene(work, fresh):  # noqa: ARG001  (it cleans up)
    """A scene with an obstacle and a body of modules beside it."""
    (work / "ellipse.py").write_text(block("obstacle", "ellipse.py"))
    (work / "frames.py").write_text(block("body", "frames.py"))
    (work / "disc.toml").write_text(DISC)
    return "disc.toml"


def history(folder):
    return np.genfromtxt(folder / "history.csv", delimiter=",", skip_header=1)


def goes_on(command, work, monkeypatch, scene, options):
    """Run a scene as "whole" was, stopped and continued on one rank and on two.

    Returns what is said where it is continued without the extension.
    """
    whole, observe = history(work / "whole"), TimeLoop._observe

    def interrupted(self, *given):
        if self.layer == 55:
            raise InterruptedRunError(2)
        return observe(self, *given)

    with monkeypatch.context() as patch:
        patch.setattr(TimeLoop, "_observe", interrupted)
        assert command("run", scene, *options, "--out", "half", "--quiet").code == 130
    assert (work / "half" / FILE).exists()
    shutil.copytree(work / "half", work / "ranks")
    done = command("run", "--restart", "half", *options, "--quiet")
    assert done.code == 0, done.err
    np.testing.assert_array_equal(history(work / "half"), whole)

    words = ("-m", "impactfem", "run", "--restart", "ranks", "--quiet")
    missing = launch(work, 1, *words)  # in a process without it
    assert missing.code == 2
    assert launch(work, 2, *words, *options).code == 0
    np.testing.assert_allclose(history(work / "ranks"), whole, rtol=1e-10, atol=1e-12)
    return missing.err


@pytest.mark.slow
def test_runs_with_report_restart_and_ranks(scene, command, work, monkeypatch):
    done = command("run", scene, *BOTH, "--out", "whole", "--quiet", drawn=True)
    assert done.code == 0, done.err
    assert "An ellipse: center = " in (work / "whole" / "report.html").read_text("utf-8")
    summary = json.loads((work / "whole" / "summary.json").read_text())
    assert [one["adds"] for one in summary["run"]["extensions"]] == [
        ["body frame"], ["obstacle ellipse"]
    ]  # fmt: skip
    assert "--extension ellipse.py --extension frames.py" in summary["run"]["command"]
    missing = goes_on(command, work, monkeypatch, scene, BOTH)
    assert "needs body frame of the extension frames and obstacle ellipse of" in missing

    done = launch(work, 1, "-m", "impactfem", "plot", "ranks")
    assert done.code == 2
    assert "--extension ellipse" in done.err


@pytest.mark.slow
@pytest.mark.usefixtures("fresh")
def test_an_interior_runs_with_report_restart_and_ranks(command, work, monkeypatch):
    (work / "backward_euler.py").write_text(block("scheme", "backward_euler.py"))
    scene = block("scheme", "block.toml").replace("velocity = [0.0, -0.1]", "velocity = [0.0, 0.0]")
    scene = scene.replace("duration = 4.0", "duration = 2.0\ngravity = [0.01, -0.02]")
    (work / "block.toml").write_text(scene.replace("[0.0, 0.1]", "[0.0, 0.002]") + MORE)
    options = ("--extension", "backward_euler.py")
    done = command("run", "block.toml", *options, "--out", "whole", "--quiet", drawn=True)
    assert done.code == 0, done.err
    assert "backward_euler: backward Euler with massless" in (
        (work / "whole" / "report.html").read_text("utf-8")
    )
    assert json.loads((work / "whole" / "summary.json").read_text())["contact"]["impulse"] > 0.0
    said = goes_on(command, work, monkeypatch, "block.toml", options)
    assert "it needs method backward_euler of the extension backward_euler" in said


@pytest.mark.slow
@pytest.mark.usefixtures("fresh")
def test_a_law_of_impacts_runs_with_report_restart_and_ranks(command, work, monkeypatch):
    (work / "yielding.py").write_text(block("law", "yielding.py"))
    scene = block("law", "ball.toml").replace("[solve]\ndt = 1e-4", "[output]\ncheckpoint = 20\n\n"
        "[solve]\ndt = 0.01").replace("restitution = 0.8", "restitution = 0.8\n"
        "friction_coefficient = 0.2").replace("[0.0, 1.0]\n\n[[ob", "[0.0, 1.0]\n"
        "velocity = [0.3, 0.0]\n\n[[ob")  # fmt: skip
    (work / "ball.toml").write_text(scene)
    options = ("--extension", "yielding.py")
    done = command("run", "ball.toml", *options, "--out", "whole", "--quiet", drawn=True)
    assert done.code == 0, done.err
    page = (work / "whole" / "report.html").read_text("utf-8")
    assert "restitution 0.8 by the law yielding (e falls with the fourth root" in page
    said = goes_on(command, work, monkeypatch, "ball.toml", options)
    assert "it needs law yielding of the extension yielding" in said


@pytest.mark.usefixtures("fresh")
def test_a_scheme_of_bars_is_measured_and_the_same_on_ranks(command, work):
    text = block("scheme", "symplectic.py").replace("@numba.njit(cache=True)\n", "")
    (work / "symplectic.py").write_text(text)
    (work / "bar.toml").write_text(block("scheme", "bar.toml"))
    options = ("--extension", "symplectic.py", "--quiet")
    done = command("run", "bar.toml", *options, "--out", "whole")
    assert done.code == 0, done.err
    summary = json.loads((work / "whole" / "summary.json").read_text())
    assert summary["error"]["displacement_l2"] == pytest.approx(0.0173, rel=0.01)
    assert summary["contact"]["impulse"] == pytest.approx(0.991, rel=1e-3)
    assert command("methods", *options[:2]).out.count("symplectic Euler with lumped mass") == 1
    for key, value, text in (
        ("solve.courant", "1.1", "beyond the stability limit"),
        ("body.bar.far_end_displacement", '"0.1*t"', "knows no prescribed motion"),
        ("body.bar.load", "1.0", '"symplectic": waves keep their shape'),
    ):
        done = command("run", "bar.toml", *options, "--set", f"{key}={value}")
        assert done.code == 2
        assert text in done.err


@pytest.mark.usefixtures("fresh")
def test_joints_and_finite_strain_are_refused_with_an_interior_of_its_own(command, work):
    (work / "backward_euler.py").write_text(block("scheme", "backward_euler.py"))
    options = ("--extension", "backward_euler.py")
    finite = ("--set", 'body.block.strain="finite"')
    (work / "block.toml").write_text(block("scheme", "block.toml"))
    done = command("validate", "block.toml", *options, *finite)
    assert done.code == 2
    assert "backward_euler" in done.err
    joint = """
[[body]]
kind = "rigid"
name = "lid"
shape = { kind = "block", size = [0.2, 0.2], corner = [0.15, 1.1] }
density = 1.0

[[joint]]
kind = "fixed"
between = ["block/top", "lid"]
point = [0.25, 1.1]
"""
    (work / "block.toml").write_text(block("scheme", "block.toml").replace("-0.1]", "0.0]") + joint)
    done = command("run", "block.toml", *options, "--quiet")
    assert done.code == 2
    assert "moved by BackwardEuler, and joints hold solids in the midpoint rule only" in done.err


def test_a_scene_loads_no_code(scene, command):
    done = command("validate", scene)
    assert done.code == 2
    assert 'body[1].kind = "frame" is not allowed' in done.err
    assert "load the extension that adds it (--extension)" in done.err
    assert "ellipse" not in sys.modules


def test_schema_and_doctor_know_it(scene, command):
    done = command("schema", *BOTH)
    found = json.loads(done.out)["definitions"]
    assert found["ellipse.RigidEllipse"]["properties"]["size"]["items"]["exclusiveMinimum"] == 0
    assert {"$ref": "#/definitions/frames.Frame"} in json.loads(done.out)["properties"]["body"][
        "items"
    ]["oneOf"]
    assert "ellipse (obstacle ellipse); frames (body frame)" in command("doctor", *BOTH).out
    impactfem.Scene.from_toml(scene)  # the same process has it now


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module', line 1"),
        ("x = 1\ny = x / 0", "ZeroDivisionError: division by zero, line 2"),
        ("x = (", "SyntaxError"),
        ("x = 1", "registers nothing"),
    ],
)
@pytest.mark.usefixtures("fresh")
def test_broken_extensions_are_refused(command, work, text, message):
    (work / "broken.py").write_text(text)
    done = command("scenes", "--extension", "broken.py")
    assert done.code == 2
    assert "--extension broken.py: " in done.err
    assert message in done.err


@pytest.mark.parametrize("name", ["nowhere.py", "nowhere", "json.py"])
@pytest.mark.usefixtures("fresh")
def test_extensions_that_are_not_there_are_refused(command, name):
    done = command("scenes", "--extension", name)
    assert done.code == 2
    assert f"--extension {name}: " in done.err


def test_installed_extensions_are_loaded_with_the_first_scene(scene, work, monkeypatch):
    made = work / "mine-1.0.dist-info"
    made.mkdir()
    (made / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (made / "entry_points.txt").write_text(
        "[impactfem.extensions]\nellipse = ellipse\nframes = frames\nlost = no_such_module\n"
    )
    monkeypatch.syspath_prepend(work)
    extensions.load_installed.cache_clear()
    with pytest.warns(ImpactWarning, match="installed extension lost .no_such_module.: cannot be"):
        found = impactfem.Scene.from_toml(scene)
    assert {"frame", "solid"} == found.kinds
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        impactfem.Scene.from_toml(scene)  # once
    monkeypatch.undo()
    extensions.load_installed.cache_clear()
