"""Numbers of absurd size, folders that are gone, titles that deceive: a message, no traceback."""

import copy
import shutil
from contextlib import suppress

import pytest
from trouble_process import run

import impactfem
from impactfem import Scene
from impactfem.errors import SceneError
from impactfem.planning import plan
from impactfem.shipped import shipped_scenes

HOSTILE = (
    5e-324, 1e-308, 1e-160, 1e-50, -1e50, 1e50, 1e160, 1e308, 10**400, float("inf"), float("nan"),
)  # fmt: skip


def numbers(table, path=""):
    """Keys of all numbers in a scene."""
    if isinstance(table, bool | str):
        return
    if isinstance(table, int | float):
        yield path[1:]
        return
    entries = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in entries:
        yield from numbers(value, f"{path}.{key}")


def put(scene, key, value):
    """The tables of a scene with another value at a path of keys and places in lists."""
    changed = copy.deepcopy(scene)
    *path, last = [int(word) if word.isdigit() else word for word in key.split(".")]
    table = changed
    for word in path:
        table = table[word]
    table[last] = value
    return changed


@pytest.mark.parametrize("name", ["bar_impact", "two_bars", "bouncing_ball", "dropped_beam"])
def test_every_number_of_a_scene_of_every_kind(name):
    scene = Scene.from_toml(shipped_scenes()[name]).to_dict()
    for key in numbers(scene):
        for value in HOSTILE:
            with suppress(SceneError):
                plan(Scene.from_dict(put(scene, key, value)))


def test_a_normal_that_vanishes_is_refused():
    """Its length was 0 by underflow, and the plane nowhere."""
    scene = Scene.from_toml(shipped_scenes()["dropped_beam"]).to_dict()
    with pytest.raises(SceneError, match=r"normal.*which vanishes"):
        Scene.from_dict(scene | {"obstacle": [scene["obstacle"][0] | {"normal": [0.0, 1e-170]}]})


def test_a_scene_is_asked_for(tmp_path):
    for wrong in (None, {"title": "a"}, 3):
        with pytest.raises(SceneError, match="not a Scene; make one by"):
            impactfem.solve(wrong)
    path = tmp_path / "mine.toml"
    shutil.copy(shipped_scenes()["bar_impact"], path)
    for given in (path, str(path)):
        assert impactfem.solve(given, method="exact").summary["status"] == "completed"
    with pytest.raises(SceneError, match="nothing"):
        impactfem.solve(tmp_path / "nothing.toml")


@pytest.mark.parametrize("code", [0x202A, 0x202E, 0x2066, 0x2069])
def test_a_title_does_not_turn_the_direction_of_writing(code):
    scene = Scene.from_toml(shipped_scenes()["bar_impact"])
    with pytest.raises(SceneError, match=f"control character U\\+{code:04X}"):
        scene.with_settings({"title": f"safe {chr(code)}txt.exe"})
    assert scene.with_settings({"title": "שלום"}).title == "שלום"  # letters do as they like


@pytest.mark.parametrize("command", ["doctor", "scenes"])
def test_a_present_folder_that_is_gone(tmp_path, command):
    (tmp_path / "gone").mkdir()
    (tmp_path / "main.py").write_text(
        "import os, sys\n"
        "from impactfem.cli import main\n"
        "os.chdir('gone')\n"
        "os.rmdir(os.getcwd())\n"
        f"sys.exit(main(['{command}']))\n"
    )
    code, out, err = run(tmp_path, "main.py")
    assert (code, out) == (1, "")
    assert err == (
        "impactfem: the present folder cannot be used (No such file or directory); change to "
        "another one (cd)\n"
    )


def test_too_little_address_space_is_said(tmp_path):
    pytest.importorskip("dolfinx")
    (tmp_path / "main.py").write_text(
        "import resource, sys\n"
        "from impactfem.fem import loading\n"
        "size = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (size + 2**27, size + 2**27))\n"
        "try:\n"
        "    loading._check_room()\n"
        "except loading.MissingDependencyError as error:\n"
        "    sys.exit(str(error))\n"
    )
    code, _, err = run(tmp_path, "main.py")
    assert code == 1
    assert "320 MiB of address space are left; allow more (ulimit -v)" in err


def test_rounding_is_no_energy():
    scene = Scene.from_toml(shipped_scenes()["oscillator"])
    assert impactfem.solve(scene).summary["energy"]["final"] == 0.0


def test_a_solid_that_reaches_nothing_is_no_fault():
    pytest.importorskip("dolfinx")
    scene = Scene.from_toml(shipped_scenes()["dropped_disc"])
    short = scene.with_settings({"duration": 1e-3, "output.fields": [], "solve.estimate": False})
    result = impactfem.solve(short)
    assert result.history["gap"].isnull().all()
    assert "not_finite" not in [each["code"] for each in result.summary["verdict"]["findings"]]
    assert result.summary["status"] == "completed"


def test_blocks_whose_sides_rounding_spoils_are_refused():
    """Qhull loses them: such a body had no corner, and ended in a traceback."""
    keys = {"density": 500.0, "velocity": [0.3, 0.0, 0.0]}
    for thick, place in ((1e-20, 0.0), (1e-20, -0.15), (1e-14, 0.0), (1e-3, 1e12)):
        block = {"kind": "block", "size": [thick, 0.2, 0.1], "corner": [place, -0.1, 0.95]}
        with pytest.raises(SceneError, match=r"shape\.size = .* has a side that rounding spoils"):
            impactfem.RigidBody(shape=block, **keys)
    leaf = {"kind": "block", "size": [1e-10, 0.2, 0.1], "corner": [-0.15, -0.1, 0.95]}
    body = impactfem.RigidBody(shape=leaf, **keys)
    assert len(body.form.nodes) == 8
    assert body.total_mass == pytest.approx(500.0 * 1e-10 * 0.2 * 0.1, rel=1e-12)
