"""When contact begins and ends, from the force of layers and the gap of levels."""

import numpy as np
import pytest

from impactfem.runs.summary import contact_intervals


def flight(times, start, end, speed=0.5):
    """Gap of a body that arrives at a speed, rests and leaves at the same speed."""
    return speed * (np.maximum(start - times, 0.0) + np.maximum(times - end, 0.0))


def mean_force(times, start, end):
    """Unit force between two times, mean of each layer."""
    inside = np.minimum(times[1:], end) - np.maximum(times[:-1], start)
    return np.concatenate([[0.0], np.maximum(inside, 0.0) / np.diff(times)])


@pytest.mark.parametrize("start", [0.5, 0.53, 0.599])
@pytest.mark.parametrize("end", [1.1, 1.123, 1.17])
def test_contact_begins_and_ends_inside_layers(start, end):
    times = np.sort(np.append(np.linspace(0.0, 2.0, 21), 0.77))
    found = contact_intervals(times, mean_force(times, start, end), flight(times, start, end))
    assert found == [pytest.approx([start, end], abs=1e-12)]


def test_force_that_reaches_into_open_layers_is_no_contact():
    times = np.linspace(0.0, 2.0, 21)
    force = mean_force(times, 0.53, 1.17)
    force[5] = force[13] = 0.1
    found = contact_intervals(times, force, flight(times, 0.53, 1.17))
    assert found == [pytest.approx([0.53, 1.17], abs=1e-12)]


def test_contact_within_one_layer_and_at_both_ends_of_the_history():
    times = np.linspace(0.0, 2.0, 21)
    gap = flight(times, 0.55, 0.56)
    assert contact_intervals(times, mean_force(times, 0.55, 0.56), gap) == [
        pytest.approx([0.55, 0.56], abs=1e-12)
    ]
    assert contact_intervals(times, np.ones(21), np.zeros(21)) == [[0.0, 2.0]]
    assert contact_intervals(times, np.zeros(21), gap) == []
    assert contact_intervals(times, np.zeros(21), np.full(21, np.nan)) == []


def test_contact_over_a_gap_that_stays_open_lasts_as_long_as_its_force():
    """Impulses on speeds may hold a body before its gap is closed."""
    times = np.linspace(0.0, 2.0, 21)
    gap = flight(times, 0.5, 1.1) + 1e-3
    found = contact_intervals(times, mean_force(times, 0.5, 1.1), gap)
    assert found == [pytest.approx([0.502, 1.098], abs=1e-12)]


def test_a_gap_that_is_held_a_little_open_is_closed_all_the_time():
    """As under finite strain, where a hundredth of a layer's way may be left."""
    times = np.linspace(0.0, 2.0, 21)
    gap = np.maximum(flight(times, 0.53, 1.17), np.where(times < 0.8, 4e-4, 0.0))
    found = contact_intervals(times, mean_force(times, 0.53, 1.17), gap)
    assert found == [pytest.approx([0.53, 1.17], abs=2e-3)]
