"""Contacts that give way by themselves: closed forms, energy, what they are refused beside."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_scenes import check_ranks, check_restart
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import impactfem
from impactfem import Scene, SceneError
from impactfem.contact.complementarity import solve_by_active_set
from impactfem.contact.friction_solver import Solving
from impactfem.contact.layer_law import Layer, solve_layer
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
    force = np.zeros(count)

    def obey(give, rest):
        nonlocal force
        force, systems = solver(held + np.diag(give), gap + rest, force > 0.0)
        return force, gap + held @ force, systems

    if not springs.rest(gap):
        springs.solve(obey, gap, held.diagonal())
    true = gap + held @ force + springs.depth(force)
    assert true.min() > -1e-10
    assert abs(force @ true) < 1e-10 * (1.0 + force.sum())
    free = gap + random.normal(size=count)
    before = force[:, None], true[:, None]
    layer = Layer(free[:, None], response, held, before, springs=springs)
    found = solve_layer(layer, "conserving", Solving.to(1e-14, 100))
    pushes, levels = found.force[:, 0], found.multiplier[:, 0]
    moved = free + response @ pushes - gap
    end = free + response @ pushes + held @ levels + springs.depth(levels)
    np.testing.assert_allclose(end, found.place[:, 0], atol=1e-11)
    assert end.min() > -1e-9
    assert 0.0 <= found.theta <= 1.0
    balance = float(pushes @ moved) + energy(levels) - energy(force)
    assert abs(balance) < 1e-11 * (energy(force) + energy(levels) + 1e-3)


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


def test_a_touch_much_softer_than_a_step_is_found():
    """It ended in "forces of springs were not found": of its force 1e-14 are less than a digit."""
    light = {"kind": "point", "name": "b", "mass": 0.01, "radius": 0.01, "velocity": [0.2, -1.0],
             "position": [0.0, 0.0101]}  # fmt: skip
    law = {"between": ["b", "floor"], "stiffness": 1e7, "stiffness_exponent": 1.5}
    more = {"gravity": [0.0, -9.81], "solve": {"dt": 1e-6, "estimate": False}}
    run = impactfem.solve(scene([light], law, 1.2e-4, obstacles=[FLOOR], **more))
    depth = run.history["indentation"].values.max()
    assert depth == pytest.approx(2e-5, rel=1e-2)
    assert run.history["contact_force"].values[-1] == pytest.approx(1e7 * depth**1.5, rel=0.1)


@pytest.mark.parametrize(("k", "exponent", "dt"), [(2e4, 1.0, 2e-3), (1e6, 1.5, 2e-3)])
def test_a_ball_bounces_many_times_and_keeps_its_energy(k, exponent, dt):
    law = {"between": ["ball", "floor"], "stiffness": k, "stiffness_exponent": exponent}
    falls = scene([ball(height=2e-4, speed=0.0)], law, 2.4, dt, [FLOOR], gravity=[0.0, -9.81])
    history = impactfem.solve(falls).history
    pressed = history["indentation"].values > 0.0
    assert np.count_nonzero(np.diff(pressed.astype(int)) > 0) > 40
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


BAR = {"kind": "bar", "name": "bar", "length": 1.0, "area": 1.0, "density": 1.0,
       "youngs_modulus": 1.0, "gap": 1e-4, "velocity": -1e-3}  # fmt: skip
"""With Z = c = 1, at the wall after .1 s."""
WALL = {"kind": "wall", "name": "wall"}


@pytest.mark.parametrize("kappa", [1.0, 10.0, 60.0])
def test_a_bar_on_a_wall_that_gives_way(kappa):
    """F = Z v (1 - e^(-kappa s)) up to 2 L/c; the contact lasts as the returning wave lets it."""
    law = {"between": ["bar", "wall"], "stiffness": kappa}
    history = impactfem.solve(scene([BAR], law, 4.0, obstacles=[WALL], gravity=0.0)).history
    time, force = history["time"].values, history["contact_force"].values
    middle = time - 0.1 - 0.5 * (time[1] - time[0])  # forces are means of layers
    inside = (middle > 0.0) & (middle < 1.98)
    exact = 1e-3 * (1.0 - np.exp(-kappa * middle[inside]))
    assert np.abs(force[inside] - exact).max() < 2.5e-5
    more = brentq(lambda y: kappa * y - math.log(2 - math.exp(-2 * kappa) + 2 * kappa * y), 1e-3, 3)
    assert time[force > 0.0].max() == pytest.approx(2.1 + more, abs=0.01)
    energy = history["total_energy"].values
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-12


def test_bars_with_springs_between():
    """The dent grows by twice the wave that each gives; a Hertz law against its equation."""
    other = BAR | {"name": "other", "gap": 1.0001, "velocity": -1e-3}
    law = {"between": ["bar/far_end", "other"], "stiffness": 1e3, "stiffness_exponent": 1.5}
    still = BAR | {"gap": 0.0, "velocity": 0.0}
    made = scene([still, other], law, 2.0)
    history = impactfem.solve(made).history
    time, force = history["time"].values, history["contact_force"].values
    dent = solve_ivp(
        lambda _, d: 1e-3 - 2e3 * np.maximum(d, 0.0) ** 1.5, (0.0, 1.9), [0.0], rtol=1e-9,
        atol=1e-12, dense_output=True,
    )  # fmt: skip
    middle = time - 0.1 - 0.5 * (time[1] - time[0])
    inside = (middle > 0.0) & (middle < 1.88)
    exact = 1e3 * np.maximum(dent.sol(middle[inside])[0], 0.0) ** 1.5
    assert np.abs(force[inside] - exact).max() < 2e-3 * exact.max()
    assert np.ptp(history["momentum"].values) < 1e-12


BLOCK = {
    "kind": "solid", "name": "block", "model": "plane_stress", "thickness": 1.0,
    "shape": {"kind": "block", "size": [1.0, 0.05], "corner": [1e-4, 0.0]}, "mesh_size": 0.025,
    "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.0, "velocity": [-1e-3, 0.0],
    "strain": "small", "contact_surfaces": ["left"], "degree": 2,
}  # fmt: skip
SIDE = {"kind": "half_space", "name": "side", "point": [0.0, 0.0], "normal": [1.0, 0.0]}


@pytest.mark.parametrize("degree", [1, 2])
def test_a_block_on_a_layer_that_gives_way(degree):
    """As a bar: rho c v A (1 - e^(-k t / rho c)) with k in Pa/m, on any mesh."""
    law = {"between": ["block", "side"], "stiffness": 3.0}
    made = scene([BLOCK | {"degree": degree}], law, 2.0, 0.005, [SIDE])
    history = impactfem.solve(made).history
    middle = history["time"].values - 0.1 - 0.0025
    inside = (middle > 0.0) & (middle < 1.8)
    exact = 0.05e-3 * (1.0 - np.exp(-3.0 * middle[inside]))
    assert np.abs(history["contact_force"].values[inside] - exact).max() < 3e-3 * 0.05e-3
    energy = history["total_energy"].values
    assert np.ptp(energy) < 1e-10 * energy[0]


def test_a_plate_on_a_layer_that_gives_way():
    """Thrown flat it does not bend: half a sine with the frequency sqrt(k A / m)."""
    plate = {
        "kind": "plate", "name": "plate", "outline": {"kind": "disc", "radius": 1.0},
        "mesh_size": 0.3, "thickness": 0.01, "density": 100.0, "youngs_modulus": 1e7,
        "poisson_ratio": 0.3, "velocity": -0.01,
    }  # fmt: skip
    low = {"kind": "half_space", "name": "low", "point": [0.0, 0.0, -0.005],
           "normal": [0.0, 0.0, 1.0]}  # fmt: skip
    law = {"between": ["plate", "low"], "stiffness": 1e3}
    history = impactfem.solve(scene([plate], law, 0.12, 2e-4, [low])).history
    time, mass = history["time"].values - 1e-4, history["momentum.z"].values[0] / -0.01
    omega = math.sqrt(1e3)
    exact = np.where(time < math.pi / omega, mass * 0.01 * omega * np.sin(omega * time), 0.0)
    exact[0] = 0.0
    assert np.abs(history["contact_force"].values - exact).max() < 5e-3 * exact.max()
    assert history["plate.vz"].values[-1] == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parallel(2)
def test_two_ranks_press_a_layer_alike(monkeypatch):
    law = {"between": ["block", "side"], "stiffness": 30.0}
    check_ranks(lambda: scene([BLOCK], law, 0.5, 0.005, [SIDE]), monkeypatch)


def test_gravity_of_such_a_bar_is_towards_the_wall():
    law = {"between": ["bar", "wall"], "stiffness": 10.0}
    made = scene([BAR], law, 3.0, obstacles=[WALL], gravity=2e-3)
    history = impactfem.solve(made).history
    first = history["time"].values[history["contact_force"].values > 0.0].min()
    assert first == pytest.approx(math.sqrt(0.25 + 0.1) - 0.5, abs=0.006)


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
    return scene(two, law, 0.3, 5e-4, [FLOOR], gravity=[0.0, -9.81],
                 output={"fields": [], "checkpoint": 100})  # fmt: skip


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    check_restart(bouncing(), 340, tmp_path, monkeypatch)


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
        ({"between": ["box", "ball"], "stiffness": 1.0}, [BOX], "box, a rigid, may touch at many"),
        ({"between": ["ball", "s"], "stiffness": 1.0}, [SOLID], "s, a solid, may touch at many"),
    ],
)
def test_what_is_refused(law, bodies, says):
    with pytest.raises(SceneError, match=says):
        scene([ball(height=1.0), *bodies], {"between": ["ball", "floor"]} | law, 1.0, None, [FLOOR])
