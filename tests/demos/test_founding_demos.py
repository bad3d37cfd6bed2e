"""The demos of the founding benchmarks: they run, and their pages promise what they deliver."""

import re
from pathlib import Path

import numpy as np
import pytest
from demo_process import script

import impactfem
from impactfem.reference.bar import exact_bar
from impactfem.reference.bar_row import exact_row
from impactfem.shipped import shipped_scenes

TOP = Path(__file__).resolve().parents[2]
DEMOS = TOP / "demos"
PICTURES = {
    "gravity_impact": ["motion", "check"],
    "step_load": ["motion"],
    "point_mass": ["family"],
}
SCENES = {
    "gravity_impact": "gravity_impact",
    "step_load": "step_load",
    "bouncing": "irregular_bounces",
}


def plot(name, *arguments):
    return script(DEMOS / name / "plot.py", *arguments)


def shipped(name):
    return impactfem.Scene.from_toml(shipped_scenes()[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_plot_draws_its_pictures(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = plot(name, *(["elsewhere"] if name == "point_mass" else []))
    folder = tmp_path / ("elsewhere" if name == "point_mass" else f"results/{name}_script")
    for picture in PICTURES[name]:
        file = folder / f"{picture}.png"
        assert file.read_bytes().startswith(b"\x89PNG")
        assert 10_000 < file.stat().st_size < 150_000
        assert str(file.relative_to(tmp_path)) in said
    errors = re.findall(r"formula against characteristics: (\S+) m", said)
    assert len(errors) == (name in {"gravity_impact", "step_load"})
    assert all(float(error) < 1e-12 for error in errors)


@pytest.mark.parametrize(("demo", "scene"), SCENES.items())
def test_scene_of_a_demo_is_the_shipped_one(demo, scene):
    mine = (DEMOS / demo / "scene.toml").read_text(encoding="utf-8")
    assert mine == shipped_scenes()[scene].read_text(encoding="utf-8")


@pytest.mark.parametrize("name", shipped_scenes())
def test_shipped_scenes_make_contact(name):
    scene = shipped(name)
    if not scene.bars:
        pytest.skip("other bodies have no exact solution: the demos of each kind")
    assert len(scene.title) > 10
    exact = exact_row(scene) if len(scene.bars) > 1 else exact_bar(scene)
    assert any(exact.contacts)


def numbers(name, row):
    """Cells of a row of a demo's table."""
    page = (DEMOS / name / "README.md").read_text(encoding="utf-8")
    line = re.search(rf"(?m)^\| {re.escape(row)}.*\|$", page)[0]
    return [float(cell) for cell in line.strip("|").split("|")[1:]]


@pytest.mark.parametrize("name", ["gravity_impact", "step_load"])
def test_errors_are_those_of_the_page(name):
    expected = zip(
        numbers(name, "n"), numbers(name, "displacement error"), numbers(name, "force error"),
        strict=True,
    )  # fmt: skip
    for elements, displacement, force in expected:
        result = impactfem.solve(shipped(name), method="galerkin", elements=int(elements))
        error = result.summary["error"]
        assert error["displacement_max"] == pytest.approx(displacement, rel=0.03)
        assert error["force_l1"] == pytest.approx(force, rel=0.03)


def test_impact_on_a_layer_is_exact():
    scene = shipped("gravity_impact").with_settings({"body.bar.gap": 0.55})
    result = impactfem.solve(scene, method="galerkin", elements=10)
    assert result.summary["error"]["displacement_max"] < 1e-13


def test_step_load_leaves_without_vibration():
    exact = exact_bar(shipped("step_load"))
    kinetic, elastic = exact.energy([3.0, 3.5, 4.0])
    assert max(elastic) < 1e-25
    assert kinetic == pytest.approx(0.5 * 0.35, rel=1e-12)


def test_bounces_are_those_of_the_page():
    contacts = exact_bar(shipped("irregular_bounces")).contacts
    page = (DEMOS / "bouncing" / "README.md").read_text(encoding="utf-8")
    line = re.search(r"(?m)^- Irregular: contacts (.*) s\.$", page)[1]
    pairs = [[float(t) for t in pair.split(" to ")] for pair in line.split(", ")]
    assert np.array(pairs) == pytest.approx(np.array(contacts), abs=6e-5)
    regular = exact_bar(shipped("doyen_bounces")).contacts
    assert [start for start, _ in regular] == pytest.approx([1 + k * 8 / 3 for k in range(8)])


def test_bouncing_scenes_scale():
    scene = shipped("irregular_bounces")
    small = scene.with_settings(
        {"body.bar.gap": 0.005, "body.bar.velocity": -0.02, "gravity": 0.01}
    )
    assert np.array(exact_bar(small).contacts) == pytest.approx(np.array(exact_bar(scene).contacts))


def test_impact_between_falls_between():
    scene = shipped("bar_impact_between")
    start = exact_bar(scene).contacts[0][0]
    for elements in (10, 20, 40, 80, 160):
        layer = start * elements % 1.0
        assert 0.02 < layer < 0.98, elements
    assert start * 160 % 1.0 == pytest.approx(0.4)


def solved_by(solver):
    return impactfem.solve(
        shipped("bar_impact"), method="monolithic", elements=20, active_set=solver
    )


def test_variational_inequality_loses_the_last_half_force():
    # docs/benchmarks.md: h v0^2/4 of energy, h/2 v0 of momentum, n/2 + 1 iterations.
    inequality, primal_dual = solved_by("snes_vi"), solved_by("pdas")
    final = [float(run.history["total_energy"][-1]) for run in (inequality, primal_dual)]
    assert final[1] == pytest.approx(0.125, abs=1e-12)
    assert final[1] - final[0] == pytest.approx(0.05 * 0.25 / 4, rel=1e-6)
    assert inequality.summary["contact"]["impulse"] == pytest.approx(1.0 - 0.025 * 0.5, rel=1e-9)
    assert inequality.summary["active_set"]["iterations"] <= 12
    assert inequality.summary["error"]["displacement_max"] == pytest.approx(0.05, rel=1e-6)


def test_pictures_of_the_page_exist():
    text = (TOP / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    pictures = re.findall(r"!\[[^]]+\]\(([^)]+)\)", text)
    assert len(pictures) >= 6
    for picture in pictures:
        assert (TOP / "docs" / picture).stat().st_size < 150_000
    for target in re.findall(r"\]\(([^)#:]+\.md)", text):
        assert (TOP / "docs" / target).exists()
