"""A solid's result survives the way to disk and back."""

import json

import numpy as np
import pytest
from synthetic import solid_result

from impactfem import Result
from impactfem.errors import OutputError
from impactfem.result import Fields, StoredSnapshots

FORMATS = ("vtkhdf", "vtx", "pvd")


@pytest.fixture
def result(tmp_path):
    """With all formats of fields, in a passing folder."""
    passing = tmp_path / "passing"
    passing.mkdir()
    made = solid_result(passing / "spool.vtkhdf", layers=5)
    scene = made.scene.with_settings({"output.fields": list(FORMATS)})
    fields = StoredSnapshots(passing / "spool.vtkhdf", passing=passing)
    return Result(scene, made.history, made.summary, fields)


def test_a_saved_result_loads_the_same_and_reads_fields_when_asked(result, tmp_path):
    folder = result.save(tmp_path / "out", pictures=False)
    names = {"scene.toml", "history.csv", "history.nc", "summary.json"}
    fields = {"fields.vtkhdf", "fields.bp", "fields.pvd", "fields_pvd"}
    assert {path.name for path in folder.iterdir()} == names | fields
    again = Result.load(folder)
    assert isinstance(again.fields, StoredSnapshots)
    assert again.scene == result.scene
    assert again.summary == json.loads(json.dumps(result.summary))
    assert again.history.equals(result.history)
    for name, values in result.fields.read(2).items():
        assert np.array_equal(again.fields.read(2)[name], values, equal_nan=True)
    # The result stays usable, and a loaded one can be saved elsewhere and over itself.
    assert len(result.fields.read(0)) == 7
    again.save(folder, pictures=False)
    again.save(tmp_path / "other", pictures=False)
    assert len(Result.load(tmp_path / "other").fields) == len(Result.load(folder).fields) == 5


@pytest.mark.slow
def test_the_command_plot_draws_solids_again(result, tmp_path, capsys):
    from impactfem.cli import main

    folder = result.save(tmp_path / "out", pictures=False)
    assert main(["plot", str(folder)]) == 0
    pictures = [
        "contact_force.png", "motion.png", "velocity.png", "energy.png", "body.png", "motion.gif",
    ]  # fmt: skip
    pictures.append("report.html")
    assert capsys.readouterr().out.split() == [str(folder / name) for name in pictures]
    assert all((folder / name).stat().st_size > 1000 for name in pictures)
    # A later result without pictures leaves none behind.
    result.save(folder, pictures=False)
    assert not any((folder / name).exists() for name in pictures)


def test_a_full_disk_is_noticed_before_anything_is_written(result, tmp_path, monkeypatch):
    asked = []

    def full(_, size):
        asked.append(size)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("impactfem.result.record.reserve", full)
    with pytest.raises(OutputError, match=r"out: cannot be written \(No space left"):
        result.save(tmp_path / "out", pictures=False)
    assert asked == [result.fields.path.stat().st_size]
    assert not (tmp_path / "out").exists()


def test_a_broken_field_file_is_an_output_error(result, tmp_path):
    folder = result.save(tmp_path / "out", pictures=False)
    (folder / "fields.vtkhdf").write_bytes(b"noise")
    with pytest.raises(OutputError, match=r"fields\.vtkhdf: not a field file of impactfem"):
        Result.load(folder)


def test_bars_still_have_their_own_fields(tmp_path):
    import impactfem

    scene = impactfem.Scene(
        title="bar",
        duration=0.5,
        bodies=[impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.1, velocity=-1)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="exact", elements=4),
    )
    folder = impactfem.solve(scene).save(tmp_path / "out", pictures=False)
    assert isinstance(Result.load(folder).fields, Fields)
