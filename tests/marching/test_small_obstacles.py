"""Obstacles smaller than the triangles of a plate: balls, corners, edges and wires."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

SIDES = ("left", "right", "bottom", "top")
BALL = {"kind": "sphere", "name": "tip", "center": [0.16, 0.12, -0.015], "radius": 0.005}
BOX = {"kind": "box", "name": "tip", "center": [0.13, 0.08, -0.03], "size": [0.03, 0.03, 0.04],
       "angle": 0.3}  # fmt: skip
RIDGE = BOX | {"center": [0.03, 0.02, -0.03], "size": [0.4, 0.004, 0.04], "angle": 0.4}
WIRE = {"kind": "cylinder", "name": "tip", "center": [0.03, 0.02, -0.012], "radius": 0.002,
        "axis": [float(np.cos(0.4)), float(np.sin(0.4)), 0.0]}  # fmt: skip
"""All 0.005 below the face of the plate, whose elements are 0.1."""


def thrown(*obstacles, speed=1.0, size=0.1, bodies=(), duration=0.06, **more):
    """A clamped square with D = rho t = 1."""
    plate = {
        "kind": "plate", "name": "plate", "mesh_size": size, "thickness": 0.01, "density": 100.0,
        "youngs_modulus": 12.0 * 0.91e6, "poisson_ratio": 0.3,
        "outline": {"kind": "rectangle", "size": [1.0, 1.0]},
        "supports": [{"edge": edge, "kind": "clamped"} for edge in SIDES],
        "velocity": f"-{speed}*(1-4*x**2)*(1-4*y**2)",
    }  # fmt: skip
    keys = {"membrane", "pressures"} & more.keys()
    plate |= {key: more.pop(key) for key in keys}
    return Scene.from_dict(
        {"title": "small", "duration": duration, "gravity": [0.0, 0.0, 0.0],
         "body": [plate, *bodies], "obstacle": list(obstacles), "output": {"fields": []},
         "solve": {"estimate": False, "dt": 5e-4}} | more
    )  # fmt: skip


def depth(result):
    """By which they lie in the plate, as a share of its thickness."""
    found = result.summary["verdict"]["findings"]
    return max((each["value"] for each in found if each["code"] == "penetration"), default=0.0)


@pytest.mark.parametrize(("speed", "up"), [(1.0, 0.0), (0.0, 0.4)])
def test_a_ball_is_as_one_that_is_heavy(speed, up):
    """At rest, and one that moves up into a plate at rest."""
    ball = {"kind": "point", "name": "ball", "mass": 1e9, "radius": 0.005,
            "position": [0.16, 0.12, -0.015], "velocity": [0.0, 0.0, up]}  # fmt: skip
    moving = BALL | {"motion": ["0.0", "0.0", f"{up}*t"]} if up else BALL
    one = impactfem.solve(thrown(moving, speed=speed))
    two = impactfem.solve(thrown(speed=speed, bodies=[ball]))
    force = one.history["contact_force"].values
    assert force.max() > 1.0
    assert force == pytest.approx(two.history["contact_force"].values, abs=1e-7 * force.max())
    assert depth(one) < 0.2  # 0.055 measured; it passes through without, by one thickness and more


def test_a_wire_is_as_the_edge_of_a_ridge():
    """Which both press along a line: impulses differ by the width of the ridge, 0.004."""
    wire, ridge = (impactfem.solve(thrown(each)) for each in (WIRE, RIDGE))
    kicks = [each.summary["contact"]["impulse"] for each in (wire, ridge)]
    assert kicks[0] == pytest.approx(kicks[1], rel=0.06)
    assert max(depth(wire), depth(ridge)) < 0.5  # 0.25 measured, 0.05 with half the elements


@pytest.mark.parametrize(("membrane", "growth"), [("none", 1e-4), ("von_karman", 1e-10)])
def test_corners_of_a_box_hold_a_plate(membrane, growth):
    """Energy to first order of the step where gaps follow, to rounding of what is iterated."""
    result = impactfem.solve(thrown(BOX, membrane=membrane))
    energy = result.history["total_energy"].values
    assert result.summary["contact"]["impulse"] > 0.1
    assert np.abs(energy / energy[0] - 1.0).max() < growth
    assert depth(result) < 0.4


def test_edges_that_touch_triangles_at_many_places_are_solved():
    """More places than these have freedoms: pivots went round between singular sets."""
    wide = BOX | {"center": [0.05, 0.02, -0.03], "size": [0.3, 0.3, 0.04], "angle": 0.2}
    result = impactfem.solve(thrown(wide, duration=0.03))
    assert len(result.history["time"]) == 61
    assert result.summary["contact"]["impulse"] > 0.3


@pytest.mark.slow
def test_impulses_converge():
    """0.145, 0.141, 0.139 of the ball and 0.214, 0.192, 0.187 of the box until 0.03 s."""
    for obstacle, off in ((BALL, 0.05), (BOX, 0.15)):
        coarse, fine = (
            impactfem.solve(thrown(obstacle, size=size, duration=0.03)).summary["contact"]
            for size in (0.1, 0.05)
        )
        assert coarse["impulse"] == pytest.approx(fine["impulse"], rel=off)


def test_a_plate_rests_on_a_ball():
    """Which takes what it does of a pressure: 0.879, 0.800, 0.792 with ever smaller elements."""
    near = BALL | {"center": [0.16, 0.12, -0.0105]}
    pressed = [{"face": "top", "value": 4.0}]
    resting = thrown(near, speed=0.0, pressures=pressed, start="static", duration=0.02)
    force = impactfem.solve(resting).history["contact_force"].values
    assert force[0] == pytest.approx(0.79, rel=0.25)
    assert np.ptp(force) < 1e-4 * force[0]


def test_a_ball_that_lies_in_the_plate_is_refused():
    with pytest.raises(SceneError, match=r"bodies plate and tip overlap by 0.0005 m at t = 0"):
        impactfem.solve(thrown(BALL | {"center": [0.16, 0.12, -0.0095]}))


def turning():
    rotation = {"point": [0.13, 0.08, -0.03], "axis": [1.0, 0.0, 0.0], "angle": "3*t"}
    more = {"output": {"fields": [], "checkpoint": 5}}
    return thrown(BOX | {"rotation": rotation}, duration=0.03, **more)


def test_a_run_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    whole, _ = check_restart(turning(), 27, tmp_path, monkeypatch)
    assert whole.history["contact_force"].values.max() > 0.0


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    check_ranks(turning, monkeypatch)
