"""Static friction, resistance to rolling and spinning, Poisson's restitution of rigid bodies."""

from dataclasses import replace

import numpy as np
import pytest
from moving_scenes import FAR, FAR_3D, alone_or_beside

import impactfem
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solutions import all_solutions, jams
from impactfem.errors import SceneError
from impactfem.marching.newton_march import NewtonMarch
from impactfem.marching.solids import SolidMarch
from impactfem.scene import Scene

_G = 9.81
_FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
_GROUND = {
    "kind": "half_space", "name": "floor", "point": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]
}  # fmt: skip


def scene(bodies, law, gravity, duration=0.2, obstacles=(_FLOOR,), dt=1e-3, **solve):
    return Scene.from_dict(
        {
            "title": "law", "duration": duration, "gravity": gravity, "body": list(bodies),
            "obstacle": list(obstacles), "contact": law if isinstance(law, list) else [law],
            "solve": {"dt": dt, "estimate": False} | solve, "output": {"fields": []},
        }
    )  # fmt: skip


def block(**more):
    shape = {"kind": "block", "size": [0.2, 0.05], "corner": [-0.1, 0.0]}
    return {"kind": "rigid", "name": "b", "shape": shape, "density": 1000.0} | more


def disc(**more):
    shape = {"kind": "disc", "radius": 0.1, "center": [0.0, 0.1]}
    return {"kind": "rigid", "name": "b", "shape": shape, "mass": 2.0} | more


def ball(**more):
    shape = {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.1, 0.0]}
    return {"kind": "rigid", "name": "b", "shape": shape, "mass": 2.0} | more


def law(**more):
    return {"between": ["b", "floor"], "friction_coefficient": 0.3} | more


def last(result, name):
    return result.history[name].values[-1]


@pytest.mark.parametrize("beside", [(), (FAR,)], ids=["alone", "beside finite strain"])
@pytest.mark.parametrize(
    ("slope", "speed", "expected"),
    [
        (0.5 * (1.0 - 1e-6), 0.0, 0.0),
        (0.5 * (1.0 + 1e-6), 0.0, 0.2 + 5e-7),
        (0.4, 0.1, 0.1),
        (0.25, -0.001, 0.0),
    ],
)
def test_what_rests_is_held_by_static_friction_and_what_slips_by_the_other(
    slope, speed, expected, beside
):
    """Slopes are those of gravity; a block that stops is held from then on."""
    rough = law(static_friction_coefficient=0.5)
    body = block(velocity=[speed, 0.0])
    result = impactfem.solve(scene([*beside, body], rough, [_G * slope, -_G], duration=0.1))
    assert last(result, "b.vx") == pytest.approx(
        (speed if expected else 0.0) + 0.1 * _G * expected, abs=1e-9
    )


@pytest.mark.parametrize("beside", [(), (FAR,)], ids=["alone", "beside finite strain"])
def test_a_point_is_held_too(beside):
    point = {"kind": "point", "name": "b", "mass": 1.0, "position": [0.0, 0.0]}
    rough = law(static_friction_coefficient=0.5)
    result = impactfem.solve(scene([*beside, point], rough, [0.45 * _G, -_G], duration=0.05))
    assert abs(last(result, "b.x")) < 1e-12


@alone_or_beside
def test_a_ball_that_rolls_is_braked_by_its_resistance(beside):
    """m a = -F, I a / R = F R - r N with F at the floor: a = 5/7 g r / R."""
    body = ball(velocity=[0.5, 0.0, 0.0], angular_velocity=[0.0, 0.0, -5.0])
    rough = law(rolling_resistance=2e-3)
    bodies = [body, *[FAR_3D] * beside]
    result = impactfem.solve(scene(bodies, rough, [0.0, -_G, 0.0], obstacles=[_GROUND]))
    braked = 5.0 / 7.0 * _G * 2e-3 / 0.1
    assert last(result, "b.vx") == pytest.approx(0.5 - 0.2 * braked, abs=1e-10)
    energy = result.history["total_energy"].values
    lost = pytest.approx(last(result, "friction_work"), rel=1e-6 if beside else 1e-9)
    assert energy[-1] - energy[0] == lost  # of rubber that sways rounds
    assert last(result, "friction_work") == pytest.approx(-2.0 * _G * 2e-3 * 1.0, rel=0.2)


_LYING = {"axis": [1.0, 0.0, 0.0], "angle": np.pi / 2.0}  # along z
_CAN = {
    "shape": {"kind": "cylinder", "radius": 0.1, "height": 0.3, "center": [0.0, -0.05, 0.0]},
    "orientation": _LYING,
}  # fmt: skip
_CAPSULE = {
    "shape": {
        "kind": "capsule", "radius": 0.1, "length": 0.3, "center": [0.0, 0.1, 0.0],
        "axis": [0.0, 0.0, 1.0],
    },
}  # fmt: skip


@pytest.mark.parametrize(("body", "balls"), [(_CAN, 0.0), (_CAPSULE, 4.0 / 13.0)])
def test_cylinders_and_capsules_that_roll_are_braked(body, balls):
    """a = g r / (R (1 + k)), k = I / (m R^2): 1/2 of a cylinder, 2/5 of the ends of a capsule."""
    moving = ball(velocity=[0.5, 0.0, 0.0], angular_velocity=[0.0, 0.0, -5.0]) | body
    rough = law(rolling_resistance=2e-3)
    result = impactfem.solve(scene([moving], rough, [0.0, -_G, 0.0], obstacles=[_GROUND]))
    braked = _G * 2e-3 / (0.1 * (1.5 - 0.1 * balls))
    assert last(result, "b.vx") == pytest.approx(0.5 - 0.2 * braked, abs=1e-12)
    assert last(result, "b.wz") == pytest.approx(-10.0 * last(result, "b.vx"), abs=1e-11)
    lost = np.ptp(result.history["total_energy"].values)
    assert lost == pytest.approx(-last(result, "friction_work"), abs=1e-12)


@alone_or_beside
@pytest.mark.parametrize(("slope", "holds"), [(0.02 - 1e-6, True), (0.02 + 1e-6, False)])
def test_a_disc_rests_on_a_slope_up_to_resistance_over_radius(slope, holds, beside):
    rough = law(rolling_resistance=2e-3)
    result = impactfem.solve(scene([disc(), *[FAR] * beside], rough, [_G * slope, -_G]))
    expected = 0.0 if holds else 2.0 / 3.0 * _G * 1e-6 * 0.2
    assert last(result, "b.vx") == pytest.approx(expected, abs=1e-10)


@alone_or_beside
def test_a_ball_that_spins_stops_by_its_resistance(beside):
    """I dw/dt = -s m g; with the other law it would spin for ever."""
    body = ball(angular_velocity=[0.0, 3.0, 0.0])
    rough = law(spinning_resistance=1e-3)
    bodies = [body, *[FAR_3D] * beside]
    result = impactfem.solve(scene(bodies, rough, [0.0, -_G, 0.0], obstacles=[_GROUND]))
    slower = 1e-3 * _G / (0.4 * 0.1**2)
    assert last(result, "b.wy") == pytest.approx(3.0 - 0.2 * slower, abs=1e-9)


@alone_or_beside
def test_balls_that_spin_on_each_other_keep_their_angular_momentum(beside):
    """Pressed on each other: moments act on both, I dw/dt = -s N."""
    one = ball(angular_velocity=[0.0, 2.0, 0.0], force=["0", "-5", "0"])
    two = ball(name="c", force=["0", "5", "0"])
    two["shape"] = {"kind": "sphere", "radius": 0.1, "center": [0.0, -0.1, 0.0]}
    rough = {
        "between": ["b", "c"], "friction_coefficient": 0.3, "rolling_resistance": 1e-2,
        "spinning_resistance": 5e-3,
    }  # fmt: skip
    bodies = [one, two, *[FAR_3D] * beside]
    result = impactfem.solve(scene(bodies, rough, [0.0] * 3, duration=0.05, obstacles=()))
    each = [result.history[f"angular_momentum.{axis}"].values for axis in "xyz"]
    assert np.abs(np.array(each).T - [each[0][0], each[1][0], each[2][0]]).max() < 1e-15
    slower = 5e-3 * 5.0 / (0.4 * 2.0 * 0.1**2)
    assert last(result, "b.wy") == pytest.approx(2.0 - 0.05 * slower, abs=1e-9)


@alone_or_beside
@pytest.mark.parametrize("rubs", [False, True])
def test_expansion_gives_back_what_compression_took(rubs, beside):
    """A ball drops on one that rests: Poisson (e = 0 above, 1/2 below) leaves both with 1/4."""
    below = {"kind": "point", "name": "a", "mass": 1.0, "radius": 0.1, "position": [0.0, 0.1]}
    above = below | {"name": "b", "position": [0.0, 0.3005], "velocity": [0.0, -1.0]}
    aside = below | {"name": "c", "position": [2.0, 0.1]}
    laws = [
        {"between": ["a", "b"], "restitution_law": "poisson"},
        {"between": ["a", "floor"], "restitution_law": "poisson", "restitution": 0.5},
        {"between": ["c", "floor"], "friction_coefficient": 0.3 * rubs},
    ]
    bodies = [below, above, aside, *[FAR] * beside]
    found = scene(bodies, laws, [0.0, -0.1], duration=2e-3, dt=1e-5)
    result = impactfem.solve(found)
    speeds = [last(result, f"{name}.vy") for name in "ab"]
    assert speeds == pytest.approx([0.25, 0.25], abs=1e-3)
    newton = [entry | {"restitution_law": "newton"} for entry in laws[:2]] + laws[2:]
    result = impactfem.solve(scene(bodies, newton, [0.0, -0.1], 2e-3, dt=1e-5))
    assert [last(result, f"{name}.vy") for name in "ab"] == pytest.approx([0.0, 0.0], abs=1e-3)


@alone_or_beside
def test_an_impact_reverses_slip_by_its_tangential_restitution(beside):
    """A superball: v_x = (1 - e_t) 5/7 + e_t 3/7 of what it was, whoever else is in the scene."""
    body = ball(velocity=[1.0, -1.0, 0.0])
    body["shape"] = {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.1005, 0.0]}
    rough = law(friction_coefficient=10.0, restitution=1.0, tangential_restitution=0.5)
    bodies = [body, *[FAR_3D] * beside]
    result = impactfem.solve(
        scene(bodies, rough, [0.0] * 3, duration=2e-3, obstacles=[_GROUND], dt=1e-4)
    )
    found = [last(result, name) for name in ("b.vx", "b.vy")]
    assert found == pytest.approx([4.0 / 7.0, 1.0], abs=1e-12)


@pytest.mark.parametrize(
    ("body", "more", "message"),
    [
        (block(), {"static_friction_coefficient": 0.2}, "smaller than friction_coefficient"),
        (block(), {"rolling_resistance": 1e-3}, "none of b and floor is round"),
        (disc(), {"spinning_resistance": 1e-3}, "none of b and floor is round"),
        (disc(), {"rolling_resistance": 1e-3, "friction_coefficient": 0.0}, "needs friction_coef"),
        (block(), {"restitution_law": "poisson"}, "not available with friction"),
        (block(), {"restitution_law": "other"}, "restitution_law"),
    ],
)
def test_laws_that_make_no_sense_are_refused(body, more, message):
    with pytest.raises(SceneError, match=message):
        scene([body], law(**more), [0.0, -_G])


def _rod_answers(angle):
    """A rod of mass and length 1 that leans at an angle and slides on its lower end."""
    n, t = np.cos(angle), np.sin(angle)
    return np.array([[1.0 + 3.0 * n**2, 3.0 * n * t], [3.0 * n * t, 1.0 + 3.0 * t**2]])


@pytest.mark.parametrize(("near", "expected"), [(0.8, 50.641598), (1.4, 73.048469)])
def test_a_rod_jams_between_two_angles(near, expected):
    middle = np.radians(63.434949)
    low, high = sorted((near, middle))

    def jammed(angle, mu=1.5):
        return bool(jams(_rod_answers(angle), np.array([mu]), np.ones((1, 1)))[0])

    assert jammed(middle)
    assert not jammed(near)
    for _ in range(60):
        half = 0.5 * (low + high)
        low, high = (half, high) if jammed(half) == jammed(low) else (low, half)
    assert np.degrees(low) == pytest.approx(expected, abs=5e-7)
    assert not jammed(middle, 4.0 / 3.0 - 1e-9)
    assert jammed(middle, 4.0 / 3.0 + 1e-9)


def test_a_jammed_rod_allows_two_motions_more():
    answers, none = _rod_answers(np.radians(63.0)), np.zeros(1)
    lifted = ConeProblem(answers, np.array([[1e-3, 1.0]]), none + 1.5, none)
    assert len(all_solutions(lifted)) == 3  # open, slip, and an impulse that ends the slip
    assert len(all_solutions(replace(lifted, friction=none + 1.2))) == 1


@pytest.mark.parametrize(("angle", "jammed"), [(60.0, True), (45.0, False)])
def test_a_run_says_that_a_rod_jams_and_what_was_taken(angle, jammed):
    turned, half = np.radians(angle), 0.5
    center = [half * np.cos(turned), half * np.sin(turned) + 1e-4]
    shape = {"kind": "block", "size": [1.0, 1e-5], "corner": [center[0] - half, center[1]]}
    rod = {
        "kind": "rigid", "name": "b", "shape": shape, "mass": 1.0, "inertia": 1.0 / 12.0,
        "angle": turned, "velocity": [-1.0, 0.0],
    }  # fmt: skip
    told = impactfem.solve(
        scene([rod], law(friction_coefficient=1.5), [0.0, -_G], duration=0.01, dt=1e-4)
    ).summary
    findings = [f for f in told["verdict"]["findings"] if f["code"] == "friction_nonunique"]
    assert len(findings) == jammed
    if jammed:
        known = told["details"]["friction_nonunique"]
        assert known["solutions"] == 0
        assert known["taken"] == "an impulse that ends the slip"
        assert "no bounded force" in findings[0]["text"]


@pytest.mark.parametrize(
    ("rubs", "dimension", "beside"), [(False, 1, False), (True, 6, False), (True, 6, True)]
)
def test_a_block_on_four_corners_says_what_is_not_determined(rubs, dimension, beside):
    """Beside rubber without friction three corners may be found to carry it, which is one way."""
    shape = {"kind": "block", "size": [0.2, 0.1, 0.2], "corner": [-0.1, 0.0, -0.1]}
    body = {"kind": "rigid", "name": "b", "shape": shape, "mass": 4.0}
    rough = law(friction_coefficient=0.3 * rubs)
    bodies = [body, *[FAR_3D] * beside]
    told = impactfem.solve(
        scene(bodies, rough, [0.0, -_G, 0.0], duration=0.01, obstacles=[_GROUND])
    )
    known = told.summary["details"]["overconstrained"]
    assert known["dimension"] == dimension
    low, high = known["limits"]
    assert low == pytest.approx(0.0, abs=1e-6)
    assert high == pytest.approx(0.5 * 4.0 * _G, rel=1e-6)
    (finding,) = [f for f in told.summary["verdict"]["findings"] if f["code"] == "overconstrained"]
    assert finding["severity"] == "note"
    assert finding["value"] == dimension
    assert told.history["contact_force"].values[-1] == pytest.approx(4.0 * _G, rel=1e-9)


@pytest.mark.parametrize(("march", "beside"), [(SolidMarch, ()), (NewtonMarch, (FAR,))])
def test_a_restart_knows_what_stuck_and_what_was_said(march, beside, tmp_path, monkeypatch):
    """Stopped while static friction holds; with the other coefficient alone it would slip."""
    rough = law(static_friction_coefficient=0.5)
    whole = scene([*beside, block()], rough, [0.4 * _G, -_G], duration=0.04)
    whole = whole.with_settings({"output.checkpoint": 20})
    straight = impactfem.solve(whole)
    assert abs(last(straight, "b.vx")) < 1e-12

    def stopped(self):
        if self.layer == 30:
            raise KeyboardInterrupt
        return advance(self)

    advance = march._advance
    monkeypatch.setattr(march, "_advance", stopped)
    with pytest.raises(KeyboardInterrupt):
        impactfem.solve(whole, checkpoints=tmp_path)
    monkeypatch.undo()
    again = impactfem.solve(whole, checkpoints=tmp_path, restart=tmp_path)
    for name, series in straight.history.items():
        np.testing.assert_array_equal(again.history[name].values, series.values)
    told = [result.summary["details"]["overconstrained"] for result in (straight, again)]
    assert told[0] == told[1]
