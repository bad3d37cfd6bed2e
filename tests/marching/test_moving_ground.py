"""Joints whose ground moves or whose coordinate is driven, and beams on moving ends."""

import numpy as np
import pytest
from moving_scenes import FAR, check_ranks, check_restart

import impactfem
from impactfem.errors import SceneError

TURN = np.array([np.cos(0.4), np.sin(0.4)])
BEAM = {"kind": "beam", "name": "beam", "length": 0.5, "height": 0.01, "width": 0.02,
        "density": 7800.0, "youngs_modulus": 2e11, "center": [0.25, 0.0]}  # fmt: skip
LINK = {"kind": "rigid", "name": "link", "mass": 2.0,
        "shape": {"kind": "block", "size": [1.0, 0.1], "corner": [0.0, -0.05]}}  # fmt: skip
STIFF = 2e11 * 0.02 * 0.01**3 / 12.0  # E I of the beam
LINE = 7800.0 * 0.01 * 0.02  # its rho A
ROOTS = np.array([1.87510406871, 4.69409113297, 7.85475743824, 10.9955407349, 14.1371683910])
FIRST = ROOTS[0] ** 2 / 0.5**2 * np.sqrt(STIFF / LINE)  # its first frequency if clamped [1/s]


def scene(bodies, joints, duration, dt, **more):
    dim = len(bodies[0].get("center") or bodies[0].get("position") or (0, 0))
    table = {"title": "moved", "duration": duration, "gravity": [0.0] * dim, "body": bodies,
             "joint": joints, "solve": {"dt": dt, "estimate": False},
             "output": {"fields": []}}  # fmt: skip
    return impactfem.Scene.from_dict(table | more)


def run(*given, **more):
    return impactfem.solve(scene(*given, **more)).history


@pytest.mark.parametrize("beside", [[], [FAR]], ids=["alone", "beside rubber"])
def test_a_mass_on_a_spring_from_a_moving_ground(beside):
    """m x'' = k (y - x) with y = Y (1 - cos w t), along any direction: second order."""
    m, k, size, w = 2.0, 50.0, 0.01, 3.0
    own, off = np.sqrt(k / m), []
    motion = [f"{size * axis}*(1-cos({w}*t))" for axis in TURN]
    spring = {"name": "s", "kind": "distance", "between": ["ground", "m"], "motion": motion,
              "points": [[0.0, 0.0], TURN.tolist()], "stiffness": k}  # fmt: skip
    bodies = [{"kind": "point", "name": "m", "mass": m, "position": TURN.tolist()}, *beside]
    for dt in (0.04, 0.02):
        h = run(bodies, [spring], 2.0, dt)
        t, c = h["time"].values, own**2 / (own**2 - w**2)
        exact = 1.0 + size * (1.0 - c * np.cos(w * t) + (c - 1.0) * np.cos(own * t))
        off.append(np.abs(TURN @ [h["m.x"].values, h["m.y"].values] - exact).max() / size)
        # What the ground puts in is taken off.
        assert np.ptp(h["total_energy"].values) < 1e-11 * h["kinetic_energy"].values.max()
    assert off[1] < 0.01
    assert off[0] / off[1] == pytest.approx(4.0, abs=0.2)


def shaken(t, size, w):
    """Tip of a clamped beam whose clamp moves by size (1 - cos w t), by its modes."""
    x = np.linspace(0.0, 1.0, 4001)
    moved = size * (1.0 - np.cos(w * t))
    for k in ROOTS:
        s = (np.cosh(k) + np.cos(k)) / (np.sinh(k) + np.sin(k))
        shape = np.cosh(k * x) - np.cos(k * x) - s * (np.sinh(k * x) - np.sin(k * x))
        share = np.trapezoid(shape, x) / np.trapezoid(shape**2, x)
        own = k**2 / 0.5**2 * np.sqrt(STIFF / LINE)
        pushed = -share * size * w**2 / (own**2 - w**2)
        moved = moved + shape[-1] * pushed * (np.cos(w * t) - np.cos(own * t))
    return moved


def test_a_cantilever_on_a_moving_clamp_follows_its_modal_series():
    """In the plane at an angle, by its support and by a joint; in space the same."""
    size, w = 1e-3, 0.6 * FIRST
    duration, along = 2.0 * np.pi / w, f"{size}*(1-cos({w}*t))"
    dt = duration / 400
    turned = BEAM | {"inclination": 0.4, "center": (0.25 * TURN).tolist()}
    motion = [f"-{TURN[1]}*{along}", f"{TURN[0]}*{along}"]
    support = {"end": "first", "kind": "clamped", "motion": motion}
    probe = [{"name": "tip", "body": "beam", "point": (0.5 * TURN).tolist()}]
    h = run([turned | {"supports": [support]}], [], duration, dt, probe=probe)
    across = -TURN[1] * h["tip.ux"].values + TURN[0] * h["tip.uy"].values
    exact = shaken(h["time"].values, size, w)
    assert np.abs(across - exact).max() < 2e-3 * np.abs(exact).max()
    assert np.ptp(h["total_energy"].values) < 1e-10 * h["kinetic_energy"].values.max()
    joint = {"name": "beam_first", "kind": "fixed", "between": ["ground", "beam"],
             "point": [0.0, 0.0], "motion": motion}  # fmt: skip
    by_joint = run([turned], [joint], duration, dt, probe=probe)
    # A support's end touches nothing and steps are chosen alike: the same to rounding.
    for name in ("tip.ux", "tip.uy", "beam_first.force", "beam_first.moment"):
        size_of = np.abs(h[name].values).max()
        assert np.abs(by_joint[name].values - h[name].values).max() < 1e-9 * size_of, name
    up = support | {"motion": ["0", "0", along]}
    space = BEAM | {"center": [0.25, 0.0, 0.0], "supports": [up]}
    h = run([space], [], duration, dt, probe=[probe[0] | {"point": [0.5, 0.0, 0.0]}])
    np.testing.assert_allclose(h["tip.uz"].values, across, atol=1e-9 * np.abs(exact).max())


def test_a_clamp_that_starts_at_once_gives_its_end_that_speed():
    """y = Y sin(w t): the end moves at once, the rest does not yet; the force is no impulse."""
    size, w = 1e-3, 0.6 * FIRST
    support = {"end": "first", "kind": "simply_supported", "motion": ["0", f"{size}*sin({w}*t)"]}
    h = run([BEAM | {"supports": [support]}], [], 0.01, 5e-5)
    assert np.ptp(h["total_energy"].values) < 1e-9 * h["kinetic_energy"].values.max()
    assert h["beam_first.moment"].values == pytest.approx(0.0, abs=1e-9)
    assert h["beam.y"].values.max() > 0.2 * size


@pytest.mark.parametrize("beside", [[], [FAR]], ids=["alone", "beside rubber"])
def test_a_driven_hinge_turns_a_link_with_the_torque_of_its_inertia(beside):
    """q = a t^2 / 2: torque J a about the pin, force m a r sqrt(1 + (a t^2)^2), energy balanced."""
    a, j, gravity = 0.5, 2.0 * (1.0 + 0.1**2) / 12.0 + 2.0 * 0.25, [0.0, -9.81]
    hinge = {"name": "pin", "kind": "revolute", "between": ["ground", "link"], "point": [0.0, 0.0],
             "position": f"{0.5 * a}*t**2"}  # fmt: skip
    h = run([LINK, *beside], [hinge], 0.5, 0.01, gravity=gravity)
    t = h["time"].values
    angle = 0.5 * a * t**2
    np.testing.assert_allclose(h["pin.q"].values, angle, atol=1e-12)
    np.testing.assert_allclose(h["link.angle"].values, angle, atol=1e-12)
    np.testing.assert_allclose(h["pin.v"].values, a * t, atol=1e-10)  # no zigzag about it
    # Forces are means of steps.
    middle = 0.5 * (t[1:] + t[:-1])
    torque = j * a + 2.0 * 9.81 * 0.5 * np.cos(0.5 * a * middle**2)
    np.testing.assert_allclose(np.abs(h["pin.moment"].values[1:]), torque, rtol=2e-4)
    assert np.ptp(h["total_energy"].values) < 1e-11 * h["kinetic_energy"].values.max()


def test_a_driven_length_lifts_a_mass():
    """An actuator between the ground and a mass: 0.3 m in a second, by a smooth law."""
    length = "0.5+0.3*(3*t**2-2*t**3)"
    rod = {"name": "rod", "kind": "distance", "between": ["ground", "m"],
           "points": [[0.0, 0.0], [0.0, 0.5]], "position": length}  # fmt: skip
    mass = {"kind": "point", "name": "m", "mass": 2.0, "position": [0.0, 0.5]}
    h = run([mass], [rod], 1.0, 0.01, gravity=[0.0, -9.81])
    assert h["m.y"].values[-1] == pytest.approx(0.8, abs=1e-12)
    assert np.ptp(h["total_energy"].values) < 1e-12 * np.ptp(h["kinetic_energy"].values)


def test_a_shaken_beam_strikes_and_gains_nothing():
    """Its tip strikes a stop: energy falls at most, and the stop never pulls."""
    support = {"end": "first", "kind": "clamped", "motion": ["0", f"2e-3*sin({0.9 * FIRST}*t)"]}
    stop = {"kind": "half_space", "name": "stop", "normal": [0.0, 1.0], "point": [0.0, -1e-3]}
    h = run([BEAM | {"supports": [support]}], [], 0.04, 1e-4, obstacle=[stop])
    energy, size = h["total_energy"].values, h["kinetic_energy"].values.max()
    assert h["contact_force"].values.max() > 1.0
    assert h["contact_force"].values.min() >= 0.0
    assert np.diff(energy).max() < 1e-9 * size


def held():
    """A beam on a moving end, and a link that is driven about its tip."""
    support = {"end": "first", "kind": "clamped", "motion": ["0", "1e-3*sin(300*t)"]}
    link = LINK | {"shape": {"kind": "block", "size": [0.1, 0.02], "corner": [0.5, -0.01]}}
    hinge = {"name": "pin", "kind": "revolute", "between": ["beam", "link"], "point": [0.5, 0.0],
             "position": "1-cos(100*t)"}  # fmt: skip
    stop = {"kind": "half_space", "name": "stop", "normal": [0.0, -1.0], "point": [0.0, 0.08]}
    law = {"between": ["link", "stop"], "restitution": 0.5}
    return scene([BEAM | {"supports": [support], "elements": 4}, link | {"mass": 0.05}], [hinge],
                 0.05, 2.5e-4, obstacle=[stop], contact=[law],
                 output={"fields": [], "checkpoint": 50})  # fmt: skip


def test_restarts_go_on_to_the_bit(tmp_path, monkeypatch):
    whole, _ = check_restart(held(), 120, tmp_path, monkeypatch)
    assert whole.history["contact_impulse"].values.max() > 0.0


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(held, monkeypatch, least=0.0)


def test_a_scene_says_its_supports_and_not_the_joints_they_make():
    made = held()
    again = impactfem.Scene.from_dict(made.to_dict())
    assert [joint["name"] for joint in made.to_dict()["joint"]] == ["pin"]
    assert [joint.name for joint in again.joints] == ["pin", "beam_first"]
    assert again == made


@pytest.mark.parametrize(
    ("keys", "support", "told"),
    [
        ({"between": ["link", "beam"], "motion": ["0", "t"]}, {}, "it moves the ground"),
        ({"motion": ["t"]}, {}, "motion"),
        ({"motion": ["0", "0", "t"]}, {}, "has 3 entries, point has 2"),
        ({"motion": ["0", "1e-3"]}, {}, "jumps from 0 to 0.001 m at t = 0"),
        ({"motion": ["0", "where(t<0.01,0,1)"]}, {}, "jumps"),
        ({"position": "sin(t)", "stiffness": 3.0}, {}, "position drives the coordinate"),
        ({"kind": "fixed", "position": "sin(t)"}, {}, "has no single coordinate"),
        ({}, {"kind": "elastic", "stiffness": 3.0, "motion": ["0", "t"]}, "moves an end that is"),
        ({}, {"motion": ["0"]}, "supports[0].motion"),
        ({"name": "beam_first"}, {"motion": ["0", "t"]}, "is that of a mass or a support"),
    ],
)
def test_what_cannot_move_is_refused(keys, support, told):
    end = {"end": "first", "kind": "clamped"} | support
    pin = {"name": "pin", "kind": "revolute", "between": ["ground", "link"], "point": [0.0, 0.0]}
    with pytest.raises(SceneError) as error:
        scene([LINK, BEAM | {"center": [3.0, 0.0], "supports": [end]}], [pin | keys], 0.05, 1e-3)
    assert told in str(error.value)
