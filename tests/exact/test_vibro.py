"""Closed forms of vibro-impact against other ways to find the same."""

import math

import numpy as np
import pytest
import vibro_forms
from hypothesis import given
from hypothesis import strategies as st
from penalty import damping_of
from scipy.integrate import solve_ivp

from impactfem.errors import SceneError
from impactfem.exact import vibro

restitution = st.floats(0.05, 0.95)


def test_zeno_ball_stops_where_its_impacts_accumulate():
    ball = vibro.ZenoBall(1.0, 0.8, 9.81)
    assert ball.stopping_time == pytest.approx(4.063713, abs=5e-7)
    times, speeds = vibro_forms.impact_times(ball, 200), vibro_forms.rebound_speeds(ball, 200)
    assert times[-1] == pytest.approx(ball.stopping_time, rel=1e-14)
    # A flight from a speed v lasts 2 v/g.
    assert np.diff(times) == pytest.approx(2.0 * speeds[:-1] / 9.81, rel=1e-6, abs=1e-14)
    assert times[0] == pytest.approx(math.sqrt(2.0 / 9.81))


@given(st.floats(1e-6, 1.0))
def test_grazing_oscillator_passes_the_wall_with_that_speed(depth):
    speed, period = vibro.grazing_impact(depth)
    fall = 0.5 * period
    assert math.cos(fall) == pytest.approx(-(1.0 - depth), abs=1e-14)
    assert math.sin(fall) == pytest.approx(speed, rel=1e-9)


@given(restitution)
def test_penalty_damping_inverts_its_restitution(e):
    assert vibro_forms.penalty_restitution(damping_of(e)) == pytest.approx(e, rel=1e-12)


def test_penalty_restitution_is_that_of_its_equation():
    assert damping_of(0.5) == pytest.approx(0.2154538, abs=5e-8)
    assert vibro_forms.penalty_restitution(1.0) == vibro_forms.penalty_restitution(7.0) == 0.0
    alpha = 0.3

    def leaves(_, y):
        return y[0] - 1e-14

    leaves.terminal, leaves.direction = True, 1
    run = solve_ivp(
        lambda _, y: [y[1], -2.0 * alpha * y[1] - y[0]], (0.0, 9.0), [0.0, -1.0],
        events=leaves, rtol=1e-11, atol=1e-13, max_step=0.1,
    )  # fmt: skip
    assert vibro_forms.penalty_restitution(alpha) == pytest.approx(run.y_events[0][0][1], abs=1e-9)


def bounced(angle, velocity, start, e):
    """Impacts one by one: walls as lines, a point on a straight path."""
    walls = [np.array([0.0, 1.0]), np.array([math.sin(angle), -math.cos(angle)])]
    u, v, hits, last = np.array(start), np.array(velocity), 0, 0
    while True:
        times = [-(n @ u) / (n @ v) if n @ v < -1e-13 else math.inf for n in walls]
        if hits:
            times[last] = math.inf
        if min(times) == math.inf:
            return v, hits
        last = int(np.argmin(times))
        u = u + times[last] * v
        v = v - (1.0 + e) * (walls[last] @ v) * walls[last]
        hits += 1


@given(st.floats(0.3, 3.0), st.floats(0.05, 0.95), st.floats(0.02, 0.98))
def test_unfolding_agrees_with_impacts_one_by_one(angle, at, heading):
    start = np.array([math.cos(at * angle), math.sin(at * angle)])
    psi = at * angle + math.pi + (heading - 0.5)
    v = np.array([math.cos(psi), math.sin(psi)])
    out, hits = bounced(angle, v, start, 1.0)
    if hits:
        walls = [np.array([0.0, 1.0]), np.array([math.sin(angle), -math.cos(angle)])]
        times = [-(n @ start) / (n @ v) if n @ v < -1e-13 else math.inf for n in walls]
        found = vibro.elastic_corner(angle, v, int(np.argmin(times)))
        assert found.hits == hits
        assert found.velocity == pytest.approx(out, abs=1e-10)


@pytest.mark.parametrize(("angle", "same"), [
    (math.pi / 2, True), (math.pi / 3, True), (math.pi / 5, True),
    (2 * math.pi / 5, False), (2 * math.pi / 3, False), (1.0, False),
])  # fmt: skip
def test_orders_of_impact_agree_only_for_pi_over_n(angle, same):
    psi = 0.5 * angle + math.pi + 0.1
    v = [math.cos(psi), math.sin(psi)]
    one, two = (vibro.elastic_corner(angle, v, wall).velocity for wall in (0, 1))
    assert bool(np.abs(one - two).max() < 1e-12) is same
    assert vibro_forms.corner_is_continuous(angle) is same


@given(st.floats(0.2, 3.0), st.floats(0.02, 0.98))
def test_anelastic_corner_is_the_projection_on_the_tangent_cone(angle, heading):
    psi = angle + math.pi - heading * angle  # towards the vertex
    v = np.array([math.cos(psi), math.sin(psi)])
    if v[1] >= -1e-6:
        return
    slide, after = vibro_forms.anelastic_corner(angle, v, 0)
    assert slide == pytest.approx([v[0], 0.0])
    # Projection on a convex cone: the residual is normal and in the polar cone.
    if slide[0] < 0.0:
        walls = np.array([[1.0, 0.0], [math.cos(angle), math.sin(angle)]])
        assert (slide - after) @ after == pytest.approx(0.0, abs=1e-12)
        assert ((slide - after) @ walls.T <= 1e-12).all()


def table_map(phase, speed, gamma_over_g, e, *, simplified):
    """The next impact phase and speed after it; units with w = g = 1, A = gamma_over_g."""
    a = gamma_over_g
    if simplified:
        flight = 2.0 * speed
        return phase + flight, e * speed + (1.0 + e) * a * math.cos(phase + flight)

    flight = 2.0 * speed
    for _ in range(60):
        rest = a * math.sin(phase) + speed * flight - 0.5 * flight**2 - a * math.sin(phase + flight)
        flight -= rest / (speed - flight - a * math.cos(phase + flight))
    return (
        phase + flight,
        e * (flight - speed) + (1.0 + e) * a * math.cos(phase + flight),
    )


@pytest.mark.parametrize("simplified", [True, False])
@pytest.mark.parametrize("e", [0.5, 0.8])
def test_multiplier_of_the_period_one_motion_is_minus_one_at_the_flip(e, simplified):
    gamma = vibro_forms.table_flip(e, simplified=simplified)
    amplitude = 0.5 * gamma / (1.0 + e)
    phase, speed = math.acos(vibro_forms.table_existence(e) / gamma), math.pi
    there = table_map(phase, speed, amplitude, e, simplified=simplified)
    assert there == pytest.approx((phase + 2.0 * math.pi, speed), rel=1e-12)
    h = 1e-6
    columns = [
        np.subtract(
            table_map(phase + h * one, speed + h * two, amplitude, e, simplified=simplified),
            table_map(phase - h * one, speed - h * two, amplitude, e, simplified=simplified),
        )
        / (2.0 * h)
        for one, two in ((1.0, 0.0), (0.0, 1.0))
    ]
    multipliers = np.linalg.eigvals(np.array(columns).T)
    assert np.min(np.abs(multipliers + 1.0)) < 1e-7


def test_known_values_of_the_table():
    assert vibro_forms.table_existence(0.8) == pytest.approx(1.25664, abs=5e-6)
    assert vibro_forms.table_flip(0.8, simplified=True) == pytest.approx(3.81302, abs=5e-6)
    assert vibro_forms.table_gamma(0.1, 10.0, 0.8, 9.81) == pytest.approx(36.0 / 9.81)


@given(st.floats(0.0, 1.5), restitution, st.floats(0.1, 5.0))
def test_rod_impulse_reverses_the_speed_of_its_end(inclination, e, speed):
    mass, length = 2.0, 0.7
    impulse, _ = vibro_forms.end_impulse(mass, inclination, speed, e)
    arm = 0.5 * length * math.cos(inclination)
    spin = impulse * arm / (mass * length**2 / 12.0)
    assert -speed + impulse / mass + arm * spin == pytest.approx(e * speed, rel=1e-12)


@pytest.mark.parametrize("wrong", [
    lambda: vibro.ZenoBall(1.0, 1.0, 9.81), lambda: vibro.ZenoBall(-1.0, 0.5, 9.81),
    lambda: vibro.grazing_impact(1.5), lambda: vibro.elastic_corner(1.0, [0.0, 1.0], 0),
    lambda: vibro.elastic_corner(4.0, [0.0, -1.0], 0), lambda: vibro.elastic_corner(1, [0, -1], 2),
])  # fmt: skip
def test_values_out_of_range_are_named(wrong):
    with pytest.raises(SceneError, match=r"= "):
        wrong()
