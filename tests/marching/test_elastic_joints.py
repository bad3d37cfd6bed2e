"""Joints on points and beams: one protocol with rigid bodies, held to independent equations."""

import numpy as np
import pytest
from moving_scenes import alone, differences, stopping
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, eigh
from scipy.special import ellipk

from impactfem import (
    Beam,
    Contact,
    HalfSpace,
    Joint,
    Output,
    Point,
    Probe,
    RigidBody,
    Scene,
    Solve,
    solve,
)
from impactfem.errors import SceneError
from impactfem.planning import plan
from impactfem.shapes import Disc
from impactfem.system.beam_matrices import beam_matrices

G = 9.81
STRIP = {"name": "strip", "width": 0.01, "density": 1000.0, "length": 0.5, "height": 0.1}
STRIP |= {"youngs_modulus": 4e5}


def run(bodies, joints, duration, dt, gravity=(0.0, -G), **more):
    scene = Scene(
        title="joints", duration=duration, gravity=list(gravity), bodies=bodies, joints=joints,
        solve=Solve(dt=dt, estimate=False), output=Output(fields=[]), **more,
    )  # fmt: skip
    return solve(scene).history


def drift(values):
    return np.abs(values - values[0]).max()


def columns(history, name, parts):
    return np.array([history[f"{name}.{part}"].values for part in parts])


def distance(one, two, ends, **more):
    return Joint(name="rod", kind="distance", between=[one, two], points=list(ends), **more)


def test_point_on_a_rod_has_the_period_of_a_pendulum():
    exact, errors = 4.0 * ellipk(np.sin(0.5) ** 2) / np.sqrt(G), []
    assert exact == pytest.approx(2.1391376, abs=5e-8)
    place = [np.sin(1.0), -np.cos(1.0)]
    for dt in (0.01, 0.005):
        bob = Point(name="bob", mass=2.0, position=place)
        history = run([bob], [distance("ground", "bob", ([0.0, 0.0], place))], 2.2, dt)
        rate, time = history["bob.vx"].values, history["time"].values
        k = int(np.flatnonzero((rate[1:-1] > 0.0) & (rate[2:] <= 0.0))[-1]) + 1
        errors.append(time[k] + rate[k] * dt / (rate[k] - rate[k + 1]) - exact)
        assert drift(history["total_energy"].values) < 1e-13
        assert np.abs(np.hypot(*columns(history, "bob", "xy")) - 1.0).max() < 1e-15
    assert errors[0] == pytest.approx(2.11e-4, rel=0.02)
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.02)


def test_free_dumbbell_keeps_energy_momentum_and_angular_momentum():
    bodies = [
        Point(name="a", mass=1.0, position=[0.0, 0.0, 0.0], velocity=[0.0, 0.0, 0.3]),
        Point(name="b", mass=3.0, position=[1.0, 0.0, 0.0], velocity=[0.0, 1.0, 0.0]),
    ]
    rod = distance("a", "b", ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]))
    history = run(bodies, [rod], 5.0, 0.01, gravity=(0.0, 0.0, 0.0))
    assert drift(history["total_energy"].values) < 1e-13
    moment = 0.0
    for body in bodies:
        place, rate = (
            columns(history, body.name, "xyz"),
            columns(history, body.name, ("vx", "vy", "vz")),
        )
        moment = moment + body.mass * np.cross(place.T, rate.T)
    assert np.abs(moment - moment[0]).max() < 1e-13
    assert max(drift(history[f"momentum.{axis}"].values) for axis in "xyz") < 1e-13


@pytest.mark.parametrize("between", [["ground", "cart"], ["cart", "ground"]])
def test_pendulum_on_a_cart(between):
    """Mass 2 on a slide, mass 1 on a rod: sin-like with omega^2 = (g / l) (1 + m / M)."""
    cart = Point(name="cart", mass=2.0, position=[0.0, 0.0])
    bob = Point(name="bob", mass=1.0, position=[0.01, -np.sqrt(1.0 - 1e-4)])
    slide = Joint(
        name="slide", kind="prismatic", between=between, point=[0.0, 0.0], axis=[1.0, 0.0]
    )
    rod = distance("cart", "bob", ([0.0, 0.0], bob.position))
    period = 2.0 * np.pi / np.sqrt(1.5 * G)
    history = run([cart, bob], [slide, rod], period, period / 500)
    swing = history["bob.x"].values - history["cart.x"].values
    time = history["time"].values
    wanted = 0.01 * np.cos(2.0 * np.pi * time / period)
    assert np.abs(swing - wanted).max() < 2e-6  # (1 + a^2 / 16) and the step
    assert np.abs(2.0 * history["cart.x"].values + history["bob.x"].values - 0.01).max() < 1e-15
    assert np.abs(history["cart.y"].values).max() < 1e-15
    way = 1.0 if between[0] == "ground" else -1.0
    assert history["slide.q"].values == pytest.approx(way * history["cart.x"].values, abs=1e-15)
    # The slide carries both weights, less what the swing lifts.
    assert history["slide.force"].values[1:] == pytest.approx(3.0 * G, rel=1e-3)


def test_points_on_a_rigid_body_make_it_heavier():
    """A disc with two points on it spins up under a moment as (J + 2 m r^2) has it."""
    disc = RigidBody(
        name="disc", shape=Disc(radius=0.3, center=[0.0, 0.0]), mass=1.0, inertia=0.02, moment=[0.5]
    )
    points = [Point(name=n, mass=0.5, position=[x, 0.0]) for n, x in (("a", -0.2), ("b", 0.2))]
    pins = [
        Joint(name=f"pin{p.name}", kind="fixed", between=["disc", p.name], point=p.position)
        for p in points
    ]
    history = run([disc, *points], pins, 1.0, 1e-3, gravity=(0.0, 0.0))
    assert history["disc.spin"].values[-1] == pytest.approx(0.5 / (0.02 + 0.04), rel=1e-5)
    assert np.abs(np.hypot(*columns(history, "a", "xy")) - 0.2).max() < 1e-15


@pytest.mark.parametrize(("friction", "impulse"), [(0.0, 1.02), (0.4, 1.0625)])
def test_struck_dumbbell(friction, impulse):
    """Rod at 45 degrees between 1 and 2 kg, 1 kg strikes an end: with friction it sticks there."""
    ball = {"radius": 0.1}
    bodies = [
        Point(name="a", mass=1.0, position=[0.0, 0.0], **ball),
        Point(name="b", mass=2.0, position=[1.0, 1.0], **ball),
        Point(name="c", mass=1.0, position=[0.0, -0.5], velocity=[0.0, 1.0], **ball),
    ]
    law = Contact(between=["a", "c"], restitution=0.7, friction_coefficient=friction)
    rod = distance("a", "b", ([0.0, 0.0], [1.0, 1.0]))
    history = run(bodies, [rod], 0.5, 1e-3, gravity=(0.0, 0.0), contacts=[law])
    assert history["contact_impulse"].values.sum() == pytest.approx(impulse, rel=1e-12)
    assert max(drift(history[f"momentum.{axis}"].values) for axis in "xy") < 1e-14


def test_bob_between_two_walls_loses_the_same_share_at_each():
    """It strikes where its rod stands upright and where it leans: answers turn with the rod."""
    bob = Point(name="bob", mass=1.0, position=[0.28, -0.96], velocity=[-0.96, -0.28])
    walls = [
        HalfSpace(name="left", point=[0.0, 0.0], normal=[1.0, 0.0]),
        HalfSpace(name="right", point=[0.6, 0.0], normal=[-1.0, 0.0]),
    ]
    laws = [Contact(between=["bob", wall.name], restitution=0.8) for wall in walls]
    history = run(
        [bob], [distance("ground", "bob", ([0.0, 0.0], [0.28, -0.96]))], 3.0, 1e-3,
        gravity=(0.0, 0.0), obstacles=walls, contacts=laws,
    )  # fmt: skip
    place, rate = columns(history, "bob", "xy"), columns(history, "bob", ("vx", "vy"))
    speed = np.hypot(*rate)
    found = speed[np.flatnonzero(history["contact_impulse"].values)]
    assert found == pytest.approx(0.8 ** np.arange(1, len(found) + 1), rel=2e-3)
    assert len(found) == 3
    # What the impact leaves along the rod is gone at once; what places round by, over dt, stays.
    assert np.abs((place * rate).sum(axis=0)).max() < 1e-10


@pytest.mark.parametrize("theory", ["euler_bernoulli", "timoshenko"])
def test_sections_of_a_beam_between_its_nodes(theory):
    """Fields that the elements have exactly are there exactly: linear axial, cubic or w' = r."""
    beam = Beam(**STRIP, center=[0.0, 0.0], theory=theory, elements=3)
    m = beam_matrices(beam)
    q = np.zeros(len(m.mass))
    q[3 * np.arange(len(m.nodes))] = 2.0 * m.nodes
    q[m.deflections], q[m.rotations] = m.places**3, 3.0 * m.turning_places**2
    for s in (-0.25, -0.11, 0.0, 0.07, 0.25):
        assert m.section(s) @ q == pytest.approx([2.0 * s, s**3, 3.0 * s**2], abs=1e-14)


def test_clamped_beam_swings_about_its_static_deflection():
    beam = Beam(**STRIP | {"height": 0.01}, center=[0.25, 0.0])
    bending = beam.youngs_modulus * beam.second_moment
    rate = (1.8751040687 / 0.5) ** 2 * np.sqrt(bending / (1000.0 * beam.area))
    sag, period = beam.mass * G * 0.5**3 / (8.0 * bending), 2.0 * np.pi / rate
    clamp = Joint(name="clamp", kind="fixed", between=["ground", "strip"], point=[0.0, 0.0])
    # Of such a sag linear theory knows nothing: the weight is small instead.
    history = run(
        [beam], [clamp], 2.0 * period, period / 400, gravity=(0.0, -1e-3 * G),
        probes=[Probe(name="tip", body="strip", point=[0.5, 0.0])],
    )  # fmt: skip
    tip = 1e3 * history["tip.uy"].values
    assert tip.mean() == pytest.approx(-sag, rel=3e-3)
    # Higher modes, 2 % of it, blur crossings: the best cosine has the first rate.
    time = history["time"].values

    def missed(share):
        turn = share * rate * time
        fields = np.stack([np.ones_like(time), np.cos(turn), np.sin(turn)], axis=1)
        return np.linalg.lstsq(fields, tip, rcond=None)[1][0]

    best = min(np.linspace(0.98, 1.02, 81), key=missed)
    assert best == pytest.approx(1.0, abs=1.1e-3)
    assert history["clamp.force"].values[1:].mean() == pytest.approx(1e-3 * beam.mass * G, rel=5e-3)
    assert drift(history["total_energy"].values) < 1e-8 * history["elastic_energy"].values.max()


def on_a_beam(angle, dt, duration, **more):
    """A rigid pendulum hinged at the tip of a beam that hangs from a ceiling."""
    beam = Beam(**STRIP, center=[0.0, -0.25], inclination=-np.pi / 2, elements=64)
    centre = [0.2 * np.sin(angle), -0.5 - 0.2 * np.cos(angle)]
    bob = RigidBody(name="bob", shape=Disc(radius=0.02, center=centre), mass=0.3, inertia=0.002)
    joints = [
        Joint(name="clamp", kind="fixed", between=["ground", "strip"], point=[0.0, 0.0]),
        Joint(name="pin", kind="revolute", between=["strip", "bob"], point=[0.0, -0.5]),
    ]
    probes = [Probe(name="tip", body="strip", point=[0.0, -0.5])]
    return run([beam, bob], joints, duration, dt, probes=probes, **more)


def lagrange(angle, duration, across=9, along=9):
    """The same by Lagrange's equations: polynomials for the beam, some across and some along.

    Returns:
        Angle of the pendulum, ways of the tip across and down at the end.
    """
    x, weights = np.polynomial.legendre.leggauss(30)
    x, weights, count = 0.5 * (x + 1.0), 0.5 * weights, across + along
    basis = np.polynomial.Polynomial.basis
    bending, axial = [basis(k + 2) for k in range(across)], [basis(k + 1) for k in range(along)]
    area, second = 0.1 * 0.01, 0.01 * 0.1**3 / 12.0

    def products(fields, order):
        each = np.array([f.deriv(order)(x) if order else f(x) for f in fields])
        return each * weights @ each.T

    mass = block_diag(*(1000.0 * area * 0.5 * products(f, 0) for f in (bending, axial)))
    stiffness = block_diag(
        4e5 * second / 0.5**3 * products(bending, 2), 4e5 * area / 0.5 * products(axial, 1)
    )
    squares, modes = eigh(stiffness, mass)
    a, b = modes[:across].sum(axis=0), modes[across:].sum(axis=0)
    pull = modes[across:].T @ [1000.0 * area * 0.5 * G * weights @ f(x) for f in axial]

    def rates(_, state):
        q, phi, whirl = state[:count], state[count], state[-1]
        ways = np.array([[*a, 0.2 * np.cos(phi)], [*-b, 0.2 * np.sin(phi)]])
        inertia = np.diag([*np.ones(count), 0.002]) + 0.3 * ways.T @ ways
        turning = 0.2 * whirl**2 * np.array([-np.sin(phi), np.cos(phi)])
        force = np.array([*(pull - squares * q), 0.0])
        force -= 0.3 * ways.T @ (turning + np.array([0.0, G]))
        return np.concatenate([state[count + 1 :], np.linalg.solve(inertia, force)])

    start = np.zeros(2 * count + 2)
    start[count] = angle
    end = solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
    return np.array([end[count], a @ end[:count], b @ end[:count]])


def test_pendulum_on_a_beam_follows_lagrange():
    wanted, errors = lagrange(0.8, 0.5), []
    for dt in (2e-3, 1e-3):
        history = on_a_beam(0.8, dt, 0.5)
        tip = columns(history, "tip", ("ux", "uy"))
        angle = 0.8 + drift_free(history["bob.angle"].values)
        errors.append(np.array([angle, tip[0, -1], -tip[1, -1]]) - wanted)
        ends = columns(history, "bob", "xy") - tip + [[0.0], [0.5]]
        assert np.abs(np.hypot(*ends) - 0.2).max() < 1e-12  # the hinge stays closed
        assert drift(history["total_energy"].values) < 1e-9
    assert np.abs(errors[1]).max() < 3e-5
    assert np.abs(errors[1]).max() < 0.4 * np.abs(errors[0]).max()


def drift_free(angle):
    return angle[-1] - angle[0]


KINDS = {
    "revolute": {"point": [0.1, 0.0]},
    "fixed": {"point": [0.1, 0.0]},
    "prismatic": {"point": [0.1, 0.0], "axis": [0.6, 0.8]},
    "distance": {"points": [[0.1, 0.0], [0.1, 0.4]]},
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("first", [True, False])
def test_free_beams_and_what_they_carry_keep_energy_and_momentum(kind, first):
    """The place is between nodes; what turns on the beam, or against it, bends it."""
    place, centre = np.array([0.1, 0.0]), np.array([0.1, 0.4])
    spin = {"revolute": 2.0, "distance": 1.0}.get(kind, 0.3)
    start = np.array([0.1, -0.2]) + 0.3 * np.array([0.0, place[0]])  # of the place on the beam
    speed = start + spin * np.array([-(centre - place)[1], 0.0])
    beam = Beam(
        **STRIP | {"youngs_modulus": 4e4}, center=[0.0, 0.0], velocity=[0.1, -0.2],
        angular_velocity=0.3,
    )  # fmt: skip
    disc = RigidBody(
        name="disc", shape=Disc(radius=0.05, center=centre.tolist()), mass=0.3,
        velocity=speed.tolist(), angular_velocity=spin,
    )  # fmt: skip
    names = ["strip", "disc"] if first else ["disc", "strip"]
    given = dict(KINDS[kind])
    if "points" in given and not first:
        given["points"] = given["points"][::-1]
    joint = Joint(name="joint", kind=kind, between=names, **given)
    history = run([beam, disc], [joint], 0.5, 1e-3, gravity=(0.0, 0.0))
    # Two roundings in each of 500 steps: how they add up depends on the processor.
    assert drift(history["total_energy"].values) < 1000.0 * np.finfo(float).eps
    assert history["elastic_energy"].values.max() > 1e-8
    for axis in "xy":
        assert drift(history[f"momentum.{axis}"].values) < 1e-13


def stopper(friction=1e-4):
    """A pendulum of a rigid bar and a point, on a beam with damping, that strikes a stop."""
    beam = Beam(
        name="strip", length=0.2, height=0.004, width=0.01, density=2700.0, youngs_modulus=7e9,
        center=[0.1, 0.0], damping_ratio=0.02,
    )  # fmt: skip
    bar = RigidBody(
        name="bar",
        shape=Disc(radius=0.01, center=[0.25, -0.05]),
        mass=0.02,
    )
    bob = Point(name="bob", mass=0.01, position=[0.3, -0.1], radius=0.005)
    joints = [
        Joint(name="clamp", kind="fixed", between=["ground", "strip"], point=[0.0, 0.0]),
        Joint(
            name="pin", kind="revolute", between=["strip", "bar"], point=[0.2, 0.0],
            limits=[-1.2, 0.008], restitution=0.4, friction=friction,
        ),
        Joint(name="tail", kind="fixed", between=["bar", "bob"], point=[0.3, -0.1]),
    ]  # fmt: skip
    stop = HalfSpace(name="stop", point=[0.17, 0.0], normal=[1.0, 0.0])
    law = Contact(between=["bob", "stop"], restitution=0.5, friction_coefficient=0.2)
    return Scene(
        title="stopper", duration=0.4, gravity=[0.0, -G], bodies=[beam, bar, bob], joints=joints,
        obstacles=[stop], contacts=[law], solve=Solve(dt=1e-3, estimate=False),
        output=Output(fields=[], checkpoint=20),
    )  # fmt: skip


@pytest.mark.parametrize("stop", [37, 250])
def test_a_restarted_pendulum_on_a_beam_is_equal_to_the_last_bit(tmp_path, monkeypatch, stop):
    whole = solve(stopper())
    assert whole.history["contact_impulse"].values.sum() > 0.0
    with stopping(monkeypatch, stop):
        solve(stopper(), checkpoints=tmp_path)
    again = solve(stopper(), checkpoints=tmp_path, restart=tmp_path)
    assert differences(whole, again) == {}


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same_on_a_beam(monkeypatch):
    both = solve(stopper())
    with alone(monkeypatch):
        one = solve(stopper())
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )


def test_energy_that_nothing_else_takes_is_that_of_joints_and_impacts():
    result = solve(stopper(friction=0.0))
    taken = result.summary["details"]["energy_taken"]
    energy = result.history["total_energy"].values
    assert energy[-1] < energy[0]
    assert np.diff(energy).max() < 1e-12
    # The beam's damping takes the rest.
    assert 0.0 < taken["joints"] + taken["impacts"] < energy[0] - energy[-1]


def test_the_plan_counts_what_joints_leave_free():
    point = Point(name="p", mass=1.0, position=[1.0, 0.0, 0.0])
    other = Point(name="q", mass=1.0, position=[5.0, 0.0, 0.0])
    rod = distance("ground", "p", ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]))
    scene = Scene(
        title="t", duration=1.0, bodies=[point, other], joints=[rod], gravity=[0.0, 0.0, 0.0]
    )
    assert "1 joint that leaves 2 degrees of freedom" in plan(scene).model


POINT = {"kind": "point", "name": "p", "mass": 1.0, "position": [1.0, 0.0]}
BEAM = {"kind": "beam", "center": [0.25, 0.0], **STRIP}
ROD = {"kind": "rod", "name": "rod", "mass": 1.0, "length": 1.0, "center": [0.0, 0.0]}


@pytest.mark.parametrize(
    ("body", "change", "message"),
    [
        (POINT, {"kind": "revolute"}, r'joint\[0\].kind = "revolute": p does not turn; .*"fixed"'),
        (POINT, {"point": [1.0, 0.1]}, r"joint\[0\].point .* not on p, .* at \[1.0, 0.0\]"),
        (
            POINT, {"kind": "distance", "point": None, "points": [[0.0, 0.0], [1.0, 0.1]]},
            r"joint\[0\].points\[1\] .* not on p",
        ),
        (
            POINT, {"kind": "prismatic", "between": ["p", "p2"], "axis": [1.0, 0.0]},
            "do not turn, so that neither leads its axis",
        ),
        (BEAM, {"between": ["ground", "strip"], "point": [0.6, 0.0]}, "not on strip, .* from"),
        (BEAM, {"between": ["ground", "strip"], "point": [0.5, 0.06]}, "half its height"),
        (
            BEAM | {"velocity": [1.0, 0.0]}, {"between": ["ground", "strip"], "point": [0.0, 0.0]},
            "part with 1 .* such as 0 of strip",
        ),
        (
            POINT | {"velocity": [1.0, 0.0]}, {}, r"nearest by energy are p: velocity = \[0, 0\]",
        ),
    ],
)  # fmt: skip
def test_bad_joints_on_points_and_beams_are_refused(body, change, message):
    given = {"name": "pin", "kind": "fixed", "between": ["ground", "p"], "point": [1.0, 0.0]}
    bodies = [body, POINT | {"name": "p2"}] if "p2" in change.get("between", ()) else [body]
    joint = {key: value for key, value in (given | change).items() if value is not None}
    data = {"title": "bad", "duration": 0.1, "body": bodies, "joint": [joint]}
    with pytest.raises(SceneError, match=message):
        solve(Scene.from_dict(data), estimate=False)
