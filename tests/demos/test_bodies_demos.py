"""The demos of bodies that strike each other: scenes are the shipped ones, pages hold."""

import re
from pathlib import Path

import numpy as np
import pytest

import impactfem
from impactfem.shipped import shipped_scenes

DEMOS = Path(__file__).resolve().parents[2] / "demos"
NAMES = ("ball_on_plate", "colliding_discs", "block_stack")


def solved(path, **settings):
    scene = impactfem.Scene.from_toml(path)
    return impactfem.solve(scene.with_settings({"output.fields": []} | settings))


def page(demo):
    return (DEMOS / demo / "README.md").read_text(encoding="utf-8")


def cells(demo, row):
    """Numbers in brackets or not of a row of the page's table."""
    line = re.search(rf"(?m)^\| {re.escape(row)}.*\|$", page(demo))[0]
    return [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?", line.split("|", 2)[2])]


@pytest.mark.parametrize("demo", NAMES)
def test_scene_of_a_demo_is_the_shipped_one(demo):
    mine = (DEMOS / demo / "scene.toml").read_text(encoding="utf-8")
    assert mine == shipped_scenes()[demo].read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("scene", "row"),
    [
        ("scene", "plate of 10 mm"),
        pytest.param("scene_3d", "the same, a quarter", marks=pytest.mark.slow),
    ],
)
def test_ball_leaves_the_plate_as_its_page_says(scene, row):
    result = solved(DEMOS / "ball_on_plate" / f"{scene}.toml")
    force, duration, speed = cells("ball_on_plate", row)[-3:]
    ((start, end),) = result.summary["contact"]["intervals"]
    # Meshes differ a little between versions of Gmsh.
    assert result.summary["contact"]["max_force"] == pytest.approx(force, rel=0.01)
    assert 1e3 * (end - start) == pytest.approx(duration, rel=0.02)
    assert float(result.history["ball.vy"][-1]) / 0.5 == pytest.approx(speed, abs=0.01)
    assert result.summary["energy"]["max_relative_drift"] < 1e-9


@pytest.mark.slow
def test_struck_disc_leaves_near_the_line_of_centres():
    result = solved(shipped_scenes()["colliding_discs"])
    last = result.history.isel(time=-1)
    angle, rigid, speed, fastest = cells("colliding_discs", "50 mm")
    vx, vy = float(last["right.vx"]), float(last["right.vy"])
    assert rigid == pytest.approx(np.degrees(np.arcsin(0.5)))
    assert fastest == pytest.approx(np.cos(np.arcsin(0.5)), abs=1e-3)
    assert np.degrees(np.arctan2(vy, vx)) == pytest.approx(angle, abs=0.3)
    assert np.hypot(vx, vy) == pytest.approx(speed, abs=3e-3)
    # It turns a little further, by sliding, and is a little slower, by vibration.
    assert rigid < angle < rigid + 3.0
    momentum = result.history["momentum"].values
    assert np.ptp(momentum) < 1e-11 * momentum[0]
    mass = 1100.0 * np.pi * 0.05**2
    assert momentum[0] == pytest.approx(mass, rel=0.01)  # polygons are a little smaller


def test_stack_comes_to_rest_under_its_weight():
    result = solved(shipped_scenes()["block_stack"])
    weights = 9.81 * 1100.0 * 0.05 * np.array([0.1, 0.1, 0.08])
    carried = np.cumsum(weights[::-1])
    history = result.history
    force = history["contact_force"].values
    assert force[-1] == pytest.approx(carried.sum(), rel=1e-9)
    assert np.ptp(force[-100:]) < 1e-8 * force[-1]
    for name in ("low", "middle", "top"):
        assert abs(float(history[f"{name}.vy"][-1])) < 1e-12
        assert np.abs(history[f"{name}.x"].values).max() < 1e-10
    assert [f"{value:.3f}" in page("block_stack") for value in carried] == [True] * 3
    assert np.diff(history["total_energy"].values).max() < 1e-10  # J; damping only takes
