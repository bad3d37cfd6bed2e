"""Points, rods, beams and rigid bodies that start at rest, alone and on what gives way."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

G = 9.81
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
GROUND = {"kind": "half_space", "name": "floor", "point": [0.0] * 3, "normal": [0.0, 0.0, 1.0]}
BLOCK = {
    "kind": "solid", "name": "s", "model": "plane_strain", "strain": "small", "density": 1100.0,
    "youngs_modulus": 1e6, "poisson_ratio": 0.3, "mesh_size": 0.025,
    "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 0.0]},
    "supports": [{"surface": "bottom", "kind": "fixed"}],
}  # fmt: skip


def box(corner, size=(0.04, 0.02), name="b", **more):
    shape = {"kind": "block", "size": list(size), "corner": list(corner)}
    return {"kind": "rigid", "name": name, "density": 1000.0, "shape": shape} | more


def point(height, name="b", **more):
    at = {"mass": 0.1, "radius": 0.01, "position": [0.05, height]}
    return {"kind": "point", "name": name} | at | more


def scene(bodies, obstacles=(FLOOR,), gravity=(0.0, -G), dt=1e-4, **more):
    return Scene.from_dict(
        {
            "title": "at rest", "duration": 5e-3, "start": "static", "gravity": list(gravity),
            "body": list(bodies), "obstacle": list(obstacles),
            "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
        } | more
    )  # fmt: skip


def rests(made, weight):
    """The history of a run that stays where it starts, its bodies carried by what is below."""
    history = impactfem.solve(made).history
    scale = weight * G * 0.01
    assert history["kinetic_energy"].values.max() < 1e-9 * scale
    assert np.ptp(history["total_energy"].values) < 1e-9 * scale
    return history


@pytest.mark.parametrize("tilt", [0.0, 1e-5, 1e-3, 0.05, -0.02])
def test_a_box_falls_flat_on_the_floor(tilt):
    history = rests(scene([box((0.03, 0.05), angle=tilt)]), 0.8)
    assert history["b.y"].values[-1] == pytest.approx(0.01, abs=1e-11)
    assert history["b.angle"].values[-1] == pytest.approx(0.0, abs=1e-10)
    assert history["contact_force"].values == pytest.approx(0.8 * G, rel=1e-9)


@pytest.mark.parametrize("tilt", [0.0, 1e-4, 0.01])
def test_a_box_in_space_falls_flat(tilt):
    turned = {"axis": [1.0, 0.3, 0.0], "angle": tilt}
    body = box((0.03, 0.0, 0.01), (0.04, 0.04, 0.02), orientation=turned)
    history = rests(scene([body], [GROUND], (0.0, 0.0, -G)), 0.032)
    assert history["b.z"].values[-1] == pytest.approx(0.01, abs=1e-11)
    assert history["contact_force"].values == pytest.approx(0.032 * G, rel=1e-7)


def test_boxes_and_points_rest_on_each_other():
    stack = [box((0.03, 0.0)), box((0.035, 0.05), (0.03, 0.03), "c"), point(0.2, "p")]
    history = rests(scene(stack), 1.8)
    heights = [history[f"{name}.y"].values[-1] for name in "bcp"]
    assert heights == pytest.approx([0.01, 0.035, 0.06], abs=1e-9)
    assert history["force.b.floor"].values[-1] == pytest.approx(1.8 * G, rel=1e-9)
    assert history["force.b.c"].values[0] == pytest.approx(1.0 * G, rel=1e-9)


def test_a_rod_lies_down():
    rod = {"kind": "rod", "name": "b", "length": 0.1, "mass": 0.1, "radius": 0.005,
           "center": [0.05, 0.1], "inclination": 0.01}  # fmt: skip
    history = rests(scene([rod]), 0.1)
    assert history["b.y"].values[-1] == pytest.approx(0.005, abs=1e-12)
    assert history["b.angle"].values[-1] == pytest.approx(0.0, abs=1e-12)


def test_a_point_hangs_on_its_spring():
    hung = point(0.3, springs=[{"stiffness": 100.0, "anchor": [0.05, 0.4], "rest_length": 0.05}])
    history = rests(scene([hung]), 0.1)
    assert history["b.y"].values[-1] == pytest.approx(0.35 - 0.1 * G / 100.0, abs=1e-12)


def test_a_cantilever_sags_by_its_weight():
    """Its mean by q L^4 / (20 E I)."""
    beam = {"kind": "beam", "name": "b", "length": 1.0, "youngs_modulus": 1e9, "density": 1000.0,
            "width": 0.02, "height": 0.02, "elements": 8, "center": [0.5, 0.1],
            "supports": [{"end": "first", "kind": "clamped"}]}  # fmt: skip
    history = rests(scene([beam], [FLOOR | {"point": [0.0, -1.0]}]), 0.4)
    sag = 1000.0 * 0.02**2 * G / (20.0 * 1e9 * 0.02**4 / 12.0)
    assert 0.1 - history["b.y"].values[-1] == pytest.approx(sag, rel=1e-5)


@pytest.mark.parametrize(
    ("method", "strain"),
    [("conserving", "small"), ("massless", "small"), ("explicit", "small"),
     ("conserving", "finite")],
)  # fmt: skip
def test_a_box_rests_on_a_soft_block(method, strain):
    """As deep as a start from there and back would have it, whatever marches on."""
    made = scene(
        [BLOCK | {"strain": strain}, box((0.03, 0.1))],
        solve={"method": method, "dt": 1e-4, "estimate": False},
    )
    history = rests(made, 0.8)
    assert history["force.s.b"].values == pytest.approx(0.8 * G, rel=1e-6)
    assert 1e-5 < 0.11 - history["b.y"].values[0] < 1e-4


def on_a_block():
    made = scene([BLOCK, box((0.03, 0.1)), point(0.2, "p", velocity=[0.0, -1.0])], dt=2e-4)
    return made.with_settings({"output.checkpoint": 10})


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    check_restart(on_a_block(), 15, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    spin = 1.0 / 0.02  # [rad/s], by what strikes the box with 1 m/s at its half width
    check_ranks(on_a_block, monkeypatch, {"b.spin": spin})


@pytest.mark.parametrize(
    ("bodies", "more", "says"),
    [
        ([point(0.02)], {"gravity": [1.0, -G]}, "nothing holds body b against its translation"),
        ([box((0.0, 0.1), angle=0.7)], {"gravity": [1.0, -G]}, "nothing holds body b against"),
    ],
)
def test_what_nothing_holds_is_said(bodies, more, says):
    with pytest.raises(SceneError, match=says):
        impactfem.solve(scene(bodies, **more))
