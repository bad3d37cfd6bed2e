"""The point mass at a wall: a family of solutions, of which energy picks one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactfem.errors import SceneError
from impactfem.exact.point_mass import PointMassImpact

positive = st.floats(0.01, 100.0)


@given(positive, positive, st.floats(0.0, 50.0), st.floats(0.0, 50.0))
def test_every_member_solves_the_contact_problem(height, speed, wait, leaving):
    mass = PointMassImpact(height, speed, height / speed + wait, leaving)
    end = 2.0 * mass.leaving_time + 1.0
    assert float(mass.displacement(0.0)) == pytest.approx(height)
    assert float(mass.velocity(0.0)) == -speed
    assert mass.displacement(np.linspace(0, end, 101)).min() >= 0.0
    # The wall only pushes, and only in contact.
    for time, impulse in mass.impulses:
        assert impulse >= 0.0
        assert float(mass.displacement(time)) == pytest.approx(0.0, abs=1e-12 * height)
    # u_tt is the sum of the impulses: by parts with phi = (end - t)^3, which vanishes at the end,
    # int u phi'' = -u(0) phi'(0) + u_t(0) phi(0) + sum impulse phi. u is linear between events.
    edges = np.unique([0.0, mass.impact_time, mass.leaving_time, end])
    nodes, weights = np.polynomial.legendre.leggauss(2)
    half = 0.5 * np.diff(edges)[:, None]
    t = edges[:-1, None] + half * (1.0 + nodes)
    left = np.sum(weights * half * mass.displacement(t) * 6.0 * (end - t))
    pushed = sum(impulse * (end - time) ** 3 for time, impulse in mass.impulses)
    right = 3.0 * height * end**2 - speed * end**3 + pushed
    assert left == pytest.approx(right, rel=1e-9, abs=1e-9 * (speed + leaving) * end**3)


rebounds = st.one_of(st.just(1.0), st.floats(0.0, 5.0).filter(lambda e: abs(e - 1) > 1e-6))


@given(positive, positive, st.one_of(st.just(0.0), st.floats(1e-3, 5.0)), rebounds)
def test_only_restitution_one_without_rest_keeps_the_energy(height, speed, wait, ratio):
    tau = height / speed
    mass = PointMassImpact(height, speed, tau * (1.0 + wait), ratio * speed)
    assert mass.restitution == pytest.approx(ratio)
    leave = mass.leaving_time
    energy = mass.kinetic_energy([0.0, tau, 0.5 * (tau + leave), 2.0 * leave])
    assert bool(np.all(energy == energy[0])) == mass.conserves_energy == (wait == 0 and ratio == 1)


def test_by_default_it_is_reflected():
    mass = PointMassImpact(0.5, 0.5)
    assert mass.conserves_energy
    assert mass.impulses == ((1.0, 1.0),)
    t = np.linspace(0, 4, 41)
    np.testing.assert_allclose(mass.displacement(t), 0.5 * np.abs(1.0 - t), atol=1e-15)
    assert mass.velocity([0.9, 1.0]).tolist() == [-0.5, 0.5]


def test_it_may_stay():
    mass = PointMassImpact(0.5, 0.5, float("inf"))
    assert mass.displacement([0.5, 1.0, 1e9]).tolist() == [0.25, 0.0, 0.0]
    assert mass.kinetic_energy([0.5, 2.0]).tolist() == [0.125, 0.0]
    assert mass.impulses == ((1.0, 0.5),)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((0.0, 1.0), "height = 0.0"),
        ((1.0, -1.0), "speed = -1.0"),
        ((1.0, 1.0, 0.5), "rebound_time = 0.5"),
        ((1.0, 1.0, float("nan")), "rebound_time = nan"),
        ((1.0, 1.0, 2.0, -1.0), "rebound_speed = -1.0"),
        ((1.0, 1.0, 2.0, float("inf")), "rebound_speed"),
    ],
)
def test_faulty_values_are_named(values, message):
    with pytest.raises(SceneError, match=message):
        PointMassImpact(*values)
