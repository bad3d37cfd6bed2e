"""What decides whether a contact lasts where the acceleration is zero but for rounding.

A body that is not strained has no acceleration just after an impact without rebound: the first
rate of the gap that is not zero decides, whatever the rounding of the acceleration is.
"""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from impactfem.scene.beams import Beam
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.beam import free_beam
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.event_choice import Onset, stay
from impactfem.vibro.event_driven import EventSettings, integrate_events

MIXED = np.eye(4) + 0.3 * np.tri(4, k=-1) - 0.1 * np.tri(4, k=-2).T
"""Places of masses by coordinates: in others than their own the rounding of K u does not vanish."""

FLOOR = HalfSpace(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0))


def chain(masses, springs, gap, e, *, general, both_sides=False):
    """Masses in a row, not strained, the first at a gap from a wall on the left."""
    d = len(masses)
    stiffness = np.zeros((d, d))
    for i, k in enumerate(springs):
        stiffness[i : i + 2, i : i + 2] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
    normals = np.array([np.eye(d)[0], -np.eye(d)[-1]][: 1 + both_sides])
    offsets = np.array([gap, 0.4 * gap][: len(normals)])
    mass = MIXED[:d, :d].T @ np.diag(masses) @ MIXED[:d, :d]
    stiffness = MIXED[:d, :d].T @ stiffness @ MIXED[:d, :d]
    normals = normals @ MIXED[:d, :d]
    if not general:
        return LinearSystem(
            mass=mass, stiffness=stiffness, normals=normals, offsets=offsets, restitution=e
        )
    return GeneralizedSystem(
        mass=mass, force=lambda _t, u, _v: -stiffness @ u, restitution=e,
        constraints=lambda u: normals @ u + offsets, jacobian=lambda _: normals,
        potential=lambda _, u: 0.5 * float(u @ (stiffness @ u)),
    )  # fmt: skip


@pytest.mark.parametrize(("general", "exact"), [(False, 1e-12), (True, 1e-8)])
@pytest.mark.parametrize("far_wall", [False, True])
def test_an_unstrained_pair_rests_on_the_wall_for_half_a_period(general, exact, far_wall):
    # The first mass rests while the second swings by half a period: sin pushes, then would pull.
    for speed in (0.1, 0.3, 0.7, 1.1, 3.3, 4.9, 5.0):
        for gap in (0.1, 0.3, math.pi):
            w = 3.0 * speed / gap
            system = chain([0.7, 2.0], [2.0 * w * w], gap, 0.0, general=general)
            if far_wall:  # a second constraint takes the path of several
                system = chain(
                    [0.7, 2.0], [2.0 * w * w], gap, 0.0, general=general, both_sides=True
                )
            hit = gap / speed
            run = integrate_events(
                system,
                [0.0, 0.0],
                np.linalg.solve(MIXED[:2, :2], [-speed, -speed]),
                hit + 1.2 * math.pi / w,
                EventSettings(rows=50),
            )
            assert len(run.impacts) == 1
            (start, end, _), *others = run.effort.details["sticking"]
            assert not others
            assert start == pytest.approx(hit, rel=exact)
            assert end - hit == pytest.approx(math.pi / w, rel=10.0 * exact)
            assert run.gap.min() >= -1e-13 * gap
            assert run.peak == pytest.approx(2.0 * w * speed, rel=1e-3)


@settings(max_examples=80, deadline=None)
@example([0.1, 0.1], 100.0, 3.0, 0.0625, 0.0, False)
@given(
    st.lists(st.sampled_from([1.0, 0.1, 0.3, 7.0]), min_size=1, max_size=4),
    st.sampled_from([1.0, 100.0, 0.7]), st.floats(0.05, 3.0), st.floats(0.05, 6.0),
    st.sampled_from([0.0, 0.3, 1.0]), st.booleans(),
)  # fmt: skip
def test_unstrained_chains_between_walls(masses, k, gap, speed, e, both_sides):
    system = chain(masses, [k] * (len(masses) - 1), gap, e, general=False, both_sides=both_sides)
    d = len(masses)
    start = np.zeros(d), np.linalg.solve(MIXED[:d, :d], np.full(d, -speed))
    run = integrate_events(system, *start, 3.0 * gap / speed, EventSettings(rows=100))
    assert run.gap.min() >= -1e-12 * gap
    # A chain that flies far takes strains out of large places: the rounding of u.K u is its own.
    far = np.abs(run.position).max(axis=0)
    rounding = np.finfo(float).eps * float(far @ np.abs(system.stiffness) @ far)
    assert np.diff(run.total).max() <= 1e-10 * run.kinetic.max() + rounding
    push = run.impulse.max() / run.times[1]
    assert run.contact_force.min() >= -1e-10 * push


@pytest.mark.slow
@pytest.mark.parametrize("contact", ["ends", "along"])
@pytest.mark.parametrize("inclination", [math.pi / 6, 0.0, math.pi / 2])
@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_beams_at_any_speed(contact, inclination, e):
    for count, speed in enumerate((0.5, 4.0, 4.9, 5.0)):
        center = 0.1 * math.sin(inclination) + 5e-4
        beam = Beam(
            name="beam", length=0.2, height=0.01, width=0.01, density=7850.0, youngs_modulus=210e9,
            center=(0.0, center), inclination=inclination, velocity=(0.0, -speed), elements=4,
            contact=contact,
        )  # fmt: skip
        ceiling = HalfSpace(name="ceiling", point=(0.0, 2.0 * center + 3e-4), normal=(0.0, -1.0))
        body = free_beam(beam)
        system = body.system([FLOOR, ceiling][: 1 + count % 2], restitution=e)
        run = integrate_events(system, *body.start, 6e-4 / speed, EventSettings(rows=50))
        assert run.effort.details["impacts"] > 0
        assert run.gap.min() >= -1e-12
        assert np.diff(run.total).max() <= 1e-10 * run.kinetic[0]
        assert run.contact_force.min() >= -1e-9 * run.impulse.max() / run.times[1]


def test_the_first_rate_that_is_not_zero_decides():
    # Rows are orders: doubtful at the second, the third decides; nothing at all: it stays closed.
    def onset(held):
        gaps = np.array([[1e-9, -1e-9, 1e-9, 0.0], [-1.0, 2.0, 0.0, 0.0]])
        forces = np.array([[1e-9] * len(held), [1.0 if j != 1 else -1.0 for j in held]])
        return Onset(
            gaps, np.full_like(gaps, 1e-6), forces.reshape(2, -1), np.full((2, len(held)), 1e-6)
        )

    for start in ((), (1,), (0, 1, 2, 3)):
        closed, implied, order = stay(onset, np.eye(4), start, np.arange(4))
        assert closed == (0, 2, 3)
        assert implied == ()
        assert order[1] == 3
