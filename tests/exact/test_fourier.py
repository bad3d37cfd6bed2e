"""The slides' series and d'Alembert formula against characteristics, and the slides' own claims."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.errors import SceneError
from impactfem.exact import ExactBar
from impactfem.exact.fourier import (
    REGIONS,
    GravityImpact,
    StepLoadImpact,
    clamped_series,
    clamped_vibration,
    free_series,
    free_vibration,
)

LENGTH, SPEED = 1.3, 1.7
TRANSIT = LENGTH / SPEED
PAIRS = [(clamped_series, clamped_vibration), (free_series, free_vibration)]


def exact(data, duration, gravity_times=(0.0,), gravity_values=None):
    return ExactBar(
        length=data.length,
        wave_speed=data.wave_speed,
        duration=duration,
        nodes=[0.0, data.length],
        displacement=[data.height, data.height],
        velocity=[-data.speed, -data.speed],
        gravity_times=gravity_times,
        gravity_values=(data.gravity,) if gravity_values is None else gravity_values,
    )


def points(seed, size=2000):
    """Times and places, among them wave fronts, corners and symmetry points."""
    rng = np.random.default_rng(seed)
    s = rng.uniform(-4 * TRANSIT, 12 * TRANSIT, size)
    x = rng.uniform(0, LENGTH, size)
    s[:100] = rng.integers(-4, 12, 100) * TRANSIT
    x[:40] = rng.choice([0.0, LENGTH, LENGTH / 2], 40)
    s[100:300] = x[100:300] / SPEED + rng.integers(-2, 6, 200) * 2 * TRANSIT
    s[300:400] += 1e-9
    return s, x


@pytest.mark.parametrize(("series", "closed"), PAIRS)
@pytest.mark.parametrize("terms", [1, 2, 7, 40, 300])
def test_series_stay_within_their_bound(series, closed, terms):
    s, x = points(terms)
    total, bound = series(s, x, LENGTH, SPEED, terms)
    assert np.all(np.abs(total - closed(s, x, LENGTH, SPEED)) <= bound)
    # The stated plain tails, and better wherever no wave front is near.
    plain = {
        clamped_series: 2 * TRANSIT**2 / (np.pi**3 * terms**2),
        free_series: 4 * TRANSIT**2 / (np.pi**2 * (terms + 0.5)),
    }[series]
    assert bound.max() <= plain * (1 + 1e-9) + 1e-12
    if terms >= 40:
        assert np.median(bound) < 1e-9
    if terms >= 300:
        assert np.median(bound) < 1e-12


@pytest.mark.parametrize(("series", "closed"), PAIRS)
def test_plain_sums_tend_to_the_closed_forms(series, closed):
    # Summed without the code under test.
    s, x = points(5, 400)
    n = np.arange(1, 20001)[:, None]
    if series is clamped_series:
        nu = np.pi / LENGTH * (n - 0.5)
        total = 2 / (LENGTH * SPEED**2) * np.sum(
            (np.cos(nu * SPEED * s) - 1) * np.sin(nu * x) / nu**3, axis=0
        )  # fmt: skip
        tolerance = 1e-9
    else:
        mu = np.pi * n / LENGTH
        total = 4 / SPEED**2 * np.sum(
            np.cos(mu * (SPEED * s - 2 * LENGTH)) * np.cos(mu * x) / mu**2, axis=0
        ) - 2 * LENGTH**2 / (3 * SPEED**2)  # fmt: skip
        tolerance = 2e-5
    np.testing.assert_allclose(total, closed(s, x, LENGTH, SPEED), rtol=0, atol=tolerance)


@pytest.mark.parametrize(("closed", "period"), [(clamped_vibration, 4), (free_vibration, 2)])
def test_periods_in_transit_times(closed, period):
    # 4 pi and 2 pi of the slides are phases pi c s / L.
    s, x = points(6)
    value = closed(s, x, LENGTH, SPEED)
    np.testing.assert_allclose(closed(s + period * TRANSIT, x, LENGTH, SPEED), value, atol=1e-12)
    half = closed(s + period / 2 * TRANSIT, x, LENGTH, SPEED)
    assert np.abs(half - value).max() > 0.1 * TRANSIT**2


@pytest.mark.parametrize(("closed", "load"), [(clamped_vibration, -1.0), (free_vibration, 0.0)])
def test_vibrations_solve_the_wave_equation(closed, load):
    # Mean values on characteristic diamonds inside the bar; no smoothness needed.
    rng = np.random.default_rng(7)
    s, x = rng.uniform(0, 9, 2000), rng.uniform(0, LENGTH, 2000)
    d = rng.uniform(0, 1, 2000) * np.minimum(x, LENGTH - x) / SPEED
    u = lambda a, b: closed(a, b, LENGTH, SPEED)  # noqa: E731
    diamond = u(s + d, x) + u(s - d, x) - u(s, x + SPEED * d) - u(s, x - SPEED * d)
    np.testing.assert_allclose(diamond, load * d**2, atol=1e-12)


def test_what_the_slides_claim_of_eta():
    x, step = np.linspace(0, LENGTH, 41), 1e-6
    s = np.linspace(0, 2 * TRANSIT, 41)[1:-1]
    assert np.abs(clamped_vibration(s, 0.0, LENGTH, SPEED)).max() < 1e-14
    assert np.abs(clamped_vibration(0.0, x, LENGTH, SPEED)).max() < 1e-14
    ends = clamped_vibration(s, np.array([[LENGTH], [LENGTH - step]]), LENGTH, SPEED)
    assert np.abs(ends[0] - ends[1]).max() < 2 * step**2
    # Misprint: eta_x = -(t - tau)/c at the wall, and its series has no minus in front.
    slope = clamped_vibration(s, step, LENGTH, SPEED) / step
    np.testing.assert_allclose(slope, -s / SPEED, atol=1e-5)
    nu = np.pi / LENGTH * (np.arange(1, 200001) - 0.5)
    half = 2 / (LENGTH * SPEED**2) * np.sum((np.cos(nu * SPEED * TRANSIT / 2) - 1) / nu**2)
    assert half == pytest.approx(-0.22491, abs=2e-5)
    # Misprint: the load is -1 inside the bar, not only at x = L.
    inside = -2 / LENGTH * np.sum(np.sin(nu * 0.4 * LENGTH) / nu)
    assert inside == pytest.approx(-1, abs=1e-4)


def test_what_the_slides_claim_of_chi():
    x, release = np.linspace(0, LENGTH, 41), 2 * TRANSIT
    start = free_vibration(release, x, LENGTH, SPEED)
    # Misprint: (x^2 - 2 L x)/c^2, not (x^2 - L^2)/c^2; only so the motion is continuous.
    np.testing.assert_allclose(start, x * (x - 2 * LENGTH) / SPEED**2, atol=1e-14)
    np.testing.assert_allclose(start, clamped_vibration(release, x, LENGTH, SPEED), atol=1e-14)
    assert np.abs(start - (x**2 - LENGTH**2) / SPEED**2).max() > 0.99 * TRANSIT**2
    around = free_vibration(release + np.array([[1e-6], [-1e-6]]), x[1:], LENGTH, SPEED)
    assert np.abs(around[0] - around[1]).max() < 1e-15  # chi_t = 0
    for k in (1, 2, 3):  # right as printed
        s = TRANSIT * np.linspace(2 * k, 2 * k + 2, 21)
        expected = (s - (2 * k + 1) * TRANSIT) ** 2 - TRANSIT**2
        np.testing.assert_allclose(free_vibration(s, 0.0, LENGTH, SPEED), expected, atol=1e-14)


def test_terms_must_be_positive():
    with pytest.raises(SceneError, match="terms = 0"):
        clamped_series(1.0, 0.5, 1.0, 1.0, terms=0)


K2 = [
    GravityImpact(1.0, 1.0, 0.5, 0.5, 0.1),
    GravityImpact(1.3, 1.7, 0.5, 0.5, 0.1),
    GravityImpact(1.0, 1.0, 0.5, 0.1, 0.2),  # the end leaves slowly
    GravityImpact(1.0, 1.0, 1.0, 2**0.5, 1.0),  # and just not: V = 2 p l
    GravityImpact(10.0, 30.0, 5.0, 0.0, 10.0),
]


@pytest.mark.parametrize("k2", K2)
def test_k2_is_the_exact_bar_in_every_region(k2):
    end = k2.next_impact
    bar = exact(k2, 1.1 * end)
    np.testing.assert_allclose(
        bar.events[:3], [k2.impact_time, k2.release_time, end], rtol=1e-7 if k2 is K2[3] else 1e-13
    )
    rng = np.random.default_rng(1)
    t = np.r_[rng.uniform(0, end, 4000), rng.uniform(k2.impact_time, k2.release_time, 4000)]
    x = rng.uniform(0, k2.length, t.size)
    error = np.abs(k2.displacement(t, x) - bar.displacement(t, x))
    region = k2.region(t, x)
    for index, name in enumerate(REGIONS):
        assert np.count_nonzero(region == index) > 50, name
        assert error[region == index].max() <= 1e-13 * k2.length, name
    np.testing.assert_allclose(
        k2.multiplier(t), bar.multiplier(t), rtol=0, atol=1e-13 * k2.wave_speed * k2.impact_speed
    )


@pytest.mark.parametrize("q", [2.001, 2.05, 2.1, 2.25, 2.5, 3.0, 3.7, 4.0, 7.3, 12.0, 29.9])
def test_next_impact_is_that_of_the_exact_bar(q):
    # q = V/(p l) from the least that leaves at once.
    k2 = GravityImpact(1.0, 1.0, 1e-3, (1 - 2e-3 / q) ** 0.5, 1 / q)
    bar = exact(k2, k2.next_impact + 1)
    assert bar.events[2] == pytest.approx(k2.next_impact, rel=1e-12)


def test_k2_numbers():
    k2 = K2[0]
    assert k2.impact_time == pytest.approx(0.91608, abs=1e-5)
    assert k2.multiplier(k2.impact_time + 0.5) == pytest.approx(-0.641608, abs=1e-6)
    assert k2.next_impact == pytest.approx(14.676519, abs=1e-6)
    # With the printed sign of eta_x the force would fall.
    wrong = k2.wave_speed * (k2.impact_speed - k2.gravity * 2 * k2.transit_time)
    assert -k2.multiplier(k2.release_time) == pytest.approx(0.791608, abs=1e-6)
    assert wrong == pytest.approx(0.391608, abs=1e-6)


def test_k2_from_series():
    k2 = K2[0]
    t, x = np.linspace(0, 4, 81)[:, None], np.linspace(0, 1, 21)
    error = np.abs(k2.displacement(t, x, terms=400) - k2.displacement(t, x))
    assert error.max() < k2.gravity * 4 / (np.pi**2 * 400)
    assert np.median(error) < 1e-14


def test_without_gravity_it_is_k1():
    k1 = GravityImpact(1.0, 1.0, 0.5, 0.5, 0.0)
    t, x = np.linspace(0, 5, 101)[:, None], np.linspace(0, 1, 21)
    assert k1.next_impact == float("inf")
    np.testing.assert_allclose(k1.displacement(t, x), exact(k1, 5.0).displacement(t, x), atol=1e-15)


# Logarithms of length, wave speed, height over length, speed over wave speed; share of the limit.
@settings(deadline=None, max_examples=40)
@given(
    st.floats(-6, 3), st.floats(0, 4), st.floats(-3, 0), st.floats(-4, -0.3), st.floats(0.02, 1.0)
)
def test_k2_over_decades(length, wave_speed, height, speed, share):
    length, wave_speed = 10**length, 10**wave_speed
    height, speed = 10**height * length, 10**speed * wave_speed
    # V = 2 p l / share, V^2 = v0^2 + 2 p H
    limit = 2 * length / wave_speed / share
    gravity = (height + np.sqrt(height**2 + (limit * speed) ** 2)) / limit**2
    k2 = GravityImpact(length, wave_speed, height, speed, float(gravity))
    assert k2.impact_speed >= 2 * gravity * k2.transit_time * (1 - 1e-12)
    end = min(k2.next_impact, k2.release_time + 20 * k2.transit_time)
    bar = exact(k2, end)
    rng = np.random.default_rng(2)
    t, x = rng.uniform(0, end, 500), rng.uniform(0, length, 500)
    scale = height + k2.impact_speed * k2.transit_time
    error = np.abs(k2.displacement(t, x) - bar.displacement(t, x)).max()
    assert error <= 1e-11 * scale * max(1.0, end / k2.transit_time)


@pytest.mark.parametrize("k2", K2)
def test_k3_is_the_exact_bar_and_does_not_vibrate(k2):
    k3 = StepLoadImpact(k2.length, k2.wave_speed, k2.height, k2.speed, k2.gravity)
    tau, end = k3.impact_time, 3 * k3.release_time
    bar = exact(k3, end, (0.0, tau), (k3.gravity, 0.0))
    rng = np.random.default_rng(4)
    t, x = rng.uniform(0, end, 4000), rng.uniform(0, k3.length, 4000)
    np.testing.assert_allclose(
        k3.displacement(t, x), bar.displacement(t, x), rtol=0, atol=1e-12 * k3.length
    )
    np.testing.assert_allclose(
        k3.multiplier(t), bar.multiplier(t), rtol=0, atol=1e-12 * k3.wave_speed * k3.impact_speed
    )
    after = np.linspace(k3.release_time * (1 + 1e-9), end, 31)
    kinetic, elastic = bar.energy(after)
    assert np.all(elastic <= 1e-12 * kinetic)
    np.testing.assert_allclose(bar.mean_velocity(after), k3.speed + k3.gravity * tau, rtol=1e-12)


def test_k3_knows_no_limit_of_overlap():
    StepLoadImpact(1.0, 1.0, 0.5, 0.0, 9.81)
    with pytest.raises(SceneError, match="use impactfem"):
        GravityImpact(1.0, 1.0, 0.5, 0.0, 9.81)


def test_energy_left_as_vibration():
    # 2 (p l)^2 / 3 per mass; so the centre of mass leaves with V, lower by 2 p l^2 / 3.
    k2 = K2[0]
    bar = exact(k2, 4.0)
    kinetic, elastic = bar.energy(k2.release_time)
    assert float(elastic) == pytest.approx(2 * 0.1**2 / 3)
    assert float(bar.mean_velocity(k2.release_time)) == pytest.approx(k2.impact_speed)
    assert float(bar.mean_displacement(k2.release_time)) == pytest.approx(-2 * 0.1 / 3)
    assert float(kinetic) == pytest.approx(0.5 * k2.impact_speed**2)


@pytest.mark.parametrize("q", [0.1, 0.3, 0.5, 0.6, 0.75, 1.0, 2.0, 5.0])
def test_apparent_restitution(q):
    bar = ExactBar(
        length=1.0, wave_speed=1.0, duration=8.0, nodes=[0, 1], displacement=[0, 0],
        velocity=[-1, -1], gravity_values=[q],
    )  # fmt: skip
    leave = bar.contacts[0][1]
    velocity, fallen = float(bar.mean_velocity(leave)), float(bar.mean_displacement(leave))
    assert leave == pytest.approx(2.0 if q <= 0.5 else 4 - 1 / q)
    assert velocity == pytest.approx(min(1.0, 0.5 / q))
    expected = 1 - 4 * q**2 / 3 if q <= 0.5 else 1 - 2 / (3 * q) + 1 / (4 * q**2)
    assert velocity**2 + 2 * q * fallen == pytest.approx(expected)


@pytest.mark.parametrize("kind", [GravityImpact, StepLoadImpact])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"length": 0.0}, "length = 0.0"),
        ({"wave_speed": float("nan")}, "wave_speed = nan"),
        ({"height": -1.0}, "height = -1.0"),
        ({"speed": -0.1}, "speed = -0.1"),
        ({"gravity": -0.1}, "gravity = -0.1"),
        ({"speed": 0.0, "gravity": 0.0}, "never meets the wall"),
    ],
)
def test_faulty_values_are_named(kind, change, message):
    values = {"length": 1.0, "wave_speed": 1.0, "height": 0.5, "speed": 0.5, "gravity": 0.1}
    with pytest.raises(SceneError, match=message):
        kind(**(values | change))


@pytest.mark.parametrize("t", [-0.1, 20.0, float("nan")])
def test_times_outside_are_refused(t):
    with pytest.raises(SceneError, match="give times in"):
        K2[0].displacement(t, 0.5)
    with pytest.raises(SceneError, match="give times in"):
        K2[0].multiplier(t)
