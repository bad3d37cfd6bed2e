"""The velocity-level scheme of Moreau and Jean for systems with few degrees of freedom."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.errors import ConvergenceError, SceneError
from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities


def ball(e, gravity=0.0, motion=None):
    motions = None if motion is None else [motion]
    return LinearSystem(
        mass=2.0, normals=[[1.0]], offsets=[0.0], load=[-2.0 * gravity], restitution=e,
        motion=motions,
    )  # fmt: skip


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_an_impact_takes_one_step_and_leaves_with_e_times_the_speed(e):
    found = integrate_velocities(ball(e), [0.5], [-1.3], 1.0, VelocitySettings(0.01))
    assert found.velocity[-1] == pytest.approx([1.3 * e], abs=1e-14)
    assert found.impacts.impulse == pytest.approx([2.0 * (1.0 + e) * 1.3])
    assert found.impacts.time == pytest.approx([0.5 / 1.3])
    assert np.count_nonzero(np.diff(found.velocity[:, 0])) == 1
    assert found.effort.details["max_penetration"] <= 0.01 * 1.3


def test_momentum_balances_exactly():
    choice = VelocitySettings(1e-3, every=7)
    found = integrate_velocities(ball(0.6, 9.81), [1.0], [0.5], 1.5, choice)
    pushed = found.impulse[1:, 0] - 2.0 * 9.81 * np.diff(found.times)
    assert np.diff(2.0 * found.velocity[:, 0]) == pytest.approx(pushed, abs=1e-10)


def test_a_translating_wall_is_a_frame_of_reference():
    wall = Signal(0.2, slope=0.7)
    choice = VelocitySettings(1e-2)
    still = integrate_velocities(ball(0.4, 9.81), [0.8], [-1.7], 1.0, choice)
    moved = integrate_velocities(ball(0.4, 9.81, wall), [1.0], [-1.0], 1.0, choice)
    expected = still.position[:, 0] + 0.2 + 0.7 * still.times
    assert moved.position[:, 0] == pytest.approx(expected, abs=1e-11)


def test_a_ball_comes_to_rest_with_its_weight():
    found = integrate_velocities(ball(0.5, 9.81), [1.0], [0.0], 4.0, VelocitySettings(1e-3))
    assert found.contact_force[-1] == pytest.approx([2.0 * 9.81])


@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
def test_flights_have_the_order_of_theta(theta):
    system = LinearSystem(mass=1.0, stiffness=4.0, damping=0.4, normals=[[1.0]], offsets=[5.0])
    root = np.sqrt(4.0 - 0.04)

    def error(h):
        found = integrate_velocities(system, [1.0], [0.6], 2.0, VelocitySettings(h, theta))
        t = found.times
        exact = np.exp(-0.2 * t) * (np.cos(root * t) + 0.8 / root * np.sin(root * t))
        return np.abs(found.position[:, 0] - exact).max()

    assert error(0.01) / error(0.005) == pytest.approx(4.0 if theta == 0.5 else 2.0, rel=0.02)


def test_the_energy_of_stiff_free_motion_is_kept_at_any_step():
    system = LinearSystem(mass=1.0, stiffness=1e6, normals=[[1.0]], offsets=[1.0])
    found = integrate_velocities(system, [0.1], [0.0], 1.0, VelocitySettings(0.05))
    assert found.total == pytest.approx(np.full(21, 5e3))


def test_the_python_path_agrees_with_the_compiled_one_to_the_order_of_the_step():
    linear = LinearSystem(
        mass=[1.0, 2.0], stiffness=[[3.0, 0.1], [0.1, 5.0]], load=[0.0, -1.0],
        normals=[[0.0, 1.0], [0.87, -0.5]], offsets=[0.0, 0.0], restitution=0.5,
    )  # fmt: skip
    general = GeneralizedSystem(
        mass=[1.0, 2.0],
        force=linear.force,
        constraints=lambda u: linear.normals @ u,
        restitution=0.5,
    )
    start = ([2.0, 1.0], [-1.0, -0.6], 2.0, VelocitySettings(1e-3))
    one, other = integrate_velocities(linear, *start), integrate_velocities(general, *start)
    assert len(one.impacts) >= 2
    assert one.position == pytest.approx(other.position, abs=1e-4)


def test_the_python_path_is_the_compiled_one_where_forces_are_constant():
    linear = ball(0.7, 9.81)
    general = GeneralizedSystem(
        mass=2.0,
        force=lambda _t, _u, v: 0.0 * v - 19.62,
        constraints=lambda u: u,
        restitution=0.7,
    )
    start = ([1.0], [0.0], 1.5, VelocitySettings(1e-3))
    one, other = integrate_velocities(linear, *start), integrate_velocities(general, *start)
    assert len(one.impacts) >= 2
    assert one.position == pytest.approx(other.position, abs=1e-12)
    assert one.contact_force == pytest.approx(other.contact_force, abs=1e-9)


def test_cradle_follows_the_simultaneous_law():
    system = LinearSystem(
        mass=[1.0] * 3, normals=[[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]], offsets=[0.0, 0.0],
        restitution=1.0,
    )  # fmt: skip
    start = ([0.0] * 3, [1.0, 0.0, 0.0], 1.0)
    found = integrate_velocities(system, *start, VelocitySettings(0.01))
    assert found.velocity[-1] == pytest.approx([-1 / 3, 2 / 3, 2 / 3], abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), e=st.sampled_from([0.0, 0.5, 1.0]))
def test_random_systems_change_energy_by_the_work_of_their_impulses_alone(seed, e):
    # theta = 1/2: the energy changes by P . (w_new + w_old) / 2 = (1 - e) / 2 P . w_old, which is a
    # loss unless a constraint that is pushed back was leaving
    rng = np.random.default_rng(seed)
    d, count = rng.integers(1, 4), rng.integers(1, 4)
    root, spring = rng.normal(size=(d, d)), rng.normal(size=(d, d))
    system = LinearSystem(
        mass=root @ root.T + np.eye(d), stiffness=spring @ spring.T, load=list(rng.normal(size=d)),
        normals=rng.normal(size=(count, d)), offsets=rng.random(count) + 0.1, restitution=e,
    )  # fmt: skip
    speed = rng.normal(size=d)
    found = integrate_velocities(system, np.zeros(d), speed, 2.0, VelocitySettings(0.01))
    assert (found.contact_force >= 0.0).all()
    assert (found.impulse >= 0.0).all()
    impulse, speed = found.impulse[1:], found.velocity @ system.normals.T
    work = 0.5 * (1.0 - e) * (impulse * speed[:-1]).sum(axis=1)
    scale = np.abs(found.kinetic).max() + np.abs(found.potential).max()
    assert np.diff(found.total) == pytest.approx(work, abs=1e-11 * scale)
    approaching = (speed[:-1] <= 0.0).all(axis=1)
    assert (np.diff(found.total)[approaching] <= 1e-11 * scale).all()


def test_bad_input_is_named():
    stiff = GeneralizedSystem(
        mass=1.0, force=lambda _t, u, _v: -1e4 * u, constraints=lambda u: u + 1
    )
    with pytest.raises(SceneError, match=r"dt < 0\.02 s"):
        integrate_velocities(stiff, [0.1], [0.0], 1.0, VelocitySettings(0.05))
    with pytest.raises(SceneError, match=r"theta = 0\.2"):
        integrate_velocities(ball(0.0), [0.1], [0.0], 1.0, VelocitySettings(0.05, theta=0.2))
    with pytest.raises(SceneError, match="sequential"):
        integrate_velocities(
            ball(0.0), [0.1], [0.0], 1.0, VelocitySettings(0.1, impact_law="sequential")
        )
    damped = GeneralizedSystem(
        mass=1.0, force=lambda _t, _u, v: -1e4 * v, constraints=lambda u: u + 1
    )
    with pytest.raises(ConvergenceError, match="smaller dt"):
        integrate_velocities(damped, [0.1], [1.0], 1.0, VelocitySettings(0.01))
