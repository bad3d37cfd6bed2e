"""Rigid bodies beside bodies under finite strain."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene

MODULUS, FAST = 1e6, 2.0


def pad(size=(0.2, 0.1), h=0.0125, strain="finite", **more):
    """A rubber block whose top is at 0."""
    corner = [-0.5 * size[0], -size[1], *(-0.5 * each for each in size[2:])]
    law = {"material": "neo_hookean"} if strain == "finite" else {}
    return {
        "kind": "solid", "name": "pad", "model": "plane_strain" if len(size) == 2 else "3d",
        "shape": {"kind": "block", "size": list(size), "corner": corner}, "mesh_size": h,
        "density": 1100.0, "youngs_modulus": MODULUS, "poisson_ratio": 0.4, "strain": strain,
    } | law | more  # fmt: skip


def body(shape, **more):
    return {"kind": "rigid", "name": "body", "density": 2000.0, "shape": shape} | more


def scene(bodies, laws, duration, **more):
    return Scene.from_dict(
        {"title": "rubber", "duration": duration, "body": bodies, "contact": laws,
         "output": {"fields": []}} | more | {"solve": {"estimate": False} | more.get("solve", {})}
    )  # fmt: skip


def law(mu=0.0, one="body", two="pad"):
    return {"between": [one, two], "friction_coefficient": mu}


HELD = {"supports": [{"surface": "bottom", "kind": "fixed"}]}
DISC = {"kind": "disc", "radius": 0.03, "center": [0.01, 0.0305]}
BOX = {"kind": "block", "size": [0.06, 0.03], "corner": [-0.02, 0.015]}
TILTED = {"angle": 0.3, "velocity": [0.0, -FAST]}
SPUN = {"angular_velocity": 40.0, "velocity": [0.5, -FAST]}


def test_a_smooth_disc_is_a_ball():
    """A disc that no friction turns moves as a point with its radius and mass."""
    area = np.pi * 0.03**2
    disc = body(DISC, velocity=[0.0, -FAST])
    ball = {"kind": "point", "name": "body", "mass": 2000.0 * area, "radius": 0.03,
            "position": DISC["center"], "velocity": [0.0, -FAST]}  # fmt: skip
    one, two = (
        impactfem.solve(scene([pad(**HELD), each], [law()], 0.01)).history for each in (disc, ball)
    )
    assert one["contact_force"].values.max() > 2000.0
    np.testing.assert_allclose(one["body.vy"].values, two["body.vy"].values, atol=1e-11 * FAST)


CASES = {"disc": (DISC, SPUN, 0.5), "box": (BOX, TILTED, 0.0), "rubbing box": (BOX, TILTED, 0.5)}


@pytest.mark.parametrize("case", CASES)
def test_energy_and_momenta_stay(case):
    """Of a free block and what strikes it, whatever rubs: friction takes what it tells."""
    shape, moving, mu = CASES[case]
    history = impactfem.solve(scene([pad(), body(shape, **moving)], [law(mu)], 0.015)).history
    assert history["contact_force"].values.max() > 1000.0
    kept = history["total_energy"].values - history["friction_work"].values
    assert np.ptp(kept) < 1e-11 * kept[0]
    assert (history["friction_work"].values[-1] < -0.05 * kept[0]) == (mu > 0.0)
    for axis in "xy":
        assert np.ptp(history[f"momentum.{axis}"].values) < 1e-11 * 8.0
    spins = history["angular_momentum"].values
    assert np.ptp(spins) < 1e-11 * max(1.0, np.abs(spins).max())


SHAPES = {
    "sphere": ({"kind": "sphere", "radius": 0.03, "center": [0.01, 0.0305, 0.003]}, {}),
    "capsule": (
        {"kind": "capsule", "radius": 0.02, "length": 0.05, "center": [0.01, 0.03, 0.003],
         "axis": [1.0, 0.3, 0.2]}, {},
    ),
    "cylinder": (
        {"kind": "cylinder", "radius": 0.03, "height": 0.04, "center": [0.01, 0.01, 0.003]},
        {"orientation": {"axis": [1, 0, 0.3], "angle": 0.2}},
    ),
    "block": (
        {"kind": "block", "size": [0.06, 0.03, 0.05], "corner": [-0.02, 0.025, -0.02]},
        {"orientation": {"axis": [1, 0, 0.3], "angle": 0.3}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_in_space(name):
    shape, more = SHAPES[name]
    moving = {"velocity": [0.5, -FAST, 0.2], "angular_velocity": [0.0, 10.0, 30.0]} | more
    block = pad((0.2, 0.1, 0.2), 0.05, poisson_ratio=0.3)
    result = impactfem.solve(scene([block, body(shape, **moving)], [law(0.4)], 0.012))
    history, told = result.history, result.summary["verdict"]["findings"]
    assert history["contact_impulse"].values.sum() + history["contact_force"].values.max() > 50.0
    kept = history["total_energy"].values - history["friction_work"].values
    # As far as iterates go: 1e-9 and less, but 5e-8 of the cylinder on the mesh of another Gmsh.
    assert np.ptp(kept) < (1e-7 if name == "cylinder" else 1e-9) * kept[0]
    for axis in "xyz":
        assert np.ptp(history[f"momentum.{axis}"].values) < 1e-12
    # Contact places move in a step: what goes through is a part of its way. Elements are larger
    # than what strikes them: on the mesh of another Gmsh the rim of the cylinder lies 1.3 mm deep
    # between their nodes, which the run has to tell.
    way = FAST * np.diff(history["time"].values).max()
    poked = any(finding["code"] == "penetration" for finding in told)
    assert history["gap"].values.min() > -0.2 * way or (name == "cylinder" and poked)


def test_stiff_rubber_is_as_small_strains_say():
    """The same box on the same block: its speed after the impact, but for the steps of both.

    0.5 % apart here and 1.4 % on another mesh of the same size; half of it at half the step.
    """
    after = []
    for strain in ("finite", "small"):
        block = pad(h=0.025, strain=strain, **HELD) | {"youngs_modulus": 1e8, "poisson_ratio": 0.3}
        box = body(BOX | {"corner": [-0.02, 1e-5]}, velocity=[0.0, -0.1])
        made = scene([block, box], [law()], 1e-3, solve={"dt": 1e-5})
        after.append(impactfem.solve(made).history["body.vy"].values[-1])
    assert after[0] > 0.03
    assert after[0] == pytest.approx(after[1], rel=0.02)


def test_a_ball_on_a_floor_beside_rubber_comes_to_roll():
    """It slides first, and then rolls with two thirds of its speed, whatever is beside it."""
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    block = pad(h=0.05, supports=[{"surface": "bottom", "kind": "fixed"}])
    block["shape"]["corner"] = [-1.0, 0.0]
    disc = body({"kind": "disc", "radius": 0.05, "center": [0.0, 0.05]}, velocity=[0.3, 0.0])
    laws = [law(0.4, two="floor")]
    more = {"obstacle": [floor], "gravity": [0.0, -9.81], "solve": {"dt": 5e-4}}
    history = impactfem.solve(scene([block, disc], laws, 0.06, **more)).history
    slides = history["time"].values < 0.025
    np.testing.assert_allclose(
        history["body.vx"].values[slides], 0.3 - 0.4 * 9.81 * history["time"].values[slides],
        atol=1e-9,
    )  # fmt: skip
    assert history["body.vx"].values[-1] == pytest.approx(0.2, rel=1e-6)
    assert -0.05 * history["body.spin"].values[-1] == pytest.approx(0.2, rel=1e-6)


def test_rigid_boxes_beside_rubber_strike_each_other():
    """Newton's law between them, off their centres."""
    block = pad(h=0.05)
    block["shape"]["corner"] = [-1.0, 0.0]
    low = body({"kind": "block", "size": [0.4, 0.2], "corner": [-0.2, -0.1]}, mass=3.0)
    del low["density"]
    ball = {"kind": "rigid", "name": "ball", "mass": 0.5, "velocity": [0.0, -2.0],
            "shape": {"kind": "disc", "radius": 0.01, "center": [0.15, 0.129]}}  # fmt: skip
    laws = [{"between": ["ball", "body"], "restitution": 0.6}]
    inertia = 3.0 * (0.4**2 + 0.2**2) / 12.0
    impulse = 1.6 * 2.0 / (1.0 / 0.5 + 1.0 / 3.0 + 0.15**2 / inertia)
    missed = []  # of first order: the box turns in the step of the impact
    for dt in (1e-3, 1e-4):
        made = scene([block, low, ball], laws, 0.02, solve={"dt": dt})
        history = impactfem.solve(made).history
        spin = history["body.spin"].values[-1]
        missed.append(
            np.abs([history["body.vy"].values[-1] * 3.0, spin * inertia / 0.15]) / impulse - 1.0
        )
    assert np.abs(missed[0]).max() < 5e-4
    assert np.abs(missed[1]).max() < 5e-5


def rubbing(fields=()):
    shape = {"kind": "block", "size": [0.06, 0.03], "corner": [-0.02, 0.005]}
    disc = {"kind": "disc", "radius": 0.02, "center": [-0.06, 0.021]}
    return scene(
        [pad(h=0.025, **HELD), body(shape, angle=0.1, velocity=[0.2, -1.0]),
         body(disc, name="disc", velocity=[0.5, -1.0])],
        [law(0.3), law(0.3, one="disc"), law(0.3, one="disc", two="body")], 0.006,
        output={"fields": list(fields), "every": 3, "checkpoint": 5},
    )  # fmt: skip


@pytest.mark.parallel([1, 2])
def test_a_run_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    check_restart(rubbing(["vtkhdf"]), 14, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    check_ranks(rubbing, monkeypatch)
