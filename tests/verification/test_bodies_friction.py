"""Solids that rub: sticking, slopes, stopping, rolling, cones, momentum and energy.

All lengths are of order 1 and elastic moduli 1; gravity is weak, so that bodies are nearly rigid
and the closed forms of rigid bodies hold.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import block, disc, velocity
from hypothesis import given, settings
from hypothesis import strategies as st

import impactfem
import impactfem.bodies_model
import impactfem.bodies_runs
from impactfem.errors import SceneError

FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
FLOOR_3D = FLOOR | {"point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}
GRAVITY = 0.01


def rubbing(bodies, contacts, duration, gravity=None, obstacles=(FLOOR,), **solve):
    """A scene; ``contacts`` are two names and the coefficient, or None to leave the key out."""
    plain = {
        "kind": "solid", "model": "plane_strain", "density": 1.0, "youngs_modulus": 1.0,
        "poisson_ratio": 0.3,
    }  # fmt: skip
    laws = [
        {"between": [one, two]} | ({} if mu is None else {"friction_coefficient": mu})
        for one, two, mu in contacts
    ]
    return impactfem.Scene.from_dict(
        {
            "title": "rubbing",
            "duration": duration,
            "gravity": gravity,
            "body": [plain | body for body in bodies],
            "obstacle": list(obstacles),
            "contact": laws,
            "solve": solve,
            "output": {"fields": []},
        }
    )


def settled(weight, height, axes=2):
    """Displacement of a block with nu = 0 and E = 1 under its own weight (density times g)."""
    up = "xyz"[axes - 1]
    return ["0"] * (axes - 1) + [f"-{weight}*({height}*{up} - {up}*{up}/2)"]


def work(result):
    """Frictional work of the run [J]."""
    return result.summary["details"]["friction_work"]


def tilting(mu, slope, steps=80):
    """A damped block on a floor that is tilted smoothly from 10 s to 30 s, to ``slope``."""
    last = math.atan(slope)
    table = [[0.0, [0.0, -GRAVITY]]]
    for k in range(1, steps + 1):
        part = (k - 0.5 if k < steps else steps) / steps
        angle = 0.5 * last * (1.0 - math.cos(math.pi * part))
        pull = [GRAVITY * math.sin(angle), -GRAVITY * math.cos(angle)]
        table.append([10.0 + 20.0 * (k - 1) / steps, pull])
    body = block("block", [0.0, 0.0], [1.0, 0.5], 0.125, rayleigh_stiffness=0.5)
    return rubbing([body], [("block", "floor", mu)], 45.0, table, method="massless", dt=0.1)


def late(result, start=35.0):
    """Mean acceleration [m/s^2] after ``start``."""
    time, speed = result.history.time.values, result.history["block.vx"].values
    chosen = time > start
    return np.polyfit(time[chosen], speed[chosen], 1)[0]


def test_block_on_a_slope_sticks_if_friction_is_one_percent_more():
    slope = 0.5
    result = impactfem.solve(tilting(1.01 * slope, slope))
    pull = GRAVITY * math.sin(math.atan(slope))
    assert abs(late(result)) < 1e-3 * pull
    # It is at rest: its vibrations are a thousandth of what it would slide at in the last 15 s.
    speed = result.history["block.vx"].values[result.history.time.values > 40.0]
    assert np.abs(speed).max() < 1e-3 * pull


def test_block_on_a_slope_slides_if_friction_is_one_percent_less():
    slope = 0.5
    result = impactfem.solve(tilting(0.99 * slope, slope))
    angle = math.atan(slope)
    expected = GRAVITY * (math.sin(angle) - 0.99 * slope * math.cos(angle))
    assert late(result) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("method", ["massless", "moreau_jean"])
def test_sliding_block_stops_after_the_right_distance(method):
    mu, speed = 0.4, 0.1
    body = block(
        "block", [0.0, 0.0], [1.0, 0.5], 0.125, poisson_ratio=0.0, rayleigh_stiffness=0.5,
        velocity=[speed, 0.0], displacement=settled(GRAVITY, 0.5),
    )  # fmt: skip
    case = rubbing(
        [body], [("block", "floor", mu)], 35.0, [0.0, -GRAVITY], method=method, dt=0.05
    )  # fmt: skip
    result = impactfem.solve(case)
    place = result.history["block.x"].values
    assert place[-1] - place[0] == pytest.approx(speed**2 / (2.0 * mu * GRAVITY), rel=0.01)
    assert abs(velocity(result, "block")[0]) < 1e-3 * speed
    # What it had has gone into friction, but for the vibrations that are damped.
    assert work(result) == pytest.approx(-0.5 * 0.5 * speed**2, rel=0.01)


@pytest.mark.parametrize("on", ["floor", "bed"])
def test_sliding_disc_ends_rolling(on):
    """Two thirds of the speed are left, whatever the force, after the disc has turned by 0.02.

    Small-displacement elasticity bounds the angle: a disc that turns by a grows by R a^2 / 2, and
    must climb that. The run ends at 0.04.
    """
    mu, gravity, radius, angle = 0.8, 1e-4, 0.5, 0.02
    speed = math.sqrt(9.0 * angle * mu * gravity * radius)
    slides = speed / (3.0 * mu * gravity)
    fine = {"point": [0.0, 0.0], "radius": 0.1, "size": 0.02}
    bodies = [
        disc(
            "disc", [0.0, radius], radius, 0.1, refine=[fine], velocity=[speed, 0.0],
            rayleigh_stiffness=0.2,
        )
    ]  # fmt: skip
    if on == "bed":
        held = [{"surface": "bottom", "kind": "fixed"}]
        bodies.append(
            block(
                "bed", [-0.5, -0.2], [1.0, 0.2], 0.1, refine=[fine | {"radius": 0.15}],
                supports=held, youngs_modulus=10.0, rayleigh_stiffness=0.2,
            )
        )  # fmt: skip
    result = impactfem.solve(
        rubbing(
            bodies, [("disc", on, mu)], 2.0 * slides, [0.0, -gravity],
            [FLOOR] if on == "floor" else (), method="massless", normals="updated", dt=0.05,
        )
    )  # fmt: skip
    time = result.history.time.values
    rolls = result.history["disc.vx"].values[time > 1.2 * slides]
    assert rolls.mean() == pytest.approx(2.0 / 3.0 * speed, rel=0.02)
    assert rolls[-1] == pytest.approx(2.0 / 3.0 * speed, rel=0.02)
    # Friction takes a third of the kinetic energy. The elastic support is struck at t = 0.
    mass = math.pi * radius**2
    assert work(result) == pytest.approx(-mass * speed**2 / 6.0, rel=0.04 if on == "floor" else 0.1)


def pushed(degrees, mu=0.4, speed=0.1, duration=10.0):
    """Way of a square block in space that slides at an angle to its axes [m], (2,)."""
    along = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    body = block(
        "block", [0.0, 0.0, 0.0], [1.0, 1.0, 0.5], 0.25, model="3d", cells="hexahedron",
        poisson_ratio=0.0, rayleigh_stiffness=0.5, velocity=[*(speed * along), 0.0],
        displacement=settled(GRAVITY, 0.5, 3),
    )  # fmt: skip
    result = impactfem.solve(
        rubbing(
            [body], [("block", "floor", mu)], duration, [0.0, 0.0, -GRAVITY], [FLOOR_3D],
            method="massless", dt=0.1,
        )
    )  # fmt: skip
    return np.array([np.ptp(result.history[f"block.{axis}"].values) for axis in "xy"])


def test_a_diagonal_push_meets_the_same_friction():
    """A pyramid would stop the diagonal by sqrt(2) more, and turn the way at 22.5 degrees."""
    ways = {degrees: pushed(degrees) for degrees in (0.0, 22.5, 45.0)}
    braked = {degrees: 1.0 - np.linalg.norm(way) for degrees, way in ways.items()}
    assert braked[0.0] == pytest.approx(0.5 * 0.4 * GRAVITY * 10.0**2, rel=0.02)
    for degrees, way in ways.items():
        assert braked[degrees] == pytest.approx(braked[0.0], rel=1e-3)
        assert math.degrees(math.atan2(way[1], way[0])) == pytest.approx(degrees, abs=1e-3)


def oblique(mu, method="conserving", normals="fixed", **more):
    """A block that strikes another one obliquely, without gravity."""
    bodies = [
        block("low", [0.0, 0.0], [1.0, 0.5], 0.125),
        block("top", [0.1, 0.51], [0.6, 0.4], 0.1, velocity=[0.05, -0.05], density=2.0),
    ]
    step = {} if method in ("explicit", "galerkin") else {"dt": 0.05}
    settings = {"method": method, "normals": normals} | step | more
    return rubbing(bodies, [("top", "low", mu)], 3.0, None, (), **settings)


def momenta(result):
    """Momentum of both blocks of `oblique` [N s], (2, layers)."""
    history = result.history
    return np.array(
        [0.5 * history[f"low.v{a}"].values + 0.48 * history[f"top.v{a}"].values for a in "xy"]
    )


@pytest.mark.parametrize("normals", ["fixed", "updated"])
@pytest.mark.parametrize("method", ["conserving", "massless", "explicit", "moreau_jean"])
def test_bodies_that_rub_keep_their_momentum(method, normals):
    result = impactfem.solve(oblique(0.3, method, normals))
    both = momenta(result)
    assert np.abs(both - both[:, :1]).max() < 1e-10 * 0.48 * 0.05
    # Friction acted: without it the struck block would not move sideways.
    assert velocity(result, "low")[0] > 0.1 * 0.05


def test_energy_of_bodies_falls_by_the_frictional_work():
    energy = (result := impactfem.solve(oblique(0.3))).history["total_energy"].values
    assert work(result) < -0.01 * energy[0]
    assert energy[-1] - energy[0] == pytest.approx(work(result), abs=1e-8 * energy[0])
    assert np.diff(energy).max() <= 1e-12 * energy[0]


def thrown(mu, speed, method="conserving", duration=6.0, height=0.01):
    """A block thrown flat onto a floor, without damping."""
    body = block("block", [0.0, height], [1.0, 0.5], 0.25, velocity=list(speed))
    dt = {} if method == "explicit" else {"dt": 0.1}
    return rubbing(
        [body], [("block", "floor", mu)], duration, [0.0, -GRAVITY], method=method, **dt
    )  # fmt: skip


@settings(max_examples=6, deadline=None)
@given(
    st.sampled_from(["conserving", "massless"]), st.floats(0.02, 1.2), st.floats(-0.1, 0.1),
    st.floats(-0.1, -0.01),
)  # fmt: skip
def test_a_thrown_block_obeys_the_cone_and_loses_the_frictional_work(method, mu, along, down):
    result = impactfem.solve(thrown(mu, (along, down), method))
    history, dt = result.history, result.summary["details"]["dt"]
    energy, force = history["total_energy"].values, history["contact_force"].values
    assert force.max() > 0.0
    assert force.min() >= 0.0
    assert np.nanmin(history["gap"].values) >= -1e-12
    drag = 0.5 * np.diff(history["block.vx"].values) / dt
    assert (np.abs(drag) <= mu * force[1:] + 1e-11).all()
    scale = np.abs(energy).max()
    assert np.diff(energy).max() <= 1e-12 * scale
    lost = energy[-1] - energy[0] - work(result)
    assert lost <= 1e-10 * scale
    if method == "conserving":
        assert lost >= -1e-10 * scale


def test_explicit_layers_lose_the_frictional_work():
    result = impactfem.solve(thrown(0.4, (0.1, -0.05), "explicit", height=0.03))
    history = result.history
    # Energies belong to the middle of layers. In flight at both ends nothing is cut in half; the
    # first one starts g^2 dt^2 m / 8 low.
    force = history["contact_force"].values
    assert not force[:3].any()
    assert not force[-3:].any()
    energy = history["total_energy"].values
    assert work(result) < -0.05 * energy[1]
    assert energy[-1] - energy[1] == pytest.approx(work(result), abs=1e-10 * energy[1])


def test_coefficient_zero_takes_the_path_without_friction(monkeypatch):
    def never(*_):
        raise AssertionError("a march with friction was made")

    monkeypatch.setattr(impactfem.bodies_runs, "RubbingMarch", never)
    zero, absent = (impactfem.solve(oblique(mu)) for mu in (0.0, None))
    for name in absent.history.data_vars:
        assert np.array_equal(zero.history[name], absent.history[name], equal_nan=True), name
    assert zero.summary["num_dofs"] == absent.summary["num_dofs"]
    assert work(zero) == 0.0


def test_a_trace_of_friction_is_next_to_none():
    """The march with friction tends to the one without."""
    none, trace = (impactfem.solve(oblique(mu)) for mu in (0.0, 1e-10))
    assert work(trace) < 0.0
    for name in ("low.vx", "low.vy", "top.vx", "total_energy", "contact_force"):
        assert trace.history[name].values == pytest.approx(none.history[name].values, abs=1e-9)


def forget_models():
    """Have the next run mesh anew."""
    for kept in vars(impactfem.bodies_model).values():
        if hasattr(kept, "cache_clear"):
            kept.cache_clear()


@pytest.mark.parallel(2)
def test_two_ranks_agree_with_one(monkeypatch):
    from impactfem.fem import MPI

    scenes = oblique(0.3), oblique(0.3, normals="updated"), thrown(0.4, (0.1, -0.05))
    shared = [impactfem.solve(scene) for scene in scenes]
    own = SimpleNamespace(COMM_WORLD=MPI.COMM_SELF, MAX=MPI.MAX)
    monkeypatch.setattr(impactfem.bodies_model, "MPI", own)
    forget_models()
    alone = [impactfem.solve(scene) for scene in scenes]
    forget_models()
    for one, two in zip(alone, shared, strict=True):
        assert work(one) < 0.0
        assert work(two) == pytest.approx(work(one), rel=1e-10)
        for name in one.history.data_vars:
            a, b = one.history[name].values, two.history[name].values
            scale = max(float(np.nanmax(np.abs(a))), 0.05)
            assert b == pytest.approx(a, abs=1e-10 * scale, nan_ok=True), name


@pytest.mark.parametrize("mu", [-0.1, math.inf, -math.inf, math.nan])
def test_impossible_coefficients_are_refused(mu):
    with pytest.raises(SceneError, match=r"friction_coefficient = .* >= 0"):
        thrown(mu, (0.1, -0.05))
