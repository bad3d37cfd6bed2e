"""The exact row of bars against closed forms, the exact single bar, and laws of mechanics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.errors import SceneError
from impactfem.exact import ExactBar, ExactBarRow, RowBar

SPEED = 1.5


def bar(place, velocity=0.0, length=1.0, impedance=1.0, wave_speed=1.0):
    return RowBar.moving(
        length=length, wave_speed=wave_speed, impedance=impedance, place=place, velocity=velocity
    )


def speeds(row):
    return [float(row.mean_velocity(k, row.duration)) for k in range(len(row.bars))]


def vibration(row):
    """Kinetic energy at the end beyond that of rigid motion, and elastic energy."""
    kinetic, elastic = row.energy(row.duration)
    rigid = [0.5 * b.mass * v**2 for b, v in zip(row.bars, speeds(row), strict=True)]
    return np.array(kinetic) - rigid + np.array(elastic)


def test_two_equal_bars_swap_their_velocities():
    row = ExactBarRow([bar(0.0, SPEED), bar(1.3)], 5.0)
    assert speeds(row) == pytest.approx([0.0, SPEED], abs=1e-14)
    ((spell,),) = row.contacts
    assert spell == pytest.approx((0.2, 2.2), abs=1e-12)
    assert float(row.force(0, 1.0)) == pytest.approx(0.5 * SPEED, rel=1e-14)
    assert vibration(row) == pytest.approx([0.0, 0.0], abs=1e-13)


@pytest.mark.parametrize("ratio", [0.5, 1 / 3, 0.7])
def test_short_bar_stops_and_restitution_is_the_ratio_of_lengths(ratio):
    row = ExactBarRow([bar(0.0, SPEED, length=ratio), bar(ratio + 0.1)], 5.0)
    short, long = speeds(row)
    assert short == pytest.approx(0.0, abs=1e-13)
    assert (long - short) / SPEED == pytest.approx(ratio, rel=1e-13)
    ((spell,),) = row.contacts
    assert spell[1] - spell[0] == pytest.approx(2.0 * ratio, rel=1e-11)


@pytest.mark.parametrize(("ratio", "first", "second"), [(2.0, -1 / 3, 2 / 3), (0.5, 1 / 3, 4 / 3)])
def test_impedance_ratio_at_equal_transit_times(ratio, first, second):
    # The second bar is of another length and wave speed, but as long in time.
    row = ExactBarRow([bar(0.0, SPEED), bar(1.1, length=2.0, wave_speed=2.0, impedance=ratio)], 6.0)
    assert speeds(row) == pytest.approx([first * SPEED, second * SPEED], rel=1e-12)
    ((spell,),) = row.contacts
    assert spell[1] - spell[0] == pytest.approx(2.0, rel=1e-11)
    assert float(row.force(0, 1.0)) == pytest.approx(SPEED * ratio / (1 + ratio), rel=1e-14)
    assert vibration(row) == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(("a", "end"), [(1.0, 3.068), (0.5, 4.708)])
def test_heavy_short_bar_on_a_clamped_bar_is_the_rigid_mass(a, end):
    share = 1.0 / 400.0  # of the mass's transit time
    mass = bar(0.0, SPEED, length=share * share, wave_speed=share, impedance=1.0 / (a * share))
    row = ExactBarRow([mass, bar(share * share)], 6.0, clamped=True)
    force = float(row.force(0, 1e-6))
    jump = float(row.force(0, 2.0 + 1.5 * share))
    # The force of a rigid mass jumps at once, here within a transit of the mass.
    assert force == pytest.approx(SPEED, rel=0.02)
    assert jump == pytest.approx((2.0 + math.exp(-2.0 * a)) * SPEED, rel=0.02)
    assert row.contacts[0][0][1] == pytest.approx(end, rel=0.02)


def test_of_five_touching_bars_struck_by_one_the_last_leaves_alone():
    row = ExactBarRow([bar(0.0, SPEED), *(bar(1.25 + k) for k in range(5))], 12.0)
    assert speeds(row) == pytest.approx([0.0] * 5 + [SPEED], abs=1e-13)
    assert float(row.gap(4, 12.0)) > 1.0
    assert [float(row.gap(k, 12.0)) for k in range(1, 4)] == pytest.approx([0.0] * 3, abs=1e-12)
    for k, spells in enumerate(row.contacts):
        assert spells == [pytest.approx((0.25 / SPEED + k, 0.25 / SPEED + k + 2.0), abs=1e-11)]


@pytest.mark.parametrize("clamped", [False, True])
def test_one_bar_against_the_wall_is_the_exact_bar(clamped):
    strain, velocity, place = -0.1, -0.4, 0.2
    one = ExactBar.from_functions(
        length=2.0, wave_speed=1.3, duration=9.0, displacement=lambda x: place + strain * x,
        velocity=lambda x: velocity + 0.0 * x, far_end="clamped" if clamped else "free",
    )  # fmt: skip
    row = ExactBarRow(
        [RowBar(2.0, 1.3, 2.6, place, [0.0, 2.0], [velocity], [strain])],
        9.0, wall=True, clamped=clamped,
    )  # fmt: skip
    t, x = np.linspace(0.01, 8.99, 101)[:, None], np.linspace(0.0, 2.0, 7)[None, :]
    assert np.abs(row.displacement(0, t, x) - one.displacement(t, x)).max() < 1e-11
    assert np.abs(row.gap(0, t) - one.gap(t)).max() < 1e-11
    force = -2.6 / 1.3 * one.multiplier(t)  # rho A = Z / c
    assert np.abs(row.force(0, t) - force).max() < 1e-11
    kinetic, elastic = one.energy(t)
    assert np.abs(row.energy(t)[0][0] - 2.0 * kinetic).max() < 1e-11
    assert np.abs(row.energy(t)[1][0] - 2.0 * elastic).max() < 1e-11
    assert np.abs(row.mean_velocity(0, t) - one.mean_velocity(t)).max() < 1e-11
    assert np.abs(row.mean_displacement(0, t) - one.mean_displacement(t)).max() < 1e-11


def test_sampled_start_converges_to_the_smooth_one():
    def wave(x):
        return 0.05 * np.cos(np.pi * x)

    one = ExactBar.from_functions(
        length=1.0, wave_speed=1.0, duration=4.0, displacement=lambda x: 0.3 + wave(x),
        velocity=lambda x: -0.5 + 0.0 * x, pieces=4096,
    )  # fmt: skip
    made = RowBar.from_functions(
        length=1.0, wave_speed=1.0, impedance=1.0, place=0.3, displacement=wave,
        velocity=lambda x: -0.5 + 0.0 * x,
    )  # fmt: skip
    row = ExactBarRow([made], 4.0, wall=True)
    t, x = np.linspace(0.0, 4.0, 41)[:, None], np.linspace(0.0, 1.0, 5)[None, :]
    assert row.sampled
    assert np.abs(row.displacement(0, t, x) - one.displacement(t, x)).max() < 1e-5


def test_steps_on_borders_of_pieces_are_not_sampled():
    made = RowBar.from_functions(
        length=1.2, wave_speed=1.0, impedance=1.0, place=0.0,
        displacement=lambda x: np.where(x < 0.4, 0.1 * x, 0.04),
        velocity=lambda x: np.where(x < 0.3, 1.0, -1.0),
    )  # fmt: skip
    assert not made.sampled
    assert np.asarray(made.nodes) == pytest.approx([0.0, 0.3, 0.4, 1.2], abs=1e-12)
    assert np.asarray(made.strain) == pytest.approx([0.1, 0.1, 0.0], abs=1e-12)


def test_overlap_is_refused():
    with pytest.raises(SceneError, match=r"overlaps what is before it by 0\.1 m"):
        ExactBarRow([bar(0.0), bar(0.9)], 1.0)


@st.composite
def rows(draw):
    place, bars = draw(st.floats(0.0, 0.5)), []
    for _ in range(draw(st.integers(2, 4))):
        length = draw(st.floats(0.3, 2.0))
        cut = draw(st.floats(0.1, 0.9)) * length
        bars.append(
            RowBar(
                length, draw(st.floats(0.5, 2.0)), draw(st.floats(0.2, 5.0)), place,
                [0.0, cut, length], draw(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=2)),
                draw(st.lists(st.floats(-0.1, 0.1), min_size=2, max_size=2)),
            )
        )  # fmt: skip
        place = bars[-1].far_place + draw(st.sampled_from([0.0, 0.0, 0.2]))
    return bars


@settings(max_examples=60, deadline=None)
@given(rows(), st.booleans(), st.booleans())
def test_energy_momentum_and_signs_of_random_rows(bars, wall, clamped):
    row = ExactBarRow(bars, 8.0, wall=wall, clamped=clamped)
    t = np.linspace(0.0, 8.0, 81)
    kinetic, elastic = row.energy(t)
    total = (kinetic + elastic).sum(axis=0)
    assert np.ptp(total) <= 1e-10 * max(1.0, total[0])
    impulse = row.impulse(0, t) if wall else 0.0
    if not clamped:
        assert np.ptp(row.momentum(t) - impulse) < 1e-10
    first = 0 if wall else 1
    for k in range(len(row.contacts)):
        gap, force = row.gap(k, t), row.force(k, t)
        assert gap.min() >= 0.0
        assert force.min() >= 0.0
        # Pressed only when closed; a jump within rounding of a sample may lie on either side.
        assert np.minimum(gap, force).max() < 1e-10
        behind = k + first
        before = 0.0
        if behind > 0:
            before = row.displacement(behind - 1, t, bars[behind - 1].length)
            before = before + bars[behind - 1].length
        assert np.abs(row.displacement(behind, t, 0.0) - before - gap).max() < 1e-10


@settings(max_examples=30, deadline=None)
@given(rows())
def test_mirrored_rows_move_like_mirror_images(bars):
    end = bars[-1].far_place
    mirrored = [
        RowBar(
            b.length, b.wave_speed, b.impedance, end - b.far_place,
            b.length - np.asarray(b.nodes)[::-1], -np.asarray(b.velocity)[::-1],
            np.asarray(b.strain)[::-1],
        )
        for b in reversed(bars)
    ]  # fmt: skip
    one, other = ExactBarRow(bars, 6.0), ExactBarRow(mirrored, 6.0)
    t = np.linspace(0.0, 6.0, 25)
    for k in range(len(bars)):
        difference = one.mean_velocity(k, t) + other.mean_velocity(len(bars) - 1 - k, t)
        assert np.abs(difference).max() < 1e-9
