"""The penalty method against closed forms, and against what no penalty may do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from penalty import PenaltySettings, damping_of, integrate_penalty
from plain_penalty import integrate_plainly
from scipy.optimize import brentq

from impactfem.errors import SceneError
from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events


def ball(*, restitution=0.5, mass=1.0, load=0.0, **more):
    return LinearSystem(
        mass=mass, normals=[[1.0]], offsets=[0.0], load=[load], restitution=restitution, **more
    )


def ratio(found):
    assert found.effort.details["restitution"]["count"] == 1
    return found.effort.details["restitution"]["ratios"][0]


def free_restitution(alpha):
    return 0.0 if alpha >= 1.0 else math.exp(-math.pi * alpha / math.sqrt(1.0 - alpha * alpha))


@pytest.mark.parametrize("integrator", ["lsoda", "radau", "dop853"])
@pytest.mark.parametrize("alpha", [0.0, 0.05, 0.2154538, 0.7])
def test_a_free_ball_rebounds_by_the_closed_form_whatever_its_mass(alpha, integrator):
    chosen = PenaltySettings(1e6, 0.1, damping=alpha, integrator=integrator, rtol=1e-10)
    found = integrate_penalty(ball(mass=3.0), [0.3], [-2.0], 0.4, chosen)
    assert ratio(found) == pytest.approx(free_restitution(alpha), abs=2e-8)
    assert found.velocity[-1, 0] == pytest.approx(2.0 * free_restitution(alpha), abs=1e-7)
    impulse = 3.0 * 2.0 * (1.0 + free_restitution(alpha))
    assert found.impacts.impulse[0] == pytest.approx(impulse, rel=1e-7)
    assert found.impulse.sum() == pytest.approx(impulse, rel=1e-7)


def test_the_damping_of_one_half_is_that_of_the_paper():
    assert damping_of(0.5) == pytest.approx(0.2154538, abs=5e-8)
    assert damping_of(0.0) == 1.0
    assert damping_of(1.0) == 0.0


@pytest.mark.parametrize("alpha", [1.0, 1.5])
def test_a_damping_of_one_or_more_gives_no_rebound(alpha):
    found = integrate_penalty(ball(), [0.1], [-1.0], 1.0, PenaltySettings(1e4, 0.1, damping=alpha))
    assert abs(found.velocity[-1, 0]) < 1e-9
    assert abs(found.gap[-1, 0]) < 1e-9


def contact_under_gravity(k, alpha, speed, g):
    """Speed out over speed in of z'' + 2 alpha sqrt(k) z' + k z = -g, z(0) = 0, z'(0) = -speed."""
    w, decay = math.sqrt(k * (1 - alpha * alpha)), alpha * math.sqrt(k)
    rest = -g / k
    sine = (-speed - decay * rest) / w

    def place(t):
        return rest + math.exp(-decay * t) * (-rest * math.cos(w * t) + sine * math.sin(w * t))

    def rate(t):
        e, c, s = math.exp(-decay * t), math.cos(w * t), math.sin(w * t)
        return e * ((decay * rest + sine * w) * c + (rest * w - decay * sine) * s)

    leave = brentq(place, 0.5 * math.pi / w, 1.5 * math.pi / w, xtol=1e-17)
    return rate(leave) / speed


@pytest.mark.parametrize("k", [1e4, 1e6, 1e8])
def test_under_gravity_the_restitution_is_that_of_the_damped_spring_and_tends_to_one_half(k):
    g, height = 9.81, 1.0
    chosen = PenaltySettings(k, 0.02, damping=0.2154538)
    found = integrate_penalty(ball(load=-g), [height], [0.0], 0.6, chosen)
    exact = contact_under_gravity(k, 0.2154538, math.sqrt(2 * g * height), g)
    assert ratio(found) == pytest.approx(exact, abs=1e-7)
    # Expanded in the only small number, epsilon = g / (sqrt(k) v): e - 2 alpha (1 + e) epsilon.
    first = 2.0 * 0.2154538 * 1.5 * g / math.sqrt(k * 2 * g * height)
    assert free_restitution(0.2154538) - exact == pytest.approx(
        first, rel=2.0 * g / math.sqrt(k * 2 * g * height) + 1e-4
    )


def test_one_half_is_reached_to_one_part_in_a_million():
    chosen = PenaltySettings(1e14, 0.02, damping=0.2154538)
    found = integrate_penalty(ball(load=-9.81), [1.0], [0.0], 0.6, chosen)
    assert ratio(found) == pytest.approx(0.5, abs=1e-6)


def test_a_wall_that_moves_hits_as_in_its_own_frame():
    wall = Signal(slope=0.5)
    moving = LinearSystem(mass=2.0, normals=[[1.0]], offsets=[0.0], restitution=0.5, motion=[wall])
    found = integrate_penalty(moving, [0.3], [-1.0], 0.4, PenaltySettings(1e6, 0.1))
    assert found.velocity[-1, 0] == pytest.approx(0.5 + 0.5 * 1.5, abs=1e-7)
    assert found.impacts.before[0] == pytest.approx(-1.5)


@settings(max_examples=15, deadline=None)
@given(
    st.floats(0.2, 5.0), st.floats(0.2, 5.0), st.floats(-0.9, 0.9), st.floats(0.3, 3.0),
    st.floats(-2.0, 2.0),
)  # fmt: skip
def test_the_damping_acts_along_the_normal_in_the_metric_of_the_mass(m1, m2, c, speed, slide):
    # An oblique impact, mass matrix full: Newton's law in the metric of M, closed form.
    mass = np.array([[m1, c * math.sqrt(m1 * m2)], [c * math.sqrt(m1 * m2), m2]])
    normal = np.array([0.6, 0.8])
    system = LinearSystem(mass=mass, normals=[normal], offsets=[0.0], restitution=0.5)
    start = -speed * normal + slide * np.array([-0.8, 0.6])
    answer = np.linalg.solve(mass, normal)
    exact = start + 1.5 * speed * answer / (normal @ answer)
    found = integrate_penalty(
        system, 0.1 * normal, start, 0.2 / speed + 0.2, PenaltySettings(1e6, 0.1)
    )
    assert found.velocity[-1] == pytest.approx(exact, abs=1e-6 * (1 + np.abs(exact).max()))


@settings(max_examples=10, deadline=None)
@given(st.floats(0.0, 2 * math.pi), st.floats(-1.0, 1.0), st.sampled_from([0.0, 0.1, 1.5]))
def test_energy_is_kept_without_damping_and_never_grows_with_it(heading, offset, alpha):
    theta = 1.1
    normals = [[-1.0, 0.0], [math.cos(theta), -math.sin(theta)]]
    system = LinearSystem(mass=1.0 * np.eye(2), normals=normals, offsets=[1.0, 1.0 + offset / 2])
    found = integrate_penalty(
        system, [0.0, 0.0], [math.cos(heading), math.sin(heading)], 4.0,
        PenaltySettings(1e4, 0.02, damping=alpha),
    )  # fmt: skip
    if alpha == 0.0:
        assert np.ptp(found.total) < 1e-7
    else:
        assert np.diff(found.total).max() < 1e-7
    assert found.effort.details["max_penetration"] <= 1.01 / math.sqrt(1e4)


def test_inside_a_circle_angular_momentum_is_kept():
    system = GeneralizedSystem(
        mass=[1.0, 1.0], force=lambda *_: np.zeros(2), restitution=1.0,
        constraints=lambda u: 1.0 - np.sqrt(u[0] ** 2 + u[1] ** 2), dofs=2,
    )  # fmt: skip
    found = integrate_penalty(
        system, [0.2, 0.1], [1.0, 0.3], 5.0, PenaltySettings(1e4, 0.05, rtol=1e-10)
    )
    momentum = np.cross(
        np.pad(found.position, ((0, 0), (0, 1))), np.pad(found.velocity, ((0, 0), (0, 1)))
    )[:, 2]
    assert found.effort.details["restitution"]["count"] >= 2
    assert np.ptp(momentum) < 1e-7
    assert np.ptp(found.total) < 1e-7


def test_a_mass_matrix_that_depends_on_position_gives_the_motion_of_other_coordinates():
    # A free particle in polar coordinates (r, q) hits the wall x = r cos q >= 0.
    def force(_, u, v):
        return np.array([u[0] * v[1] ** 2, -2.0 * u[0] * v[0] * v[1]])

    polar = GeneralizedSystem(
        mass=lambda u: np.diag([1.0, u[0] ** 2]), force=force, restitution=0.5, dofs=2,
        constraints=lambda u: np.array([u[0] * np.cos(u[1])]),
    )  # fmt: skip
    place, speed = np.array([0.3, 1.0]), np.array([-1.0, 0.2])
    r, q = np.hypot(*place), np.arctan2(place[1], place[0])
    rate = [place @ speed / r, (place[0] * speed[1] - place[1] * speed[0]) / r**2]
    flat = LinearSystem(mass=[1.0, 1.0], normals=[[1.0, 0.0]], offsets=[0.0], restitution=0.5)
    worst = []
    for k in (1e4, 1e6):
        one = integrate_penalty(polar, [r, q], rate, 0.8, PenaltySettings(k, 0.1))
        two = integrate_penalty(flat, place, speed, 0.8, PenaltySettings(k, 0.1))
        x = one.position[:, 0] * np.cos(one.position[:, 1])
        worst.append(float(np.abs(x - two.position[:, 0]).max()))
    # The projection is in the metric of M(u), frozen: they differ by O(penetration) at most.
    assert worst[0] < 1.0 / math.sqrt(1e4)
    assert worst[1] < worst[0] / 5.0


@pytest.mark.slow
def test_the_oscillator_of_the_paper_has_two_motions_and_a_soft_penalty_takes_the_other_one():
    period = 2 * math.pi / 50
    system = LinearSystem(
        mass=1.0, damping=1.0, stiffness=1.0, load=[Signal(harmonics=((50.0, 1.0, 0.0),))],
        normals=[[1.0]], offsets=[-0.8], restitution=0.5,
    )  # fmt: skip

    def residual(found):
        return np.ptp(found.position[found.times > found.times[-1] - 4 * period, 0])

    events = EventSettings(rows=4000)
    small = residual(integrate_events(system, [0.8], [0.1], 2.5, events))
    large = residual(integrate_events(system, [0.8], [0.11], 4.0, events))
    soft, stiff = (
        residual(integrate_penalty(system, [0.8], [0.1], 2.5, PenaltySettings(k, 0.005)))
        for k in (1e4, 1e6)
    )
    assert large > 25.0 * small  # of the rigid system itself
    assert soft > 25.0 * small  # the paper's figure: more than 25
    assert stiff < 1.3 * small


def test_a_short_contact_between_two_steps_is_not_missed():
    found = integrate_penalty(
        ball(restitution=1.0, load=1.0), [0.5 - 1e-7], [-1.0], 2.0, PenaltySettings(1e10, 0.4)
    )
    assert found.effort.details["restitution"]["count"] == 1


def test_one_integrator_that_is_blind_to_the_switch_agrees_with_legs_to_its_tolerances():
    accurate = integrate_penalty(ball(load=-1.0), [0.1], [-1.0], 0.6, PenaltySettings(1e4, 0.01))
    for restarted in (False, True):
        plain = integrate_plainly(
            ball(load=-1.0), [0.1], [-1.0], 0.6, PenaltySettings(1e4, 0.01), restarted=restarted
        )
        assert np.abs(plain.position - accurate.position).max() < 1e-3
        assert ratio(plain) == pytest.approx(ratio(accurate), abs=1e-2)


def test_the_force_of_a_row_is_its_mean():
    # Pressed onto the wall from rest.
    found = integrate_penalty(
        ball(load=-2.0, restitution=0.0), [0.0], [0.0], 1.0, PenaltySettings(1e4, 0.1)
    )
    assert found.contact_force[-1, 0] == pytest.approx(2.0, abs=1e-6)
    assert found.position[-1, 0] == pytest.approx(-2.0 / 1e4, abs=1e-9)
    momentum = 2.0 * 1.0 + found.velocity[-1, 0]  # what gravity has given and is not left
    assert found.impulse.sum() == pytest.approx(momentum, rel=1e-7)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"stiffness": 0.0}, "stiffness"), ({"stiffness": -1.0}, "stiffness"),
        ({"dt": 0.0}, "dt"), ({"damping": -0.1}, "damping"), ({"integrator": "euler"}, "euler"),
    ],
)  # fmt: skip
def test_wrong_settings_are_refused_by_name(wrong, words):
    with pytest.raises(SceneError, match=words):
        PenaltySettings(**({"stiffness": 1e4, "dt": 0.1} | wrong))


def test_two_restitutions_need_a_damping():
    system = LinearSystem(
        mass=[1.0, 1.0], normals=np.eye(2), offsets=[0.0, 0.0], restitution=[0.2, 0.5]
    )
    with pytest.raises(SceneError, match="damping"):
        integrate_penalty(system, [1.0, 1.0], [0.0, 0.0], 1.0, PenaltySettings(1e4, 0.1))
