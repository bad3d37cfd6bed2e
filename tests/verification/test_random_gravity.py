"""Bounces with arbitrary data against characteristics: within the stated bound, every time."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import impactfem
from impactfem.reference.bar import exact_bar
from impactfem.studies.hard.bars import bound

ELEMENTS = 80
LONGEST = 120.0  # transits of a wave through the bar


def decades(low, high):
    return st.floats(math.log10(low), math.log10(high)).map(lambda power: 10.0**power)


@st.composite
def falls(draw):
    """A bar of any length and wave speed, thrown at a wall in a gravity field, some bounces."""
    length, speed = draw(decades(1e-3, 1e3)), draw(decades(1e-3, 1e4))
    transit = length / speed
    gap, velocity, pull = draw(decades(0.05, 3)), draw(decades(0.03, 2)), draw(decades(0.03, 10))
    arrival = math.sqrt(velocity**2 + 2.0 * pull * gap)
    first = (arrival - velocity) / pull
    period = 2.0 + 2.0 * arrival / pull  # of a bounce, in transits
    end = min(first + 2.0 + draw(st.floats(0.5, 3.5)) * period, LONGEST)
    return impactfem.Scene(
        title="fall",
        duration=end * transit,
        gravity=pull * speed / transit,
        bodies=[
            impactfem.Bar(
                length=length,
                density=1.0,
                youngs_modulus=speed**2,
                gap=gap * length,
                velocity=-velocity * speed,
            )
        ],
        obstacles=[impactfem.Wall()],
        output=impactfem.Output(every=max(1, int(end * ELEMENTS) // 200)),
    )


@pytest.mark.parametrize(
    ("method", "courant"), [("galerkin", 1.0), ("conserving", 0.5), ("conserving", 1.0)]
)
@settings(max_examples=150, deadline=None, derandomize=True, database=None)
@given(scene=falls())
def test_error_is_within_the_bound(method, courant, scene):
    contacts = len(exact_bar(scene).contacts)
    assume(contacts)
    result = impactfem.solve(scene, method=method, courant=courant, elements=ELEMENTS)
    summary = result.summary
    limit = bound(method, ELEMENTS, contacts, courant)
    assert summary["error"]["displacement_max"] <= limit
    assert summary["energy"]["max_relative_growth"] <= 1e-6
    assert summary["contact"]["max_penetration"] == 0.0
    assert result.history["contact_force"].values.min() >= 0.0
