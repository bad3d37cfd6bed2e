"""Joints on ends of bars, and on masses and surfaces of springs."""

import numpy as np
import pytest
from moving_scenes import FAR, alone, differences, stopping
from scipy.optimize import brentq

import impactfem
from impactfem.errors import SceneError
from impactfem.planning import plan

TURN = np.array([np.cos(0.3), np.sin(0.3)])
BAR = {"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
       "point": [0.0, 0.0], "axis": TURN.tolist()}  # fmt: skip
NET = {"kind": "springs", "name": "net", "mesh_size": 0.2, "pattern": "crossed", "mass": 1.0,
       "stiffness": 2000.0,
       "shape": {"kind": "block", "size": [1.0, 0.2], "corner": [0.0, 0.0]}}  # fmt: skip
BOX = {"kind": "rigid", "name": "box", "mass": 0.5,
       "shape": {"kind": "block", "size": [0.2, 0.2], "corner": [1.0, 0.0]}}  # fmt: skip


def scene(bodies, joints, duration, gravity=(0.0, 0.0), **more):
    table = {"title": "joints", "duration": duration, "gravity": list(gravity), "body": bodies,
             "joint": [{"name": f"j{k}"} | joint for k, joint in enumerate(joints)],
             "output": {"fields": []}} | more  # fmt: skip
    return impactfem.Scene.from_dict(table | {"solve": {"estimate": False} | table["solve"]})


def run(*given, **more):
    return impactfem.solve(scene(*given, **more)).history


def fixed(one, two, place):
    return {"kind": "fixed", "between": [one, two], "point": list(place)}


def mass(name, m, place, velocity=(0.0, 0.0)):
    return {"kind": "point", "name": name, "mass": m, "position": list(place),
            "velocity": list(velocity)}  # fmt: skip


def same_to_rounding(one, two, names, elements):
    """Every step rounds anew, strains more than displacements by the number of elements."""
    room = np.finfo(float).eps * elements * len(one["time"])
    for name in names:
        size = np.abs(one[name].values).max()
        assert np.abs(one[name].values - two[name].values).max() < room * size, name


def drift(history, name):
    return float(np.ptp(history[name].values))


def test_a_mass_on_the_end_of_a_bar_vibrates_with_it():
    """u = sin(k (1 - x)) with m k tan k = 1, the far end clamped: second order, energy kept."""
    m, off = 0.5, []
    k = brentq(lambda k: m * k * np.tan(k) - 1.0, 0.1, 1.5)
    end = 0.01 * np.sin(k) * TURN
    bar = BAR | {"far_end": "clamped", "displacement": f"0.01*sin({k}*(1-x))"}
    for elements in (20, 40):
        bodies, joint = [bar, mass("m", m, end)], fixed("bar", "m", end)
        history = run(bodies, [joint], 10.0, solve={"elements": elements})
        time = history["time"].values
        along = TURN @ [history["m.x"].values, history["m.y"].values]
        off.append(np.abs(along - along[0] * np.cos(k * time)).max() / along[0])
        assert drift(history, "total_energy") < 1e-13 * history["total_energy"].values[0]
        across = TURN[0] * history["m.y"].values - TURN[1] * history["m.x"].values
        assert np.abs(across).max() < 1e-15  # the bar guides it
    assert off[1] < 4e-4
    assert off[0] / off[1] == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("beside", [[], [FAR]], ids=["alone", "beside rubber"])
def test_a_bar_reflects_waves_off_a_mass(beside):
    """A step v of the bar's velocity on a free mass m: its speed is 2 v (1 - exp(-Z t / m))."""
    m, speed = 0.3, 0.01
    bar = BAR | {"velocity": f"where(x > 0.5, {speed}, 0)", "displacement": f"{speed}*max(0,x-0.5)"}
    history = run([bar, mass("m", m, [0.0, 0.0]), *beside], [fixed("m", "bar", [0.0, 0.0])], 1.0,
                  solve={"dt": 1.0 / 400})  # fmt: skip
    time, found = history["time"].values, TURN @ [history["m.vx"].values, history["m.vy"].values]
    exact = 0.0 * time
    exact[time > 0.5] = 2.0 * speed * (1.0 - np.exp(-(time[time > 0.5] - 0.5) / m))
    assert np.abs(found - exact).max() < 5e-3 * speed


def test_two_bars_end_to_end_are_one():
    ball = mass("ball", 0.7, -0.15 * TURN, 0.02 * TURN) | {"radius": 0.1}
    solve = {"dt": 0.02}
    one = run([BAR | {"length": 2.0}, ball], [], 9.0, solve=solve)
    parts = [BAR, BAR | {"name": "other", "point": TURN.tolist()}, ball]
    joined = scene(parts, [fixed("bar/far_end", "other", TURN)], 9.0, solve=solve)
    two = impactfem.solve(joined).history
    assert np.ptp(one["ball.vx"].values) > 0.01
    same_to_rounding(one, two, ("ball.x", "ball.vx", "momentum.x", "total_energy"), 100)


def test_a_joint_clamps_a_bar_as_its_own_end_does():
    """Means over steps are the same to rounding; within them the clamp keeps its own rate."""
    bar = BAR | {"velocity": "-0.01*(1-x)"}
    idle = mass("idle", 1.0, [5.0, 5.0])
    given = 3.3, (-0.01, -0.02)
    own = run([bar | {"far_end": "clamped"}, idle], [], *given, solve={"elements": 20})
    ground = fixed("ground", "bar/far_end", TURN)
    joined = run([bar, idle], [ground], *given, solve={"elements": 20})
    same_to_rounding(own, joined, ("bar.vx", "bar.vy", "momentum.x", "total_energy"), 20)


def test_impulses_pass_a_bar_by():
    """A ball on the end of a bar rebounds as if it was alone: the wave comes after."""
    ball = {"kind": "rigid", "name": "ball", "mass": 0.5, "velocity": [-0.02, 0.0],
            "shape": {"kind": "disc", "radius": 0.1, "center": [-0.1, 0.0]}}  # fmt: skip
    bar = BAR | {"axis": [1.0, 0.0], "velocity": -0.02}
    wall = {"kind": "half_space", "name": "wall", "normal": [1.0, 0.0], "point": [-0.25, 0.0]}
    law = {"between": ["ball", "wall"], "restitution": 1.0}
    history = run([bar, ball], [fixed("bar", "ball", [0.0, 0.0])], 6.0, obstacle=[wall],
                  contact=[law], solve={"dt": 0.01})  # fmt: skip
    energy = history["total_energy"].values
    assert np.ptp(energy) < 1e-12 * energy[0]
    first = np.flatnonzero(history["contact_impulse"].values)[0]
    assert history["contact_impulse"].values[first] == pytest.approx(2.0 * 0.5 * 0.02, rel=0.05)


def test_masses_pinned_to_the_ground_are_a_support():
    given = 0.3, (0.0, -9.81)
    held = run([NET | {"supports": [{"surface": "left", "kind": "fixed"}]}], [], *given,
               solve={"dt": 2e-3})  # fmt: skip
    pins = [fixed("ground", "net", [0.0, y]) for y in (0.0, 0.2)]
    pinned = run([NET], pins, *given, solve={"dt": 2e-3})
    assert np.ptp(held["net.y"].values) > 0.05
    for name in ("net.x", "net.y", "net.vx", "net.vy", "elastic_energy"):
        assert np.abs(held[name].values - pinned[name].values).max() < 1e-11


@pytest.mark.parametrize(
    ("other", "kind", "place", "speed"),
    [("net/right", "revolute", 0.1, 0.3), ("net", "fixed", 0.2, 0.6)],  # a mass does not turn
)
def test_momenta_of_a_net_and_what_spins_on_it_stay(other, kind, place, speed):
    spun = BOX | {"velocity": [speed, 0.8], "angular_velocity": 3.0}
    joint = fixed(other, "box", [1.0, place]) | {"kind": kind}
    history = run([NET | {"velocity": [0.3, 0.5]}, spun], [joint], 2.0, solve={"dt": 4e-3})
    assert abs(history["net.angle"].values[-1]) > 0.3
    for name in ("total_energy", "momentum.x", "momentum.y", "angular_momentum"):
        assert drift(history, name) < 1e-13


def test_a_net_turned_by_its_side_goes_round_and_round():
    """A motor on one side turns all of it, with what is welded on the other, and then no more."""
    drive = {"kind": "revolute", "between": ["ground", "net/left"], "point": [0.0, 0.1],
             "motor": "where(t < 1, 2, 0)"}  # fmt: skip
    history = run([NET, BOX], [drive, fixed("net/right", "box", [1.0, 0.1])], 4.0,
                  solve={"dt": 8e-3})  # fmt: skip
    for name in ("box.angle", "net.angle", "j0.q"):
        assert history[name].values[-1] == pytest.approx(7.3, abs=0.3)
    energy = history["total_energy"].values[150:]
    work = 2.0 * np.interp(1.0, history["time"].values, history["j0.q"].values)
    assert np.ptp(energy) < 1e-9
    kinetic = history["kinetic_energy"].values + history["elastic_energy"].values
    assert kinetic[-1] == pytest.approx(work, rel=1e-3)


def hung(duration=0.3, **more):
    """A net between a hinge and a bar, with a box on a spring that falls on a floor."""
    net = NET | {"shape": {"kind": "block", "size": [1.0, 0.2], "corner": [0.0, -0.2]}}
    box = BOX | {"shape": {"kind": "block", "size": [0.2, 0.2], "corner": [0.4, -0.4]}}
    bar = BAR | {"point": [1.0, 0.0], "axis": [0.0, 1.0], "area": 20.0, "youngs_modulus": 1e3}
    floor = {"kind": "half_space", "name": "floor", "normal": [0.0, 1.0], "point": [0.0, -0.45]}
    joints = [
        {"kind": "revolute", "between": ["ground", "net/left"], "point": [0.0, -0.1]},
        fixed("bar", "net", [1.0, 0.0]),
        fixed("net/bottom", "box", [0.5, -0.2]),
    ]
    laws = [{"between": ["box", "floor"], "restitution": 0.5, "friction_coefficient": 0.3},
            {"between": ["net", "floor"], "restitution": 0.0},
            {"between": ["bar", "floor"]}]  # fmt: skip
    return scene(
        [net, box, bar],
        joints,
        duration,
        (0.3, -9.81),
        obstacle=[floor],
        contact=laws,
        solve={"dt": 2e-3},
        output={"fields": [], "every": 3, "checkpoint": 20} | more,
    )


def test_restarts_go_on_to_the_bit(tmp_path, monkeypatch):
    whole = impactfem.solve(hung())
    assert whole.history["contact_impulse"].values.any()
    with stopping(monkeypatch, 60):
        impactfem.solve(hung(), checkpoints=tmp_path)
    again = impactfem.solve(hung(), checkpoints=tmp_path, restart=tmp_path)
    assert differences(whole, again) == {}


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    both = impactfem.solve(hung())
    with alone(monkeypatch):
        one = impactfem.solve(hung())
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )


def test_nets_are_joined_where_steps_are_solved_by_iterates():
    """The same motion beside rubber that touches nothing, and energy stays."""
    joints = [fixed("ground", "net", [0.0, 0.2]), fixed("net/right", "box", [1.0, 0.1])]
    given = joints, 0.1, (0.0, -9.81)
    one = run([NET, BOX], *given, solve={"dt": 2e-3})
    beside = run([NET, BOX, FAR], *given, solve={"dt": 2e-3})
    for name in ("box.x", "box.y", "box.angle", "net.x"):
        np.testing.assert_allclose(beside[name].values, one[name].values, rtol=1e-10, atol=1e-10)
    assert drift(beside, "total_energy") < 1e-10


@pytest.mark.parametrize(
    ("body", "joint", "text"),
    [
        (BAR, fixed("ground", "bar", [0.5, 0.0]), r"joints hold at \[0.0, 0.0\]"),
        (BAR, fixed("ground", "bar/end", TURN), 'no surface "bar/end"; .* one of far_end'),
        (BAR | {"far_end": "clamped"}, fixed("ground", "bar/far_end", TURN), "one of bar"),
        (NET, fixed("ground", "net", [0.03, 0.0]), r"no mass of net .* the nearest is at \(0, 0\)"),
        (NET, fixed("ground", "net/lft", [0.0, 0.1]), 'did you mean "left"'),
        (NET, fixed("ground", "net", [0.0, 0.1]) | {"kind": "revolute"}, "net does not turn"),
        (NET | {"supports": [{"surface": "left", "kind": "fixed"}]},
         fixed("ground", "net/left", [0.0, 0.1]), "no support holds are too few"),
    ],
)  # fmt: skip
def test_what_cannot_be_held_is_refused(body, joint, text):
    with pytest.raises(SceneError, match=text):
        plan(scene([body], [joint], 0.1, solve={"dt": 1e-3}))
