"""Contacts that give way by themselves: closed forms, energy, what they are refused beside."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_scenes import check_ranks, check_restart
from scipy.integrate import solve_ivp

import impactfem
from impactfem import Scene, SceneError
from impactfem.contact.complementarity import solve_by_active_set, solve_layer
from impactfem.contact.springs import ContactSprings

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}


def scene(bodies, law, duration, dt=None, obstacles=(), **more):
    return Scene.from_dict(
        {"title": "springs", "duration": duration, "body": bodies, "obstacle": list(obstacles),
         "contact": [law], "output": {"fields": []},
         "solve": {"estimate": False} | ({"dt": dt} if dt else {})} | more
    )  # fmt: skip


def lasting(mass, speed, k, p):
    """Duration of the contact with a rigid floor, largest indentation and force."""
    dent = ((p + 1.0) * mass * speed**2 / (2.0 * k)) ** (1.0 / (p + 1.0))
    share = math.gamma(1.0 + 1.0 / (p + 1.0)) / math.gamma(0.5 + 1.0 / (p + 1.0))
    return 2.0 * dent / speed * math.sqrt(math.pi) * share, dent, k * dent**p


def ball(kind="point", mass=0.5, speed=1.0, height=0.0, name="ball"):
    common = {"kind": kind, "name": name, "mass": mass, "velocity": [0.0, -speed]}
    if kind == "point":
        return common | {"position": [0.0, height], "radius": 0.0}
    return common | {"shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 0.1 + height]}}


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.sampled_from([1.0, 1.5, 2.5]))
def test_layers_keep_the_energy_of_springs(seed, count, exponent):
    """Lambda . (g_b - g_a) = V(g_a) - V(g_b), and the law of each spring holds."""
    random = np.random.default_rng(seed)
    a, b = random.normal(size=(2, count, count))
    response, compliance = a @ a.T + 0.1 * np.eye(count), 0.05 * b @ b.T
    stiffness = np.where(random.random(count) < 0.7, random.uniform(0.3, 3.0, count), np.inf)
    springs = ContactSprings(stiffness, np.where(np.isfinite(stiffness), exponent, 1.0))
    solver = solve_by_active_set(1e-14, 100)
    held = compliance + 1e-3 * np.eye(count)

    def energy(force):
        return 0.5 * force @ held @ force + springs.energy(force).sum()

    gap = random.normal(size=count)
    force, _ = springs.solve(solver, held, gap, np.zeros(count, dtype=bool))
    true = gap + held @ force + springs.depth(force)
    assert true.min() > -1e-10
    assert abs(force @ true) < 1e-10 * (1.0 + force.sum())
    free = gap + random.normal(size=count)
    found = solve_layer(free, response, held, (force, true), "conserving", solver, springs)
    moved = free + response @ found.force - gap
    end = free + response @ found.force + held @ found.multiplier + springs.depth(found.multiplier)
    np.testing.assert_allclose(end, found.gap, atol=1e-11)
    assert end.min() > -1e-9
    assert 0.0 <= found.theta <= 1.0
    balance = float(found.force @ moved) + energy(found.multiplier) - energy(force)
    assert abs(balance) < 1e-11 * (energy(force) + energy(found.multiplier) + 1e-3)


@pytest.mark.parametrize("kind", ["point", "rigid"])
@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_a_ball_on_a_rigid_floor(kind, exponent):
    """The plan's steps: force to 1e-3, and all of the speed comes back."""
    lasts, dent, force = lasting(0.5, 1.0, 1e6, exponent)
    law = {"between": ["ball", "floor"], "stiffness": 1e6, "stiffness_exponent": exponent}
    run = impactfem.solve(scene([ball(kind)], law, 1.3 * lasts, obstacles=[FLOOR]))
    history = run.history
    assert history["contact_force"].values.max() == pytest.approx(force, rel=1e-3)
    assert history["indentation"].values.max() == pytest.approx(dent, rel=1e-5)
    pushing = np.count_nonzero(history["contact_force"].values) * history["time"].values[1]
    assert pushing == pytest.approx(lasts, rel=0.02)
    assert history["ball.vy"].values[-1] == pytest.approx(1.0, rel=1e-12)
    assert np.ptp(history["total_energy"].values) < 1e-12 * history["total_energy"].values[0]
    assert run.summary["contact"]["max_penetration"] < 1e-12


@pytest.mark.parametrize(("k", "exponent"), [(2e4, 1.0), (1e6, 1.5)])
def test_a_ball_bounces_a_hundred_times_and_keeps_its_energy(k, exponent):
    law = {"between": ["ball", "floor"], "stiffness": k, "stiffness_exponent": exponent}
    falls = scene([ball(height=2e-3, speed=0.0)], law, 6.0, 5e-4, [FLOOR], gravity=[0.0, -9.81])
    history = impactfem.solve(falls).history
    pressed = history["indentation"].values > 0.0
    assert np.count_nonzero(np.diff(pressed.astype(int)) > 0) > 100
    assert np.ptp(history["total_energy"].values) < 1e-11


def test_two_rigid_balls_strike_off_their_axes():
    """The impulse of a spring of any law is that of e = 1, along the way between centres."""
    one = ball("rigid", mass=0.5, height=0.194, name="ball")
    two = ball("rigid", mass=1.5, speed=0.0, name="other")
    two["shape"]["center"][0] = 0.05
    law = {"between": ["ball", "other"], "stiffness": 1e10, "stiffness_exponent": 1.5}
    history = impactfem.solve(scene([one, two], law, 1e-3, 5e-7)).history
    for name in ("momentum.x", "momentum.y", "angular_momentum"):
        assert np.ptp(history[name].values) < 1e-13
    n = np.array([-0.05, math.sqrt(0.2**2 - 0.05**2)]) / 0.2
    impulse = 2.0 * n[1] / (1.0 / 0.5 + 1.0 / 1.5)
    speeds = [history[f"ball.v{axis}"].values[-1] for axis in "xy"]
    np.testing.assert_allclose(speeds, [0.0, -1.0] + impulse / 0.5 * n, atol=5e-4)


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_a_ball_on_a_long_bar(exponent):
    """m v' = -F, F = K d^p, d' = v - F / Z: a dent in front of a dashpot."""
    z = math.sqrt(7800.0 * 2e11) * 1e-4
    bar = {"kind": "bar", "name": "bar", "density": 7800.0, "youngs_modulus": 2e11, "length": 1.0,
           "area": 1e-4, "gap": 0.1}  # fmt: skip
    mass, k = 0.05, 1e9 if exponent == 1.5 else 3e7
    point = {"kind": "point", "name": "ball", "mass": mass, "position": [0.1 - 1e-9],
             "velocity": [2.0]}  # fmt: skip
    law = {"between": ["ball", "bar"], "stiffness": k, "stiffness_exponent": exponent}
    lasts = 3e-4
    history = impactfem.solve(scene([bar, point], law, lasts)).history

    def rate(_, y):
        force = k * max(y[0], 0.0) ** exponent
        return [y[1] - force / z, -force / mass]

    times = history["time"].values
    known = solve_ivp(rate, (0.0, times[-1]), [0.0, 2.0], t_eval=times, rtol=1e-10, atol=1e-14).y
    assert history["indentation"].values.max() == pytest.approx(known[0].max(), rel=2e-3)
    np.testing.assert_allclose(history["ball.vx"].values, known[1], atol=5e-3)
    energy = history["total_energy"].values
    assert np.ptp(energy) < 1e-9 * energy[0]


def test_coarse_steps_are_told():
    lasts, *_ = lasting(0.5, 1.0, 1e6, 1.0)
    law = {"between": ["ball", "floor"], "stiffness": 1e6}
    run = impactfem.solve(scene([ball()], law, 3.0 * lasts, lasts / 9.0, [FLOOR]))
    said = [
        each for each in run.summary["verdict"]["findings"] if each["code"] == "contact_unresolved"
    ]
    assert said
    assert "is not resolved" in said[0]["text"]


def bouncing():
    law = {"between": ["*", "*"], "stiffness": 1e6, "stiffness_exponent": 1.5}
    two = [ball("rigid", height=0.02), ball(height=0.4, name="point") | {"radius": 0.05}]
    return scene(two, law, 0.4, 2e-4, [FLOOR], gravity=[0.0, -9.81],
                 output={"fields": [], "checkpoint": 500})  # fmt: skip


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    check_restart(bouncing(), 1100, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(bouncing, monkeypatch)


SOLID = {"kind": "solid", "name": "s", "model": "plane_strain", "density": 1e3, "mesh_size": 0.1,
         "youngs_modulus": 1e6, "poisson_ratio": 0.3,
         "shape": {"kind": "block", "size": [0.4, 0.2], "corner": [-0.2, -0.2]}}  # fmt: skip
BOX = {"kind": "rigid", "name": "box", "mass": 1.0,
       "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 1.0]}}  # fmt: skip


@pytest.mark.parametrize(
    ("law", "bodies", "says"),
    [
        ({"stiffness": -1.0}, [], "stiffness = -1.0"),
        ({"stiffness": 1.0, "stiffness_exponent": 0.5}, [], "stiffness_exponent"),
        ({"stiffness_exponent": 1.5}, [], "is that of stiffness: give it too"),
        ({"stiffness": 1.0, "restitution": 0.5}, [], "restitution = 0.5 is not available"),
        ({"stiffness": 1.0, "friction_coefficient": 0.5}, [], "friction_coefficient = 0.5 is not"),
        ({"between": ["box", "floor"], "stiffness": 1.0}, [BOX], "box, a rigid, may touch at many"),
        ({"between": ["s", "floor"], "stiffness": 1.0}, [SOLID], "s, a solid, may touch at many"),
    ],
)
def test_what_is_refused(law, bodies, says):
    with pytest.raises(SceneError, match=says):
        scene([ball(height=1.0), *bodies], {"between": ["ball", "floor"]} | law, 1.0, None, [FLOOR])
