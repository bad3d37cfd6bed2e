"""Rods with forces, joints and springs: rigid bodies whose ends touch."""

import math

import numpy as np
import pytest
from moving_scenes import check_restart
from scipy.integrate import solve_ivp

import impactfem
from impactfem.errors import SceneError

ROD = {"kind": "rod", "name": "rod", "mass": 2.0, "length": 1.5, "center": [0.0, 2.0]}
BOX = {"kind": "rigid", "name": "box", "mass": 0.5, "model": "2d",
       "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.76, 1.95]}}  # fmt: skip


def scene(rod, duration=0.3, dt=1e-3, gravity=(0.0, -9.81), bodies=(), **more):
    table = {"title": "rod", "duration": duration, "gravity": list(gravity),
             "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
             "body": [ROD | rod, *bodies]}  # fmt: skip
    return impactfem.Scene.from_dict(table | more)


def test_force_and_moment_drive_a_rod(tmp_path, monkeypatch):
    """Newton's and Euler's equations, each with its own brake."""
    rod = {"force": ["3*sin(20*t)", "-4*vy"], "moment": ["0.5-2*w"], "angular_velocity": 3.0}
    given = scene(rod)
    found = impactfem.solve(given).history
    time, inertia = found["time"].values, 2.0 * 1.5**2 / 12.0
    assert found["rod.vx"].values == pytest.approx(1.5 / 20 * (1 - np.cos(20 * time)), abs=2e-5)
    assert found["rod.vy"].values == pytest.approx(
        -9.81 / 2 * (1 - np.exp(-2 * time)), abs=2e-6
    )  # fmt: skip
    spin = 0.25 + 2.75 * np.exp(-2 / inertia * time)
    assert found["rod.spin"].values == pytest.approx(spin, abs=2e-5)
    short = given.with_settings({"duration": 0.03, "output.checkpoint": 10})
    check_restart(short, 15, tmp_path, monkeypatch)


def test_a_rod_on_a_hinge_swings_as_a_pendulum():
    """By its inertia about the end, as the same body said as a rigid one."""
    hinge = {"name": "j", "kind": "revolute", "between": ["ground", "rod"], "point": [-0.75, 2.0]}
    found = impactfem.solve(scene({}, 0.6, dt=2e-3, joint=[hinge])).history
    swing = solve_ivp(
        lambda _, y: [y[1], -1.5 * 9.81 / 1.5 * math.cos(y[0])], (0.0, 0.6), [0.0, 0.0],
        rtol=1e-10, atol=1e-12, dense_output=True,
    )  # fmt: skip
    assert found["rod.angle"].values == pytest.approx(swing.sol(found["time"].values)[0], abs=5e-5)
    force = found["j.force"].values[-1]
    angle, rate = swing.y[:, -1]
    turn = -9.81 * math.cos(angle)
    along = 2.0 * (0.75 * rate**2 - 9.81 * math.sin(angle))
    across = 2.0 * (0.75 * turn + 9.81 * math.cos(angle))
    assert force == pytest.approx(math.hypot(along, across), rel=1e-3)


def test_rods_hang_at_rest_and_carry_masses():
    """A rod on two springs that carries a mass off its middle is in equilibrium at t = 0."""
    each = [{"name": f"s{k}", "between": ["ground", "rod"], "stiffness": [0.0, 500.0],
             "point": [x, 2.0]} for k, x in enumerate((-0.75, 0.75))]  # fmt: skip
    hold = {"name": "x", "between": ["ground", "rod"], "stiffness": [50.0, 0.0],
            "point": [0.0, 2.0]}  # fmt: skip
    load = {"name": "m", "body": "rod", "point": [0.25, 2.0], "mass": 1.0}
    found = impactfem.solve(
        scene({}, 0.01, spring=[*each, hold], point_mass=[load], start="static")
    ).history
    left = 9.81 * (1.0 + 0.5 / 1.5)  # by levers, but for the turn of the rod
    assert found["s0_y.force"].values == pytest.approx(left, rel=1e-4)
    assert found["kinetic_energy"].values.max() < 1e-15


def test_gravity_that_changes_takes_the_march():
    """Until then a rod falls, from there it flies straight."""
    given = scene({}, 0.2, gravity=[[0.0, [0.0, -10.0]], [0.1, [0.0, 0.0]]])
    found = impactfem.solve(given).history
    assert found["rod.vy"].values[-1] == pytest.approx(-1.0, abs=1e-12)


def test_a_force_that_knows_other_coordinates_is_refused():
    """With those that it may use."""
    with pytest.raises(SceneError, match=r"force\[0\] = .vz. .*vx, vy"):
        scene({"force": ["vz", "0"]})


def test_a_rod_without_radius_may_meet_a_box():
    """Nothing is too thin to be found in a step where it has no thickness."""
    impactfem.solve(scene({}, 0.002, bodies=[BOX | {"velocity": [0.0, -1.0]}]))
