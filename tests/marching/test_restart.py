"""Runs that were stopped and continued: the same to the last bit, or a reason why not."""

import io
import json
import shutil
import time

import numpy as np
import pytest
from moving_scenes import (
    FLOOR,
    METHODS,
    differences,
    driven,
    finite,
    forget,
    pumped,
    rolling,
    rubbing,
    scene,
    stopping,
)

import impactfem
from impactfem.errors import OutputError
from impactfem.marching.checkpoint import FILE
from impactfem.runs.solids import SPOOL

solve = impactfem.solve


@pytest.mark.slow
@pytest.mark.parametrize("made", [driven, rolling])
@pytest.mark.parametrize("method", METHODS)
def test_a_continued_run_equals_the_whole_one(made, method, tmp_path, monkeypatch):
    case = made(method)
    whole = solve(case)
    layers = whole.summary["num_steps"]
    assert whole.summary["contact"]["max_force"] > 0.0
    with stopping(monkeypatch, int(0.4 * layers)):
        solve(case, checkpoints=tmp_path)
    with stopping(monkeypatch, int(0.7 * layers)):
        solve(case, checkpoints=tmp_path, restart=tmp_path)
    again = solve(case, checkpoints=tmp_path, restart=tmp_path)
    assert differences(whole, again) == {}
    for name in ("contact_nodes", "penetration_elsewhere", "watch", "mean_iterations_in_contact"):
        assert again.summary["details"][name] == whole.summary["details"][name]
    assert again.summary["energy"] == whole.summary["energy"]
    assert again.summary["bodies"] == whole.summary["bodies"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made", "method"),
    [
        (driven, "conserving"),
        (rolling, "conserving"),
        (rubbing, "conserving"),
        (rolling, "explicit"),
        (rubbing, "explicit"),
        (pumped, "explicit"),
    ],
)
def test_finite_strain_continues_too(made, method, tmp_path, monkeypatch):
    case = finite(made, method)
    whole = solve(case)
    with stopping(monkeypatch, int(0.6 * whole.summary["num_steps"])):
        solve(case, checkpoints=tmp_path)
    again = solve(case, restart=tmp_path)
    assert differences(whole, again) == {}
    assert whole.summary["contact"]["max_force"] > 0.0
    assert again.summary["bodies"] == whole.summary["bodies"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        rolling("conserving", linear_solver="gamg"),
        rolling("conserving", active_set="snes_vi"),
        finite(rolling, "conserving", linear_solver="gamg"),
    ],
)
def test_iterative_solvers_continue_too(case, tmp_path, monkeypatch):
    whole = solve(case)
    with stopping(monkeypatch, int(0.6 * whole.summary["num_steps"])):
        solve(case, checkpoints=tmp_path)
    assert differences(whole, solve(case, restart=tmp_path)) == {}


def thrown(**output):
    body = {
        "shape": {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 0.02]},
        "mesh_size": 0.25, "velocity": [0.0, -0.1],
    }  # fmt: skip
    return scene(body, [FLOOR], 1.5, None, {"method": "massless"}, {"every": 1} | output)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder as a killed run leaves it."""
    folder = tmp_path_factory.mktemp("kept")
    with pytest.MonkeyPatch.context() as patch, stopping(patch, 8):
        solve(thrown(), checkpoints=folder)
    return folder


@pytest.fixture
def folder(kept, tmp_path):
    """A copy of it to damage."""
    shutil.copytree(kept, tmp_path / "run")
    return tmp_path / "run"


def test_the_folder_to_damage_is_good(folder):
    assert differences(solve(thrown()), solve(thrown(), restart=folder)) == {}


def rewritten(change):
    def damage(folder):
        with np.load(folder / FILE) as file:
            data = dict(file)
        change(data)
        np.savez(folder / FILE, **data)

    return damage


def cut(share):
    def damage(folder):
        data = (folder / FILE).read_bytes()
        (folder / FILE).write_bytes(data[: int(share * len(data))])

    return damage


def flipped(folder):
    data = bytearray((folder / FILE).read_bytes())
    data[data.index(b"rows.sums.npy") + 1000] ^= 0xFF  # not in a header, where it may not matter
    (folder / FILE).write_bytes(data)


def one_array(folder):
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    (folder / FILE).write_bytes(buffer.getvalue())


def shortened(name):
    return rewritten(lambda data: data.update({name: data[name][:-1]}))


def overwritten(path):
    """Change a byte in the heads of the objects of an HDF5 file, which have checksums."""
    data = path.read_bytes().split(b"OHDR")
    path.write_bytes(b"OHDR".join([*data[:2], *(part[:8] + b"?" + part[9:] for part in data[2:])]))


READ = "no checkpoint that can be read"
AGAIN = "run the scene from its start"
DAMAGES = {
    "no file": (lambda folder: (folder / FILE).unlink(), [READ, "output.checkpoint = N"]),
    "empty": (lambda folder: (folder / FILE).write_bytes(b""), [READ, AGAIN]),
    "text": (lambda folder: (folder / FILE).write_text("no checkpoint"), [READ, AGAIN]),
    "a JSON file": (lambda folder: (folder / FILE).write_text(json.dumps({})), [READ, AGAIN]),
    "one array": (one_array, [READ, AGAIN]),
    "cut to half": (cut(0.5), [READ, AGAIN]),
    "cut at its end": (cut(0.99), [READ, AGAIN]),
    "a bit flipped": (flipped, [READ, AGAIN]),
    "a folder": (
        lambda folder: [(folder / FILE).unlink(), (folder / FILE).mkdir()],
        [READ, AGAIN],
    ),
    "no displacement": (
        rewritten(lambda data: data.pop("node.displacement")),
        ["is damaged", "node.displacement", AGAIN],
    ),
    "a node short": (shortened("node.velocity"), ["is damaged", "node.velocity", AGAIN]),
    "a contact node short": (shortened("march.contact.gap"), ["is damaged", "contact.gap", AGAIN]),
    "a row short": (shortened("rows.sums"), ["is damaged", "rows.sums", AGAIN]),
    "no answers": (
        rewritten(lambda data: data.pop("asked.nodes")),
        ["is damaged", "asked.nodes", AGAIN],
    ),
    "no layer": (rewritten(lambda data: data.pop("layer")), ["time step", AGAIN]),
    "too many layers": (
        rewritten(lambda data: data.update(layer=10_000)),
        ["is damaged", AGAIN],
    ),
    "another mesh": (
        rewritten(lambda data: data.update(body="0")),
        ["another mesh of this scene", AGAIN],
    ),
    "another step": (
        rewritten(lambda data: data.update(dt=0.5 * data["dt"])),
        ["time step", AGAIN],
    ),
    "another scene": (
        rewritten(lambda data: data.update(scene=thrown(every=2).to_toml())),
        ["belongs to another scene", "of that folder"],
    ),
    "no fields": (lambda folder: (folder / SPOOL).unlink(), [SPOOL]),
    "fields cut": (
        lambda folder: (folder / SPOOL).write_bytes((folder / SPOOL).read_bytes()[:3000]),
        [SPOOL],
    ),
    "fields overwritten": (lambda folder: overwritten(folder / SPOOL), [SPOOL]),
}


@pytest.mark.parametrize(("damage", "parts"), DAMAGES.values(), ids=DAMAGES)
def test_what_cannot_be_continued_is_said(folder, damage, parts):
    damage(folder)
    begin = time.monotonic()
    with pytest.raises(OutputError) as caught:
        solve(thrown(), restart=folder)
    assert time.monotonic() - begin < 10.0  # HDF5 would look for minutes for a writer to be done
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize("text", ["", "no checkpoint", None])
def test_a_broken_checkpoint_names_no_scene(folder, text):
    from impactfem.marching.checkpoint import scene_of

    if text is None:
        rewritten(lambda data: data.pop("scene"))(folder)
    else:
        (folder / FILE).write_text(text)
    with pytest.raises(OutputError, match="no checkpoint"):
        scene_of(folder)


def test_a_new_run_forgets_the_older_checkpoint(folder, monkeypatch):
    """A run killed before its first checkpoint must not continue another's."""
    with stopping(monkeypatch, 2):
        solve(thrown(), checkpoints=folder)
    with pytest.raises(OutputError, match=READ):
        solve(thrown(), restart=folder)


def test_a_mesh_file_that_was_changed_is_noticed(tmp_path, monkeypatch):
    script = (
        'SetFactory("OpenCASCADE"); Rectangle(1) = {{0, 0.02, 0, 1, {height}}}; '
        'Physical Surface("body") = {{1}}; MeshSize{{:}} = 0.25;'
    )
    (tmp_path / "body.geo").write_text(script.format(height=0.5))
    body = {"mesh": "body.geo", "velocity": [0.0, -0.1]}
    case = scene(body, [FLOOR], 1.5, None, {"method": "massless"}, {})
    case = impactfem.Scene.from_dict(case.to_dict(), base=tmp_path)
    with stopping(monkeypatch, 8):
        solve(case, checkpoints=tmp_path)
    forget()
    (tmp_path / "body.geo").write_text(script.format(height=0.6))
    with pytest.raises(OutputError, match="another mesh of this scene"):
        solve(case, restart=tmp_path)


def test_output_settings_are_those_of_the_scene_not_of_an_earlier_one():
    """The model in memory serves scenes with other settings too."""
    first, second = solve(thrown(every=1)), solve(thrown(every=4))
    layers = second.summary["num_steps"]
    assert len(first.fields) == layers + 1
    assert len(second.fields) == len({*range(0, layers, 4), layers})
    assert solve(thrown(fields=[])).fields is None
