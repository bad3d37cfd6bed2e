"""Starts at rest that friction holds: inclines, a ladder, what is too steep."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart
from test_rest_of_few import BLOCK, FLOOR, GROUND, box, point, scene

import impactfem
from impactfem import SceneError

SLOPE = 0.3  # of gravity along the floor
RUBBER = BLOCK | {
    "name": "b", "shape": {"kind": "block", "size": [0.1, 0.05], "corner": [0.0, 0.0]},
    "supports": [],
}  # fmt: skip


def rough(mu, *names, **more):
    return [{"between": list(names or ("b", "floor")), "friction_coefficient": mu} | more]


def run(bodies, law, slope=SLOPE, method=None, **more):
    solve = {"estimate": False} | ({"method": method} if method else {"dt": 1e-4})
    made = scene(bodies, gravity=(10.0 * slope, -10.0), contact=law, solve=solve, **more)
    return impactfem.solve(made)


def held(result, weight, slope=SLOPE, pair="b.floor", rel=1e-6):
    """It stays where it starts, and friction takes all that pulls it down the slope."""
    history = result.history
    assert history["kinetic_energy"].values.max() < 1e-16
    assert history[f"force.{pair}"].values == pytest.approx(10.0 * weight, rel=rel)
    pulled = np.abs(history[f"tangential_force.{pair}"].values)
    assert pulled == pytest.approx(10.0 * slope * weight, rel=rel)
    assert not result.summary["energy"]["grows"]


@pytest.mark.parametrize(
    ("method", "strain"),
    [
        ("conserving", "small"), ("massless", "small"), ("explicit", "small"),
        ("moreau_jean", "small"), ("conserving", "finite"), ("explicit", "finite"),
    ],
)  # fmt: skip
def test_a_soft_block_is_held_on_an_incline(method, strain):
    result = run([RUBBER | {"strain": strain}], rough(0.5), method=method)
    held(result, 5.5, rel=1e-6 if strain == "small" else 1e-5)  # the floor is met askew
    if strain == "small" and method in {"conserving", "massless", "explicit"}:
        with pytest.raises(SceneError, match=r"nothing holds body b against its translation along"):
            run([RUBBER], rough(0.28), method=method)


@pytest.mark.parametrize(
    ("body", "weight", "spare"),
    [
        (box((0.03, 0.0)), 0.8, 1e-3), (box((0.03, 0.1)), 0.8, 1e-3), (point(0.01), 0.1, 1e-6)
    ],
    ids=["box", "box above", "point"],
)  # fmt: skip
def test_static_friction_holds_up_to_its_coefficient(body, weight, spare):
    """The larger coefficient counts, at the start and after it."""
    held(run([body], rough(0.1, static_friction_coefficient=SLOPE * (1.0 + spare))), weight)
    with pytest.raises(SceneError, match=r"nothing holds body b against its"):
        run([body], rough(0.1, static_friction_coefficient=SLOPE * (1.0 - spare)))


def test_a_box_in_space_is_held_at_an_odd_angle():
    body = box((0.03, 0.0, 0.0), (0.04, 0.03, 0.02), angular_velocity=[0.0, 0.0, 0.0])
    made = scene([body], [GROUND], (1.7, -2.3, -10.0), contact=rough(0.3))
    history = impactfem.solve(made).history
    assert history["kinetic_energy"].values.max() < 1e-20
    pulled = [history[f"tangential_force.b.floor.{axis}"].values[-1] for axis in "xy"]
    assert np.abs(pulled) == pytest.approx([0.024 * 1.7, 0.024 * 2.3], rel=1e-9)


def test_a_box_on_a_soft_block_on_an_incline():
    law = rough(0.5, "b", "s") + rough(0.5, "s", "floor")
    result = run([BLOCK, box((0.03, 0.1))], law)
    held(result, 0.8, pair="b.s", rel=3e-3)  # the block leans by 6e-4


def test_a_ladder_stands_on_a_rough_floor():
    """Against a smooth wall at 60 degrees: mu >= cot(60) / 2 = .28868, wall W cot(60) / 2."""
    low = 1e-9 + 0.005
    ladder = {"kind": "rod", "name": "b", "length": 1.0, "mass": 1.0, "radius": 0.005,
              "center": [0.245 - 1e-9, 0.5 * np.sin(np.pi / 3) + low],
              "inclination": np.pi / 3}  # fmt: skip
    wall = {"kind": "half_space", "name": "wall", "point": [0.5, 0.0], "normal": [-1.0, 0.0]}

    def stood(mu):
        contacts = [*rough(mu), {"between": ["b", "wall"]}]
        return impactfem.solve(scene([ladder], [FLOOR, wall], (0.0, -10.0), contact=contacts))

    with pytest.raises(impactfem.SceneError, match=r"nothing holds body b .* or more friction"):
        stood(0.2886)
    history = stood(0.2887).history
    assert history["kinetic_energy"].values.max() < 1e-14
    assert history["force.b.wall"].values[-1] == pytest.approx(5.0 / np.tan(np.pi / 3), rel=1e-6)
    assert history["force.b.floor"].values[-1] == pytest.approx(10.0, rel=1e-6)


def test_friction_does_not_hold_a_disc_that_can_roll():
    disc = {"kind": "rigid", "name": "b", "mass": 1.0,
            "shape": {"kind": "disc", "radius": 0.02, "center": [0.0, 0.02]}}  # fmt: skip
    with pytest.raises(SceneError, match="nothing holds body b against its"):
        run([disc], rough(0.5))


def leaning():
    law = rough(0.5, "b", "s") + rough(0.5, "s", "floor")
    made = scene([BLOCK, box((0.03, 0.1))], gravity=(3.0, -10.0), contact=law, dt=2e-4)
    return made.with_settings({"output.checkpoint": 10})


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    check_restart(leaning(), 15, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(leaning, monkeypatch)
