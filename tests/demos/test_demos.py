"""The demo, the meshes and what README promises of them."""

import os
import re
import shutil
import sys
from pathlib import Path

import pytest
from demo_process import run, script

import impactfem

TOP = Path(__file__).resolve().parents[2]
DEMO = TOP / "demos" / "bar_impact"
README = (TOP / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A scratch folder as the current one: the demos write into ./results."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    return tmp_path


def python_blocks(text):
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


def test_readme_shows_the_script():
    assert (DEMO / "script.py").read_text(encoding="utf-8") in python_blocks(README)


@pytest.mark.parametrize("command", ["make demo", "make test", "make setup"])
def test_readme_names_the_commands(command):
    assert command in README
    assert re.search(rf"(?m)^{command.split()[1]}:", (TOP / "Makefile").read_text(encoding="utf-8"))


def test_readme_names_the_system_packages():
    listed = (TOP / ".ci" / "system-packages.txt").read_text(encoding="utf-8")
    packages = re.sub("#.*", "", listed).split()
    line = re.search(r"apt-get install ((?:.|\\\n)*?)\n(?!\s)", README)
    assert sorted(line[1].replace("\\", " ").split()) == sorted(packages)


@pytest.mark.parametrize(
    "page",
    sorted([*TOP.glob("*.md"), *(TOP / "demos").rglob("*.md"), *(TOP / "meshes").glob("*.md")]),
)
def test_relative_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_every_public_name_is_documented():
    page = (TOP / "docs" / "api.md").read_text(encoding="utf-8")
    public = [name for name in impactfem.__all__ if f"impactfem.{name}" not in page]
    for room in impactfem._ROOMS:
        names = getattr(impactfem, room).__all__
        public += [
            f"{room}.{name}" for name in names
            if name not in impactfem.__all__ and f"impactfem.{room}.{name}" not in page
        ]  # fmt: skip
    assert public == []


@pytest.mark.slow
def test_script(elsewhere):
    said = run(sys.executable, str(DEMO / "script.py")).splitlines()
    assert [line.split()[0] for line in said[:3]] == ["10", "20", "40"]
    assert float(said[3].split()[0]) == pytest.approx(0.5, rel=1e-10)
    assert impactfem.Result.load(elsewhere / "results" / "script").summary["status"] == "completed"


@pytest.mark.slow
def test_plot_without_arguments(elsewhere):
    script(DEMO / "plot.py")
    picture = elsewhere / "results" / "bar_impact_force.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    errors = [
        impactfem.Result.load(folder).summary["error"]["displacement_max"]
        for folder in sorted((elsewhere / "results").glob("bar_impact_[0-9]*"))
    ]
    assert len(errors) == 3
    # First order: the impact lies between layers.
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.05)


@pytest.mark.slow
def test_plot_of_a_run(elsewhere):
    script(DEMO / "script.py")
    script(DEMO / "plot.py", "results/script", "--out", "force.png")
    assert (elsewhere / "force.png").stat().st_size > 1000


@pytest.mark.skipif(os.name == "nt" or not shutil.which("bash"), reason="a shell script")
@pytest.mark.slow
def test_run_script_on_two_ranks(elsewhere):
    run(str(DEMO / "run.sh"), "2")
    summary = impactfem.Result.load(elsewhere / "results" / "bar_impact").summary
    assert summary["ranks"] == 2
    assert summary["error"]["displacement_max"] < 1e-11


def solved_on(mesh):
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    return impactfem.solve(scene.with_settings({"solve.mesh": str(mesh)}))


def test_geo_mesh_gives_what_the_built_mesh_gives():
    by_file = solved_on(TOP / "meshes" / "bar_spacetime.geo")
    built = impactfem.solve(impactfem.Scene.from_toml(DEMO / "scene.toml"), elements=40)
    for name in ("displacement_max", "displacement_l2", "force_l1"):
        assert by_file.summary["error"][name] == pytest.approx(
            built.summary["error"][name], abs=1e-12
        )
    assert by_file.summary["active_set"]["set_changes"] == [160, 80, 0]
    for name in ("gap", "contact_force", "total_energy"):
        difference = by_file.history[name] - built.history[name]
        assert float(abs(difference).max()) < 1e-11


def test_mesh_without_layers_fits_the_scene_and_is_not_trusted():
    with pytest.raises(impactfem.errors.MeshError, match="unstable on it"):
        solved_on(TOP / "meshes" / "bar_unstructured.geo")
