"""Rods and beams dropped on a rigid floor at an angle: what must hold for any of them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from tips import tip_damping_ratio, tip_restitution, tip_state, with_tips
from vibro_forms import end_impulse

from impactfem.errors import SceneError
from impactfem.scene.beams import Beam
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.beam import free_beam
from impactfem.system.episode import contact_episode
from impactfem.system.rod import rod_system
from impactfem.vibro.event_driven import EventSettings, integrate_events
from impactfem.vibro.position_level import PositionSettings, integrate_positions
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities

FLOOR = HalfSpace(point=[0.0, 0.0], normal=[0.0, 1.0])
TRACE = (0.0, -1e-3)  # decides how an unbent beam leaves its first touch


def dropped(degrees, elements=8, youngs_modulus=2.1e11, contact="ends"):
    angle = math.radians(degrees)
    data = {"length": 0.2, "height": 0.0127, "width": 0.0127, "density": 7800.0}
    data |= {"elements": elements, "inclination": angle, "velocity": [0.0, -1.0]}
    data |= {"youngs_modulus": youngs_modulus, "contact": contact}
    period = 2 * math.pi / Beam(**data, center=[0, 1]).first_frequency
    body = free_beam(Beam(**data, center=[0.0, 0.1 * math.sin(angle) + 0.01 * period]))
    return body, period


def march(body, period, method, local_e=0.0, gravity=(0.0, 0.0), steps=6000, periods=1.5):
    system = body.system(FLOOR, gravity, local_e)
    duration = periods * period
    if method == "events":
        motion = integrate_events(system, *body.start, duration, EventSettings(rows=2000))
    elif method == "position":
        choice = PositionSettings(dt=duration / steps, implicit=True)
        motion = integrate_positions(system, *body.start, duration, choice)
    else:
        choice = VelocitySettings(dt=duration / steps)
        motion = integrate_velocities(system, *body.start, duration, choice)
    return contact_episode(body, system, motion), motion


def share(degrees):
    """Effective mass of the end over the mass."""
    return 1.0 / (1.0 + 3.0 * math.cos(math.radians(degrees)) ** 2)


@pytest.mark.parametrize("method", ["position", "velocity"])
@settings(max_examples=12, deadline=None)
@given(degrees=st.floats(5, 90), local_e=st.floats(0, 1))
def test_impulse_and_energy_are_those_of_the_rigid_part(method, degrees, local_e):
    body, period = dropped(degrees, 6)
    episode, motion = march(body, period, method, local_e, steps=3000)
    # Only the contact impulse changes the rigid part: P = (1 + e) m_e v with the apparent e.
    mass = body.beam.mass
    impulse = (1.0 + episode.restitution) * share(degrees) * mass
    assert episode.impulse == pytest.approx(impulse, rel=1e-6)
    # What the rigid part lost is in vibrations, or lost.
    expected = (1.0 - episode.restitution**2) * share(degrees)
    assert episode.vibration + episode.lost == pytest.approx(expected, abs=1e-6)
    assert (motion.contact_force >= 0.0).all()
    if method == "velocity":
        assert motion.total.max() <= motion.total[0] * (1 + 1e-9)


@settings(max_examples=5, deadline=None)
@given(degrees=st.floats(5, 90), local_e=st.sampled_from([0.0, 0.4]))
def test_event_driven_drops_do_not_penetrate_pull_or_gain_energy(degrees, local_e):
    body, period = dropped(degrees, 5)
    episode, motion = march(body, period, "events", local_e, TRACE)
    assert motion.gap.min() > -1e-12
    assert (motion.contact_force >= 0.0).all()
    assert motion.total.max() <= motion.total[0] * (1 + 1e-9)
    assert -1e-9 <= episode.lost < 1.0


@pytest.mark.parametrize(("degrees", "bound"), [(30, 0.02), (50, 0.02), (75, 2e-3), (88, 2e-3)])
def test_three_methods_agree_on_the_apparent_restitution(degrees, bound):
    body, period = dropped(degrees)
    events, _ = march(body, period, "events", 0.0, TRACE)
    for method in ("position", "velocity"):
        found, _ = march(body, period, method, steps=16_000)
        assert abs(found.restitution - events.restitution) < bound
        assert found.is_over
        if degrees > 70:
            assert found.micro_impacts == events.micro_impacts == 1


def test_apparent_restitution_does_not_depend_on_the_stiffness():
    # On a rigid floor the times of contact scale with the period: 4 E halves all times.
    found = [march(*dropped(40, youngs_modulus=E), "position")[0] for E in (5e10, 2e11)]
    assert found[0].restitution == pytest.approx(found[1].restitution, rel=1e-6)
    assert found[0].micro_impacts == found[1].micro_impacts
    assert found[0].last_contact == pytest.approx(2 * found[1].last_contact, rel=1e-6)


def test_restitution_depends_strongly_and_not_monotonically_on_the_angle():
    by_angle = {
        degrees: march(*dropped(degrees, 16), "position")[0].restitution
        for degrees in (10, 42, 65, 72, 90)
    }
    assert by_angle[10] > by_angle[42] + 0.05
    assert by_angle[65] > by_angle[42] + 0.05
    assert by_angle[72] < by_angle[65] - 0.3
    assert by_angle[90] > 0.9  # along its axis the elastic bar keeps nearly all


def test_a_beam_dropped_on_its_end_is_a_bar_that_keeps_all_energy_of_motion():
    missing = [
        1.0 - march(*dropped(90, elements), "position", steps=8000)[0].restitution
        for elements in (8, 16, 32)
    ]
    rates = np.log2(np.array(missing[:-1]) / np.array(missing[1:]))
    assert (np.abs(rates - 2 / 3) < 0.05).all()  # the width of a smeared jump, as for the bar


def test_contact_along_the_axis_is_that_of_the_end_while_the_beam_is_steep():
    ends, _ = march(*dropped(45), "position")
    along, motion = march(*dropped(45, contact="along"), "position")
    assert along.restitution == pytest.approx(ends.restitution, abs=1e-9)
    assert motion.contact_force.shape[1] == 9


def test_the_rigid_rod_is_the_limit_of_long_contacts():
    degrees, distances = 35.0, []
    body, period = dropped(degrees)
    zeta = tip_damping_ratio(0.5)
    for ratio in (1.0, 2.0, 4.0):
        mass, omega = share(degrees) * body.beam.mass, math.pi / (ratio * period)
        system = body.system(FLOOR)
        tips = with_tips(system, mass * omega**2, 2 * zeta * mass * omega, 1e-5 * mass)
        start = (tip_state(system, field) for field in body.start)
        duration = (1.5 + 1.5 * ratio) * period
        motion = integrate_velocities(tips, *start, duration, VelocitySettings(dt=duration / 8000))
        episode = contact_episode(body, system, motion)
        assert episode.is_over
        assert episode.micro_impacts == 1
        distances.append(abs(episode.restitution - 0.5))
    assert distances[2] < 0.01
    assert distances[2] < distances[1] / 3 < distances[0] / 9


@pytest.mark.parametrize("zeta", [0.0, 0.1, 0.4, 0.7, 0.9])
def test_restitution_of_a_viscoelastic_tip_has_its_closed_form(zeta):
    def force(_, y):
        return y[0] + 2.0 * zeta * y[1]

    force.terminal, force.direction = True, -1
    path = solve_ivp(
        lambda t, y: [y[1], -force(t, y)], (0.0, 20.0), [1e-300, 1.0],
        events=force, rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    assert -path.y[1, -1] == pytest.approx(tip_restitution(zeta), rel=1e-8)


def test_tips_that_cannot_be_are_refused():
    system = dropped(30)[0].system(FLOOR)
    for values in ((0.0, 0.0, 1.0), (1.0, -1.0, 1.0), (1.0, 0.0, 0.0)):
        with pytest.raises(SceneError, match="tip: "):
            with_tips(system, *values)
    with pytest.raises(SceneError, match="restitution = 0"):
        tip_damping_ratio(0.05)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("degrees", [10.0, 45.0, 80.0, 90.0])
def test_a_dropped_rigid_rod_leaves_with_its_restitution_at_any_angle(degrees, e):
    mass, length, angle = 0.3, 0.2, math.radians(degrees)
    system = rod_system(mass, length, FLOOR, restitution=e)
    u = np.array([0.0, 0.5 * length * math.sin(angle) + 1e-3, angle])
    motion = integrate_events(system, u, [0.0, -1.0, 0.0], 1.1e-3, EventSettings(rows=11))
    impulse, lost = end_impulse(mass, angle, 1.0, e)
    assert len(motion.impacts) == 1
    assert motion.impacts.after[0] == pytest.approx(e, abs=1e-6)
    assert motion.impacts.impulse[0] == pytest.approx(impulse, rel=1e-6)
    assert 1.0 - motion.total[-1] / motion.total[0] == pytest.approx(lost, abs=1e-6)
