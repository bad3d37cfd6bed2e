"""Conjectures on over-damped penalties: how fast penalised motions tend to Moreau's rule."""

import dataclasses

import pytest
from corner_conjectures import cases, measure


@pytest.fixture(scope="module")
def corners():
    return {c.name: dataclasses.replace(c, starts=c.starts[:1]) for c in cases()}


@pytest.mark.parametrize(
    ("name", "power"),
    [
        ("2pi/3, pressed on wall 1", 0.5),
        pytest.param("hollow circle and wall, pi/3", 0.25, marks=pytest.mark.slow),
    ],
)
def test_a_force_slows_the_limit_to_a_power_of_the_stiffness(corners, name, power):
    soft, stiff = (measure(corners[name], k)[1] for k in (1e4, 1e6))
    assert stiff / soft == pytest.approx(100.0**-power, rel=0.15)


def test_in_an_octant_the_limit_is_exponential(corners):
    soft, stiff = (measure(corners["3D, octant"], k)[1] for k in (1e2, 1e4))
    assert soft > 1e-2
    assert stiff < 1e-5
