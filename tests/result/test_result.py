"""A result survives the way to disk and back, and its pictures show what they should."""

import json

import numpy as np
import pytest

import impactfem
from impactfem.result.history import COLUMNS


@pytest.fixture(scope="module")
def result():
    scene = impactfem.Scene(
        title="Ärger & <Stoß>",
        duration=5.0,
        bodies=[
            impactfem.Bar(
                name="rod", length=1.0, density=1.0, youngs_modulus=1.0, gap=0.5, velocity=-0.5
            )
        ],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="monolithic", elements=20),
    )
    return impactfem.solve(scene)


def test_saved_result_loads_the_same(result, tmp_path):
    folder = result.save(tmp_path / "out")
    again = impactfem.Result.load(folder)
    assert again.history.identical(result.history)
    assert again.summary == json.loads(json.dumps(result.summary))
    assert np.array_equal(again.fields.displacement, result.fields.displacement)
    assert again.scene == result.scene
    assert again.exact.identical(result.exact)


def test_csv_holds_the_columns_of_the_contract(result, tmp_path):
    folder = result.save(tmp_path / "out", pictures=False)
    header = (folder / "history.csv").read_text().splitlines()[0].split(",")
    motion = [f"rod.{name}" for name in ("x", "y", "z", "vx", "vy", "vz")]
    pairs = ["force.rod.wall", "gap.rod.wall"]
    assert header == ["time", *COLUMNS, "angular_momentum", *motion, *pairs]
    table = np.loadtxt(folder / "history.csv", delimiter=",", skiprows=1)
    for index, name in enumerate(header):
        assert np.array_equal(table[:, index], result.history[name].values), name


def test_history_carries_units(result):
    assert result.history["contact_force"].attrs["units"] == "N"
    assert result.history["rod.vx"].attrs["units"] == "m/s"
    assert result.history["time"].attrs["units"] == "s"


def test_saved_scene_runs_to_the_same_answer(result, tmp_path):
    folder = result.save(tmp_path / "out", pictures=False)
    again = impactfem.solve(impactfem.Scene.from_toml(folder / "scene.toml"))
    assert np.array_equal(again.history["gap"].values, result.history["gap"].values)


def test_figures_show_the_data(result):
    figures = result.plot()
    assert set(figures) == {
        "displacement", "world_lines", "velocity_map", "strain", "contact_force", "energy",
        "active_set",
    }  # fmt: skip
    force = figures["contact_force"].axes[0]
    exact = next(line for line in force.lines if line.get_label() == "exact")
    assert max(exact.get_ydata()) == pytest.approx(0.5)
    stairs = force.patches[0].get_data()
    assert stairs.values.max() == pytest.approx(0.5)
    position = figures["world_lines"].axes[0]
    assert max(line.get_ydata().max() for line in position.lines) == pytest.approx(2.0)
    labels = {line.get_label() for line in figures["energy"].axes[0].lines}
    assert labels == {"kinetic", "elastic", "total"}


def test_exact_method_agrees_with_the_finite_elements(result):
    exact = impactfem.solve(result.scene, method="exact")
    for name in ("gap", "contact_force", "rod.x"):
        assert exact.history[name].values == pytest.approx(
            result.history[name].values, abs=1e-10
        ), name
    assert exact.summary["method"] == "exact"
    assert exact.summary["error"]["displacement_max"] <= 1e-12
    assert exact.summary["contact"]["intervals"][0] == pytest.approx([1.0, 3.0])
