"""Edges and faces of rigid bodies on ends of bars and on polylines."""

import math

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene

LENGTH, DENSITY, YOUNG, AREA = 0.3, 7800.0, 210e9, 1e-4
SPEED, MASS = math.sqrt(YOUNG / DENSITY), DENSITY * AREA * LENGTH


def scene(bodies, laws, duration, dt=None, **more):
    return Scene.from_dict(
        {"title": "edges", "duration": duration, "body": bodies, "contact": laws,
         "output": {"fields": []}, "solve": {"estimate": False} | ({"dt": dt} if dt else {})} | more
    )  # fmt: skip


def bar(dim):
    return {"kind": "bar", "name": "bar", "density": DENSITY, "youngs_modulus": YOUNG,
            "length": LENGTH, "area": AREA, "far_end": "clamped",
            "point": [0.0] * dim, "axis": [0.0] * (dim - 1) + [-1.0]}  # fmt: skip


def falling(shape, dim):
    return {"kind": "rigid", "name": "box", "mass": MASS, "shape": shape,
            "velocity": [0.0] * (dim - 1) + [-1.0]}  # fmt: skip


SHAPES = [
    ({"kind": "block", "size": [0.05, 0.05], "corner": [-0.025, 0.0]}, 2),
    ({"kind": "hull", "points": [[-0.03, 0.0], [0.03, 0.0], [0.0, 0.05]]}, 2),
    ({"kind": "block", "size": [0.05, 0.05, 0.05], "corner": [-0.025, -0.025, 0.0]}, 3),
    ({"kind": "cylinder", "radius": 0.02, "height": 0.05, "center": [0.0, -0.025, 0.02]}, 3),
    ({"kind": "capsule", "radius": 0.02, "length": 0.05, "center": [0.0, 0.0, 0.02],
      "axis": [1.0, 0.0, 0.0]}, 3),
]  # fmt: skip


@pytest.mark.parametrize(("shape", "dim"), SHAPES)
def test_a_rigid_body_on_the_end_of_a_bar(shape, dim):
    """Over its centre it is a mass on a bar: F = rho c A v exp(-t c / L), jumps by twice that."""
    laws = [{"between": ["box", "bar"]}]
    history = impactfem.solve(scene([bar(dim), falling(shape, dim)], laws, 2.5 * LENGTH / SPEED))
    time, force = (history.history[name].values for name in ("time", "force.box.bar"))
    shares = (time - 0.5 * time[1]) * SPEED / LENGTH
    first = (shares > 0.0) & (shares < 1.98)
    impedance = DENSITY * SPEED * AREA
    np.testing.assert_allclose(force[first], impedance * np.exp(-shares[first]), rtol=2e-3)
    assert force.max() / impedance == pytest.approx(2.0 + math.exp(-2.0), rel=0.01)


def test_a_box_beside_its_centre_turns_as_its_impulse_has_it():
    shape = {"kind": "block", "size": [0.05, 0.05], "corner": [-0.015, 0.0]}
    laws = [{"between": ["box", "bar"]}]
    run = impactfem.solve(scene([bar(2), falling(shape, 2)], laws, 4.0 * LENGTH / SPEED))
    spin, lift = (run.history[f"box.{name}"].values[-1] for name in ("spin", "vy"))
    inertia = MASS * 2.0 * 0.05**2 / 12.0
    # It turns by 8 mrad in the contact, and its arm with it.
    assert spin == pytest.approx(-0.01 * MASS * (lift + 1.0) / inertia, rel=5e-3)


PIECES = [[float(x), 0.0] for x in np.linspace(-3.0, 3.0, 62)]
CHAIN = {"kind": "polyline", "name": "floor", "points": PIECES}
PLANE = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
BLOCK = {"kind": "box", "name": "floor", "center": [0.0, -0.5], "size": [6.0, 1.0]}
STEP = {"kind": "polyline", "name": "floor", "points": [[-3, 0], [0, 0], [0, 0.05], [3, 0.05]]}


def box(x, y=0.0, speed=(0.0, 0.0), **more):
    return {"kind": "rigid", "name": "box", "mass": 1.0, "velocity": list(speed),
            "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [x, y]}} | more  # fmt: skip


def moved(body, floor, duration, **law):
    laws = [{"between": ["box", "floor"]} | law]
    run = impactfem.solve(
        scene([body], laws, duration, 1e-3, obstacle=[floor], gravity=[0.0, -9.81])
    )
    names = ("x", "y", "angle", "vx", "vy", "spin")
    return np.array([run.history[f"box.{name}"].values for name in names]), run.history


@pytest.mark.slow
def test_a_box_does_not_feel_the_seams_of_a_chain():
    """As on a half-space while it slides and stops; as on a convex obstacle where it tumbles."""
    slides = box(0.0, speed=(1.0, 0.0))
    one, two = (moved(slides, floor, 0.5, friction_coefficient=0.3)[0] for floor in (PLANE, CHAIN))
    np.testing.assert_allclose(one, two, atol=1e-12)
    falls = box(0.0, 0.2, (1.0, -1.0), angular_velocity=2.0)
    law = {"friction_coefficient": 0.3, "restitution": 0.3}
    one, two = (moved(falls, floor, 0.5, **law)[0] for floor in (BLOCK, CHAIN))
    np.testing.assert_allclose(one, two, atol=1e-9)


@pytest.mark.slow
def test_a_chain_turns_with_what_lies_on_it():
    turns = {"rotation": {"point": [0.0, 0.0], "angle": "0.3*(1-cos(3*t))"}}
    one, two = (
        moved(box(-0.1), floor | turns, 0.4, friction_coefficient=0.3)[0]
        for floor in (BLOCK, CHAIN)
    )
    np.testing.assert_allclose(one, two, atol=1e-9)


def test_a_slope_of_pieces():
    slope = math.radians(20.0)
    c, s = math.cos(slope), math.sin(slope)
    floor = CHAIN | {"points": [[c * x, s * x] for x, _ in PIECES]}
    corners = [[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.0, 0.1]]
    shape = {"kind": "hull", "points": [[c * x - s * y, s * x + c * y] for x, y in corners]}
    found, _ = moved(box(0.0) | {"shape": shape}, floor, 0.3, friction_coefficient=0.3)
    assert math.hypot(*found[3:5, -1]) / 0.3 == pytest.approx(9.81 * (s - 0.3 * c), rel=1e-10)
    assert abs(found[5]).max() < 1e-10


def test_a_box_over_the_end_of_a_chain_stays_or_tips():
    """Its centre 1 mm before the end, or behind it: the end carries it, away from its corners."""
    table = CHAIN | {"points": [[-3.0, 0.0], [0.0, 0.0]]}
    stays, _ = moved(box(-0.101), table, 0.3, friction_coefficient=0.5)
    tips, _ = moved(box(-0.099), table, 0.3, friction_coefficient=0.5)
    np.testing.assert_allclose(stays[:, -1], stays[:, 0], atol=1e-12)
    assert tips[2, -1] < -0.01
    # (I + m r^2) a = m g r at first, with the arm r from the end.
    arms = np.array([0.001, 0.05])
    turned = 0.5 * 9.81 * arms[0] / (0.05 / 12.0 + arms @ arms) * 0.1**2
    assert tips[2, 100] == pytest.approx(-turned, rel=0.2)


@pytest.mark.parametrize("points", [[[-3, 0], [0, 0]], [[-3, 0], [0, 0], [0, -1]]])
def test_a_corner_that_comes_back_over_an_edge_does_not_strike_it(points):
    floor = CHAIN | {"points": points}
    found, _ = moved(box(-0.15, speed=(-0.5, 0.0)), floor, 0.2)
    np.testing.assert_allclose(found[3], -0.5, atol=1e-12)


def test_a_point_that_slides_near_a_cliff_does_not_meet_its_face_from_behind():
    point = {"kind": "point", "name": "box", "mass": 1.0, "position": [-0.15, 0.0],
             "velocity": [-0.5, 0.0]}  # fmt: skip
    floor = CHAIN | {"points": [[-3, 0], [0, 0], [0, -1]]}
    laws = [{"between": ["box", "floor"], "friction_coefficient": 0.1}]
    made = scene([point], laws, 0.1, 1e-3, obstacle=[floor], gravity=[0.0, -9.81])
    speed = impactfem.solve(made).history["box.vx"].values[-1]
    assert speed == pytest.approx(0.981 * 0.1 - 0.5, abs=2e-3)  # nothing rubs in the first step


def test_a_riser_sends_a_box_back_and_its_edge_holds_a_side():
    """The riser is half as high as the box: its upper corner holds the side, between corners."""
    found, history = moved(box(-0.3, speed=(1.0, 0.0)), STEP, 0.2, restitution=1.0)
    assert found[3, -1] == pytest.approx(-1.0, abs=1e-9)
    assert found[0].max() == pytest.approx(-0.1, abs=2e-3)
    assert np.ptp(history["total_energy"].values) < 1e-12
    hangs = box(-0.3, 0.02, (1.0, 0.0))  # above the floor, below the edge
    found, _ = moved(hangs, STEP, 0.15)
    assert found[0].max() < -0.1 + 2e-3


def test_a_box_goes_over_a_crest_and_gains_no_energy():
    slope = math.radians(20.0)
    crest = CHAIN | {"points": [[-3, 0], [0, 0], [3 * math.cos(slope), -3 * math.sin(slope)]]}
    found, history = moved(box(-0.4, speed=(1.5, 0.0)), crest, 0.9)
    assert np.diff(history["total_energy"].values).max() < 1e-12
    # It lands within a step, with a corner up to its way in the slope: 0.5 mm of 0.2 m.
    assert found[2, -1] == pytest.approx(-slope, abs=5e-3)
    assert found[0, -1] > 0.5


def rough():
    points = [[float(x), 0.01 * math.cos(20.0 * x) - 0.0101] for x in np.linspace(-1.0, 1.0, 40)]
    laws = [{"between": ["box", "floor"], "friction_coefficient": 0.1, "restitution": 0.3}]
    return scene([box(-0.5, 0.01, (2.0, 0.0))], laws, 0.2, 1e-3, gravity=[0.0, -9.81],
                 obstacle=[CHAIN | {"points": points, "motion": ["0", "0.01*sin(20*t)"]}],
                 output={"fields": [], "checkpoint": 50})  # fmt: skip


@pytest.mark.slow
def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    check_restart(rough(), 130, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(rough, monkeypatch)
