"""The demos of bars in a row do what their pages say."""

import re
from pathlib import Path

import pytest
from demo_process import script

import impactfem
from impactfem.shipped import shipped_scenes

DEMOS = Path(__file__).resolve().parents[2] / "demos"
SCRIPTS = {"two_bars": "speeds.png", "wave_cradle": "odd_one.png"}


@pytest.mark.parametrize("name", SCRIPTS)
def test_scene_of_a_demo_is_the_shipped_one(name):
    mine = (DEMOS / name / "scene.toml").read_text(encoding="utf-8")
    assert mine == shipped_scenes()[name].read_text(encoding="utf-8")


def page(name):
    return (DEMOS / name / "README.md").read_text(encoding="utf-8")


def output(name, folder):
    """What the script of a demo prints."""
    said = script(DEMOS / name / "script.py", folder)
    assert (folder / SCRIPTS[name]).stat().st_size > 5000
    return said


def test_short_bar_stops_with_the_force_of_the_page():
    result = impactfem.solve(impactfem.Scene.from_toml(shipped_scenes()["two_bars"]))
    assert float(result.history["short.vx"][-1]) == pytest.approx(0.0, abs=1e-9)
    assert float(result.history["long.vx"][-1]) == pytest.approx(2.0, rel=1e-9)
    (force,) = re.findall(r"= (\d+) N\.", page("two_bars"))
    assert result.summary["contact"]["max_force"] == pytest.approx(float(force), rel=1e-9)
    ((begin, end),) = result.summary["contact"]["intervals"]
    assert end - begin == pytest.approx(0.4e-3, rel=1e-6)
    (kept,) = re.findall(r"keeps its value to (1e-\d+)", page("two_bars"))
    assert result.summary["energy"]["max_relative_drift"] <= float(kept)


def test_script_of_two_bars_gives_the_closed_forms(tmp_path):
    text = output("two_bars", tmp_path)
    found = {
        label: [float(x) for x in re.findall(r"-?\d[\d.e-]*", line)]
        for label, line in re.findall(r"(?m)^(.*?): speeds (.*)$", text)
    }
    assert found["length 1/2"] == pytest.approx([0.0, 0.5, 0.5], abs=1e-9)
    assert found["impedance 2"] == pytest.approx([-1 / 3, 2 / 3, 0.0], abs=1e-9)
    assert found["impedance 1/2"] == pytest.approx([1 / 3, 4 / 3, 0.0], abs=1e-9)


@pytest.mark.slow
def test_cradle_and_its_variants_are_those_of_the_page(tmp_path):
    text = output("wave_cradle", tmp_path)
    assert "equal                 speeds 0.000, 0.000, 0.000, 0.000, 0.000, 5.000" in text
    for speed in re.findall(r"at\s+([\d.]+) m/s", page("wave_cradle")):
        assert float(speed) in {abs(float(x)) for x in re.findall(r"-?\d+\.\d{3}|5", text)}
