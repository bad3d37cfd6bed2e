"""Columns of histories: the same for every family of bodies, and balances that they must keep."""

import numpy as np
import pytest

import impactfem
from impactfem import Contact, HalfSpace, Point, Rod, Scene, Solve
from impactfem.result.history import COLUMNS
from impactfem.result.whole import Whole
from impactfem.shipped import shipped_scenes

SCENES = [
    "bar_impact", "wave_cradle", "corner", "cradle", "bouncing_ball", "dropped_beam",
    "elastic_sphere", "block_stack",
]  # fmt: skip
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
BELOW = FLOOR | {"point": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]}


def columns(result, name):
    """Values of a column; with a dot at its end, of all that begin so, (rows, columns)."""
    history = result.history
    if not name.endswith("."):
        return history[name].values
    return np.stack([history[n].values for n in history.data_vars if n.startswith(name)], axis=1)


def momenta(result):
    return np.stack([columns(result, f"momentum.{letter}") for letter in "xyz"], axis=1)


@pytest.mark.parametrize("name", SCENES)
def test_every_history_has_the_same_columns_and_pairs_add_up(name):
    scene = Scene.from_toml(shipped_scenes()[name])
    result = impactfem.solve(scene.with_settings(["output.fields=[]"]))
    history = result.history
    assert list(COLUMNS) == list(history.data_vars)[: len(COLUMNS)]
    force = columns(result, "contact_force")
    assert force.max() > 0.0 or columns(result, "impulse.").max() > 0.0
    assert columns(result, "force.").sum(axis=1) == pytest.approx(force, rel=1e-12, abs=1e-300)
    gap = columns(result, "gap.")
    assert np.array_equal(np.fmin.reduce(gap, axis=1), columns(result, "gap"))
    along = momenta(result) @ history["momentum"].attrs["direction"]
    assert along == pytest.approx(columns(result, "momentum"), rel=1e-12, abs=1e-300)
    total = columns(result, "total_energy")
    assert np.array_equal(columns(result, "dissipated_energy"), total[0] - total)
    for body in scene.bodies:
        assert {f"{body.name}.{x}" for x in ("x", "y", "z", "vx", "vy", "vz")} <= set(
            history.data_vars
        )


def solid(shape, model="plane_strain", name="body", size=0.125, **more):
    return {
        "name": name, "kind": "solid", "model": model, "density": 1.0, "youngs_modulus": 1.0,
        "poisson_ratio": 0.3, "mesh_size": size, "shape": shape,
    } | more  # fmt: skip


def scene(bodies, obstacles, duration, contacts=(), **solve):
    return Scene.from_dict(
        {
            "title": "columns", "duration": duration, "body": bodies, "obstacle": obstacles,
            "contact": list(contacts), "solve": {"estimate": False} | solve,
            "output": {"fields": []},
        }
    )  # fmt: skip


DISC = {"kind": "disc", "radius": 0.5, "center": [0.3, 2.0]}
BLOCK = {"kind": "block", "size": [0.5, 0.3, 0.4], "corner": [0.3, 2.0, -0.2]}


@pytest.mark.parametrize("method", ["explicit", "massless", "newmark"])
def test_a_disc_that_nothing_touches_turns_at_its_spin_and_keeps_its_angular_momentum(method):
    disc = solid(DISC, velocity=[0.2, 0.1], angular_velocity=0.05)
    result = impactfem.solve(scene([disc], [FLOOR], 1.0, method=method))
    angular = columns(result, "angular_momentum")
    mass = result.summary["bodies"]["body"]["mass"]
    inertia = result.summary["bodies"]["body"]["inertia"]
    own = mass * (0.3 * 0.1 - 2.0 * 0.2) + inertia * 0.05
    assert angular[1:] == pytest.approx(np.full(len(angular) - 1, angular[1]), rel=1e-12)
    assert angular[1] == pytest.approx(own, rel=1e-3)
    assert columns(result, "body.spin")[1:] == pytest.approx(0.05, rel=1e-9)
    time = columns(result, "time")
    assert columns(result, "body.angle") == pytest.approx(0.05 * time, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("method", ["explicit", "massless"])
def test_a_block_in_space_turns_about_its_axis(method):
    spin = np.array([0.03, -0.02, 0.05])
    block = solid(BLOCK, "3d", size=0.2, velocity=[0.2, 0.1, -0.1], angular_velocity=spin.tolist())
    result = impactfem.solve(scene([block], [BELOW], 0.5, method=method, normals="fixed"))
    found = np.stack([columns(result, f"body.w{x}") for x in "xyz"], axis=1)
    assert found[1] == pytest.approx(spin, rel=1e-9)
    angular = np.stack([columns(result, f"angular_momentum.{x}") for x in "xyz"], axis=1)
    assert angular[1:] == pytest.approx(np.tile(angular[1], (len(angular) - 1, 1)), rel=1e-11)
    q = np.array([columns(result, f"body.q{x}")[-1] for x in "wxyz"])
    angle = spin * columns(result, "time")[-1]
    half = 0.5 * np.linalg.norm(angle)
    assert q == pytest.approx([np.cos(half), *(0.5 * angle * np.sinc(half / np.pi))], rel=1e-6)


def test_a_body_that_starts_turned_says_so():
    turned = {"displacement": ["-0.01*(y - 2)", "0.01*(x - 0.3)"]}
    result = impactfem.solve(scene([solid(DISC, **turned)], [FLOOR], 0.1, method="massless"))
    assert columns(result, "body.angle")[0] == pytest.approx(0.01, rel=1e-4)


RUBS = [{"name": "foot", "between": ["body", "floor"], "friction_coefficient": 0.3}]


@pytest.mark.parametrize("method", ["explicit", "massless", "moreau_jean"])
def test_forces_of_a_pair_change_the_momentum_by_their_impulse(method):
    disc = solid(DISC | {"center": [0.3, 0.52]}, velocity=[0.2, -0.1])
    result = impactfem.solve(scene([disc], [FLOOR], 6.0, RUBS, method=method))
    p = momenta(result)
    dt = np.diff(columns(result, "time"))
    force, rub = columns(result, "force.foot"), columns(result, "tangential_force.foot")
    scale = float(np.abs(p).max())
    assert force.max() > 0.0 > rub.min()
    assert force[-1] == 0.0  # momenta of explicit layers are those amid them
    for k, f in ((0, rub), (1, force)):
        whole = float((f[1:] * dt).sum())
        assert p[-1, k] - p[0, k] == pytest.approx(whole, abs=1e-11 * scale)
    assert columns(result, "friction_work")[-1] == pytest.approx(
        result.summary["details"]["friction_work"], rel=1e-12
    )
    assert columns(result, "slip.foot")[-1] > 0.0


def test_a_block_slides_in_contact_as_far_as_its_slip_says():
    block = solid(
        {"kind": "block", "size": [0.4, 0.1], "corner": [0.0, 0.0]}, size=0.05, velocity=[0.3, 0.0],
        youngs_modulus=1e3,
    )  # fmt: skip
    case = scene([block], [FLOOR], 0.3, RUBS, method="massless")
    result = impactfem.solve(case.with_settings({"gravity": [0.0, -1.0]}))
    way = np.diff(columns(result, "body.x"))[columns(result, "force.foot")[1:] > 0.0].sum()
    assert way > 0.07
    assert columns(result, "slip.foot")[-1] == pytest.approx(way, rel=5e-3)
    late = columns(result, "tangential_force.foot")[-50:].sum()
    assert late == pytest.approx(-0.3 * columns(result, "force.foot")[-50:].sum(), rel=1e-6)


def test_each_body_has_its_own_pair_with_the_floor():
    names, places = ("one", "two"), (-1.0, 1.0)
    bodies = [
        solid(DISC | {"center": [x, 0.52]}, name=name, velocity=[0.0, -0.1 - 0.05 * x])
        for name, x in zip(names, places, strict=True)
    ]
    result = impactfem.solve(scene(bodies, [FLOOR], 5.0, method="massless"))
    dt = np.diff(columns(result, "time"))
    for name in names:
        speed = columns(result, f"{name}.vy")
        mass = result.summary["bodies"][name]["mass"]
        pushed = float((columns(result, f"force.{name}.floor")[1:] * dt).sum())
        assert mass * (speed[-1] - speed[0]) == pytest.approx(pushed, rel=1e-9)
        assert columns(result, f"gap.{name}.floor").min() == pytest.approx(0.0, abs=1e-12)


def test_images_turn_the_other_way_but_about_the_axis_across_the_plane():
    turn = np.array([1.0, 2.0, 3.0])
    assert np.array_equal(Whole((("x", 0.0),)).mean_turn(turn), [1.0, 0.0, 0.0])
    assert not Whole((("x", 0.0), ("z", 0.0))).mean_turn(turn).any()


@pytest.mark.slow
def test_friction_in_space_is_a_vector_on_the_first_body():
    """The other one carries the multipliers, since its faces are smaller."""
    contact = [{"between": ["high", "low"], "friction_coefficient": 0.5},
               {"between": ["low", "floor"]}]  # fmt: skip
    cells = {"cells": "hexahedron"}
    low = solid({"kind": "block", "size": [1.0, 0.6, 1.0], "corner": [0.0, 0.0, 0.0]}, "3d", "low",
                0.34, contact_surfaces=["top", "bottom"], **cells)  # fmt: skip
    high = solid({"kind": "block", "size": [0.5, 0.3, 0.5], "corner": [0.3, 0.605, 0.2]}, "3d",
                 "high", 0.5, contact_surfaces=["bottom"], velocity=[0.05, -0.1, 0.02],
                 **cells)  # fmt: skip
    case = scene([low, high], [BELOW], 0.3, contact, method="massless", normals="fixed", dt=0.03)
    result = impactfem.solve(case)
    dt = np.diff(columns(result, "time"))
    mass = result.summary["bodies"]["high"]["mass"]
    for letter in "xz":
        gained = mass * np.ptp(columns(result, f"high.v{letter}")[[0, -1]])
        pulled = float((columns(result, f"tangential_force.high.low.{letter}")[1:] * dt).sum())
        assert pulled < 0.0
        assert -pulled == pytest.approx(gained, rel=1e-9)
    parts = [columns(result, f"tangential_force.high.low.{x}") for x in "xyz"]
    whole = columns(result, "tangential_force.high.low")
    assert whole == pytest.approx(np.linalg.norm(parts, axis=0), rel=1e-12)


def test_a_rod_that_strikes_with_one_end_turns_by_the_moment_of_the_impulse():
    rod = Rod(name="rod", mass=2.0, length=1.0, center=[0.3, 0.6], inclination=0.5,
              velocity=[0.0, -1.0])  # fmt: skip
    case = Scene(
        title="rod", duration=0.45, bodies=[rod], obstacles=[HalfSpace(**{
            k: v for k, v in FLOOR.items() if k != "kind"})],
        contacts=[Contact(name="hit", between=["rod", "floor"], restitution=0.5)],
        solve=Solve(estimate=False),
    )  # fmt: skip
    result = impactfem.solve(case)
    angular, impulse = columns(result, "angular_momentum"), columns(result, "impulse.hit")
    (row,) = np.flatnonzero(impulse)
    assert angular[:row] == pytest.approx(-2.0 * 0.3, rel=1e-12)
    arm = columns(result, "rod.x")[row] - 0.5 * np.cos(columns(result, "rod.angle")[row - 1])
    assert angular[-1] - angular[0] == pytest.approx(arm * impulse[row], rel=1e-9)
    spin = columns(result, "rod.spin")
    assert np.diff(columns(result, "rod.angle"))[-1] == pytest.approx(
        spin[-1] * np.diff(columns(result, "time"))[-1], rel=1e-9
    )


def test_points_in_space_have_vectors():
    points = [Point(name="a", mass=1.0, position=[0.0, 1.0, 2.0], velocity=[1.0, 0.0, 0.5])]
    floor = HalfSpace(name="floor", point=[0.0, 0.0, 0.0], normal=[0.0, 0.0, 1.0])
    result = impactfem.solve(Scene(title="free", duration=0.1, bodies=points, obstacles=[floor]))
    found = [columns(result, f"angular_momentum.{x}") for x in "xyz"]
    assert np.array(found)[:, -1] == pytest.approx([0.5, 2.0, -1.0], rel=1e-12)
    assert "angular_momentum" not in result.history.data_vars


def test_of_very_many_pairs_none_has_columns():
    points = [Point(name=f"p{k}", mass=1.0, position=[float(k), 1.0]) for k in range(51)]
    floor = HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])
    roof = HalfSpace(name="roof", point=[0.0, 2.0], normal=[0.0, -1.0])
    case = Scene(title="many", duration=0.01, bodies=points, obstacles=[floor, roof])
    result = impactfem.solve(case)
    assert not [name for name in result.history.data_vars if name.startswith("force.")]
