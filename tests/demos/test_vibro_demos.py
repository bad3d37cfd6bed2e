"""The demos of points and beams do what their pages say."""

import re
import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest

import impactfem
from impactfem.shipped import shipped_scenes

TOP = Path(__file__).resolve().parents[2]
DEMOS = TOP / "demos"
SCENES = ("oscillator", "corner", "vibrating_table", "dropped_beam")


@pytest.mark.parametrize("name", SCENES)
def test_scene_of_a_demo_is_the_shipped_one(name):
    mine = (DEMOS / name / "scene.toml").read_text(encoding="utf-8")
    assert mine == shipped_scenes()[name].read_text(encoding="utf-8")


def solved(name, **settings):
    return impactfem.solve(impactfem.Scene.from_toml(shipped_scenes()[name]), **settings)


def page(name):
    return (DEMOS / name / "README.md").read_text(encoding="utf-8")


def test_oscillator_hops_as_high_as_its_page_says():
    result = solved("oscillator")
    late = result.history["gap"].sel(time=slice(2.0, None))
    (height,) = re.findall(r"hops (\d+) micrometres high once", page("oscillator"))
    assert 1e6 * float(late.max()) == pytest.approx(float(height), abs=0.5)
    assert float(result.history["mass.x"].max()) == pytest.approx(0.806, abs=2e-4)
    coarse = solved("oscillator", method="paoli_schatzman", dt=5e-3, estimate=False)
    late = coarse.history["gap"].sel(time=slice(2.0, None))
    (high,) = re.findall(r"step 0.005 hops (\d+) micrometres", page("oscillator"))
    assert 1e6 * float(late.max()) == pytest.approx(float(high), abs=0.6)


def test_corner_is_left_as_by_two_reflections():
    result = solved("corner")
    first, second = (np.array(o.unit_normal) for o in reversed(result.scene.obstacles))
    velocity = np.array(result.scene.bodies[0].velocity)
    for normal in (first, second):
        velocity = velocity - 2.0 * (normal @ velocity) * normal
    found = [float(result.history[f"ball.v{c}"][-1]) for c in "xy"]
    assert found == pytest.approx(velocity, abs=1e-12)
    assert result.summary["verdict"]["level"] == "trust"


def test_ball_is_caught_by_the_table():
    result = solved("vibrating_table")
    spells = result.summary["details"]["sticking"]
    (start,) = re.findall(r"after ([\d.]+) s of irregular bounces", page("vibrating_table"))
    assert spells[0][0] == pytest.approx(float(start), abs=0.2)
    # It rests once in each period from then on.
    period = 2.0 * np.pi / 99.3
    late = np.array([s[0] for s in spells if s[0] > 4.0])
    assert np.diff(late) / period == pytest.approx(np.ones(len(late) - 1), abs=0.2)


def test_beam_rebounds_as_its_page_says():
    episode = solved("dropped_beam").summary["details"]["episode"]
    (restitution,) = re.findall(r"apparent restitution ([\d.]+);", page("dropped_beam"))
    assert episode["restitution"] == pytest.approx(float(restitution), abs=2e-3)
    assert episode["micro_impacts"] == 7
    assert episode["is_over"]


def test_examples_of_the_guide_run(tmp_path, capsys):
    text = (TOP / "docs/vibro_impact.md").read_text(encoding="utf-8")
    (scene,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    result = impactfem.solve(impactfem.Scene.from_dict(tomllib.loads(scene)))
    assert result.summary["status"] == "completed"
    (script,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    path = tmp_path / "pendulum.py"
    path.write_text(script, encoding="utf-8")
    runpy.run_path(str(path))
    assert "6 impacts, the first at 0.643" in capsys.readouterr().out
