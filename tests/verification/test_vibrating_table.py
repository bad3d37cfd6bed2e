"""The ball on a vibrating table against the exact map of its flights."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

PATH = Path(__file__).resolve().parents[2] / "benchmarks" / "vibrating_table.py"
SPEC = importlib.util.spec_from_file_location("vibrating_table", PATH)
table = importlib.util.module_from_spec(SPEC)
sys.path.insert(0, str(PATH.parent))  # for its neighbours
SPEC.loader.exec_module(table)


def test_period_one_exists_from_the_fold_on():
    assert table.bisect(1.2, 1.35, table.stays, 1e-4) == pytest.approx(1.25664, abs=1e-3)


def test_period_one_flips_where_the_exact_map_does_and_not_the_high_bounce_one():
    found = table.bisect(3.7, 4.0, table.returns, 1e-4)
    assert found == pytest.approx(table.flip_exact(), abs=1e-3)
    assert abs(found - table.flip_high_bounce()) > 0.03


@pytest.mark.parametrize("e", [0.3, 0.8])
def test_flips_are_where_a_multiplier_is_minus_one(e):
    # independent of the closed forms: eigenvalues of differences of the maps at the fixed point
    for flip, fly in ((table.flip_exact, table.fly), (table.flip_high_bounce, _high_bounce)):
        gamma = flip(e)
        size = table.amplitude(gamma, e)
        start = np.array([math.acos(table.existence(e) / gamma), math.pi])
        image = np.array(fly(size, e, *start))
        assert image - [2.0 * math.pi, 0.0] == pytest.approx(start, abs=1e-9)
        columns = [
            (np.array(fly(size, e, *(start + d))) - np.array(fly(size, e, *(start - d)))) / 2e-6
            for d in 1e-6 * np.eye(2)
        ]
        least = np.linalg.eigvals(np.array(columns).T).real.min()
        assert least == pytest.approx(-1.0, abs=1e-6)


def _high_bounce(size, e, t, u):
    return t + 2.0 * u, e * u + (1.0 + e) * size * math.cos(t + 2.0 * u)


def test_event_driven_impacts_are_those_of_the_map():
    gamma, t, u = table.CHAOTIC, 1.0, 3.2
    times, speeds = table.orbit(gamma, table.launch(gamma, t, u, 30), t)
    for i in range(20):
        t, u = table.fly(table.amplitude(gamma), table.RESTITUTION, t, u)
        assert (times[i], speeds[i]) == pytest.approx((t, u), abs=1e-9)


def test_jacobians_are_those_of_differences():
    gamma, t, u = 5.0, 1.0, 3.2
    times, speeds = table.orbit(gamma, table.launch(gamma, t, u, 10), t)
    found = table.jacobians(gamma, times, speeds)
    size, e, h = table.amplitude(gamma), table.RESTITUTION, 1e-6
    for i in range(4):
        here = np.array([times[i], speeds[i]])
        columns = [
            (np.array(table.fly(size, e, *(here + d))) - np.array(table.fly(size, e, *(here - d))))
            / (2.0 * h)
            for d in h * np.eye(2)
        ]
        assert found[i] == pytest.approx(np.array(columns).T, rel=1e-6, abs=1e-6)


def test_tangent_map_and_two_orbits_give_one_positive_exponent():
    gamma, phase = table.CHAOTIC, 1.3
    times, speeds = table.orbit(gamma, table.launch(gamma, phase, 3.15, 20_000), phase)
    logs = table.growth(table.jacobians(gamma, times[500:], speeds[500:]))
    error = table.batch_error(logs)
    size, e = table.amplitude(gamma), table.RESTITUTION
    two = table.separation(size, e, phase, 3.15, 20_000, 1e-7)
    assert logs.mean() > 10.0 * error
    assert two == pytest.approx(logs.mean(), abs=6.0 * error)


def test_statistics_agree_where_motions_do_not():
    _, _, apart, chance = table.statistics(10.0, 24_000, 500)
    assert apart < 1.6 * chance  # two methods differ by little more than two starts do
    assert table.parting(10.0, 500) < 50


def test_position_level_keeps_period_one():
    gamma = 3.0
    phase = math.acos(table.existence() / gamma)
    found = table.launch(gamma, phase, math.pi, 60, "position", table.TURN / 2000)
    steps = np.diff(found.impacts.time[-10:])
    assert steps == pytest.approx(np.full(9, table.TURN), rel=1e-3)
