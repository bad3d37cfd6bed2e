"""Solids that cannot be, on one and on two ranks: exit code 2, one message, nothing written.

Each under a watchdog: a rank that waits for another would wait for ever.
"""

import signal

import pytest
from conftest import launch
from processes import contents

from impactfem.cli import BAD_INPUT, DONE

SECONDS = 30  # after which a run counts as hanging

SCENE = """
title = "Disc on a floor"
duration = 0.01

[[body]]
name = "disc"
kind = "solid"
model = "plane_strain"
shape = { kind = "disc", radius = 0.5, center = [0.0, 0.52] }
mesh_size = 0.2
density = 1000.0
youngs_modulus = 1e6
poisson_ratio = 0.3

[[obstacle]]
name = "floor"
kind = "half_space"
point = [0.0, 0.0]
normal = [0.0, 1.0]

[output]
fields = []
"""
SHAPE = 'shape = { kind = "disc", radius = 0.5, center = [0.0, 0.52] }\nmesh_size = 0.2'
GEO = """
SetFactory("OpenCASCADE");
Rectangle(1) = {-0.5, 0.02, 0, 1, 1};
Physical Surface("plate") = {1};
Physical Curve("edge") = {1, 2, 3, 4};
Mesh.MeshSizeMax = 0.3;
"""


def changed(old, new):
    assert SCENE.count(old) == 1
    return SCENE.replace(old, new)


def meshed(name, more=""):
    return changed(SHAPE, f'mesh = "{name}"\n{more}')


HELD = 'supports = [{ surface = "rim", kind = "motion", value = ["", " "] }]\n[[obstacle]]'
OTHER = 'supports = [{ surface = "egde", kind = "fixed" }]\n'
# name: (scene, files beside it, parts of the message)
BAD = {
    "mesh missing": (meshed("no.msh"), {}, ["no.msh", "No such file", "check `body.mesh`"]),
    "mesh empty": (meshed("a.msh"), {"a.msh": ""}, ["a.msh", "empty"]),
    "geometry empty": (meshed("a.geo"), {"a.geo": "\n"}, ["a.geo"]),
    "geometry broken": (meshed("a.geo"), {"a.geo": GEO + "Line(9) = {1,;"}, ["a.geo", "syntax"]),
    "surface unknown in a file": (
        meshed("a.geo", OTHER), {"a.geo": GEO}, ["egde", "Did you mean 'edge'?"],
    ),
    "surface unknown": (
        changed("[[obstacle]]", 'contact_surfaces = ["rimm"]\n[[obstacle]]'), {},
        ["body[0].contact_surfaces[0]", 'did you mean "rim"'],
    ),
    "mesh too fine": (
        changed("mesh_size = 0.2", "mesh_size = 1e-6"), {}, ["mesh_size", "GiB", "larger elements"],
    ),
    "body in the floor": (
        changed("center = [0.0, 0.52]", "center = [0.0, 0.3]"), {},
        ["body 'disc'", "inside obstacle 'floor'", "move the body by 0.2 m along (0, 1)"],
    ),
    "support that fixes nothing": (
        changed("[[obstacle]]", HELD), {}, ["body[0].supports[0].value", "every direction free"],
    ),
    "incompressible": (
        changed("poisson_ratio = 0.3", "poisson_ratio = 0.5"), {},
        ["body[0].poisson_ratio = 0.5", "< 0.5"],
    ),
}  # fmt: skip


def write(work, name):
    text, files, parts = BAD[name]
    for file, content in {"scene.toml": text, **files}.items():
        (work / file).write_text(content, encoding="utf-8")
    return parts, contents(work)


def check(done, parts):
    assert done.code == BAD_INPUT, done.err
    assert done.out == ""
    for part in parts:
        assert part in done.err
    assert done.err.count("impactfem: ") == 1, done.err
    assert "Traceback" not in done.err


@pytest.fixture
def watched():
    """Fail instead of waiting for ever."""

    def late(*_):
        raise TimeoutError(f"no end after {SECONDS} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("watched")
def test_the_scene_to_change_is_good(command, work):
    (work / "scene.toml").write_text(SCENE, encoding="utf-8")
    assert command("validate", "scene.toml").code == DONE
    (work / "a.geo").write_text(GEO, encoding="utf-8")
    (work / "scene.toml").write_text(meshed("a.geo"), encoding="utf-8")
    assert command("validate", "scene.toml").code == DONE


@pytest.mark.usefixtures("watched")
@pytest.mark.parametrize("name", BAD)
def test_a_bad_solid_is_refused(name, command, work):
    parts, before = write(work, name)
    check(command("run", "scene.toml"), parts)
    assert contents(work) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["mesh missing", "mesh empty", "geometry broken", "surface unknown in a file", "mesh too fine",
     "body in the floor", "incompressible"],
)  # fmt: skip
def test_two_ranks_end_and_one_speaks(name, work):
    parts, before = write(work, name)
    check(launch(work, 2, "-m", "impactfem", "run", "scene.toml", timeout=SECONDS), parts)
    assert contents(work) == before
