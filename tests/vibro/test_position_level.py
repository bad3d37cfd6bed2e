"""The position-level scheme: flights, impacts, walls that move, several constraints, errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.contact.impact_law import complementarity
from impactfem.errors import ConvergenceError, SceneError
from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro import position_level, vibro_rows
from impactfem.vibro.position_level import PositionSettings, integrate_positions


def ball(e=0.8, gravity=0.0, motion=None):
    motions = None if motion is None else [motion]
    return LinearSystem(
        mass=2.0, normals=[[1.0]], offsets=[0.0], load=[-2.0 * gravity], restitution=e,
        motion=motions,
    )  # fmt: skip


def oscillator(e=0.5):
    """The founding paper's oscillator as a linear system and as functions."""
    load = Signal(harmonics=((50.0, 5.0, 0.0),))
    linear = LinearSystem(
        mass=1.0, damping=1.0, stiffness=1.0, load=[load], normals=[[1.0]], offsets=[-0.8],
        restitution=e,
    )  # fmt: skip

    class Driven:
        def __call__(self, t, u, v):
            return 5.0 * np.cos(50.0 * t) - v - u

        def mean(self, start, end, u, v):
            return 0.1 * (np.sin(50.0 * end) - np.sin(50.0 * start)) / (end - start) - v - u

    general = GeneralizedSystem(
        mass=1.0,
        force=Driven(),
        constraints=lambda u: u - 0.8,
        restitution=e,
    )
    return linear, general


def corner(e=0.5):
    """Two flat walls, a full mass matrix, coupled springs and dampers."""
    data = {
        "mass": [[1.0, 0.2], [0.2, 2.0]],
        "stiffness": [[3.0, 0.1], [0.1, 5.0]],
        "damping": [[0.1, 0.05], [0.05, 0.2]],
        "load": [0.0, -1.0],
        "normals": [[0.0, 1.0], [0.87, -0.5]],
        "offsets": [0.0, 0.0],
        "restitution": e,
    }
    linear = LinearSystem(**data)
    general = GeneralizedSystem(
        mass=data["mass"],
        force=linear.force,
        constraints=lambda u: np.array(data["normals"]) @ u,
        restitution=e,
    )
    return linear, general


@pytest.mark.parametrize("share", [0.03, 0.3, 0.5, 0.9])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.8, 1.0])
def test_an_impact_leaves_with_e_times_the_speed_and_two_steps_late(e, share):
    h, speed = 0.01, 1.3
    u0 = speed * h * (20 + share)
    found = integrate_positions(ball(e), [u0], [-speed], 100 * h, PositionSettings(h))
    assert found.velocity[-1] == pytest.approx([e * speed], abs=1e-12)
    late = found.times[-1] - u0 / speed - 2.0 * h
    assert found.position[-1] == pytest.approx([e * speed * late], abs=1e-12)
    assert len(found.impacts) == 1
    assert found.impacts.time == pytest.approx(u0 / speed)
    assert found.impacts.before == pytest.approx(-speed)
    assert found.impacts.impulse == pytest.approx(2.0 * (1.0 + e) * speed)
    assert found.effort.details["max_penetration"] <= 2.0 * e / (1.0 + e) * h * speed + 1e-14


def test_momentum_balances_exactly():
    found = integrate_positions(ball(0.6, 9.81), [1.0], [0.5], 1.5, PositionSettings(1e-3, every=7))
    pushed = found.impulse[1:, 0] - 2.0 * 9.81 * np.diff(found.times)
    assert np.diff(2.0 * found.velocity[:, 0]) == pytest.approx(pushed, abs=1e-10)


def test_a_ball_comes_to_rest_with_its_weight():
    found = integrate_positions(ball(0.5, 9.81), [1.0], [0.0], 4.0, PositionSettings(1e-3))
    assert found.contact_force[-1] == pytest.approx([2.0 * 9.81])
    assert found.position[-1] == pytest.approx([0.0], abs=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_resting_ball_rests(e):
    found = integrate_positions(ball(e, 9.81), [0.0], [0.0], 1.0, PositionSettings(1e-2))
    assert np.abs(found.position).max() == pytest.approx(0.0, abs=1e-14)
    assert found.contact_force[1:] == pytest.approx(np.full((100, 1), 2.0 * 9.81))


def test_a_start_on_the_wall_that_approaches_it_rebounds_at_once():
    found = integrate_positions(ball(0.5), [0.0], [-1.0], 1.0, PositionSettings(0.1))
    assert found.position[:, 0] == pytest.approx(0.5 * found.times)
    assert found.impacts.impulse == pytest.approx([3.0])


@pytest.mark.parametrize("e", [0.4, 1.0])
def test_a_translating_wall_is_a_frame_of_reference(e):
    wall = Signal(0.2, slope=0.7)
    still = integrate_positions(ball(e, 9.81), [0.8], [-1.7], 2.0, PositionSettings(1e-2))
    moved = integrate_positions(ball(e, 9.81, wall), [1.0], [-1.0], 2.0, PositionSettings(1e-2))
    expected = still.position[:, 0] + 0.2 + 0.7 * still.times
    assert moved.position[:, 0] == pytest.approx(expected, abs=1e-11)
    assert moved.contact_force == pytest.approx(still.contact_force, rel=1e-8, abs=1e-6)


def test_the_compiled_path_is_the_python_path():
    linear, general = oscillator()
    start = ([0.8], [0.1], 0.8, PositionSettings(0.005))
    one, other = integrate_positions(linear, *start), integrate_positions(general, *start)
    assert one.position == pytest.approx(other.position, abs=1e-12)
    assert one.contact_force == pytest.approx(other.contact_force, abs=1e-7)
    assert one.impacts.time == pytest.approx(other.impacts.time, abs=1e-10)
    linear, general = corner()
    start = ([2.0, 1.0], [-1.0, -0.6], 3.0, PositionSettings(0.01))
    one, other = integrate_positions(linear, *start), integrate_positions(general, *start)
    assert one.effort.details["handed_back"] > 0  # the active set was needed
    assert one.position == pytest.approx(other.position, abs=1e-11)
    assert one.contact_force == pytest.approx(other.contact_force, abs=1e-6)


def test_tables_and_calls_of_any_length_give_one_motion(monkeypatch):
    linear, _ = oscillator()
    start = ([0.8], [0.1], 0.8, PositionSettings(0.005))
    one = integrate_positions(linear, *start)
    kernel = position_level.march_positions

    def one_by_one(span, dt, loads, walls, *rest):
        m, begin, _, last, every = span
        return kernel((m, begin, m + 1, last, every), dt, loads, walls, *rest)

    monkeypatch.setattr(position_level, "march_positions", one_by_one)
    monkeypatch.setattr(vibro_rows, "_MOST_STEPS", 13)
    other = integrate_positions(linear, *start)
    assert (one.position == other.position).all()
    assert len(one.impacts) == len(other.impacts)


def test_implicit_and_explicit_have_order_two_in_free_flight():
    system = LinearSystem(mass=1.0, stiffness=4.0, normals=[[1.0]], offsets=[5.0])

    def error(h, implicit):
        found = integrate_positions(system, [1.0], [0.6], 2.0, PositionSettings(h, implicit))
        exact = np.cos(2.0 * found.times) + 0.3 * np.sin(2.0 * found.times)
        return np.abs(found.position[:, 0] - exact).max()

    for implicit in (False, True):
        assert error(0.02, implicit) / error(0.01, implicit) == pytest.approx(4.0, rel=0.02)


def test_several_restitutions_act_each_on_its_constraint():
    system = LinearSystem(
        mass=[1.0, 1.0],
        normals=[[1.0, 0.0], [0.0, 1.0]],
        offsets=[0.0, 0.0],
        restitution=[0.2, 0.9],
    )
    found = integrate_positions(system, [0.5, 0.5], [-1.0, -1.0], 1.0, PositionSettings(0.01))
    assert found.velocity[-1] == pytest.approx([0.2, 0.9])


@pytest.mark.parametrize(("e", "expected"), [(1.0, [-1 / 3, 2 / 3, 2 / 3]), (0.0, [1 / 3] * 3)])
def test_cradle_follows_the_simultaneous_law(e, expected):
    system = LinearSystem(
        mass=[1.0] * 3, normals=[[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]], offsets=[0.105, 0.0],
        restitution=e,
    )  # fmt: skip
    found = integrate_positions(system, [0.0] * 3, [1.0, 0.0, 0.0], 1.0, PositionSettings(0.01))
    assert found.velocity[-1] == pytest.approx(expected, abs=1e-12)


def test_forces_without_potential_are_solved_by_sweeps():
    system = LinearSystem(
        mass=[1.0, 1.0], damping=[[0.0, 3.0], [-3.0, 0.0]], normals=[[1.0, 0.0], [0.0, 1.0]],
        offsets=[0.0, 0.0], load=[-1.0, -1.0],
    )  # fmt: skip
    found = integrate_positions(system, [0.1, 0.1], [0.0, 0.0], 3.0, PositionSettings(0.01))
    assert found.contact_force[-1] == pytest.approx([1.0, 1.0])
    assert found.gap.min() > -0.05


def test_a_curved_wall_keeps_energy_and_angular_momentum():
    system = GeneralizedSystem(
        mass=[1.0, 1.0],
        force=lambda _t, _u, v: 0.0 * v,
        constraints=lambda u: 1.0 - (u[0] * u[0] + u[1] * u[1]) ** 0.5,
        restitution=1.0,
    )

    def drift(h):
        found = integrate_positions(system, [0.5, 0.0], [0.3, 1.0], 6.0, PositionSettings(h))
        u, v = found.position, found.velocity
        free = np.ones(len(u), dtype=bool)
        acts = np.flatnonzero(found.impulse[:, 0] > 0.0)
        for shift in (-1, 0, 1):
            free[np.clip(acts + shift, 0, len(u) - 1)] = False
        moment = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])[free]
        assert len(found.impacts) >= 3
        return np.abs(found.kinetic[free] / 0.545 - 1.0).max(), np.abs(moment / 0.5 - 1.0).max()

    coarse, fine = drift(4e-3), drift(1e-3)
    assert fine < (1e-2, 1e-2)
    assert fine[1] < 0.5 * coarse[1] + 1e-12


def test_a_mass_matrix_that_depends_on_position():
    # a free particle in polar coordinates against the wall x = r cos(theta) >= 1, e = 1
    system = GeneralizedSystem(
        mass=lambda u: np.diag([1.0, u[0] ** 2]),
        force=lambda _t, u, v: np.array([u[0] * v[1] ** 2, -2.0 * u[0] * v[0] * v[1]]),
        constraints=lambda u: u[0] * np.cos(u[1]) - 1.0,
        restitution=1.0,
        dofs=2,
    )

    def error(h):
        # Cartesian: from (2, -0.5) with (-1, 0.6): hits x = 1 at t = 1, then x = t
        start = [np.hypot(2.0, 0.5), np.arctan2(-0.5, 2.0)]
        rate = [(-2.0 - 0.3) / start[0], (2.0 * 0.6 - 0.5) / start[0] ** 2]
        found = integrate_positions(system, start, rate, 1.5, PositionSettings(h))
        r, angle = found.position[-1]
        return np.hypot(r * np.cos(angle) - 1.5, r * np.sin(angle) - 0.4)

    coarse, fine = error(4e-3), error(1e-3)
    assert fine < 5e-3
    assert fine < 0.5 * coarse


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    e=st.sampled_from([0.0, 0.5, 0.9]),
)
def test_random_systems_neither_pull_nor_sink(seed, e):
    rng = np.random.default_rng(seed)
    d, count = rng.integers(1, 4), rng.integers(1, 4)
    root = rng.normal(size=(d, d))
    normals = rng.normal(size=(count, d))
    system = LinearSystem(
        mass=root @ root.T + np.eye(d), load=list(rng.normal(size=d)), normals=normals,
        offsets=rng.random(count) + 0.1, restitution=e,
    )  # fmt: skip
    h = 0.01
    found = integrate_positions(system, np.zeros(d), rng.normal(size=d), 2.0, PositionSettings(h))
    assert (found.contact_force >= 0.0).all()
    average = found.gap[2:] + e * found.gap[:-2]
    assert average.min() >= -1e-12 * (1.0 + np.abs(found.position).max())
    fastest = np.sqrt(2.0 * found.kinetic.max()) * np.linalg.norm(normals, axis=1).max()
    assert found.effort.details["max_penetration"] <= 4.0 * h * fastest


def test_stiff_systems_are_implicit_by_themselves():
    system = LinearSystem(mass=1.0, stiffness=1e6, normals=[[1.0]], offsets=[1.0])
    found = integrate_positions(system, [0.1], [0.0], 0.1, PositionSettings(1e-2))
    assert found.effort.details["implicit"] is True
    assert np.abs(found.position).max() <= 0.1 + 1e-12
    with pytest.raises(SceneError, match=r"dt = 0\.01 s .* dt < 0\.002 s .* implicit = true"):
        integrate_positions(system, [0.1], [0.0], 0.1, PositionSettings(1e-2, implicit=False))


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        (PositionSettings(0.0), "dt = 0:"),
        (PositionSettings(0.1, every=0), "every = 0"),
        (PositionSettings(0.1, impact_law="sequential"), "sequential"),
    ],
)
def test_bad_settings_are_named(choice, message):
    with pytest.raises(SceneError, match=message):
        integrate_positions(ball(), [1.0], [0.0], 1.0, choice)


def test_bad_systems_are_named():
    stiff = GeneralizedSystem(
        mass=1.0, force=lambda _t, u, _v: -1e4 * u, constraints=lambda u: u + 1.0
    )
    with pytest.raises(SceneError, match=r"dt < 0\.02 s"):
        integrate_positions(stiff, [0.1], [0.0], 1.0, PositionSettings(0.05))
    with pytest.raises(SceneError, match="implicit"):
        integrate_positions(stiff, [0.1], [0.0], 1.0, PositionSettings(0.001, implicit=True))
    with pytest.raises(SceneError, match="outside constraint 0"):
        integrate_positions(ball(), [-1.0], [0.0], 1.0, PositionSettings(0.01))
    damped = GeneralizedSystem(
        mass=1.0, force=lambda _t, _u, v: -1e4 * v, constraints=lambda u: u + 1.0
    )
    with pytest.raises(ConvergenceError, match="smaller dt"):
        integrate_positions(damped, [0.1], [1.0], 1.0, PositionSettings(0.01))


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_parallel_walls_act_as_the_nearest_one(e):
    walls = LinearSystem(
        mass=1.0, normals=[[1.0], [2.0], [-1.0]], offsets=[0.0, 1e-3, 1.0], restitution=e
    )
    one = LinearSystem(mass=1.0, normals=[[1.0], [-1.0]], offsets=[0.0, 1.0], restitution=e)
    start = ([0.5], [-1.0], 1.2, PositionSettings(0.01))
    several, single = integrate_positions(walls, *start), integrate_positions(one, *start)
    assert several.effort.details["handed_back"] > 0
    assert several.position == pytest.approx(single.position, abs=1e-10)


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_complementarity_holds_with_more_constraints_than_directions(seed):
    rng = np.random.default_rng(seed)
    d, count = rng.integers(1, 4), rng.integers(2, 7)
    normals = rng.normal(size=(count, d))
    matrix = normals @ normals.T
    offset = normals @ rng.normal(size=d) + rng.random(count)  # a point obeys all constraints
    found = complementarity(matrix, offset)
    gap = matrix @ found + offset
    assert found.min() >= 0.0
    assert gap.min() >= -1e-8
    assert np.abs(gap * found).max() <= 1e-7 * max(1.0, np.abs(found).max())
