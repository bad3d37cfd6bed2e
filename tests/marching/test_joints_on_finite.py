"""Joints beside bodies under finite strain: what stays, small strains, limits, loops, restarts."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene

HELD = {"supports": [{"surface": "bottom", "kind": "fixed"}]}
PIN = {"name": "pin", "kind": "revolute", "between": ["bob", "ground"], "point": [-0.2, 0.06]}
ARM = np.array([0.2, -0.029])  # from the pin to the middle of the bob


def pad(strain="finite", h=0.025, **more):
    """A rubber block whose top is at 0."""
    law = {"material": "neo_hookean"} if strain == "finite" else {}
    return {
        "kind": "solid", "name": "pad", "model": "plane_strain", "mesh_size": h, "strain": strain,
        "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, -0.1]},
        "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3,
    } | law | more  # fmt: skip


def bob(rate=0.0, **more):
    """A disc above the middle of the block, which turns clockwise about the pin."""
    return {
        "kind": "rigid",
        "name": "bob",
        "mass": 0.5,
        "inertia": 1e-4,
        "shape": {"kind": "disc", "radius": 0.03, "center": [0.0, 0.031]},
        "velocity": [rate * ARM[1], -rate * ARM[0]],
        "angular_velocity": -rate,
    } | more


def bar(**more):
    return {
        "kind": "rigid",
        "name": "bar",
        "density": 2000.0,
        "shape": {"kind": "block", "size": [0.06, 0.02], "corner": [0.03, 0.03]},
    } | more


def law(mu, one="bob", **more):
    return {"between": [one, "pad"], "friction_coefficient": mu} | more


def scene(bodies, joints, laws, duration, dt=5e-4, **more):
    return Scene.from_dict(
        {"title": "rubber", "duration": duration, "body": bodies, "joint": joints, "contact": laws,
         "solve": {"dt": dt, "estimate": False}, "output": {"fields": []}} | more
    )  # fmt: skip


def kept(history):
    return history["total_energy"].values - history["friction_work"].values


@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_a_pendulum_strikes_rubber_and_keeps_its_energy(mu):
    history = impactfem.solve(scene([pad(**HELD), bob(4.0)], [PIN], [law(mu)], 0.04)).history
    assert history["contact_force"].values.max() > 300.0
    assert np.ptp(kept(history)) < 1e-10 * kept(history)[0]
    assert (history["friction_work"].values[-1] < -1e-3 * kept(history)[0]) == (mu > 0.0)
    place = np.stack([history["bob.x"].values + 0.2, history["bob.y"].values - 0.06])
    assert np.ptp(np.hypot(*place)) < 1e-14
    assert history["bob.spin"].values[-1] > 1.0


@pytest.mark.slow
def test_bodies_that_a_pin_joins_keep_both_momenta():
    """A disc and a bar strike a free block."""
    moving = {"velocity": [0.3, -2.0]}
    pin = PIN | {"between": ["bob", "bar"], "point": [0.03, 0.035]}
    laws = [law(0.4), law(0.4, "bar")]
    block = pad(h=0.0125)  # finer, as its masses then have its moment of inertia
    made = scene([block, bob() | moving, bar(**moving)], [pin], laws, 0.018)
    history = impactfem.solve(made).history
    assert min(history[f"force.{n}.pad"].values.max() for n in ("bob", "bar")) > 100.0
    assert np.ptp(kept(history)) < 1e-10 * kept(history)[0]
    for name in ("momentum.x", "momentum.y", "angular_momentum"):
        assert np.ptp(history[name].values) < 1e-11


@pytest.mark.slow
def test_stiff_rubber_is_as_small_strains_say():
    """The same pendulum on the same block: its rate after the impact, but for the steps of both."""
    after = []
    for strain in ("finite", "small"):
        block = pad(strain, **HELD) | {"youngs_modulus": 1e8}
        block["shape"] = block["shape"] | {"corner": [-0.1, -0.1 + 1e-3 - 1e-5]}
        made = scene([block, bob(0.5)], [PIN], [law(0.0)], 1e-3, 1e-5)
        after.append(impactfem.solve(made).history["bob.spin"].values[-1])
    assert after[0] > 0.2
    assert after[0] == pytest.approx(after[1], rel=0.02)


@pytest.mark.slow
def test_motors_friction_and_limits_beside_rubber():
    """As without it, far away: a crank with a motor, dry friction and a stop that sends back."""
    far = pad(h=0.05) | {"shape": {"kind": "block", "size": [0.2, 0.1], "corner": [5.0, 0.0]}}
    pin = PIN | {"limits": [-0.3, 0.3], "restitution": 0.5, "friction": 0.02,
                 "motor": "-0.02*v - 0.5*q", "stiffness": 0.5}  # fmt: skip
    found = [
        impactfem.solve(scene(bodies, [pin], [law(0.0)] * (len(bodies) > 1), 0.3, 1e-3)).history
        for bodies in ([far, bob(4.0)], [bob(4.0)])
    ]
    for name in ("pin.q", "pin.v", "pin.lost"):
        one, two = (each[name].values for each in found)
        np.testing.assert_allclose(one, two, atol=2e-2 * np.abs(two).max())
    assert found[0]["pin.q"].values.max() > 0.29  # the stop


def crank(**output):
    """A disc on a bar on the ground, which rubs on the block; a free disc strikes it."""
    joints = [
        PIN | {"between": ["bar", "ground"], "point": [0.09, 0.04], "friction": 0.01},
        PIN | {"name": "knee", "between": ["bob", "bar"], "point": [0.03, 0.04]},
    ]
    disc = bob(name="disc", velocity=[0.2, -1.0])
    disc["shape"] = {"kind": "disc", "radius": 0.02, "center": [-0.06, 0.021]}
    laws = [law(0.3), law(0.3, "disc"), {"between": ["disc", "bob"], "restitution": 0.3}]
    turning = bar(velocity=[0.0, -0.9], angular_velocity=30.0)
    bodies = [pad(**HELD), disc, bob(velocity=[0.0, -1.8], angular_velocity=0.0), turning]
    return scene(bodies, joints, laws, 0.008, output={"fields": [], "checkpoint": 5} | output)


@pytest.mark.parallel([1, 2])
@pytest.mark.slow
def test_a_run_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    whole, _ = check_restart(crank(), 14, tmp_path, monkeypatch)
    assert whole.history["force.bob.pad"].values.max() > 100.0


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    check_ranks(crank, monkeypatch)


POINT = {"kind": "point", "name": "bob", "mass": 0.5, "radius": 0.03, "position": [0.0, 0.031],
         "velocity": [-0.058, -0.4]}  # fmt: skip
ROD = {"name": "pin", "kind": "distance", "between": ["bob", "ground"],
       "points": [[0.0, 0.031], [-0.2, 0.06]]}  # fmt: skip
BEAM = {"kind": "beam", "name": "bob", "density": 2700.0, "youngs_modulus": 7e9, "length": 0.2,
        "height": 4e-3, "width": 0.02, "elements": 6, "center": [0.0, 0.02],
        "velocity": [0.0, -0.3], "angular_velocity": -3.0}  # fmt: skip
LASH = PIN | {"point": [-0.1, 0.02]}
LIGHT = {"point": (POINT, ROD, 0.05), "beam": (BEAM, LASH, 0.1)}


@pytest.mark.parametrize("kind", LIGHT)
def test_points_and_beams_in_joints_strike_rubber_and_keep_their_energy(kind):
    body, joint, duration = LIGHT[kind]
    history = impactfem.solve(scene([pad(**HELD), body], [joint], [law(0.0)], duration)).history
    force, speed = history["contact_force"].values, history["bob.vy"].values
    assert force.max() > {"point": 200.0, "beam": 5.0}[kind]
    assert speed.max() > 0.2  # it comes back
    assert np.ptp(kept(history)) < 1e-10 * kept(history)[0]
    if kind == "point":
        place = np.stack([history["bob.x"].values + 0.2, history["bob.y"].values - 0.06])
        assert np.ptp(np.hypot(*place)) < 1e-14


def bead(**output):
    """A point on a rod that strikes the block with friction."""
    return scene([pad(**HELD), POINT], [ROD], [law(0.3)], 8e-3, output={"fields": []} | output)


@pytest.mark.parallel([1, 2])
def test_a_point_in_a_joint_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    made = bead(checkpoint=5)
    whole, _ = check_restart(made, 14, tmp_path, monkeypatch)
    assert whole.history["contact_force"].values.max() > 50.0
