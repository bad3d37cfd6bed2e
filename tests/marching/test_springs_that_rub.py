"""Contacts that give way and rub: Coulomb's cone on the springs' forces, energy, rolling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_scenes import FAR, FAR_3D, alone_or_beside, check_ranks, check_restart
from scipy.integrate import solve_ivp

import impactfem
from impactfem import Scene, SceneError
from impactfem.contact.friction_solver import Solving
from impactfem.contact.layer_law import Layer, solve_layer
from impactfem.contact.speed_law import Halfway
from impactfem.contact.springs import ContactSprings

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
FLOOR3 = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0, 0.0], "normal": [0, 0, 1]}
HERTZ = {"between": ["ball", "floor"], "stiffness": 1e8, "stiffness_exponent": 1.5}


def scene(bodies, laws, duration, dt, obstacles=(FLOOR,), **more):
    return Scene.from_dict(
        {"title": "springs that rub", "duration": duration, "body": bodies, "contact": laws,
         "obstacle": list(obstacles), "output": {"fields": []},
         "solve": {"estimate": False, "dt": dt}} | more
    )  # fmt: skip


def disc(name="ball", x=0.0, speed=1.0, mass=0.5):
    return {"kind": "rigid", "name": name, "mass": mass, "velocity": [speed, 0.0],
            "shape": {"kind": "disc", "radius": 0.1, "center": [x, 0.1]}}  # fmt: skip


def lost(history):
    """Energy less the work of friction, but for a constant [J]."""
    return history["total_energy"].values - history["friction_work"].values


def layer(seed, count, dim, mu, exponent, rule):
    """A layer of springs between nodes with mass, springs on massless ones, and no springs."""
    random = np.random.default_rng(seed)

    def spd(size):
        root = random.standard_normal((size, size + 2))
        return root @ root.T / size

    across = random.random(count) < 0.5
    springs = across | (random.random(count) < 0.5)
    soft = ContactSprings(
        np.where(springs, random.uniform(0.3, 3.0, count), np.inf),
        np.where(springs, exponent, 1.0),
    )
    heavy = np.repeat(across, dim)
    static = np.where(heavy[:, None] | heavy, 0.0, spd(count * dim))
    response = spd(count * dim)
    force, place = random.standard_normal((2, count, dim))
    force[:, 0] = np.maximum(force[:, 0], 0.0)
    place[:, 0] = np.where(force[:, 0] > 0.0, 0.0, np.abs(place[:, 0]))
    size = np.linalg.norm(force[:, 1:], axis=1)
    force[:, 1:] *= (mu * force[:, 0] * random.random(count) * ~across / size)[:, None]

    def by(matrix, values):
        return (matrix @ values.ravel()).reshape(values.shape)

    def inside(place, force):
        found = place - by(static, force)
        found[:, 0] -= soft.depth(force[:, 0])
        return found

    def stored(force):
        return 0.5 * float((force * by(static, force)).sum()) + soft.energy(force[:, 0]).sum()

    begin = inside(place, force)
    free = begin + random.standard_normal(begin.shape)
    ways = random.standard_normal(free.shape)
    none = np.zeros(count, dtype=bool)
    made = Layer(
        free, response, static, (force, place), np.full(count, mu), soft,
        Halfway(none, ways, none, across),
    )  # fmt: skip
    found = solve_layer(made, rule, Solving.to(1e-15))
    moved = free + by(response, found.force) - begin
    kept = np.where(across[:, None] & (np.arange(dim) > 0), 0.0, found.multiplier)
    change = float((found.force * moved).sum()) + stored(kept) - stored(force)
    end = free + by(response, found.force) + by(static, kept)
    end[:, 0] += soft.depth(kept[:, 0])
    return found, across, change, end, ways + by(response, found.force)


_CASES = st.integers(0, 2**32), st.integers(1, 5), st.integers(2, 3), st.floats(0.01, 0.8)


@settings(max_examples=80, deadline=None)
@given(*_CASES, st.sampled_from([1.0, 1.5, 2.5]), st.sampled_from(["conserving", "dissipative"]))
def test_layers_lose_the_work_of_friction_and_obey_its_law(seed, count, dim, mu, exponent, rule):
    found, across, change, end, speed = layer(seed, count, dim, mu, exponent, rule)
    scale = 1.0 + np.abs(found.place).max() * np.abs(found.force).max()
    assert 0.0 <= found.theta <= 1.0
    excess = change - found.work.sum()
    assert excess < 1e-11 * scale
    assert rule == "dissipative" or excess > -1e-11 * scale
    np.testing.assert_allclose(found.place, end, atol=1e-10 * scale)
    assert end[:, 0].min() > -1e-9 * scale
    assert np.abs(end[:, 0] * found.multiplier[:, 0]).max() < 1e-9 * scale
    # Between nodes with mass the force of the layer is against the speed at its end.
    bound, size = mu * found.force[:, 0], np.linalg.norm(found.force[:, 1:], axis=1)
    assert (size <= bound + 1e-10 * scale).all()
    fast = np.linalg.norm(speed[:, 1:], axis=1)
    against = found.force[:, 1:] * fast[:, None] + bound[:, None] * speed[:, 1:]
    assert np.abs(against[across]).max(initial=0.0) < 1e-9 * scale**2


def struck(mu, duration, radius=0.1, mass=0.5):
    """Place, velocity and spin of a ball that strikes a floor askew and spins, by its equations."""
    inertia = 0.4 * mass * radius**2

    def rate(_, y, slides):
        push = 1e8 * max(radius - y[2], 0.0) ** 1.5
        slip = np.array([y[3] - radius * y[7], y[4] + radius * y[6]])
        pull = -mu * push * slip / np.linalg.norm(slip) if slides else np.zeros(2)
        turned = np.array([radius * pull[1], -radius * pull[0], 0.0]) / inertia
        return np.concatenate([y[3:6], pull / mass, [push / mass], turned])

    def sticks(_, y, __):
        return float(np.hypot(y[3] - radius * y[7], y[4] + radius * y[6])) - 1e-9

    sticks.terminal = True
    start = [0.0, 0.0, radius, 1.0, 0.4, -1.0, 3.0, -8.0, 5.0]
    limits = {"rtol": 1e-10, "atol": 1e-12, "max_step": duration / 100}
    first = solve_ivp(rate, (0.0, duration), start, args=(True,), events=sticks, **limits)
    rest = solve_ivp(rate, (first.t[-1], duration), first.y[:, -1], args=(False,), **limits)
    return rest.y[:, -1]


@pytest.mark.parametrize(("mu", "beside"), [(0.25, False), (0.6, False), (0.6, True)])
def test_a_spinning_ball_strikes_a_floor_askew(mu, beside):
    """With 0.25 it slides, with 0.6 it comes to roll in the contact: places to second order."""
    known, off = struck(mu, 3e-3), []
    ball = {"kind": "rigid", "name": "ball", "mass": 0.5, "velocity": [1.0, 0.4, -1.0],
            "shape": {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.0, 0.1]},
            "angular_velocity": [3.0, -8.0, 5.0]}  # fmt: skip
    for steps in (150, 300):
        bodies, law = [ball, *[FAR_3D] * beside], HERTZ | {"friction_coefficient": mu}
        made = scene(bodies, [law], 3e-3, 3e-3 / steps, [FLOOR3])
        history = impactfem.solve(made).history
        names = [*"xyz", "vx", "vy", "vz", "wx", "wy", "wz"]
        found = np.array([history[f"ball.{name}"].values[-1] for name in names])
        atol = 1e-5 if beside else 1e-6  # there arms turn to second order too
        np.testing.assert_allclose(found[3:], known[3:], atol=atol)
        off.append(np.abs(found - known)[:3].max())
        assert np.ptp(lost(history)) < 1e-12
        assert np.diff(history["friction_work"].values).max() <= 0.0
    assert off[0] < 1e-6
    assert 3.5 < off[0] / off[1] < 4.5


@pytest.mark.parametrize(
    ("shape", "beside"), [("disc", False), ("sphere", False), ("sphere", True)]
)
def test_a_ball_on_a_dent_slides_and_then_rolls(shape, beside):
    """Two thirds and five sevenths of the speed; energy less friction stays to rounding."""
    ball, floor = disc(), FLOOR
    if shape == "sphere":
        ball = disc() | {"velocity": [1.0, 0.0, 0.0]}
        ball["shape"] = {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.0, 0.1]}
        floor = FLOOR3
    gravity = [0.0] * (len(ball["velocity"]) - 1) + [-9.81]
    laws = [HERTZ | {"friction_coefficient": 0.3}]
    bodies = [ball, *[FAR if shape == "disc" else FAR_3D] * beside]
    history = impactfem.solve(scene(bodies, laws, 0.16, 5e-4, [floor], gravity=gravity)).history
    rolls = {"disc": 2.0 / 3.0, "sphere": 5.0 / 7.0}[shape]
    assert history["ball.vx"].values[-1] == pytest.approx(rolls, rel=1e-12)
    assert np.ptp(lost(history)) < 1e-13


@pytest.mark.parametrize(
    ("stiffness", "exponent", "beside"),
    [(2e4, 1.0, False), (1e6, 1.5, False), (1e8, 1.5, False), (1e6, 1.5, True)],
)
def test_a_body_on_a_spring_slides_to_rest(stiffness, exponent, beside):
    """It falls into its dent and bobs: the way is that of v - mu (g t + v_y), 1e-3 longer."""
    point = {"kind": "point", "name": "ball", "mass": 0.5, "position": [0.0, 0.0],
             "velocity": [1.0, 0.0]}  # fmt: skip
    law = HERTZ | {"stiffness": stiffness, "stiffness_exponent": exponent}
    laws = [law | {"friction_coefficient": 0.3}]
    bodies = [point, *[FAR] * beside]
    history = impactfem.solve(scene(bodies, laws, 0.4, 8e-4, gravity=[0.0, -9.81])).history
    x, y, speed, lift = (history[f"ball.{name}"].values for name in ("x", "y", "vx", "vy"))
    slides = speed > 1e-9
    known = 1.0 - 0.3 * (9.81 * history["time"].values + lift)
    np.testing.assert_allclose(speed[slides], known[slides], atol=1e-12)
    assert np.count_nonzero(slides) == pytest.approx(0.34 / 8e-4, rel=0.02)
    assert x[-1] == pytest.approx(1.0 / (2 * 0.3 * 9.81), rel=5e-3)
    assert x[-1] == pytest.approx(x[-25], abs=1e-12)
    assert np.ptp(lost(history)) < 1e-13
    assert y.max() < 1e-12


@alone_or_beside
def test_a_spring_in_one_pair_beside_friction_in_others(beside):
    """Discs on a rough floor that strike each other, at one height: as without the floor."""
    laws = [{"between": ["ball", "other"], "stiffness": 1e8, "stiffness_exponent": 1.5},
            {"between": ["*", "floor"], "friction_coefficient": 0.2}]  # fmt: skip
    two = [disc(), disc("other", 0.201, 0.0, 1.5), *[FAR] * beside]
    history = impactfem.solve(scene(two, laws, 2.4e-3, 1e-5, gravity=[0.0, -9.81])).history
    before, after = (history["ball.vx"].values[k] for k in (0, -1))
    # Friction takes up to mu g t in 2.4 ms, Newton's law of e = 1 gives -1/2.
    assert before == 1.0
    assert after == pytest.approx(-0.5, abs=0.2 * 9.81 * 2.4e-3)
    assert np.ptp(lost(history)) < 1e-12


BLOCK = {"kind": "rigid", "name": "ball", "mass": 2.0, "velocity": [0.0, -1.0],
         "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, 0.0]}}  # fmt: skip
DEEP = BLOCK | {
    "velocity": [0.0, 0.0, -1.0],
    "shape": {"kind": "block", "size": [0.2, 0.1, 0.1], "corner": [0.0, 0.0, 0.0]},
}


@pytest.mark.parametrize(("block", "floor", "corners"), [(BLOCK, FLOOR, 2), (DEEP, FLOOR3, 4)])
def test_a_block_has_a_spring_at_each_corner(block, floor, corners):
    """It falls flat as a ball on a spring of all of them: d = (p + 1) m v^2 / (2 n K), ^1/(p+1)."""
    law = HERTZ | {"stiffness": 1e6}
    dent = (2.5 * 2.0 / (2.0 * corners * 1e6)) ** 0.4
    history = impactfem.solve(scene([block], [law], 6.0 * dent, 0.01 * dent, [floor])).history
    assert history["indentation"].values.max() == pytest.approx(dent, rel=1e-4)
    force = corners * 1e6 * dent**1.5
    assert history["contact_force"].values.max() == pytest.approx(force, rel=1e-3)
    upwards = history[f"ball.v{'yz'[corners // 4]}"].values[-1]
    assert upwards == pytest.approx(1.0, abs=1e-9)
    assert np.ptp(history["total_energy"].values) < 1e-11


@alone_or_beside
def test_a_block_on_springs_slides_to_rest(beside):
    law = HERTZ | {"stiffness": 1e6, "stiffness_exponent": 1.0, "friction_coefficient": 0.3}
    slides = BLOCK | {"velocity": [1.0, 0.0]}
    bodies = [slides, *[FAR] * beside]
    history = impactfem.solve(scene(bodies, [law], 0.4, 8e-4, gravity=[0.0, -9.81])).history
    assert history["ball.x"].values[-1] == pytest.approx(1.0 / (2 * 0.3 * 9.81), rel=1e-3)
    assert np.ptp(lost(history)) < 1e-8


def bouncing(*beside):
    law = {"stiffness": 1e6, "stiffness_exponent": 1.5, "friction_coefficient": 0.3}
    laws = [law | {"between": ["grain", "floor"]}, law | {"between": ["disc", "grain"]},
            law | {"between": ["disc", "floor"], "rolling_resistance": 1e-3}]  # fmt: skip
    point = {"kind": "point", "name": "grain", "mass": 0.5, "radius": 0.05,
             "position": [0.03, 0.26]}  # fmt: skip
    return scene([disc("disc"), point, *beside], laws, 0.06, 2e-4, gravity=[0.0, -9.81],
                 output={"fields": [], "checkpoint": 100})  # fmt: skip


@pytest.mark.parametrize("beside", [(), (FAR,)], ids=["alone", "beside rubber"])
def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch, beside):
    whole, _ = check_restart(bouncing(*beside), 240, tmp_path, monkeypatch)
    assert np.count_nonzero(whole.history["friction_work"].values[200:]) > 0
    assert whole.history["force.disc.grain"].values.max() > 0.0


@pytest.mark.parallel(2)
@pytest.mark.parametrize("beside", [(), (FAR,)], ids=["alone", "beside rubber"])
def test_two_ranks_do_the_same(monkeypatch, beside):
    check_ranks(lambda: bouncing(*beside), monkeypatch)


def test_what_a_spring_gives_back_is_not_said_twice():
    law = HERTZ | {"friction_coefficient": 0.3, "tangential_restitution": 0.5}
    with pytest.raises(SceneError, match=r"tangential_restitution = 0.5 is not available with"):
        scene([disc()], [law], 1.0, 1e-3)
